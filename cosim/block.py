"""What a plant or a controller is.

A block is a plain class with three dataclasses of declared fields (`Params`, `Inputs`, `Outputs`); they are found by
the annotations of `__init__` and `step`, and read by `handover.cosim.block_description.describe`.
"""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, ClassVar, Protocol


class Block(Protocol):
    """A plant or a controller with declared ports, advanced in steps.

    What a block may offer besides: `handover.cosim.eventful_block.EventfulBlock`,
    `handover.cosim.differentiable_block.DifferentiableBlock`.

    Class attributes: `feedthrough` names, by output, the inputs that act on it at once (within the same communication
    point); `period` is the sampling period of a block that is sampled, in seconds, else None.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]]
    period: ClassVar[Fraction | None]

    def __init__(self, params: Any) -> None: ...
    def outputs(self, t: float, u: Any) -> Any:
        """Return the outputs at the start; no time passes."""
        ...

    def step(self, t: float, dt: float, u: Any) -> Any:
        """Advance from t by dt with u held and return the outputs at t + dt.

        A sampled block is stepped by its period only, once at each tick, with the inputs of that instant; a host sees
        the outputs at once, and they hold until the next tick.
        """
        ...

    def get_state(self) -> bytes:
        """Return the complete state: what follows `set_state` is the same, bit for bit."""
        ...

    def set_state(self, state: bytes) -> None:
        """Go back to a state that `get_state` gave."""
        ...
