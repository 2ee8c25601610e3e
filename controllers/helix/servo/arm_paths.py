"""The arm's ways that are not straight: over the ball, and back to where it was seen.

`next_place` leads the open gripper to a ball that lies in a hand: up beside it, over it, and down. `Recovery` leads the
arm back along its last commands, and on to a search, while ring or ball are not seen.
"""

import math
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats

_CENTRED = 0.018
"""How far beside the ball's middle open fingers come down without a touch, m: where they pass it they are 4.6 cm from
their axis, and its radius is 2.5 cm."""
_FUNNEL = 3.0
"""How much higher, m, the gripper is led for each metre that it is farther beside than _CENTRED (own choice)."""
_LOW, _BESIDE = 0.03, 0.03
"""Height over the ball's middle, m, below which a gripper that is farther beside than this goes around the ball: its
fingers are lower than the ball's top."""
_LOW_FUNNEL = 2.0
"""How much that height grows for each metre beside; the funnel lies above it, so the gripper does not turn back (own
choice)."""
_TILTED = 0.2
"""How much higher, m, a gripper stays over the ball for each rad that it is tilted too much (own choice)."""
_LAST = 60
"""Commands that are kept."""
_SHARE = 0.35
"""Part of the way to a place of the search that one control period takes."""
_STAY = 4
"""Control periods that each place of the search is given."""
_SWAY = 0.35
"""Rotation of the last segment to either side in the search, rad."""


def next_place(p_WG: Floats, p_WO: Floats, p_WG_goal: Floats, *, standoff: float, over: float, excess: float) -> Floats:
    """Return where the gripper is to go next on its way to a goal over the ball or at it, in W, shape (3,), m.

    The straight way from below leads the fingers through ball and hand. A gripper that is lower than the ball's top
    and beside it is therefore sent up first, at `standoff` from the ball, on the side where it is. One that is higher
    comes over the ball and down in a funnel: farther beside than 1.8 cm, 3 m higher for each metre, up to `over`.
    One that is tilted too much to close stays above until it is not: the fingers on its lower side would press on the
    ball.

    Args:
        p_WG: position of the gripper, in W, m.
        p_WO: position of the ball, in W, m.
        p_WG_goal: the goal, in W, m.
        standoff: distance beside the ball at which the gripper goes up, m; 0: the goal is the next place.
        over: height over the ball's middle at which the gripper passes over it, m; open fingers end 0.8 cm lower.
        excess: by how much the gripper is tilted too much, rad.
    """
    if standoff == 0.0:
        return p_WG_goal
    aside = (p_WG - p_WO)[:2]
    beside, height = math.sqrt(aside @ aside), p_WG[2] - p_WO[2]
    least = p_WO[2] + min(max(_FUNNEL * (beside - _CENTRED), _TILTED * excess, 0.0), over)
    z = max(p_WG_goal[2], least)
    if height >= min(_LOW, _LOW_FUNNEL * (beside - _BESIDE)):
        return np.array([p_WG_goal[0], p_WG_goal[1], z])
    direction = aside / beside if beside > 0.0 else np.array([1.0, 0.0])
    return np.array([*(p_WO[:2] + standoff * direction), z])


class Recovery:
    """Commands that lead back to where ring and ball were seen, and on.

    First the commands of the last control periods are given again, latest first, two at a time so that it takes half as
    long. Then the arm goes to hang straight, as calibrated, where the ring faces the cameras, and sways the last
    segment to its sides, which uncovers a ball that the gripper hides.

    Args:
        q_calib: state of the hanging arm, shape (9,), rad and m.
    """

    def __init__(self, q_calib: Floats) -> None:
        self._q_calib = q_calib
        self._commands: list[Floats] = []
        self._searched = 0

    def keep(self, q_sys: Floats) -> None:
        """Keep a command that was given while the ring was seen."""
        self._commands = [*self._commands[1 - _LAST :], q_sys]
        self._searched = 0

    def next(self, q_sys: Floats) -> Floats:
        """Return the command after q_sys, both of shape (9,)."""
        if self._commands:
            self._commands, back = self._commands[:-2], self._commands[-2:][0]
            return back
        k = self._searched // _STAY
        self._searched += 1
        goal = np.array(self._q_calib)
        goal[6:8] += _SWAY * np.array([(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)][k % 5])
        return q_sys + _SHARE * (goal - q_sys)

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state."""
        return self._commands, self._searched

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        self._commands, self._searched = state
