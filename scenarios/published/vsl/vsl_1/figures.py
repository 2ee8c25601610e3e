"""Figures of the experiment `vsl-1`: paths like [Gandarias2020] fig. 5, errors along them, and errors by load."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from handover.controllers.vsl.paths import Path as TipPath
from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.published.vsl.path_traces import Repetitions, traces_of
from handover.scenarios.published.vsl.vsl_1.runs import PATHS, RIGID, SOFT, Cell, Vsl1Runs, format_load

_SERVOS = "servos"
_COLOURS = dict(zip((_SERVOS, RIGID.label, *(links.label for links in SOFT)), (0, 1, 2, 3, 4, 8), strict=True))
"""As in the paper: servos blue, rigid links red, then green, purple, yellow, and brown for its orange."""

DESIRED_COLOUR = "#4d5866"

Curves = Mapping[str, Repetitions]
"""What a panel of fig. 5 shows: the servos' path, and that of the tip on each kind of links."""


def draw_figures(runs: Vsl1Runs, folders: Path, folder: Path) -> list[Figure]:
    """Draw into a folder, of runs whose folders are in `folders`; what has no runs, or no records, is left out."""
    panels = {(path, load): _curves(runs, path, load, folders) for path in PATHS for load in runs.loads}
    figures: list[Figure] = []
    if any(panels.values()):
        figures += [_paths(runs, panels, folder), _along(runs, panels, folder)]
    if runs.done and len(runs.loads) > 1:
        figures.append(_by_load(runs, folder))
    return figures


def _curves(runs: Vsl1Runs, path: TipPath, load: float, folders: Path) -> Curves:
    curves: dict[str, Repetitions] = {}
    for links in runs.links:
        if traces := traces_of(folders, runs.names(Cell(path, load, links))):
            if links == RIGID:
                curves[_SERVOS] = Repetitions.of(traces, "servo")
            curves[links.label] = Repetitions.of(traces, "tracked")
    return curves


def _paths(runs: Vsl1Runs, panels: Mapping[tuple[TipPath, float], Curves], folder: Path) -> Figure:
    columns = len(runs.loads)
    with figure(folder / "paths", len(PATHS), columns, size=(1.2 + 2.3 * columns, 9.0)) as grid:
        for axes, ((path, load), curves) in zip(grid, panels.items(), strict=True):
            if curves:
                draw_desired(axes, next(iter(curves.values())).desired)
            for name, curve in curves.items():
                draw_path(axes, curve, COLOURS[_COLOURS[name]], name)
            _name(axes, path, load, first=load == runs.loads[0])
            axes.set_aspect("equal", adjustable="datalim")
        _label(grid, columns, "x in W (mm)", "z in W (mm)")
        legend_below(grid[0])
    drawn = [curve for curves in panels.values() for curve in curves.values()]
    each = "each of one run"
    if _are_repeated(panels):
        widest = 1000 * max(float(np.max(curve.deviation)) for curve in drawn)
        each = f"each the mean of its runs with a band of their standard deviation, which is at most {widest:.2g} mm"
    caption = (
        "Paths like [Gandarias2020] fig. 5, by load: where encoders and rigid links put the tip of the rigid arm "
        f"(servos), and the tip by the tracker on rigid links and on soft ones by pressure, {each}. Equal scales."
    )
    return Figure("paths", caption)


def _are_repeated(panels: Mapping[tuple[TipPath, float], Curves]) -> bool:
    """Return whether something was run more than once."""
    return any(len(curve.errors) > 1 for curves in panels.values() for curve in curves.values())


def draw_desired(axes: Axes, points: Floats) -> None:
    """Draw the desired path, shape (n, 3), m, under the others."""
    axes.plot(1000 * points[:, 0], 1000 * points[:, 2], color=DESIRED_COLOUR, lw=3.0, alpha=0.3, label="desired")


