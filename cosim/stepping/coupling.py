"""What an algorithm does to the units that are due at a communication point."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from handover.cosim.system.schedule import Slot


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

    def get_state(self) -> Mapping[str, Any]:
        """Return what a run that goes on from here must know besides the units' states; JSON can hold it."""
        ...

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go back to where `get_state` was called."""
        ...
