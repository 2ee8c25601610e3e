"""FMI 3's calls for clocks, for one instance."""

import ctypes
import enum
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from typing import Any

from handover.cosim.events.fmu_clock import FmuClock

Call = Callable[..., None]
"""Calls a function of the standard by its name without `fmi3`, and raises `UnitFailure` where it does not answer OK."""


class Qualifier(enum.IntEnum):
    """What an interval is that a unit told: fmi3IntervalQualifier."""

    NOT_YET_KNOWN = 0
    UNCHANGED = 1
    CHANGED = 2


class ClockCalls:
    """Lets an instance's input clocks tick, and asks for its output clocks and for intervals."""

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
        """Return a clock's interval in seconds, and what it is."""
        clock, qualifier = self._clocks[name], ctypes.c_int()
        if clock.supports_fraction:
            counter, resolution = ctypes.c_uint64(), ctypes.c_uint64(1)
            self._ask("GetIntervalFraction", clock, counter, resolution, qualifier)
            seconds = Fraction(counter.value, resolution.value or 1)
        else:
            decimal = ctypes.c_double()
            self._ask("GetIntervalDecimal", clock, decimal, qualifier)
            known = qualifier.value != Qualifier.NOT_YET_KNOWN
            seconds = Fraction(repr(decimal.value)) if known else Fraction(0)
        return seconds, Qualifier(qualifier.value)

    def shift(self, name: str) -> Fraction:
        """Return when a clock ticks first, in seconds after the start."""
        clock = self._clocks[name]
        if clock.supports_fraction:
            counter, resolution = ctypes.c_uint64(), ctypes.c_uint64(1)
            self._ask("GetShiftFraction", clock, counter, resolution)
            return Fraction(counter.value, resolution.value or 1)
        decimal = ctypes.c_double()
        self._ask("GetShiftDecimal", clock, decimal)
        return Fraction(repr(decimal.value))

    def _ask(self, function: str, clock: FmuClock, *answers: Any) -> None:
        reference = ctypes.c_uint32(clock.reference)
        self._call(function, ctypes.byref(reference), 1, *(ctypes.byref(a) for a in answers))
