"""What the visual servo does while it does not see ring or ball: back along its last commands, then a search."""

from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats

_LAST = 60
"""Commands that are kept."""
_SHARE = 0.35
"""Part of the way to a place of the search that one control period takes."""
_STAY = 4
"""Control periods that each place of the search is given."""
_SWAY = 0.35
"""Rotation of the last segment to either side in the search, rad."""


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
