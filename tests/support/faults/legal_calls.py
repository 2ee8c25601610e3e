"""Random sequences of calls that the standards allow: FMI 2.0 section 4.2.4; FMI 3.0 sections 2.3 and 4.2."""

import ctypes
import math
import random
from collections.abc import Callable
from dataclasses import dataclass

from support.faults.derivatives import derive
from support.faults.draws import legal_values
from support.faults.event_mode import advance, enter_event_mode, settle, to_step_mode
from support.faults.foreign_unit import ForeignUnit
from support.faults.subject import Fault, Saved, Subject, of_one_type

LENGTH = (5, 12)
CATEGORIES = (b"logStatusError", b"logStatusWarning", b"logAll")
WEIGHTS = {
    "instantiated": {"set_some": 3, "log": 1, "save_and_restore": 1, "enter": 4},
    "initialisation": {"set_some": 2, "get_some": 2, "derive": 1, "save_and_restore": 1, "exit": 4, "log": 1},
    "stepping": {
        "set_some": 3,
        "get_some": 4,
        "derive": 1,
        "step": 5,
        "save_and_restore": 2,
        "enter_event": 2,
        "log": 1,
        "end": 1,
    },
    "event": {
        "set_some": 2,
        "get_some": 2,
        "derive": 1,
        "ask_clock": 1,
        "update": 2,
        "leave_event": 4,
        "save_and_restore": 1,
        "end": 1,
    },
    "terminated": {"get_some": 3, "derive": 1, "save_and_restore": 1, "reset": 3, "log": 1},
    "failed": {"reset": 1},
}
"""What may be called in which mode, and how often it is."""


@dataclass
class Effort:
    """What a sequence may cost.

    Attributes:
        from_scratch: share of sequences that make the block anew; the others go on from a saved state.
        steps: most steps in a sequence.
        bytes: share of the occasions at which a state's bytes are looked at, or it is gone back to; two pictures make
            megabytes of them, and going back draws them again.
    """

    from_scratch: float = 0.5
    steps: int = 12
    bytes: float = 1.0


