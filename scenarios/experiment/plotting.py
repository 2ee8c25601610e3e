"""Figures for papers by matplotlib: the style that all of them share, and time plots drawn in it."""

import warnings
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from itertools import cycle
from math import ceil
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.transforms import ScaledTranslation

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.time_plot import COLOURS, Phase, TimeFigure, TimePlot

COLUMN, PAGE = 3.5, 7.16
"""Widths of a column and of a page's text in IEEE's journals, in."""

FORMATS, PRINTED_FORMATS = ("png", "svg"), ("png", "svg", "pdf")
"""Suffixes of a figure's files; of one at the size of print."""

MARKERS = ("o", "s", "D", "^", "v", "P", "X", "<", ">")
"""A mark for each of `COLOURS`, as not all of these differ for everybody, or in print without colours."""

_LETTERS, _PRINTED_LETTERS = 10.0, 8.0
"""Sizes of letters, points."""

STYLE: dict[Any, Any] = {
    "font.size": _LETTERS,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e2e6ec",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 150,
    "svg.hashsalt": "handover",
    "pdf.fonttype": 42,  # TrueType, as publishers ask for
}

_SOFT, _SHADE = "#4d5866", "#eef2f7"
_STROKES: dict[str, dict[str, Any]] = {
    "solid": {"lw": 1.4},
    "dashed": {"lw": 1.4, "ls": (0, (4, 2))},
    "dotted": {"lw": 1.0, "ls": ":"},
}
_LEVELS = ((0, (7, 3)), (0, (7, 2, 1, 2)))

_WIDTH, _ALONE, _STACKED = 8.0, 2.6, 1.6
"""Width of a time figure, height of a single plot, and of each of several below each other, in."""
_MARKS = 6
"""Marks along a curve."""
_LETTER, _UPRIGHT = 5.2, 8.5
"""Widths of a letter, and of a phase's name that stands upright, points."""


@contextmanager
def own_style() -> Generator[None, None, None]:
    """Draw in `STYLE` alone: a `matplotlibrc` of the working directory, or a user's, has no part in it."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


@contextmanager
def figure(
    path: Path,
    rows: int,
    columns: int = 1,
    size: tuple[float, float] = (8.0, 3.2),
    heights: Sequence[float] | None = None,
    *,
    as_printed: bool = False,
) -> Generator[list[Axes], None, None]:
    """Make a figure of `rows` x `columns` axes, row by row; save it as PNG and SVG on leaving the context.

    `path` is without suffix, `size` in inches; `heights` are the rows' relative heights. A figure `as_printed` has the
    size that it has on paper: its letters are of 8 points, and it is saved as PDF, too. pyplot, which holds what a
    user's own program draws, is left alone.
    """
    with own_style():
        if as_printed:
            mpl.rcParams.update({"font.size": _PRINTED_LETTERS, "savefig.dpi": 300})
        canvas = Canvas(figsize=size)
        FigureCanvasAgg(canvas)  # draws it to memory
        axes: Any = canvas.subplots(rows, columns, squeeze=False, height_ratios=heights)
        axes_by_row: list[Axes] = axes.reshape(-1).tolist()
        yield axes_by_row
        _save(canvas, path, PRINTED_FORMATS if as_printed else FORMATS)


def legend_below(axes: Axes, entries: Mapping[str, Artist] | None = None, columns: int | None = None) -> None:
    """Write a figure's legend below all of its axes: entries by their labels, or else what one of its axes has."""
    handles, labels = axes.get_legend_handles_labels() if entries is None else (list(entries.values()), list(entries))
    _canvas(axes).legend(handles, labels, loc="outside lower center", ncols=columns or len(labels))


def draw_time_figures(
    figures: Sequence[TimeFigure], time: Floats, folder: Path, *, as_printed: bool = False
) -> list[Figure]:
    """Draw curves over the record's time, s, into a folder; `as_printed` in the width of a column, as of `figure`."""
    for spec in figures:
        _draw_time_figure(spec, time, folder / spec.name, as_printed=as_printed)
    return [Figure(spec.name, spec.caption) for spec in figures]


