"""A person who leads the arm to the ball by its gripper. [Vervloet2025] sec. 3.5.2, fig. 11."""

from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Floats

_OVER, _HIGHEST = 0.03, 0.08
"""How far beside the ball the gripper is led down, and how much higher it is led from farther away, m (assumed)."""
_CLEAR, _ASIDE = 0.04, 0.1
"""How high over its middle open fingers pass the ball, and where beside it they are lifted that high, m (assumed)."""


@dataclass(frozen=True)
class GuidanceGains:
    """How a person leads; all assumed.

    Attributes:
        stiffness: k, N/m; 0: there is no guidance.
        damping: c, N s/m.
        force_max: largest force, N.
        height: of the gripper's goal over the ball's middle, m.
        speed: with which the person leads, m/s.
    """

    stiffness: float
    damping: float
    force_max: float
    height: float
    speed: float


class Guidance:
    """Leads the gripper over the ball, and holds it there while the arm comes after.

    f_G = k e - c v_WG, cut at the largest force. e leads from the gripper to the point to which the person leads it at
    the moment. That point sets out from the gripper and goes to a place above the ball with the speed of guidance. The
    place is `height` over the ball's middle, and as much higher as the gripper is farther beside it than 3 cm, by 8 cm
    at most; a gripper that is lower than 4 cm over the ball is lifted 10 cm beside it first: the fingers come from
    above and not through the ball.

    A spring that pushed sidewards until the gripper is there, or lifted with 15 N, tipped the gripper by 20 to 50
    degrees, and the thesis's error, which has the tilt in it, stayed above its threshold.

    The goal is the ball's top, not its middle. From the middle the thesis's error to its first goal, 5 cm above over
    wrist and gripper, is sqrt(2) 5 cm, so that it would not fall below the threshold of 5 cm until the arm's tendons
    have overcome the person; 2.5 cm above the ball, the errors to both of its goals are below.
    """

    def __init__(self, gains: GuidanceGains) -> None:
        self._gains = gains
        self._p_WG_led: Floats | None = None  # where the person leads the gripper to at the moment

    def force(self, p_WO: Floats, p_WG: Floats, v_WG: Floats, dt: float) -> Floats:
        """Return f_G, shape (3,), N, in W, that acts for the next dt.

        Args:
            p_WO: position of the ball, in W, m.
            p_WG: position of the gripper, in W, m.
            v_WG: its velocity, m/s.
            dt: step, s.
        """
        g = self._gains
        if g.stiffness == 0.0:
            return np.zeros(3)
        goal = self._goal(p_WO, p_WG)
        led = p_WG if self._p_WG_led is None else self._p_WG_led
        way = goal - led
        distance = float(np.linalg.norm(way))
        self._p_WG_led = goal if distance <= g.speed * dt else led + g.speed * dt / distance * way
        e = self._p_WG_led - p_WG
        f = g.stiffness * e - g.damping * v_WG
        size = float(np.linalg.norm(f))
        if size > g.force_max:
            return f * g.force_max / size
        return f

    def _goal(self, p_WO: Floats, p_WG: Floats) -> Floats:
        """Return where the gripper is to go: over the ball, or while it is low, up at a distance beside it."""
        aside = np.array([*(p_WG - p_WO)[:2], 0.0])
        beside = float(np.linalg.norm(aside))
        height = self._gains.height + min(max(0.0, beside - _OVER), _HIGHEST)
        is_low = beside > _OVER and p_WG[2] < p_WO[2] + _CLEAR
        return p_WO + np.array([0.0, 0.0, height]) + (_ASIDE / beside * aside if is_low else 0.0)

    def get_state(self) -> Floats | None:
        """Return the complete state."""
        return self._p_WG_led

    def set_state(self, state: Floats | None) -> None:
        """Restore what `get_state` gave."""
        self._p_WG_led = state
