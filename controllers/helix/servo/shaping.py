"""Smooth commands for an arm that swings: the average over the last swing."""

from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats


class Shaper:
    """Averages the command over a time. What is as long as a swing of the arm excites none: its spectrum is zero there.

    Between two calls the command is taken to stay as it was.

    Args:
        duration: s; 0: no average.
        q: the command before, shape (9,).

    Attributes:
        q: the averaged command, shape (9,).
    """

    def __init__(self, duration: float, q: Floats) -> None:
        self._duration = duration
        self._given: list[tuple[float, Floats]] = [(-np.inf, q)]
        self.q: Floats = q

    def advance(self, t: float, q: Floats) -> None:
        """Take the command that is in force from t on, s, and average up to t."""
        if self._duration == 0.0:
            self.q = q
            return
        begin = t - self._duration
        given = self._given
        while len(given) > 1 and given[1][0] <= begin:
            given = given[1:]
        ends = [max(begin, at) for at, _ in given[1:]] + [t]
        starts = [begin, *ends[:-1]]
        parts = [(end - start) * value for start, end, (_, value) in zip(starts, ends, given, strict=True)]
        self.q = np.sum(parts, axis=0) / self._duration
        self._given = given if np.array_equal(q, given[-1][1]) else [*given, (t, q)]

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state."""
        return self._given, self.q

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        self._given, self.q = state