def _draw_time_figure(spec: TimeFigure, time: Floats, path: Path, *, as_printed: bool) -> None:
    plots, columns = spec.plots, spec.columns
    rows = ceil(len(plots) / columns)
    scale = _PRINTED_LETTERS / _LETTERS if as_printed else 1.0
    width = 72.0 * 0.86 * (COLUMN / scale if as_printed else _WIDTH) / columns
    span = float(time[-1] - time[0])
    above = max(_height_of_names(p.phases, span / width) for p in plots) / 72.0
    bottom = {k for k in range(len(plots)) if k % rows == rows - 1 or k == len(plots) - 1}
    with_legend = [
        k for k, p in enumerate(plots) if p.has_legend and (k in bottom or _entries(p) != _entries(plots[k + 1]))
    ]
    legends = sum(_legend_rows(plots[k], width) for k in with_legend if k < rows) * 0.18
    is_shared = columns > 1 and len(with_legend) > 1 and len({_entries(plots[k]) for k in with_legend}) == 1
    height = (_ALONE if rows == 1 else _STACKED * rows) + above + legends + 0.4
    size = (COLUMN if as_printed else _WIDTH, scale * height)
    with figure(path, rows, columns, size, as_printed=as_printed) as grid:
        for k, plot in enumerate(plots):
            column, row = divmod(k, rows)
            axes = grid[row * columns + column]
            draw_time_plot(axes, plot, time)
            if as_printed:
                _mark_curves(axes, plot, time)
            if row == 0 or plot.phases != plots[k - 1].phases:
                name_phases(axes, plot.phases, span / width)
            if k in bottom:
                axes.set_xlabel("time (s)")
            axes.tick_params(labelbottom=k in bottom)
            if k in with_legend and not is_shared:
                _legend_below(axes, plot, width, scale * (34.0 if k in bottom else 6.0))
        for axes in grid:
            axes.set_visible(axes.has_data())
        if is_shared:
            column, row = divmod(with_legend[0], rows)
            wide = _legend_columns(plots[with_legend[0]], columns * width)
            legend_below(grid[row * columns + column], columns=wide)
        _canvas(grid[0]).align_ylabels()


def draw_time_plot(axes: Axes, plot: TimePlot, time: Floats) -> None:
    """Draw curves, levels and shades of phases into axes, over the record's time, s."""
    for phase in plot.phases[1::2]:
        axes.axvspan(phase.begin, phase.end, color=_SHADE, lw=0, zorder=0)
    for curve, colour in zip(plot.curves, plot.colours, strict=True):
        style = "steps-post" if curve.held else "default"
        axes.plot(time, curve.values, color=COLOURS[colour], label=curve.label, ds=style, **_STROKES[curve.stroke])
    for level, label, dashes in zip(plot.levels, plot.level_labels, cycle(_LEVELS)):
        axes.axhline(level.value, color=_SOFT, lw=0.8, ls=dashes, label=label)
    if plot.logarithmic:
        axes.set_yscale("log")
    label = plot.axis_label if len(plot.axis_label) < 19 else plot.axis_label.replace(" (", "\n(")
    axes.set(ylabel=label, xlim=(time[0], time[-1]))
    if plot.shown_range is not None:
        axes.set_ylim(*plot.shown_range)


