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
    """Shade every second phase and write the names of those that last over the axes, where `names` has them."""
    edges = np.flatnonzero(np.diff(phase)) + 1
    starts = [0, *edges.tolist()]
    ends = [*edges.tolist(), len(t) - 1]
    for k, (a, b) in enumerate(zip(starts, ends, strict=True)):
        if k % 2:
            axes.axvspan(t[a], t[b], color="#eef2f7", lw=0, zorder=0)
        name = names.get(int(phase[a]), "").replace("_", " ").lower()
        if t[b] - t[a] > 0.06 * (t[-1] - t[0]):
            axes.text((t[a] + t[b]) / 2, 1.02, name, transform=axes.get_xaxis_transform(), ha="center", color="#4d5866")


def _save(canvas: Canvas, path: Path) -> None:
    canvas.savefig(path.with_suffix(".png"), metadata={"Software": None})
    canvas.savefig(path.with_suffix(".svg"), metadata={"Date": None})
