"""Figures of `vsl-2`, like [Gandarias2020] figs. 6 and 7, and errors by the rigid arm's joints and by arm."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.published.vsl.path_traces import PathTrace, Repetitions, traces_of
from handover.scenarios.published.vsl.vsl_1.figures import DESIRED_COLOUR, draw_desired, draw_path
from handover.scenarios.published.vsl.vsl_2.runs import CASES, MODEL_BASED, TRAINED, Case, ControlMethod, Vsl2Runs
from handover.scenarios.vsl.plots import draw_box

_BLUE, _RED, _GREEN, _PURPLE = COLOURS[:4]
_STROKES: tuple[Any, ...] = ("-", "--", ":", "-.")


def draw_figures(runs: Vsl2Runs, folders: Path, folder: Path) -> list[Figure]:
    """Draw into a folder, of runs whose folders are in `folders`; what has no runs, or no records, is left out."""
    traces = {(case, method): traces_of(folders, runs.names(case, method)) for case in CASES for method in runs.methods}
    figures: list[Figure] = []
    if all(traces.get((case, MODEL_BASED)) for case in CASES):
        figures.append(_estimates({case: traces[case, MODEL_BASED] for case in CASES}, folder))
        if all(traces.get((case, runs.hybrid)) for case in CASES):
            figures.append(_compensated(runs, traces, folder))
    if runs.methods and all(traces.values()):
        figures.append(_boxes(runs, traces, folder))
    if len(runs.rigid) > 1 and runs.learned:
        figures.append(_by_joints(runs, folder))
    if runs.arms:
        figures.append(_by_arm(runs, folder))
    return figures


def _estimates(traces: Mapping[Case, Sequence[PathTrace]], folder: Path) -> Figure:
    with figure(folder / "estimates", 1, len(CASES), size=(9.0, 4.2)) as panels:
        for axes, (case, runs) in zip(panels, traces.items(), strict=True):
            draw_desired(axes, runs[0].desired)
            draw_path(axes, Repetitions.of(runs, "servo"), _GREEN, "tip by rigid kinematics")
            draw_path(axes, Repetitions.of(runs, "estimated"), _PURPLE, "tip by the hybrid forward model")
            draw_path(axes, Repetitions.of(runs, "tracked"), _BLUE, "tip by the tracker")
            _label_plane(axes, case)
        legend_below(panels[0])
    caption = (
        "Where the tip is taken to be as it is commanded along the curve by rigid kinematics, like [Gandarias2020] "
        "fig. 6: means of the runs with bands of their standard deviation. Equal scales."
    )
    return Figure("estimates", caption)


def _compensated(
    runs: Vsl2Runs, traces: Mapping[tuple[Case, ControlMethod], Sequence[PathTrace]], folder: Path
) -> Figure:
    with figure(folder / "compensated", 1, len(CASES), size=(9.0, 4.2)) as panels:
        for axes, case in zip(panels, CASES, strict=True):
            plain, hybrid = (traces[case, method][0] for method in (MODEL_BASED, runs.hybrid))
            draw_desired(axes, plain.desired)
            axes.plot(*_in_plane(plain.tracked), color=_GREEN, lw=1.1, label="tip, by rigid kinematics")
            axes.plot(*_in_plane(hybrid.tracked), color=_RED, lw=1.1, label=f"tip, by {runs.hybrid.label}")
            axes.plot(*_in_plane(hybrid.commanded), color=_RED, lw=1.1, ls="--", label="compensated command")
            _label_plane(axes, case)
        legend_below(panels[0], columns=4)
    caption = (
        "The curve in a single run of each, like [Gandarias2020] fig. 7(a): the tip by the tracker, commanded by rigid "
        "kinematics and by the hybrid inverse model, and where its compensated command would put the tip of a rigid "
        "arm. Equal scales."
    )
    return Figure("compensated", caption)


def _in_plane(positions: Floats) -> tuple[Floats, Floats]:
    """Return x and z in W, mm."""
    return 1000 * positions[:, 0], 1000 * positions[:, 2]


def _label_plane(axes: Axes, case: Case) -> None:
    axes.set(title=case.label, xlabel="x in W (mm)", ylabel="z in W (mm)")
    axes.set_aspect("equal", adjustable="datalim")


def _boxes(runs: Vsl2Runs, traces: Mapping[tuple[Case, ControlMethod], Sequence[PathTrace]], folder: Path) -> Figure:
    with figure(folder / "errors", len(CASES), size=(11.0, 6.6)) as panels:
        for axes, case in zip(panels, CASES, strict=True):
            for k, method in enumerate(runs.methods):
                errors = np.concatenate([np.linalg.norm(t.tracked - t.desired, axis=1) for t in traces[case, method]])
                draw_box(axes, k, 1000 * errors, _colour(method))
            axes.set_xticks(range(len(runs.methods)), [_wrapped(method) for method in runs.methods], fontsize="small")
            axes.set(title=case.label, ylabel="error (mm)")
            _logarithmic(axes, (0.02, 0.1, 0.5, 2.0, 10.0, 50.0))
            axes.grid(visible=False, axis="x")
    caption = (
        "Distances of the tip from the desired points of the curve, like [Gandarias2020] fig. 7(b), of all runs: 25th "
        "to 75th percentile (box), range, median (line) and mean (dot). Logarithmic, as they differ by tens."
    )
    return Figure("errors", caption)


def _logarithmic(axes: Axes, ticks: Sequence[float]) -> None:
    """Make the error's axis logarithmic, with these ticks, mm, alone."""
    axes.set(yscale="log", ylim=(ticks[0], 1.4 * ticks[-1]))
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks([], minor=True)