def name_phases(axes: Axes, phases: Sequence[Phase], per_point: float) -> None:
    """Write the names of phases over axes: level where they fit; a name that fits nowhere once, upright with a line.

    `per_point` is the time, s, that a point on paper stands for. Without room for all, the shortest phases go unnamed.
    """
    if not phases:
        return
    low, high = phases[0].begin, phases[-1].end
    levels, upright = _named(phases, per_point)
    for phase in levels:
        middle = (phase.begin + phase.end) / 2
        axes.text(middle, 1.02, phase.name, transform=axes.get_xaxis_transform(), ha="center", color=_SOFT)
    max_upright = max(int((high - low) / per_point / _UPRIGHT), 1)
    kept = sorted(sorted(upright, key=lambda p: p.begin - p.end)[:max_upright], key=lambda p: p.begin)
    middles = [(p.begin + p.end) / 2 for p in kept]
    positions = _spread(middles, low, high, _UPRIGHT * per_point)
    for phase, middle, position in zip(kept, middles, positions, strict=True):
        axes.annotate(
            phase.name,
            xy=(middle, 1.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=((position - middle) / per_point, 20.0 if levels else 8.0),
            textcoords="offset points",
            rotation=90,
            ha="center",
            va="bottom",
            size=7,
            color=_SOFT,
            arrowprops={
                "arrowstyle": "-",
                "color": _SOFT,
                "lw": 0.5,
                "shrinkA": 0.0,
                "shrinkB": 0.0,
                "relpos": (0.5, 0.0),
            },
            annotation_clip=False,
        )


def _named(phases: Sequence[Phase], per_point: float) -> tuple[list[Phase], list[Phase]]:
    """Return the phases whose names fit over them, and of each other name the longest phase, named upright.

    The page's script names phases by the same rule (`phases.js`).
    """
    named = [p for p in phases if p.name and p.end > p.begin]
    level = [p for p in named if _LETTER * len(p.name) * per_point < p.end - p.begin]
    written = {p.name for p in level}
    longest: dict[str, Phase] = {}
    for phase in sorted(named, key=lambda p: p.begin - p.end):
        if phase.name not in written:
            longest.setdefault(phase.name, phase)
    return level, list(longest.values())


def _height_of_names(phases: Sequence[Phase], per_point: float) -> float:
    """Return the approximate height of the phases' names above axes, points."""
    levels, upright = _named(phases, per_point)
    return (14.0 if levels else 0.0) + max((4.0 * len(p.name) + 8.0 for p in upright), default=0.0)


def _spread(positions: Sequence[float], low: float, high: float, apart: float) -> list[float]:
    """Return ascending positions moved so that neighbours keep a distance, between low and high."""
    spread: list[float] = []
    for position in positions:
        spread.append(max(position, low + apart / 2, spread[-1] + apart if spread else low))
    for n in reversed(range(len(spread))):
        spread[n] = min(spread[n], high - apart * (len(spread) - n - 0.5))
    return spread


def _entries(plot: TimePlot) -> tuple[Any, ...]:
    """Return what the legend of a plot shows; plots with equal entries share one legend."""
    return (*((c.label, c.stroke, k) for c, k in zip(plot.curves, plot.colours, strict=True)), *plot.level_labels)


def _legend_columns(plot: TimePlot, width: float) -> int:
    """Return how many legend columns fit into a width, points, with curves of one colour in one column."""
    labels = [*(c.label for c in plot.curves), *plot.level_labels]
    max_columns = max(int(width / (0.8 * _LETTER * max(len(label) for label in labels) + 42.0)), 1)
    together = max((plot.colours.count(k) for k in plot.colours), default=1)
    rows = together * ceil(len(labels) / max_columns / together)
    return ceil(len(labels) / rows)


def _legend_rows(plot: TimePlot, width: float) -> int:
    return ceil((len(plot.curves) + len(plot.levels)) / _legend_columns(plot, width))


def _legend_below(axes: Axes, plot: TimePlot, width: float, gap: float) -> None:
    """Put the legend below the axes, by a gap in points that keeps clear of the axis's labels."""
    below = axes.transAxes + ScaledTranslation(0.0, -gap / 72.0, _canvas(axes).dpi_scale_trans)
    axes.legend(
        ncols=_legend_columns(plot, width),
        loc="upper center",
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=below,
        borderaxespad=0.0,
        fontsize=0.9 * mpl.rcParams["font.size"],
    )


def _mark_curves(axes: Axes, plot: TimePlot, time: Floats) -> None:
    """Mark curves of several colours at some times, beside the others' marks."""
    if len(set(plot.colours)) > 1:
        for k, (line, colour) in enumerate(zip(axes.lines, plot.colours, strict=False)):
            at = time[0] + (time[-1] - time[0]) * (np.arange(_MARKS) + (k + 0.5) / len(plot.curves)) / _MARKS
            line.set(marker=MARKERS[colour], ms=3.5, markevery=np.searchsorted(time, at).tolist())


def _canvas(axes: Axes) -> Canvas:
    canvas = axes.get_figure(root=True)
    assert canvas is not None, "axes are drawn within a figure"
    return canvas


_METADATA = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""What matplotlib writes into files by itself, and would differ from day to day."""


def _save(canvas: Canvas, path: Path, formats: Sequence[str]) -> None:
    for ending in formats:
        file, metadata = path.with_name(f"{path.name}.{ending}"), _METADATA[ending]
        file.unlink(missing_ok=True)  # a link in a folder of somebody else would have another file written
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph")  # it has a name's letter raw
            canvas.savefig(file, metadata=metadata)
            if _made_room(canvas):
                canvas.savefig(file, metadata=metadata)
        canvas.set_layout_engine("none")  # the layout stays: computing it costs as much as drawing


def _made_room(canvas: Canvas) -> bool:
    """Make room for labels of vertical axes that reached out on the left as a figure was saved; return whether any did.

    They do where the lowest tick is at the very end of an axis: matplotlib's layout has overlooked it.
    """
    engine = canvas.get_layout_engine()
    if not isinstance(engine, ConstrainedLayoutEngine):
        return False
    labels = [axes.yaxis.label for axes in canvas.axes if axes.get_visible() and axes.get_ylabel()]
    beyond = max((-label.get_window_extent().x0 for label in labels), default=0.0)
    share = 1.5 * beyond / (canvas.get_figwidth() * mpl.rcParams["savefig.dpi"])
    if share > 0.0:
        engine.set(rect=(share, 0.0, 1.0 - share, 1.0))
    return share > 0.0
