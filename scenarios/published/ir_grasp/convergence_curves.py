"""Distances of the fingers by Gauss-Newton steps, from records, and their drawing. [Luberto] figs. 12, 13, table II."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from handover.controllers.ir_grasp.ir_reflex import Phase
from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import figure, legend_below
from handover.scenarios.ir_grasp.evaluation import IN_COST
from handover.scenarios.ir_grasp.plots import FINGER_COLOURS, FINGER_NAMES
from handover.scenarios.published.ir_grasp.ir_table_runs import OBJECTS, POSES, REFLEX, IrTableRuns

_NORM = "#7a1f5c"
_CURVES = (*zip(FINGER_NAMES, FINGER_COLOURS, strict=True), ("norm", _NORM))
_NAMES = {False: "convergence_nominal", True: "convergence_perturbed"}
_NUMBERS = {False: "12", True: "13"}


@dataclass(frozen=True, eq=False)
class Descent:
    """One run's distances at the beginning of its first step, and after each step.

    Attributes:
        distance: by the controller's curve, of thumb, index and ring, shape (steps + 1, 3), m; NaN where a finger sees
            nothing.
    """

    distance: Floats

    @property
    def norm(self) -> Floats:
        """The residual's Euclidean norm, sqrt(d_thumb^2 + d_ring^2), m: the paper's residual is the distance itself."""
        return np.sqrt(np.sum(self.distance[:, IN_COST] ** 2, axis=1))

    @property
    def ends(self) -> tuple[float, float] | None:
        """The norm before the first step and after the last one; None without steps, or where a finger loses sight."""
        first, last = float(self.norm[0]), float(self.norm[-1])
        return (first, last) if len(self.norm) > 1 and np.isfinite([first, last]).all() else None

    @classmethod
    def of(cls, record: Record) -> "Descent | None":
        """Read a run; None if it made no step.

        A step is over at the control period in which it is counted: the hand then stands where it led.
        """
        steps, phase = record["reflex.steps"].astype(int), record["reflex.phase"]
        if not steps.max():
            return None
        first = int(np.argmax(phase == Phase.STEP))
        index = [first, *(int(np.argmax(steps == n)) for n in range(1, int(steps.max()) + 1))]
        seen = record["reflex.distance"][index]
        return cls(np.where(seen < ReflexParams().distance_max, seen, np.nan))


def descents_of(rows: Sequence[dict[str, Any]], runs: Path) -> list[Descent]:
    """Return the descents of rows' runs, whose folders are in `runs`; of those that made a step."""
    found = [Descent.of(Record(runs / row["run"] / "signals.parquet")) for row in rows]
    return [descent for descent in found if descent is not None]


def median_of(curves: Sequence[Floats]) -> Floats:
    """Return the median by step, over the curves that go as far and have a value there.

    It ends where fewer than half of the curves go on, and is NaN where fewer than half of those have a value: a few
    would stand for all.
    """
    length = max((len(c) for c in curves), default=0)
    columns = [np.array([c[k] for c in curves if len(c) > k]) for k in range(length)]
    kept = [column for column in columns if 2 * len(column) >= len(curves)]
    return np.array([np.median(c[np.isfinite(c)]) if 2 * np.isfinite(c).sum() >= len(c) else np.nan for c in kept])


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
            above.set(
                title=f"{name.replace('_', ' ')} ({len(descents)} run{'' if len(descents) == 1 else 's'})", ylim=(0, 68)
            )
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
