"""What an algorithm does to the units that are due at a communication point."""

from collections.abc import Sequence
from typing import Protocol

from cosim.schedule import Slot


class Coupling(Protocol):
    """Takes units from one communication point to the next.

    At a communication point t, `arrive` is called, then observers see the signals, then `depart`. Both get the units
    that are due there, in the schedule's order. A slot's `period` is the step to take, in seconds.
    """

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Bring the signals to what observers see at t."""
        ...

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Step the units that are due, from t."""
        ...
