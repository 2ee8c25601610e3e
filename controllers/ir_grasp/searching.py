"""A search across, row by row, for an object that no finger sees at the pre-grasp pose."""

import math

import numpy as np

from handover.controllers.ir_grasp.moves import X
from handover.controllers.ir_grasp.parameters import Params

_ELLIPSE = 1.25  # half axis ahead of the searched ellipse, in `search_ahead` (assumed)


class Search:
    """A zig-zag about the pre-grasp pose: a step back, then rows across, each farther ahead, then a guess.

    The fingers look inwards: an object beside the hand is not seen, and an open hand that goes ahead pushes it. So the
    rows begin a step behind, where the fingers pass before what was moved to the side. Together they fill half an
    ellipse before the pre-grasp pose, of half axes `search_width` and 1.25 `search_ahead`, cut off at `search_ahead`.
    If nothing was seen, the hand goes where the object would be had it not been moved (`search_guess` ahead). It goes
    farther to the right: the two fingers on the left look farther ahead than the thumb, and see what the hand has
    passed.
    """

    def __init__(self, params: Params) -> None:
        self._params = p = params
        self._low = np.append(p.p_WH_pregrasp, p.yaw_pregrasp) - p.fast_reach
        self._high = np.append(p.p_WH_pregrasp, p.yaw_pregrasp) + p.fast_reach
        self._ends = [(-p.search_back, 0.0)]
        side, ahead = 1.0, -p.search_back
        while ahead <= p.search_ahead:
            share = math.sqrt(max(0.0, 1.0 - (max(ahead, 0.0) / (_ELLIPSE * p.search_ahead)) ** 2))
            left, right = float(p.search_width[0]), -float(p.search_width[1])
            ends = [(ahead, share * left), (ahead, share * right)]
            self._ends += ends if side > 0.0 else ends[::-1]
            side, ahead = -side, ahead + p.search_row
        self._ends.append((p.search_guess, 0.0))
        self._next = 0

    @property
    def over(self) -> bool:
        """Whether the last row has been searched."""
        return self._next == len(self._ends)

    def advance(self, command: X, dt: float) -> X:
        """Return the command after dt at the search's speed."""
        p = self._params
        c, s = math.cos(p.yaw_pregrasp), math.sin(p.yaw_pregrasp)
        x, y, way = command[0], command[1], p.search_speed * dt
        while way > 0.0 and not self.over:
            ahead, left = self._ends[self._next]
            corner_x = float(p.p_WH_pregrasp[0]) + c * ahead - s * left
            corner_y = float(p.p_WH_pregrasp[1]) + s * ahead + c * left
            goal_x, goal_y = np.clip([corner_x, corner_y], self._low[:2], self._high[:2]).tolist()
            away = math.hypot(goal_x - x, goal_y - y)
            if away <= way:
                x, y, way, self._next = goal_x, goal_y, way - away, self._next + 1
            else:
                x, y, way = x + way * (goal_x - x) / away, y + way * (goal_y - y) / away, 0.0
        return (*np.clip([x, y, command[2]], self._low, self._high).tolist(), command[3])

    def get_state(self) -> int:
        """Return which corner comes next."""
        return self._next

    def set_state(self, state: int) -> None:
        """Restore a state that `get_state` gave."""
        self._next = state
