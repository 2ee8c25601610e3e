"""The look of all figures, and time plots with units, by matplotlib."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e2e6ec",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 150,
    "svg.hashsalt": "handover",
}

COLOURS = ("#2f6db5", "#d1602b", "#3c8d53", "#8357a8", "#b58a1b", "#4d5866")


_NAME = "#4d5866"
_LETTER, _UPRIGHT = 5.2, 8.5
"""Widths of a letter of a name over a phase, and of an upright name, in points."""


@contextmanager
def figure(
    path: Path,
    rows: int,
    columns: int = 1,
    size: tuple[float, float] = (8.0, 3.2),
    heights: Sequence[float] | None = None,
) -> Generator[list[Axes], None, None]:
    """Make a figure of `rows` x `columns` axes; on leaving save it as PNG and SVG beside each other.

    `path` is without suffix, `size` in inches; `heights` are the rows' relative ones.
    """
    with plt.rc_context(STYLE):
        canvas, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, height_ratios=heights)
        try:
            every: list[Axes] = axes.reshape(-1).tolist()
            yield every
            _save(canvas, path)
        finally:
            plt.close(canvas)


def shade_phases(axes: Axes, t: NDArray[np.float64], phase: NDArray[np.int64], names: Mapping[int, str]) -> None:
    """Shade every second phase and write the names of phases, where `names` has them.

    A name stands over its phase if it is narrower; else upright at the top of the axes, with a line to its phase.
    """
    edges = np.flatnonzero(np.diff(phase)) + 1
    starts = [0, *edges.tolist()]
    ends = [*edges.tolist(), len(t) - 1]
    per_point = float(t[-1] - t[0]) / _width(axes)
    narrow: list[tuple[float, float, str]] = []
    for k, (a, b) in enumerate(zip(starts, ends, strict=True)):
        if k % 2:
            axes.axvspan(t[a], t[b], color="#eef2f7", lw=0, zorder=0)
        name, wide = names.get(int(phase[a]), "").replace("_", " ").lower(), float(t[b] - t[a])
        if _LETTER * len(name) * per_point < wide:
            axes.text((t[a] + t[b]) / 2, 1.02, name, transform=axes.get_xaxis_transform(), ha="center", color=_NAME)
        elif name:
            narrow.append((wide, float(t[a] + t[b]) / 2, name))
    _upright(axes, narrow, float(t[0]), float(t[-1]), _UPRIGHT * per_point)


def leave_room(axes: Axes) -> None:
    """Let axes with upright names of phases reach beyond what is drawn, so that the names stand above it."""
    if not any(text.get_rotation() for text in axes.texts):
        return
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.55 * (high - low))


def _width(axes: Axes) -> float:
    """Return about how wide the axes are, in points."""
    inches: float = axes.figure.get_figure(root=True).get_size_inches()[0]  # pyright: ignore
    return 72.0 * 0.88 * inches


def _upright(axes: Axes, labels: Sequence[tuple[float, float, str]], low: float, high: float, apart: float) -> None:
    """Write names upright at places, given with widths, at least so far apart; the narrowest go if there is no room."""
    room = max(int((high - low) / apart), 1)
    kept = sorted(sorted(labels, reverse=True)[:room], key=lambda label: label[1])
    placed: list[float] = []
    for _, x, _ in kept:
        placed.append(max(x, low + apart / 2, placed[-1] + apart if placed else low))
    for n in reversed(range(len(placed))):
        placed[n] = min(placed[n], high - apart * (len(placed) - n - 0.5))
    across = axes.get_xaxis_transform()
    for (_, x, name), at in zip(kept, placed, strict=True):
        top = 0.98 if abs(at - x) < apart / 4 else 0.93
        if top < 0.98:
            axes.plot([x, at], [1.0, top + 0.01], transform=across, color=_NAME, lw=0.5)
        text = axes.text(at, top, name, transform=across, rotation=90, ha="center", va="top", size=7, color=_NAME)
        text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])


def _save(canvas: Canvas, path: Path) -> None:
    canvas.savefig(path.with_suffix(".png"), metadata={"Software": None})
    canvas.savefig(path.with_suffix(".svg"), metadata={"Date": None})