def _colour(method: ControlMethod) -> str:
    return _GREEN if method is MODEL_BASED else _RED if method.is_learned else _BLUE


def _wrapped(method: ControlMethod) -> str:
    return "\n".join(wrap(method.label, 13))


def _by_joints(runs: Vsl2Runs, folder: Path) -> Figure:
    with figure(folder / "rigid_joints", 1, len(CASES), size=(9.0, 3.6)) as panels:
        for axes, case in zip(panels, CASES, strict=True):
            points = [(f, 1000 * runs.metric("mean_error", case, method).mean()) for f, method in runs.rigid]
            axes.plot(*zip(*points, strict=True), "o-", ms=5, lw=1.2, color=_BLUE, label="rigid arm")
            for k, method in enumerate(runs.learned):
                level = 1000 * runs.metric("mean_error", case, method).mean()
                axes.axhline(level, color=_RED, lw=1.2, ls=_STROKES[k], label=method.label)
            axes.set(title=case.label, xlabel="joints stiffer by", ylim=(0.0, None), xscale="log")
            axes.set_xticks([f for f, _ in runs.rigid], [f"{f:g}" for f, _ in runs.rigid], minor=False)
            axes.set_xticks([], minor=True)
        panels[0].set_ylabel("mean error of the tip (mm)")
        legend_below(panels[0])
    caption = (
        "Mean error of an arm with rigid links by how many times its joints are stiffer than assumed, and that of the "
        "soft arm, with joints as assumed, by what was learned: means over the runs. The claim is that each run of the "
        "latter has less error."
    )
    return Figure("rigid_joints", caption)


def _by_arm(runs: Vsl2Runs, folder: Path) -> Figure:
    methods = [method for method in runs.methods if method.is_learned or method is MODEL_BASED]
    with figure(folder / "other_arms", len(CASES), size=(9.0, 6.6)) as panels:
        for axes, case in zip(panels, CASES, strict=True):
            for k, method in enumerate(methods):
                trained = 1000 * runs.metric("mean_error", case, method, TRAINED)
                others = [
                    1000 * v.mean() for arm in runs.arms if len(v := runs.metric("mean_error", case, method, arm))
                ]
                axes.plot([k - 0.12] * len(trained), trained, "o", ms=4, color=_colour(method))
                axes.plot([k + 0.12] * len(others), others, "o", ms=5, mfc="none", mec=_colour(method))
            axes.set_xticks(range(len(methods)), [_wrapped(method) for method in methods], fontsize="small")
            axes.set(title=case.label)
            _logarithmic(axes, (1.0, 2.0, 5.0, 10.0, 20.0, 50.0))
            axes.grid(visible=False, axis="x")
        panels[0].set_ylabel("mean error of the tip (mm)")
        panels[0].plot([], [], "o", ms=4, color=DESIRED_COLOUR, label="the arm that was learned from, each run")
        panels[0].plot([], [], "o", ms=5, mfc="none", mec=DESIRED_COLOUR, label="another arm, mean of its runs")
        legend_below(panels[0])
    caption = "Mean errors of the tip along the curve on the arm that was learned from and on others, by method."
    return Figure("other_arms", caption)
