"""How much of a commanded motion the arm makes: where tendons are slack, a part of it."""

import math
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats


class Response:
    """Compares the gripper's motion with the commanded one, J dq, both summed with a memory that fades.

    Args:
        memory: seconds in which the sums fade to 1/e.
        delay: seconds by which the arm's motion trails the command.
        least: the part below which it does not go.
    """

    def __init__(self, memory: float, delay: float, least: float) -> None:
        self._memory, self._delay, self._least = memory, delay, least
        self._commanded: Floats = np.zeros(3)
        self._made: Floats = np.zeros(3)
        self._due: Floats = np.zeros(3)
        self._p_WG: Floats | None = None
        self._t = 0.0  # of that position
        self.part = 1.0
        """Part of the commanded motion that is made, along its direction: from `least` to 1."""

    def command(self, motion: Floats) -> None:
        """Note a commanded motion of the gripper, shape (3,), m."""
        self._due = self._due + motion

    def observe(self, p_WG: Floats, t: float) -> None:
        """Note where the gripper is, shape (3,), m, at a time, s, later than the last one."""
        dt = math.inf if self._p_WG is None else t - self._t
        self._t = t
        fade = math.exp(-dt / self._memory)
        come = self._due * (1.0 - math.exp(-dt / self._delay))
        self._due = self._due - come
        self._commanded = fade * self._commanded + come
        if self._p_WG is not None:
            self._made = fade * self._made + (p_WG - self._p_WG)
        self._p_WG = np.array(p_WG)
        square = float(self._commanded @ self._commanded)
        if square > _LEAST_MOTION**2:
            self.part = min(max(float(self._made @ self._commanded) / square, self._least), 1.0)

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state."""
        return self._commanded, self._made, self._due, self._p_WG, self._t, self.part

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        self._commanded, self._made, self._due, self._p_WG, self._t, self.part = state


_LEAST_MOTION = 0.0015
"""Commanded motion, m, from which on the part is measured: shorter ones drown in the ball's tremor and the noise."""
