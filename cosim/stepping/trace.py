"""An output at its last two communication points."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Moments = tuple[int, NDArray[np.float64], int, NDArray[np.float64]]
"""Tick and values before, tick and values last; the arrays are not written to again."""


class Trace:
    """The line through an output's last two points; level while there is one point only.

    `values` is where the output's values live.
    """

    def __init__(self, values: NDArray[Any]) -> None:
        self._values = values
        here = np.array(values, dtype=np.float64)
        self.moments: Moments = (0, here, 0, here)

    @property
    def last(self) -> NDArray[np.float64]:
        """The values of the last point."""
        return self.moments[3]

    def record(self, tick: int) -> None:
        """Take the values as those of a tick: of the last one once more, or of a later one."""
        before, was, last, is_ = self.moments
        here = np.array(self._values, dtype=np.float64)
        self.moments = (last, is_, tick, here) if tick > last else (before, was, last, here)

    def at(self, half_ticks: int) -> NDArray[np.float64]:
        """Return the values on the line, at a time in half ticks: exact up to the rounding of the last operations."""
        before, was, last, is_ = self.moments
        if last == before:
            return is_
        return is_ + (is_ - was) * ((half_ticks - 2 * last) / (2 * (last - before)))

    def rate(self, tick: float) -> NDArray[np.float64]:
        """Return the line's slope per second; `tick` is in seconds."""
        before, was, last, is_ = self.moments
        return (is_ - was) / ((last - before) * tick) if last > before else np.zeros_like(is_)

    def get_state(self) -> list[Any]:
        """Return the two points as JSON can hold them."""
        before, was, last, is_ = self.moments
        return [before, was.tolist(), last, is_.tolist()]

    def set_state(self, state: list[Any]) -> None:
        """Go back to what `get_state` gave."""
        before, was, last, is_ = state
        self.moments = (before, np.array(was, dtype=np.float64), last, np.array(is_, dtype=np.float64))