class LegalCalls:
    """A random walk through an instance's modes.

    Args:
        subject: what is called.
        ready: a state of it after initialisation with start values.
    """

    def __init__(self, subject: Subject, ready: Saved, rng: random.Random, effort: Effort) -> None:
        self.subject, self.ready, self.rng, self.effort = subject, ready, rng, effort
        self.steps = 0

    def begin(self) -> None:
        """Go where the sequence begins."""
        if self.rng.random() < self.effort.from_scratch:
            self.subject.reset()
        else:
            self.subject.restore(self.ready)

    def one(self) -> None:
        """Make one random call, or a few that belong together."""
        weights = WEIGHTS[self.subject.mode]
        (name,) = self.rng.choices(list(weights), list(weights.values()))
        action: Callable[[], None] = getattr(self, name)
        action()

    def set_some(self) -> None:
        """Set inputs, before the end of initialisation also parameters."""
        s = self.subject
        before = s.mode in ("instantiated", "initialisation")
        afresh = before and self.rng.random() < self.effort.from_scratch
        settable = s.unit.of(*(("input", "parameter") if afresh else ("input",)))
        if not settable:
            return
        some = of_one_type(settable, self.rng)[: 3 if before else None]
        values = [legal_values(v, self.rng, wide=True) for v in some]
        status = s.set(some, values)
        if status:
            raise Fault(f"setting {[v.name for v in some]} to {values} is answered with {status}: {s.log[-1:]}")

    def get_some(self) -> None:
        """Get variables, or nothing at all."""
        if self.rng.random() < 0.1:
            kind = "Real" if self.subject.unit.fmi == 2 else "Int64"
            self.subject.demand(f"Get{kind}", None, 0, None, *((0,) if self.subject.unit.fmi == 3 else ()))
            return
        readable = self.subject.unit.of("input", "parameter", "output", "independent")
        self.subject.get(of_one_type(readable, self.rng))

    def log(self) -> None:
        """Choose what is logged."""
        some = self.rng.sample(CATEGORIES, self.rng.randrange(4))
        names = (ctypes.c_char_p * len(some))(*some) if some else None
        self.subject.demand("SetDebugLogging", self.rng.random() < 0.3, len(some), names)

    def enter(self) -> None:
        """Enter initialisation mode, with any times that make sense."""
        start = self.rng.choice([0.0, 0.0, self.rng.uniform(-10.0, 1000.0)])
        stop = self.rng.choice([math.inf, start + 100.0 * self.subject.unit.step])
        self.subject.enter(start, stop, self.rng.choice([None, 1e-6]))

    def exit(self) -> None:
        """Leave initialisation mode."""
        self.subject.exit()

    def step(self) -> None:
        """Do a step, or some."""
        unit = self.subject.unit
        whole = self.rng.randint(1, 3)
        if self.steps + whole > self.effort.steps:
            return
        self.steps += whole
        if unit.any_step:
            advance(self.subject, unit.step * self.rng.choice([whole, 0.5, 1.0, self.rng.uniform(0.1, 2.0)]))
            return
        for _ in range(whole):
            if not advance(self.subject, unit.step):
                return

    def save_and_restore(self) -> None:
        """Save the state, perhaps go on, go back to it, directly or by way of its bytes, and free it."""
        s = self.subject
        saved = s.save()
        if s.mode == "stepping" and self.rng.random() < 0.5:
            self.step()
        if self.rng.random() < 0.5 * self.effort.bytes:
            data = s.serialised(saved)
            copy = s.deserialised(data, saved)
            s.restore(copy)
            s.forget(copy)
            again = s.save()
            if s.serialised(again) != data:
                raise Fault("a restored state's bytes differ from those that it was restored from")
            s.forget(again)
        elif self.rng.random() < 0.8 * max(0.25, self.effort.bytes):
            s.restore(saved)
        s.forget(saved)

    def enter_event(self) -> None:
        """Enter event mode if the instance was made with it."""
        if self.subject.event_mode:
            enter_event_mode(self.subject)

    def update(self) -> None:
        """Bring the discrete states up to date, after activating the clock if it ticks."""
        settle(self.subject)

    def ask_clock(self) -> None:
        """Ask whether the clock is active, and for its interval."""
        unit, active, interval, qualifier = self.subject.unit, ctypes.c_bool(), ctypes.c_double(), ctypes.c_int()
        if unit.has_clocks:
            self.subject.demand("GetClock", unit.clock, 1, ctypes.byref(active))
            self.subject.demand("GetIntervalDecimal", unit.clock, 1, ctypes.byref(interval), ctypes.byref(qualifier))
            if active.value or interval.value != unit.period:
                raise Fault(f"the clock is active, or its interval {interval.value!r} s is not {unit.period!r} s")

    def derive(self) -> None:
        """Ask for derivatives."""
        derive(self.subject, self.rng)

    def leave_event(self) -> None:
        """Go on to step mode."""
        to_step_mode(self.subject)

    def end(self) -> None:
        """Terminate, now and then."""
        if self.rng.random() < 0.5:
            self.subject.demand("Terminate")
            self.subject.mode = "terminated"

    def reset(self) -> None:
        """Reset, or where that would be dear, go back to the state after initialisation."""
        if self.rng.random() < max(0.1, self.effort.from_scratch):
            self.subject.reset()
        else:
            self.subject.restore(self.ready)


def performance(subject: Subject, unit: ForeignUnit) -> list[object]:
    """Return what a unit shows over a few steps from its start values on: the same however it got there."""
    rng, seen = random.Random(unit.name), list[object]()
    subject.enter()
    if not subject.exit():
        raise Fault(f"start values are refused: {subject.log[-1:]}")
    inputs, outputs = unit.of("input"), unit.of("output")
    for _ in range(2):
        for v in inputs:
            if v.type != "Binary":
                subject.set([v], [legal_values(v, rng, wide=False)])
        if not advance(subject, unit.step):
            raise Fault(f"inputs near the start values are refused: {subject.log[-1:]}")
        seen += [subject.get([v]) for v in outputs]
    return seen
