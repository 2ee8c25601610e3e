"""When a time-based clock ticks next: counted in exact fractions, so without drift. FMI 3.0, sec. 2.2.9.2."""

from fractions import Fraction

from handover.cosim.events.clock_calls import ClockCalls, Qualifier
from handover.cosim.events.fmu_clock import FmuClock


class ClockTimer:
    """The times of a time-based input clock.

    Periodic clocks (constant, fixed, tunable) tick at shift + k * interval; the interval is the description's, or else
    what the unit tells while it is initialised (the parameters that it may depend on do not change in a run). A
    changing clock tells the interval to its next tick whenever it has ticked, a countdown clock in any event mode.

    Attributes:
        next: the time of the next tick, s; None while a countdown has not begun.
    """

    def __init__(self, clock: FmuClock, calls: ClockCalls) -> None:
        """Ask for what the description leaves open, in initialisation mode."""
        self.clock = clock
        self._calls = calls
        self.next: Fraction | None = None
        if clock.variability in ("changing", "countdown"):
            self._count_from(Fraction(0))
            return
        self.next, self._interval = clock.shift, clock.interval
        if clock.interval is None:
            self._interval, _ = calls.interval(clock.name)
            self.next = calls.shift(clock.name)
        if not self._interval:
            raise ValueError(f"its clock {clock.name!r} ticks every {self._interval} s")

    def is_due(self, t: float) -> bool:
        """Whether it ticks at t."""
        return self.next is not None and float(self.next) <= t

    def tick(self) -> None:
        """Take note of a tick, after the unit has updated its discrete states in event mode."""
        if self.clock.variability == "countdown" or self.next is None:
            self.next = None
        elif self.clock.variability == "changing":
            ticked, self.next = self.next, None
            self._count_from(ticked)
        elif self._interval:
            self.next += self._interval

    def ask(self, t: float) -> None:
        """Ask a countdown for its interval, in event mode at t."""
        if self.clock.variability == "countdown":
            self._count_from(Fraction(t))

    def _count_from(self, begin: Fraction) -> None:
        interval, qualifier = self._calls.interval(self.clock.name)
        if qualifier is Qualifier.CHANGED or (self.next is None and qualifier is Qualifier.UNCHANGED):
            self.next = begin + interval
