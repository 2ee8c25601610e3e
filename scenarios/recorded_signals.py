"""The signals of a run that has ended, one instant at a time, as its watch saw them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.system.signals import Signals
from handover.scenarios.record import Record


class RecordedSignals(Signals):
    """Answers as the signals of the running system did at one row of its record, which holds no pictures and texts.

    Attributes:
        row: of the record.
    """

    def __init__(self, record: Record) -> None:
        super().__init__({}, {}, owner=record)
        self._record = record
        self._arrays: dict[str, NDArray[Any]] = {}
        self.row = 0

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a copy of a signal's value in its shape.

        Raises:
            KeyError: it was not recorded.
        """
        if name not in self._arrays:
            self._arrays[name] = self._record[name]
        return np.array(self._arrays[name][self.row])

    def text(self, name: str) -> str:
        """Return the item's name of an enumeration."""
        value = int(self[name])
        return self._record.items(name).get(value, str(value))
