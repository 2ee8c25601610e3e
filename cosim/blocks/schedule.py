"""Values over time that change in steps, as a text parameter gives them: `8:0.05 12:0`."""

import bisect
import math
from dataclasses import dataclass


class InvalidSchedule(ValueError):
    """A text that is not a schedule; `fault` says why."""

    def __init__(self, fault: str) -> None:
        super().__init__(fault)
        self.fault = fault


@dataclass(frozen=True)
class Schedule:
    """What a value is from some times on; before the first one there is none.

    Attributes:
        times: in s, ascending.
        values: what holds from each of them, as many numbers each.
    """

    times: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]

    @classmethod
    def parse(cls, text: str, sizes: tuple[int, ...], minimum: float, maximum: float) -> "Schedule":
        """Return the schedule of a text `TIME:VALUE TIME:VALUE ...`, a value with commas where it is several numbers.

        Args:
            text: may be empty.
            sizes: how many numbers a value may have.
            minimum: the least that a number may be.
            maximum: the most.

        Raises:
            InvalidSchedule: the text has another form, times do not ascend from 0, or numbers are out of range.
        """
        times: list[float] = []
        values: list[tuple[float, ...]] = []
        for entry in text.split():
            time, colon, numbers = entry.partition(":")
            try:
                t, value = float(time), tuple(float(number) for number in numbers.split(","))
            except ValueError:
                colon = ""
                t, value = math.nan, ()
            if not colon or len(value) not in sizes:
                form = "TIME:VALUE" if sizes == (1,) else "TIME:VALUE or TIME:VALUE,VALUE"
                raise InvalidSchedule(f"{entry!r} is not of the form {form}, with a space between two such entries")
            if not 0.0 <= t < math.inf or (times and t <= times[-1]):
                raise InvalidSchedule(f"{entry!r}: times ascend from 0 s, each later than the one before")
            if not all(minimum <= number <= maximum for number in value):
                raise InvalidSchedule(f"{entry!r}: values are from {minimum:g} to {maximum:g}")
            times.append(t)
            values.append(value)
        return cls(tuple(times), tuple(values))

    def at(self, t: float) -> tuple[float, ...] | None:
        """Return what holds at t, s, to rounding of times; None before the first time."""
        i = bisect.bisect_right(self.times, t + 1e-9)
        return self.values[i - 1] if i else None
