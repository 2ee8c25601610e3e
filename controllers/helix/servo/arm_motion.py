"""How the arm follows a command: it swings, lags behind, and makes a part of it where tendons are slack.

`Shaper` smooths the command for an arm that swings, `FirstOrderLag` is how its motion trails the command, and
`Response` measures which part of the commanded motion it makes.
"""

import math
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats

_LEAST_MOTION = 0.0015
"""Commanded motion, m, from which on the part is measured: shorter ones drown in the ball's tremor and the noise."""


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


class FirstOrderLag:
    """What is to come arrives exponentially: of what is pending, 1 - exp(-dt / T) in a time dt.

    Args:
        size: of the vector that arrives.
        delay: T, s.

    Attributes:
        pending: what has not arrived, shape (size,); the complete state.
    """

    def __init__(self, size: int, delay: float) -> None:
        self._delay = delay
        self.pending: Floats = np.zeros(size)

    def add(self, more: Floats) -> None:
        """Let more be pending, shape (size,)."""
        self.pending = self.pending + more

    def advance(self, dt: float) -> Floats:
        """Let time pass, s; return what arrived, shape (size,)."""
        arrived = self.pending * (1.0 - math.exp(-dt / self._delay))
        self.pending = self.pending - arrived
        return arrived


class Response:
    """Compares the gripper's motion with the commanded one, J dq, both summed with a memory that fades.

    Args:
        memory: seconds in which the sums fade to 1/e.
        delay: seconds by which the arm's motion trails the command.
        least: the part below which it does not go.
    """

    def __init__(self, memory: float, delay: float, least: float) -> None:
        self._memory, self._least = memory, least
        self._commanded: Floats = np.zeros(3)
        self._made: Floats = np.zeros(3)
        self._lag = FirstOrderLag(3, delay)
        self._p_WG: Floats | None = None
        self._t = 0.0  # of that position
        self.part = 1.0
        """Part of the commanded motion that is made, along its direction: from `least` to 1."""

    def command(self, motion: Floats) -> None:
        """Note a commanded motion of the gripper, shape (3,), m."""
        self._lag.add(motion)

    def observe(self, p_WG: Floats, t: float) -> None:
        """Note where the gripper is, shape (3,), m, at a time, s, later than the last one."""
        dt = math.inf if self._p_WG is None else t - self._t
        self._t = t
        fade = math.exp(-dt / self._memory)
        self._commanded = fade * self._commanded + self._lag.advance(dt)
        if self._p_WG is not None:
            self._made = fade * self._made + (p_WG - self._p_WG)
        self._p_WG = np.array(p_WG)
        square = float(self._commanded @ self._commanded)
        if square > _LEAST_MOTION**2:
            self.part = min(max(float(self._made @ self._commanded) / square, self._least), 1.0)

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state."""
        return self._commanded, self._made, self._lag.pending, self._p_WG, self._t, self.part

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        self._commanded, self._made, self._lag.pending, self._p_WG, self._t, self.part = state
