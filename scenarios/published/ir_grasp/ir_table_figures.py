"""Figures of the experiment `ir-table`: rates of success and distances, beside the published."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from handover.scenarios.campaign.statistics import success_interval
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.ir_grasp.plots import FINGER_COLOURS, FINGER_NAMES
from handover.scenarios.published.ir_grasp.ir_table_runs import ARMS, OBJECTS, POSES, REFLEX, Count, IrTableRuns

_OURS, _THEIRS = COLOURS[0], COLOURS[1]
_OFFSET = 0.13
"""Half the distance between ours and theirs, in places on the axis."""

_SPREAD = 0.16
"""Width over which points of runs are spread, likewise."""


def draw_table(runs: IrTableRuns, folder: Path) -> list[Figure]:
    """Draw rates of success and distances into a folder."""
    return [_rates(runs, folder), _distances(runs, folder)]


def _rates(runs: IrTableRuns, folder: Path) -> Figure:
    with figure(folder / "success_rates", 1, 2, size=(8.0, 3.6)) as panels:
        for axes, (perturbed, pose) in zip(panels, POSES.items(), strict=True):
            for n, arm in enumerate(ARMS):
                published = runs.published(arm, perturbed)
                shift = 0.0 if published is None else _OFFSET
                _rate(axes, n - shift, runs.count(arm, perturbed), _OURS, "o")
                if published is not None:
                    _rate(axes, n + shift, published, _THEIRS, "s")
            axes.set(title=f"{pose} poses", ylim=(-3, 103), xlim=(-0.5, len(ARMS) - 0.5))
            axes.set_xticks(range(len(ARMS)), [arm.title.replace("forward ", "forward\n") for arm in ARMS])
            axes.grid(visible=False, axis="x")
        panels[0].set(ylabel="successful grasps (%)")
        panels[0].plot([], [], color=_OURS, marker="o", ls="", label="ours")
        panels[0].plot([], [], color=_THEIRS, marker="s", ls="", label="published")
        _legend(panels[0])
    caption = (
        "Successful grasps of all objects by arm and pose, with intervals by Clopper and Pearson (95 %), beside the "
        "totals of [Luberto] table I. The forward arms, which go a stated way without looking and close, are a control "
        "that the paper does not have."
    )
    return Figure("success_rates", caption)


def _rate(axes: Axes, x: float, count: Count, colour: str, marker: str) -> None:
    if not count[1]:
        return
    interval, rate = success_interval(*count), count[0] / count[1]
    reach = [[100 * (rate - interval.low)], [100 * (interval.high - rate)]]
    axes.errorbar([x], [100 * rate], yerr=reach, color=colour, marker=marker, ms=6, capsize=3, lw=1.4)


def _distances(runs: IrTableRuns, folder: Path) -> Figure:
    with figure(folder / "final_distances", 1, 2, size=(8.0, 3.8)) as panels:
        for axes, (perturbed, pose) in zip(panels, POSES.items(), strict=True):
            for n, (name, things) in enumerate(OBJECTS.items()):
                published = runs.published_distances(name, perturbed)
                for i, finger in enumerate(FINGER_NAMES):
                    x = n + 0.27 * (i - 1)
                    ours = 1000 * runs.metric(f"final_distance_{finger}", REFLEX, perturbed, things)
                    across = x + _SPREAD * (np.linspace(0.0, 1.0, len(ours)) - 0.5)
                    axes.plot(across, ours, ".", ms=3, color=FINGER_COLOURS[i], alpha=0.5)
                    axes.plot([x], [1000 * published[finger]], "s", ms=7, mfc="none", mec=FINGER_COLOURS[i], mew=1.6)
            axes.set(title=f"{pose} poses", ylim=(0, 68), xlim=(-0.5, len(OBJECTS) - 0.5))
            axes.set_xticks(range(len(OBJECTS)), [name.replace("_", " ") for name in OBJECTS])
            axes.grid(visible=False, axis="x")
        panels[0].set(ylabel="distance at the last step (mm)")
        for i, finger in enumerate(FINGER_NAMES):
            panels[0].plot([], [], ".", ms=8, color=FINGER_COLOURS[i], label=finger)
        panels[0].plot([], [], "s", ms=7, mfc="none", mec="#4d5866", mew=1.6, label="published")
        _legend(panels[0])
    caption = (
        "Distances between fingertips and object at the last step of the IR-guided grasp: points are our runs, as the "
        "sensors measure them (none where a finger sees nothing), squares the figures of [Luberto] table II. Thumb and "
        "ring enter the cost; their target of 10 mm was taken from the table's nominal poses."
    )
    return Figure("final_distances", caption)


def _legend(axes: Axes) -> None:
    """Put the legend of one panel above all panels, so that these keep the same size."""
    handles, labels = axes.get_legend_handles_labels()
    canvas: Any = axes.get_figure(root=True)
    canvas.legend(handles, labels, loc="outside upper center", ncols=len(labels))
