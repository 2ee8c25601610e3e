"""Figures 12 and 13 of Luberto et al. with all runs: distances and norm of the residual by step, and table II."""

import math
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import figure, legend_below
from handover.scenarios.ir_grasp.plots import FINGER_COLOURS, FINGER_NAMES
from handover.scenarios.published.ir_grasp.convergence_curves import descents_of, median_of
from handover.scenarios.published.ir_grasp.ir_table_runs import OBJECTS, POSES, REFLEX, IrTableRuns

_NORM = "#7a1f5c"
_CURVES = (*zip(FINGER_NAMES, FINGER_COLOURS, strict=True), ("norm", _NORM))
_NAMES = {False: "convergence_nominal", True: "convergence_perturbed"}
_NUMBERS = {False: "12", True: "13"}


def draw_convergence(runs: IrTableRuns, folders: Path, folder: Path) -> list[Figure]:
    """Draw a figure a pose into a folder, of runs whose folders are in `folders`."""
    return [_of_pose(runs, folders, folder, perturbed) for perturbed in POSES]


def _of_pose(runs: IrTableRuns, folders: Path, folder: Path, perturbed: bool) -> Figure:
    found = {name: descents_of(runs.rows(REFLEX, perturbed, things), folders) for name, things in OBJECTS.items()}
    last = max((len(d.norm) - 1 for descents in found.values() for d in descents), default=1)
    with figure(folder / _NAMES[perturbed], 2, 3, size=(10.0, 5.6)) as panels:
        for k, (name, descents) in enumerate(found.items()):
            published = runs.published_distances(name, perturbed)
            above, below = panels[k], panels[k + 3]
            for i, (finger, colour) in enumerate(_CURVES[:3]):
                _curves(above, [1e3 * d.distance[:, i] for d in descents], colour, last, 1e3 * published[finger])
            norm = 1e3 * math.hypot(published["thumb"], published["ring"])
            _curves(below, [1e3 * d.norm for d in descents], _NORM, last, norm)
            above.set(title=f"{name.replace('_', ' ')} ({len(descents)} runs)", ylim=(0, 68))
            below.set(xlabel="Gauss-Newton step", ylim=(0, 92))
            for axes in (above, below):
                axes.set(xlim=(-0.4, last + 1.2))
                axes.tick_params(labelleft=k == 0)
            above.tick_params(labelbottom=False)
        panels[0].set_ylabel("distance (mm)")
        panels[3].set_ylabel("norm, thumb and ring (mm)")
        entries: dict[str, Any] = {name: Line2D([], [], color=colour, lw=2.2) for name, colour in _CURVES}
        entries["a run"] = Line2D([], [], color="#4d5866", lw=0.6)
        entries["table II, at the last step"] = Line2D([], [], color="#4d5866", marker="s", mfc="none", ls="", mew=1.5)
        legend_below(panels[0], entries)
    caption = (
        f"Distances by the sensors and the norm of the residual in {POSES[perturbed]} poses, as in [Luberto] fig. "
        f"{_NUMBERS[perturbed]}: each run thin, the median thick, as far as half of the runs go; nothing is drawn "
        "where a finger sees nothing. Squares: table II, where the paper's runs ended (the norm follows from it); "
        "its curves' numbers are not printed."
    )
    return Figure(_NAMES[perturbed], caption)


def _curves(axes: Axes, curves: list[Floats], colour: str, last: int, published: float) -> None:
    for curve in curves:
        axes.plot(range(len(curve)), curve, color=colour, lw=0.6, alpha=0.4)
    median = median_of(curves)
    axes.plot(range(len(median)), median, color=colour, lw=2.4)
    axes.plot([last + 0.6], [published], "s", color=colour, mfc="none", mew=1.5, ms=6, clip_on=False)