def draw_path(axes: Axes, curve: Repetitions, colour: str, name: str) -> None:
    """Draw mean and deviation, mm, the latter as a band across the path."""
    x, z = 1000 * curve.mean[:, 0], 1000 * curve.mean[:, 2]
    across = 1000 * curve.deviation[:, None] * _normals(curve.desired)
    middle: Floats = np.column_stack([x, z])
    band: Floats = np.vstack([middle + across, (middle - across)[::-1]])
    axes.fill(band[:, 0], band[:, 1], color=colour, alpha=0.25, lw=0)
    axes.plot(x, z, color=colour, lw=1.1, label=name)


def _normals(points: Floats) -> Floats:
    """Return unit vectors across a path in the plane XZ, shape (n, 2)."""
    along = np.gradient(points[:, [0, 2]], axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    return np.column_stack([-along[:, 1], along[:, 0]])


def _along(runs: Vsl1Runs, panels: Mapping[tuple[TipPath, float], Curves], folder: Path) -> Figure:
    columns = len(runs.loads)
    highest = max(float(np.max(c.errors)) for curves in panels.values() for c in curves.values())
    with figure(folder / "errors_along", len(PATHS), columns, size=(1.2 + 2.3 * columns, 7.0)) as grid:
        for axes, ((path, load), curves) in zip(grid, panels.items(), strict=True):
            for name, curve in curves.items():
                _draw_error(axes, curve, COLOURS[_COLOURS[name]], name)
            _name(axes, path, load, first=load == runs.loads[0])
            axes.set_ylim(0.0, 1050 * highest)
        _label(grid, columns, "along the path (mm)", "error (mm)")
        legend_below(grid[0])
    means = "; means of the runs, with bands of their standard deviation" if _are_repeated(panels) else ""
    caption = (
        "Distance from the desired point along the path, by load: of the place where encoders and rigid links put the "
        f"tip of the rigid arm (servos), and of the tip by the tracker{means}."
    )
    return Figure("errors_along", caption)


def _draw_error(axes: Axes, curve: Repetitions, colour: str, name: str) -> None:
    along, mean = 1000 * curve.along, 1000 * curve.errors.mean(axis=0)
    deviation = 1000 * curve.errors.std(axis=0, ddof=min(1, len(curve.errors) - 1))
    axes.fill_between(along, mean - deviation, mean + deviation, color=colour, alpha=0.25, lw=0)
    axes.plot(along, mean, color=colour, lw=1.1, label=name)


def _name(axes: Axes, path: TipPath, load: float, *, first: bool) -> None:
    axes.set_title(f"{path.name.lower()}, {format_load(load)}" if first else format_load(load), fontsize="medium")


def _label(grid: list[Axes], columns: int, x: str, y: str) -> None:
    for axes in grid[-columns:]:
        axes.set_xlabel(x)
    for axes in grid[::columns]:
        axes.set_ylabel(y)


def _by_load(runs: Vsl1Runs, folder: Path) -> Figure:
    with figure(folder / "errors_by_load", 1, len(PATHS), size=(9.0, 3.6)) as panels:
        for axes, path in zip(panels, PATHS, strict=True):
            for links in runs.links:
                found = [(load, runs.metric("mean_error", Cell(path, load, links))) for load in runs.loads]
                points = [(1000 * load, 1000 * values.mean()) for load, values in found if len(values)]
                if points:
                    axes.plot(*zip(*points, strict=True), "o-", ms=4, lw=1.2, color=COLOURS[_COLOURS[links.label]],
                              label=links.label)  # fmt: skip
            axes.set(title=path.name.lower(), xlabel="load (g)", ylim=(0.0, None))
        panels[0].set_ylabel("mean error of the tip (mm)")
        top = max(axes.get_ylim()[1] for axes in panels)
        for axes in panels:
            axes.set_ylim(0.0, top)
        legend_below(panels[0])
    caption = "Mean distance of the tip from the desired points by load, on rigid links and on soft ones by pressure."
    return Figure("errors_by_load", caption)
