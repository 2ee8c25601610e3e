"""Figures of a published experiment, declared as panels of marks, and the kinds that several experiments have."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below

SOFT = COLOURS[5]
"""Of what is not ours: desired or published."""

DASHED = (0, (7, 3))


class Drawable(Protocol):
    """What a panel shows."""

    def draw(self, axes: Axes) -> None:
        """Draw it."""
        ...


@dataclass(frozen=True)
class Mark:
    """A curve, or points: values over another, with matplotlib's form, and a band or bars of error if given.

    Attributes:
        x, y: the values; none: an entry of the legend alone.
        form: such as "o-".
        colour: of all of it.
        label: in the legend.
        band: half the width of a band about the curve.
        bars: how far bars of error reach down and up, shape (2, n).
        style: of the curve, by matplotlib's names.
    """

    x: ArrayLike = ()
    y: ArrayLike = ()
    form: str = "-"
    colour: str = SOFT
    label: str = ""
    band: ArrayLike | None = None
    bars: ArrayLike | None = None
    style: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @classmethod
    def through(cls, points: Iterable[tuple[float, float]], form: str, colour: str, label: str = "") -> "Mark":
        """Return a mark of points (x, y)."""
        x, y = zip(*points, strict=True)
        return cls(x, y, form, colour, label)

    def draw(self, axes: Axes) -> None:
        """Draw it."""
        label = self.label or None
        if self.band is not None:
            middle, half = np.asarray(self.y), np.asarray(self.band)
            axes.fill_between(np.asarray(self.x), middle - half, middle + half, color=self.colour, alpha=0.2, lw=0)
        if self.bars is not None:
            axes.errorbar(self.x, self.y, self.bars, fmt="none", ecolor=self.colour, elinewidth=0.8, capsize=2)
        usual: dict[str, Any] = {"lw": 1.2, "ms": 4.0, "color": self.colour, "label": label}
        form = () if "ls" in self.style else (self.form,)
        axes.plot(self.x, self.y, *form, **{**usual, **self.style})


def level(y: float, colour: str = SOFT, label: str = "", **style: Any) -> "Line":
    """Return a level line across the panel, dashed unless a style says otherwise."""
    return Line(Axes.axhline, y, {"color": colour, "label": label or None, "ls": DASHED, "lw": 1.0, **style})


def upright(x: float, colour: str = SOFT, label: str = "", **style: Any) -> "Line":
    """Return an upright line across the panel, dashed unless a style says otherwise."""
    return replace(level(x, colour, label, **style), method=Axes.axvline)


@dataclass(frozen=True)
class Line:
    """A line across a panel, by the method of matplotlib that draws it at a value."""

    method: Callable[..., Any]
    value: float
    style: Mapping[str, Any]

    def draw(self, axes: Axes) -> None:
        """Draw it."""
        self.method(axes, self.value, **self.style)


@dataclass(frozen=True)
class Bars:
    """Upright bars: places and heights."""

    points: Sequence[tuple[float, float]]
    width: float
    colour: str
    label: str = ""

    def draw(self, axes: Axes) -> None:
        """Draw them."""
        x, y = [x for x, _ in self.points], [y for _, y in self.points]
        axes.bar(x, y, width=self.width, color=self.colour, label=self.label)


_GREY = {"color": "#d5dae2", "lw": 0, "zorder": 0}


@dataclass(frozen=True)
class Spans:
    """Grey spans of published values, upright: places, least and greatest."""

    spans: Sequence[tuple[float, float, float]]
    width: float
    label: str

    def draw(self, axes: Axes) -> None:
        """Draw them."""
        x, low, high = np.reshape(self.spans, (-1, 3)).T
        axes.bar(x, high - low, self.width, bottom=low, label=self.label, **_GREY)


@dataclass(frozen=True)
class Band:
    """A grey band of published values from the least to the greatest x, as high as the panel."""

    low: float
    high: float
    label: str

    def draw(self, axes: Axes) -> None:
        """Draw it."""
        axes.axvspan(self.low, self.high, label=self.label, **_GREY)


@dataclass(frozen=True)
class Panel:
    """A panel: what is drawn into it, and what its axes get by matplotlib's names.

    Attributes:
        marks: in their order.
        axes: title, labels, limits, scales, of which a vertical one may be a pair of its name and options.
        x_ticks, y_ticks: places and texts of ticks, which are then the only ones.
        small: whether these texts are small.
    """

    marks: Sequence[Drawable]
    axes: Mapping[str, Any]
    x_ticks: Mapping[float, str] | None = None
    y_ticks: Mapping[float, str] | None = None
    small: bool = False

    def draw(self, axes: Axes) -> None:
        """Draw it."""
        for mark in self.marks:
            mark.draw(axes)
        given = dict(self.axes)
        if isinstance(given.get("yscale"), tuple):
            scale, options = given.pop("yscale")
            axes.set_yscale(scale, **options)
        axes.set(**given)
        for axis, ticks in ((axes.xaxis, self.x_ticks), (axes.yaxis, self.y_ticks)):
            if ticks is not None:
                axis.set_ticks(list(ticks), list(ticks.values()), fontsize=7 if self.small else None)
                axis.set_ticks([], minor=True)


def records_of(names: Iterable[str], runs: Path) -> list[Record]:
    """Return the records of runs, given by the names of their folders in `runs`, of those that left one."""
    files = (runs / name / "signals.parquet" for name in names)
    return [Record(file) for file in files if file.exists()]


def drawn(
    path: Path,
    caption: str,
    panels: Sequence[Panel],
    columns: int = 1,
    *,
    size: tuple[float, float],
    same_height: bool = False,
    legend: int | None = 0,
) -> list[Figure]:
    """Draw panels, row by row, into a file without suffix; nothing without panels.

    Labels of horizontal axes stand below the lowest panels, of vertical ones beside the leftmost.

    Args:
        path: of the figure.
        caption: of the figure.
        panels: row by row.
        columns: of panels.
        size: in.
        same_height: whether all vertical axes go as far as the farthest.
        legend: columns of the legend below, which has all labels once; 0: as many as labels; None: no legend.
    """
    if not panels:
        return []
    rows = -(-len(panels) // columns)
    with figure(path, rows, columns, size=size) as grid:
        for k, (axes, panel) in enumerate(zip(grid, panels, strict=False)):
            panel.draw(axes)
            if k + columns < len(panels) and panel.axes.get("xlabel") == panels[k + columns].axes.get("xlabel"):
                axes.set_xlabel("")
            if k % columns and panel.axes.get("ylabel") == panels[k - 1].axes.get("ylabel"):
                axes.set_ylabel("")
        for axes in grid[len(panels) :]:
            axes.set_visible(False)
        if same_height:
            top = max(axes.get_ylim()[1] for axes in grid[: len(panels)])
            for axes in grid:
                axes.set_ylim(top=top)
        entries: dict[str, Any] = {}
        for axes in grid:
            handles, labels = axes.get_legend_handles_labels()
            entries = {**dict(zip(labels, handles, strict=True)), **entries}
        if legend is not None and entries:
            legend_below(grid[0], entries, columns=legend or len(entries))
    return [Figure(path.name, caption)]


def strips(
    path: Path,
    caption: str,
    cases: Mapping[str, Sequence[Drawable]],
    axes: Mapping[str, Any],
    key: Sequence[Drawable] = (),
    x_ticks: Mapping[float, str] | None = None,
    legend: int | None = 0,
) -> list[Figure]:
    """Draw a strip a case, from above: each of its marks is drawn with its y from the strip's middle; nothing of none.

    Args:
        path: as of `drawn`.
        caption: as of `drawn`.
        cases: marks by the case's label.
        axes: as of `Panel`.
        key: what is drawn besides, or shown in the legend below.
        x_ticks: as of `Panel`.
        legend: as of `drawn`.
    """
    marks = [mark for k, of_case in enumerate(cases.values()) for mark in strip(k, of_case)]
    limits = {"ylim": (len(cases) - 0.4, -0.6), **axes}
    panel = Panel([*key, *marks], limits, x_ticks, dict(enumerate(cases)))
    return drawn(path, caption, [panel] if cases else [], size=(8.0, 1.4 + 0.27 * len(cases)), legend=legend)


def strip(place: int, marks: Sequence[Drawable]) -> list[Drawable]:
    """Return marks, whose y is from a strip's middle, at the strip's place."""
    return [
        replace(m, y=np.full(np.shape(m.x), place, dtype=np.float64) + np.asarray(m.y, dtype=np.float64))
        if isinstance(m, Mark)
        else m
        for m in marks
    ]
