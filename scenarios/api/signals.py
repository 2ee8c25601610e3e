"""The signals of a run as arrays by name, and as a table of pandas."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.cosim.record.reader import Record
from handover.scenarios.runs.results.run_facts import elements_of

if TYPE_CHECKING:
    from pandas import DataFrame


class SignalTable(Mapping[str, NDArray[Any]]):
    """The outputs of all units over time: `signals["arm.p_WG"]` has a row for each entry of `time`.

    An array port has its shape after the first axis; `signals["arm.p_WG[1]"]` is its first entry alone. Enumerations
    are integers, see `item_names`. Texts and pictures are not recorded.

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
        duration = self.time[-1] - self.time[0] if len(self.time) else 0.0
        return f"<{counted(len(self), 'signal')} over {duration:g} s, {len(self.time)} rows>"


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
