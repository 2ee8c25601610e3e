"""The look of all figures, and time plots with units, by matplotlib."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

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
    path: Path, rows: int, columns: int = 1, size: tuple[float, float] = (8.0, 3.2)
) -> Generator[list[Axes], None, None]:
    """Make a figure of `rows` x `columns` axes; on leaving save it as PNG and SVG beside each other.

    `path` is without suffix, `size` in inches.
    """
    with plt.rc_context(STYLE):
        canvas, axes = plt.subplots(rows, columns, figsize=size, squeeze=False)
        try:
            every: list[Axes] = axes.reshape(-1).tolist()
            yield every
            _save(canvas, path)
        finally:
            plt.close(canvas)


def _save(canvas: Canvas, path: Path) -> None:
    canvas.savefig(path.with_suffix(".png"), metadata={"Software": None})
    canvas.savefig(path.with_suffix(".svg"), metadata={"Date": None})
