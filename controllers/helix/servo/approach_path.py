"""The way of the open gripper to a ball that lies in a hand: up beside it, over it, and down."""

import math

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
