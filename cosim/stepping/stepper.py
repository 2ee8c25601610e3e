"""How a run gets from one communication point to the next."""

from collections.abc import Mapping
from typing import Any, Protocol


class Stepper(Protocol):
    """Moves an ensemble through time."""

    @property
    def time(self) -> float:
        """Simulated time in seconds."""
        ...

    def arrive(self, last: int) -> bool:
        """Go to the next communication point, tick `last` at the latest; return whether that tick is reached."""
        ...

    def depart(self) -> None:
        """Step what is due at the communication point."""
        ...

    def get_state(self) -> Mapping[str, Any]:
        """Return what a run that goes on from here must know besides the units' states; JSON can hold it."""
        ...

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go back to where `get_state` was called."""
        ...
