"""The way of the open gripper to a ball that lies in a hand: up beside it, over it, and down."""

import math

import numpy as np

from handover.cosim.blocks.ports import Floats

_ALONGSIDE = 0.03
"""How far beside the ball's middle, m, the open fingers pass the ball from above without a touch, and no farther."""
_CENTRED = 0.01
"""How far beside the ball's middle the gripper may be and come straight down, m."""
_CLEAR = 0.04
"""How high over the ball's middle the open gripper is clear of ball and hand, m."""
_FUNNEL = 4.0
"""How much higher the gripper is to be for each metre that it is farther beside than that."""


def next_place(p_WG: Floats, p_WO: Floats, p_WG_goal: Floats, standoff: float) -> Floats:
    """Return where the gripper is to go next on its way to a goal over the ball or at it, in W, shape (3,), m.

    The straight way from below leads the fingers through ball and hand. A gripper that is lower than 4 cm over the ball
    and farther beside it than 3 cm is therefore sent up first, at `standoff` from the ball, on the side where it is.
    One that is over the ball comes down in a funnel: 4 m higher for each metre beyond 1 cm beside its middle, as
    high as 4 cm.

    Args:
        p_WG: position of the gripper, in W, m.
        p_WO: position of the ball, in W, m.
        p_WG_goal: the goal, in W, m.
        standoff: distance beside the ball at which the gripper goes up, m; 0: the goal is the next place.
    """
    if standoff == 0.0:
        return p_WG_goal
    aside = np.array([*(p_WG - p_WO)[:2], 0.0])
    beside = math.sqrt(aside @ aside)
    height = min(max(0.0, _FUNNEL * (beside - _CENTRED)), _CLEAR)
    over = p_WG_goal + np.array([0.0, 0.0, max(0.0, p_WO[2] + height - p_WG_goal[2])])
    if beside <= _ALONGSIDE or p_WG[2] >= p_WO[2] + _CLEAR:
        return over
    return np.array([*(p_WO + standoff / beside * aside)[:2], over[2] + _CENTRED])
