"""Whether the arm still comes nearer to its goal, and how much its tilt weighs meanwhile."""

import math
from typing import Any

from handover.controllers.helix.servo.servo_parameters import Params
from handover.cosim.blocks.ports import Floats

_REGAIN, _FADE, _RISE, _LEAST = 1.05, 0.85, 1.5, 0.05
"""Factors of the tilt's share for a control step with progress, one without, and one for the tilt; its least value."""


class Progress:
    """Counts control steps and what they gain. A ball that has moved by `threshold` restarts the count.

    The less the position gains, the less the tilt weighs, so that a tilt which cannot be reached keeps the gripper from
    no ball; one that keeps the gripper above the ball weighs more.
    """

    def __init__(self, params: Params, p_WO: Floats) -> None:
        self._params = params
        self.tilt_share = 1.0
        """Part of its weight that the tilt has, up to 1."""
        self._steps = 0
        self.restart(p_WO)

    def restart(self, p_WO: Floats) -> None:
        """Begin anew, for another goal or a ball that has moved to p_WO, shape (3,), m."""
        self._stalled, self._best, self._p_WO = 0, math.inf, p_WO

    def goes_on(self, error: float, p_WO: Floats, levels: bool) -> bool:
        """Count a control step after which the error is this, m; return whether the arm is to go on.

        Args:
            error: of position, m.
            p_WO: position of the ball, shape (3,), m.
            levels: whether the gripper stays where it is until it is less tilted.
        """
        p, moved = self._params, p_WO - self._p_WO
        if math.sqrt(moved @ moved) > p.threshold:
            self.restart(p_WO)
        self._steps += 1
        self._stalled += 1
        gains = error < self._best - p.progress
        factor = _RISE if levels else _REGAIN if gains or error < p.threshold_grasp else _FADE
        self.tilt_share = min(max(self.tilt_share * factor, _LEAST), 1.0)
        if gains:
            self._stalled, self._best, self._p_WO = 0, error, p_WO
        return self._stalled < p.patience and self._steps <= p.max_steps

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state."""
        return self.tilt_share, self._steps, self._stalled, self._best, self._p_WO

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        self.tilt_share, self._steps, self._stalled, self._best, self._p_WO = state
