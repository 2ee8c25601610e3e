"""FMI 3's calls for the clocks of one instance, and the times at which its time-based clocks tick.

Tick times are exact fractions, so they do not drift. FMI 3.0, sec. 2.2.9.
"""

import ctypes
import enum
from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

from handover.cosim.fmu.calls import Call
from handover.cosim.fmu.file.clocks import FmuClock


class Qualifier(enum.IntEnum):
    """The meaning of an interval that a unit returned: fmi3IntervalQualifier."""

    NOT_YET_KNOWN = 0
    UNCHANGED = 1
    CHANGED = 2


class ClockCalls:
    """Activates an instance's input clocks, and reads its output clocks, intervals and shifts."""

    def __init__(self, call: Call, clocks: Mapping[str, FmuClock]) -> None:
        self._call = call
        self._clocks = clocks
        outputs = [c for c in clocks.values() if not c.is_input]
        self._outputs = [c.name for c in outputs]
        self._references = (ctypes.c_uint32 * len(outputs))(*(c.reference for c in outputs))
        self._active = (ctypes.c_bool * len(outputs))()

    def tick(self, names: Iterable[str]) -> None:
        """Activate input clocks."""
        references = [self._clocks[n].reference for n in names]
        n = len(references)
        self._call("SetClock", (ctypes.c_uint32 * n)(*references), n, (ctypes.c_bool * n)(*[True] * n))

    def ticking(self) -> set[str]:
        """Return the output clocks that are active."""
        if not self._outputs:
            return set()
        self._call("GetClock", self._references, len(self._outputs), self._active)
        return {name for name, active in zip(self._outputs, self._active, strict=True) if active}

    def interval(self, name: str) -> tuple[Fraction, Qualifier]:
        """Return a clock's interval in seconds, and its qualifier."""
        clock, qualifier = self._clocks[name], ctypes.c_int()
        if clock.supports_fraction:
            counter, resolution = ctypes.c_uint64(), ctypes.c_uint64(1)
            self._get("GetIntervalFraction", clock, counter, resolution, qualifier)
            seconds = Fraction(counter.value, resolution.value or 1)
        else:
            decimal = ctypes.c_double()
            self._get("GetIntervalDecimal", clock, decimal, qualifier)
            is_known = qualifier.value != Qualifier.NOT_YET_KNOWN  # else the decimal may be anything, also NaN
            seconds = Fraction(repr(decimal.value)) if is_known else Fraction(0)
        return seconds, Qualifier(qualifier.value)

    def shift(self, name: str) -> Fraction:
        """Return the time of a clock's first tick, in seconds after the start."""
        clock = self._clocks[name]
        if clock.supports_fraction:
            counter, resolution = ctypes.c_uint64(), ctypes.c_uint64(1)
            self._get("GetShiftFraction", clock, counter, resolution)
            return Fraction(counter.value, resolution.value or 1)
        decimal = ctypes.c_double()
        self._get("GetShiftDecimal", clock, decimal)
        return Fraction(repr(decimal.value))

    def _get(self, function: str, clock: FmuClock, *results: Any) -> None:
        reference = ctypes.c_uint32(clock.reference)
        self._call(function, ctypes.byref(reference), 1, *(ctypes.byref(r) for r in results))


class ClockTimer:
    """The times of a time-based input clock.

    Periodic clocks (constant, fixed, tunable) tick at start + shift + k * interval; the interval is the description's,
    or else the one that the unit returns while it is initialised (the parameters that it may depend on do not change in
    a run).
    A changing clock gives the interval to its next tick whenever it has ticked, a countdown clock in any event mode.

    Attributes:
        next: the time of the next tick, s; None while a countdown has not begun.
    """

    def __init__(self, clock: FmuClock, calls: ClockCalls, start: Fraction) -> None:
        """Read from the unit, in initialisation mode of a run from `start` on, what the description leaves open."""
        self.clock = clock
        self._calls = calls
        self.next: Fraction | None = None
        if clock.variability in ("changing", "countdown"):
            self._count_from(start)
            return
        shift, self._interval = clock.shift, clock.interval
        if clock.interval is None:
            self._interval, _ = calls.interval(clock.name)
            shift = calls.shift(clock.name)
        if not self._interval:
            raise ValueError(f"its clock {clock.name!r} ticks every {self._interval} s")
        self.next = start + shift

    def is_due(self, t: float) -> bool:
        """Whether it ticks at t."""
        return self.next is not None and float(self.next) <= t

    def tick(self) -> None:
        """Set the time of the next tick, after the unit has updated its discrete states in event mode."""
        if self.clock.variability == "countdown" or self.next is None:
            self.next = None
        elif self.clock.variability == "changing":
            ticked, self.next = self.next, None
            self._count_from(ticked)
        elif self._interval:
            self.next += self._interval

    def ask(self, t: float) -> None:
        """Read a countdown clock's interval, in event mode at t."""
        if self.clock.variability == "countdown":
            self._count_from(Fraction(t))

    def _count_from(self, begin: Fraction) -> None:
        interval, qualifier = self._calls.interval(self.clock.name)
        if qualifier is Qualifier.CHANGED or (self.next is None and qualifier is Qualifier.UNCHANGED):
            self.next = begin + interval
