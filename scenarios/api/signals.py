"""The signals of a run as arrays by name, as a table of pandas, and as a figure of matplotlib."""

import io
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import nearest
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.display_unit import unit_symbol
from handover.scenarios.experiment.plotting import STYLE, draw_time_plot
from handover.scenarios.experiment.time_plot import COLOURS, Curve, TimePlot
from handover.scenarios.results.run_facts import elements_of

if TYPE_CHECKING:
    from pandas import DataFrame

_WIDTH, _ALONE, _STACKED = 8.0, 3.0, 2.1
"""Width of a figure, height of a single plot, and of each of several below each other, in."""


class SignalTable(Mapping[str, NDArray[Any]]):
    """The outputs of all units over time: `signals["arm.p_WG"]` has a row for each entry of `time`.

    An array port has its shape after the first axis; enumerations are integers, see `item_names`. Texts and
    pictures are not recorded.

    Attributes:
        time: in seconds, shape (rows,).
    """

    def __init__(self, record: Record) -> None:
        self._record = record
        self.time: Floats = record.time

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a signal over time.

        Raises:
            KeyError: there is none of that name; the nearest names are given.
        """
        return self._record[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names, in the order of the system's units."""
        return iter(self._record.signals)

    def __len__(self) -> int:
        """Return the number of signals."""
        return len(self._record.signals)

    def unit(self, name: str) -> str:
        """Return a signal's unit, such as "m/s"; "1" for a pure number."""
        return self._record.unit(name)

    @property
    def units(self) -> dict[str, str]:
        """The units of all signals by name."""
        return {name: self.unit(name) for name in self}

    def item_names(self, name: str) -> dict[int, str]:
        """Return the names of an enumeration's values; none for another signal."""
        return self._record.items(name)

    def description(self, name: str) -> str:
        """Return what a signal is; "" where its unit does not say."""
        return self._record.description(name)

    def to_pandas(self) -> "DataFrame":
        """Return a table with the time in seconds as index and a column for each scalar, as `arm.p_WG[1]`.

        Its `attrs["units"]` has the columns' units.

        Raises:
            ImportError: pandas is not installed.
        """
        elements = {name: elements_of(name, self[name]) for name in self}
        columns = {column: values for of_signal in elements.values() for column, values in of_signal.items()}
        units = {column: self.unit(name) for name, of_signal in elements.items() for column in of_signal}
        return data_frame({"time": self.time, **columns}, units).set_index("time")

    def __repr__(self) -> str:
        """Return how many there are, and over which time."""
        return f"<{len(self)} signals over {self.time[-1] - self.time[0]:g} s, {len(self.time)} rows>"


def data_frame(columns: Mapping[str, Any], units: Mapping[str, str]) -> "DataFrame":
    """Return a table of pandas, whose `attrs["units"]` has the columns' units.

    Raises:
        ImportError: pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError as e:
        raise ImportError("to_pandas needs pandas: python -m pip install pandas") from e
    table = pd.DataFrame(columns)
    table.attrs["units"] = dict(units)
    return table


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
        names: which of them.
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
        raise ValueError(f"{len(names)} signals for one pair of axes; one is right")
    with mpl.rc_context(STYLE):
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
    values, items = signals[name], signals.item_names(name)
    elements = list(elements_of(name.rpartition(".")[2], values).items())[: len(COLOURS)]
    held = values.dtype.kind != "f"
    curves = [Curve(label=label, values=column.astype(np.float64), held=held) for label, column in elements]
    plot = TimePlot(title=name, quantity=name, unit=unit_symbol(signals.unit(name)), curves=curves)
    draw_time_plot(axes, plot, signals.time)
    if items:
        axes.set_yticks(list(items), [text.replace("_", " ").lower() for text in items.values()])
    if len(curves) > 1:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
