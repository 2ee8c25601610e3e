"""Sequences of calls that the standards forbid: each is rejected, named in the log, and changes nothing."""

import random
from collections.abc import Callable

from support.faults import derivatives
from support.faults.event_mode import advance, enter_event_mode, to_step_mode
from support.faults.illegal import clocks, instances, states, times, variables
from support.faults.legal_calls import Effort, LegalCalls
from support.faults.subject import Fault, Saved, Subject

Offence = Callable[[Subject, random.Random], None]

REFUSALS: tuple[Offence, ...] = (
    *variables.REFUSALS,
    *times.REFUSALS,
    *states.REFUSALS,
    *instances.REFUSALS,
    *clocks.REFUSALS,
    *derivatives.REFUSALS,
)
"""Calls that are rejected immediately."""

POISONS: tuple[Offence, ...] = (*variables.POISONS, *times.POISONS)
"""Values that may be set, but with which the unit rejects the next step."""


class IllegalCalls:
    """A few offences against an instance in any mode; after them it goes on as if nothing had happened.

    Args:
        subject: whom they are against.
        other: another instance of the same unit, and `foreign` a state of it.
        ready: a state of `subject` after initialisation with start values.
    """

    def __init__(self, subject: Subject, foreign: Saved, ready: Saved, rng: random.Random, effort: Effort) -> None:
        self.subject, self.foreign, self.ready, self.rng, self.effort = subject, foreign, ready, rng, effort

    def run(self) -> None:
        """Make the sequence."""
        s, rng = self.subject, self.rng
        self._take_position()
        place = s.save()
        before = s.serialised(place) if rng.random() < self.effort.bytes else None
        for _ in range(rng.randint(3, 8)):
            rng.choice(REFUSALS)(s, rng)
        states.refuse_foreign_state(s, self.foreign)
        if before is not None:
            states.refuse_corrupted_state(s, before, rng)
            self._expect_unchanged(before)
        if rng.random() < max(0.05, 0.5 * self.effort.from_scratch):
            rng.choice(POISONS)(s, rng)
            s.restore(place)
        s.forget(place)
        if rng.random() < self.effort.from_scratch:
            LegalCalls(s, self.ready, rng, self.effort).one()

    def _take_position(self) -> None:
        s, afresh = self.subject, self.rng.random() < min(0.4, 0.1 + 2.0 * self.effort.from_scratch)
        mode = self.rng.choice(["instantiated", "initialisation"] if afresh else ["ready", "ready", "terminated"])
        if mode in ("instantiated", "initialisation"):
            s.reset()
        else:
            s.restore(self.ready)
        if mode == "initialisation":
            s.enter()
        if mode == "ready" and s.mode == "event" and self.rng.random() < 0.7:
            to_step_mode(s)
            if s.unit.has_clocks and self.rng.random() < 0.5:
                advance(s, 0.5 * s.unit.period)
                enter_event_mode(s)
        if mode == "terminated":
            s.demand("Terminate")
            s.mode = "terminated"

    def _expect_unchanged(self, before: bytes) -> None:
        saved = self.subject.save()
        after = self.subject.serialised(saved)
        self.subject.forget(saved)
        if after != before:
            at = next((i for i, (x, y) in enumerate(zip(before, after, strict=False)) if x != y), len(before))
            raise Fault(f"refused calls changed the instance, from byte {at} of its {len(before)} bytes of state on")
