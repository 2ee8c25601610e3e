"""What a block offers whose course has events: instants at which something changes at once."""

from typing import Any, Protocol

from handover.cosim.block import Block

MOST_EVENTS = 1000
"""Most events in a row at one instant."""


class UnfitAdvance(ValueError):
    """A block's `advance` went backwards, or farther than it was to."""

    def __init__(self, block: str, reached: float, dt: float) -> None:
        super().__init__(f"{block}.advance came {reached!r} s far; it was to advance by at most {dt!r} s")
        self.reached, self.dt = reached, dt


class EndlessEvents(RuntimeError):
    """A block has one event after the other without time passing."""

    def __init__(self, block: str, t: float) -> None:
        super().__init__(f"{block} has had {MOST_EVENTS} events at t = {t!r} s; it must come to rest, or get on")
        self.t = t


class EventfulBlock(Block, Protocol):
    """A block with events of its own, such as an impact. It has all three methods and no period.

    `step` handles the events within [t, t + dt) by itself, as `step_through_events` does; one at t + dt is left to what
    follows, be it the next step or `handle_event`. With `advance` and `handle_event` a host sees each event.
    """

    def advance(self, t: float, dt: float, u: Any) -> tuple[float, Any]:
        """Advance from t with u held, by dt or to the first event.

        Returns:
            How far it came, s: dt, or less where an event is; 0 if one is due at t. And the outputs there, as they are
            before the event changes anything.
        """
        ...

    def handle_event(self, t: float, u: Any) -> Any:
        """Change what the event changes that is due at t, and return the outputs after it; no time passes.

        The instant of an event known beforehand may have been missed by what a host's sum of steps is off, 1e-9 s.
        """
        ...

    def next_event(self, t: float) -> float | None:
        """Return the time of the next event that is known beforehand, or None.

        A host with event mode lets a step end there. Events that depend on inputs need not be told.
        """
        ...


def step_through_events(block: EventfulBlock, t: float, dt: float, u: Any) -> Any:
    """Advance from t by dt with u held, handle the events on the way, and return the outputs at t + dt.

    Raises:
        UnfitAdvance: the block went backwards, or farther than it was to.
        EndlessEvents: there are more than MOST_EVENTS events in a row and no time passes.
    """
    passed, idle = 0.0, 0
    while True:
        left = dt - passed
        reached, y = block.advance(t + passed, left, u)
        if not 0.0 <= reached <= left:
            raise UnfitAdvance(type(block).__name__, reached, left)
        passed += reached
        if reached == left:
            return y
        idle = 0 if reached > 0.0 else idle + 1
        if idle > MOST_EVENTS:
            raise EndlessEvents(type(block).__name__, t + passed)
        y = block.handle_event(t + passed, u)
        if passed >= dt:
            return y
