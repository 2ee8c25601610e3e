"""The protocols of a block, which is a plant or a controller: stepped, differentiable, with events.

A block is a plain class with three dataclasses of declared fields (`Params`, `Inputs`, `Outputs`); they are found by
the annotations of `__init__` and `step`, and read by `handover.cosim.blocks.description.describe`. Every block
implements `Block`. `DifferentiableBlock` adds directional derivatives of outputs by inputs, `EventfulBlock` adds
events: instants at which state or outputs jump. A block rejects parameters and inputs by raising `InvalidParameters`.
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray


class Block(Protocol):
    """A plant or a controller with declared ports, advanced in steps.

    A block may offer more, see `EventfulBlock` and `DifferentiableBlock`.

    Class attributes: `feedthrough` names, by output, the inputs with direct feedthrough to it (within the same
    communication point); `period` is the sampling period of a block that is sampled, in seconds, else None. Others may
    be left out: `terminals` are ports that are connected together, see `handover.cosim.blocks.terminals`; `deferred`
    names modules that the constructor imports late, as they take long to load and ports are read without them: an FMU
    loads them when it is instantiated (not every library loads in the thread that a host steps in), and a process that
    makes many instances loads them once beforehand; `icon` names a PNG beside the block's module, by which other tools
    show the unit; an SVG of the same name goes with it.
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
        the outputs at that instant, and they hold until the next tick.
        """
        ...

    def get_state(self) -> bytes:
        """Return the complete state: after `set_state` with it, the block continues in the same way, bit for bit.

        It is data: `handover.cosim.blocks.state.pack_state` makes bytes of numbers, texts, arrays and the like.
        """
        ...

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` returned.

        Raises:
            InvalidState: it is not such a state.
        """
        ...


class DifferentiableBlock(Block, Protocol):
    """A block with exact derivatives of its real outputs by its real inputs.

    They are the derivatives of `outputs` as a function of u, with the state held; at a kink, of either side. A block
    that has the method counts as differentiable.
    """

    def directional_derivative(
        self, t: float, u: Any, du: Mapping[str, float | NDArray[np.float64]]
    ) -> Mapping[str, float | NDArray[np.float64]]:
        """Return the outputs' derivatives in the direction du: dy = (dy/du) du.

        Args:
            t: time, s.
            u: inputs where the derivative is taken.
            du: direction by input's name, a float or an array of the input's shape, per unit of the direction's
                parameter; inputs that are not named do not change.

        Returns:
            Derivatives by output's name, of the output's shape; those that are not named are zero.
        """
        ...


MAX_EVENTS = 1000
"""How many events may follow each other at one instant."""


class InvalidAdvance(ValueError):
    """A block's `advance` went backwards, or beyond dt."""

    def __init__(self, block: str, reached: float, dt: float) -> None:
        super().__init__(f"{block}.advance came {reached!r} s far; it was to advance by at most {dt!r} s")
        self.reached, self.dt = reached, dt


class TooManyEvents(RuntimeError):
    """A block has one event after another and time does not advance (Zeno behaviour)."""

    def __init__(self, block: str, t: float) -> None:
        super().__init__(f"{block} has had {MAX_EVENTS} events at t = {t!r} s; it must come to rest or advance")
        self.t = t


class EventfulBlock(Block, Protocol):
    """A block with events of its own, such as an impact. It has all three methods and no period.

    `step` handles the events within [t, t + dt) by itself, as `step_through_events` does; one at t + dt is left to what
    follows, the next step or `handle_event`. With `advance` and `handle_event` a host sees each event.
    """

    def advance(self, t: float, dt: float, u: Any) -> tuple[float, Any]:
        """Advance from t with u held, by dt or to the first event.

        Returns:
            The time by which it advanced, s: dt, or less where an event is; 0 if one is due at t. And the outputs
            there, before the event changes anything.
        """
        ...

    def handle_event(self, t: float, u: Any) -> Any:
        """Apply the event that is due at t and return the outputs after it; no time passes.

        t may differ from the time of an event known beforehand by a host's rounding errors in its sum of steps, 1e-9 s.
        """
        ...

    def next_event(self, t: float) -> float | None:
        """Return the time of the next event that is known beforehand, or None.

        A host with event mode lets a step end there. Events that depend on inputs need not be announced.
        """
        ...


def step_through_events(block: EventfulBlock, t: float, dt: float, u: Any) -> Any:
    """Advance from t by dt with u held, handle the events on the way, and return the outputs at t + dt.

    Raises:
        InvalidAdvance: the block went backwards, or beyond dt.
        TooManyEvents: there are more than MAX_EVENTS events in a row and no time passes.
    """
    passed, idle = 0.0, 0  # seconds, and events in a row without any
    while True:
        left = dt - passed
        reached, y = block.advance(t + passed, left, u)
        if not 0.0 <= reached <= left:
            raise InvalidAdvance(type(block).__name__, reached, left)
        passed += reached
        if reached == left:
            return y
        idle = 0 if reached > 0.0 else idle + 1
        if idle > MAX_EVENTS:
            raise TooManyEvents(type(block).__name__, t + passed)
        y = block.handle_event(t + passed, u)
        if passed >= dt:
            return y


class InvalidParameters(ValueError):
    """Parameters or inputs that a block rejects; its state has not changed. Subclasses name their block.

    An FMU logs the message in one line, without a traceback: the runtime looks for a true `is_refusal`.

    Attributes:
        faults: everything that is wrong, each with the values that would be valid.
    """

    block: str
    is_refusal: ClassVar[bool] = True

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__(f"{self.block}: " + "; ".join(faults))
        self.faults = list(faults)


class InvalidState(ValueError):
    """A saved state cannot be restored: it is damaged, no plain data, or of another unit; nothing is changed.

    Defined here and not beside `pack_state`, so that FMUs without states do not need its package. An FMU logs it
    in one line, without a traceback.
    """

    is_refusal: ClassVar[bool] = True

    def __init__(self, fault: str = "the state was saved by another unit, or by another version of this one") -> None:
        super().__init__(fault)
