"""The calls of one unit that answered Warning: how many, from when on, and what the unit said of it.

Warning is a success: "things are not quite right, but the computation can continue" (FMI 2.0.4, sec. 2.1.3; FMI 3.0,
sec. 2.2.4). So a run goes on, and the warnings are reported at its end. Calls that the compiled plan or the
process of an isolated unit makes are counted there and added here when somebody asks.
"""

import collections
import math
from typing import TypedDict

_MAX_MESSAGE = 200
"""Characters of a message that are reported."""


class WarningData(TypedDict):
    """The warnings of one instance: how many of each FMI call, the time of the first in s, and the last message."""

    instance: str
    calls: dict[str, int]
    time: float
    message: str


class UnitWarnings:
    """Counts calls that answered Warning.

    Attributes:
        first: simulated time of the first one in seconds; infinite until there is one.
    """

    def __init__(self) -> None:
        self.first = math.inf
        self._calls: collections.Counter[str] = collections.Counter()
        self._message = ""

    def add(self, call: str, t: float, n: int = 1) -> None:
        """Count a call that answered Warning n times, the first time at t in seconds."""
        self._calls[call] += n
        self.first = min(self.first, t)

    def note_message(self, message: str) -> None:
        """Keep what the unit has logged with the status Warning; the last one is reported, in one line."""
        self._message = message

    def add_all(self, data: WarningData) -> None:
        """Count what `as_data` returned, as of the run that is resumed."""
        for call, n in data["calls"].items():
            self.add(call, data["time"], n)
        self.note_message(data["message"])

    def __bool__(self) -> bool:
        """Whether a call answered Warning; what is only logged does not count."""
        return bool(self._calls)

    def as_data(self, unit: str) -> WarningData:
        """Return the warnings of the instance with this name, calls in the order of their names."""
        message = " ".join(self._message[: 2 * _MAX_MESSAGE].split())
        if len(message) > _MAX_MESSAGE:
            message = f"{message[:_MAX_MESSAGE]}..."
        time = float(f"{self.first:.15g}")  # a step ends at 0.1 + 0.2, where the next one begins at 0.3
        return WarningData(instance=unit, calls=dict(sorted(self._calls.items())), time=time, message=message)
