"""The signals of a run as a figure of matplotlib, which takes long to load and comes with the extra `reports`."""

import io
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from handover.cosim.exceptions import nearest
from handover.scenarios.api.signals import SignalTable
from handover.scenarios.experiment.plotting import draw_time_plot, own_style
from handover.scenarios.runs.reporting.run_figures import signal_plot

_WIDTH, _ALONE, _STACKED = 8.0, 3.0, 2.1
"""Width of a figure, height of a single plot, and of each of several below each other, in."""


class Plot(Figure):
    """A figure of matplotlib that a notebook shows without a backend; `savefig` writes it."""

    def _repr_png_(self) -> bytes:
        picture = io.BytesIO()
        self.savefig(picture, format="png", dpi=110)
        return picture.getvalue()


def plot_signals(signals: SignalTable, names: Sequence[str], axes: Axes | None = None) -> Figure:
    """Draw signals over time, one below the other, with names and units at the axes; pyplot is left alone.

    Args:
        signals: of a run.
        names: which of them, or of their elements, `arm.p_WG[3]`.
        axes: where to draw a single one; by default in a new figure.

    Raises:
        KeyError: a name is of no signal; all of these are named.
        ValueError: no name is given, or several for one pair of axes.
    """
    if not names:
        raise ValueError("no signal is named: plot('arm.p_WG') draws one")
    if unknown := [n for n in names if n not in signals]:
        raise KeyError("; ".join(f"no signal {n!r}: {nearest(n, signals)}" for n in unknown))
    if axes is not None and len(names) > 1:
        raise ValueError(f"{len(names)} signals for one pair of axes; expected one")
    with own_style():
        if axes is not None:
            _draw(axes, signals, names[0])
            axes.set_xlabel("time (s)")
            canvas = axes.get_figure(root=True)
            assert canvas is not None, "axes are drawn within a figure"
            return canvas
        height = _ALONE if len(names) == 1 else _STACKED * len(names) + 0.4
        figure = Plot(figsize=(_WIDTH, height))
        grid: Any = figure.subplots(len(names), 1, squeeze=False, sharex=True)
        for row, name in zip(grid[:, 0], names, strict=True):
            _draw(row, signals, name)
        grid[-1, 0].set_xlabel("time (s)")
        figure.align_ylabels()
        return figure


def _draw(axes: Axes, signals: SignalTable, name: str) -> None:
    items, plot = signals.item_names(name), signal_plot(name, name, signals[name], signals.unit(name))
    draw_time_plot(axes, plot, signals.time)
    if items:
        axes.set_yticks(list(items), [text.replace("_", " ").lower() for text in items.values()])
    if len(plot.curves) > 1:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
