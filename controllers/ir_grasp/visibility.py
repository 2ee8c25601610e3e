"""Which fingers see the object, and where to move so that all do. [Luberto] sec. V-C, fig. 9."""

import enum
import math
from typing import NamedTuple


class Visibility(enum.IntEnum):
    """The fingers whose sensor has the object in its range; a sum of THUMB = 1, INDEX = 2 and RING = 4."""

    NONE = 0
    THUMB = 1
    INDEX = 2
    THUMB_INDEX = 3
    RING = 4
    THUMB_RING = 5
    INDEX_RING = 6
    ALL_SEEN = 7


class Action(enum.IntEnum):
    """Motions that bring sensors to see the object: four linear ones, in the hand's axes, and closing."""

    FORWARD = 0
    BACK = 1
    TO_THUMB = 2
    TO_FINGERS = 3
    CLOSE = 4


RECOVERY = {
    Visibility.NONE: Action.FORWARD,
    Visibility.THUMB: Action.TO_THUMB,
    Visibility.INDEX: Action.FORWARD,
    Visibility.RING: Action.BACK,
    Visibility.INDEX_RING: Action.TO_FINGERS,
    Visibility.THUMB_INDEX: Action.FORWARD,
    Visibility.THUMB_RING: Action.CLOSE,
}
"""The action of each of the seven cases. The text does not describe the figure's arrows; these actions follow from
the planar hand (assumed). If one side alone sees the object, it is on that side, and the hand moves there. The index
reaches farthest ahead: what it sees and the ring does not is too far, what the ring alone sees is too near. What only
the index misses, it will see as the hand closes."""

SECOND = {
    Visibility.NONE: Action.FORWARD,
    Visibility.THUMB: Action.FORWARD,
    Visibility.INDEX: Action.TO_FINGERS,
    Visibility.RING: Action.TO_FINGERS,
    Visibility.INDEX_RING: Action.FORWARD,
    Visibility.THUMB_INDEX: Action.CLOSE,
    Visibility.THUMB_RING: Action.FORWARD,
}
"""The action that replaces the first where that would undo the last motion, or the hand may not close more
(assumed). Sides that see in turn have the object between them, but too far; a finger that sees too much and too little
in turn has it on its side."""

_OPPOSITE = {
    Action.FORWARD: Action.BACK,
    Action.BACK: Action.FORWARD,
    Action.TO_THUMB: Action.TO_FINGERS,
    Action.TO_FINGERS: Action.TO_THUMB,
}
_AXIS = {
    Action.FORWARD: "along",
    Action.BACK: "along",
    Action.TO_THUMB: "across",
    Action.TO_FINGERS: "across",
    Action.CLOSE: "closing",
}


class Motion(NamedTuple):
    """An action and its size: m, for CLOSE the change of sigma."""

    action: Action
    size: float


class Recovery:
    """Chooses recovering motions and breaks cycles, which the cases alone run into (left, left, right, right).

    A motion opposite to the last one along its axis is not made: the step along that axis is halved, down to a least
    one, for both directions, and the case's second action is taken. So the hand does not oscillate
    for ever: it closes, or goes forward as far as its reach.

    Args:
        step: first step of the linear motions, m.
        closing: step of sigma.
        least: smallest linear step, m.
    """

    def __init__(self, step: float, closing: float, least: float) -> None:
        self._step, self._closing, self._least = step, closing, least
        self._sizes = {"along": step, "across": step}
        self._last: dict[str, int] = {}

    def motion(self, case: Visibility, *, may_close: bool) -> Motion:
        """Return the next motion for a case other than ALL_SEEN; `may_close` says whether sigma has room to grow."""
        action = RECOVERY[case]
        axis = _AXIS[action]
        if action in _OPPOSITE and self._last.get(axis) == _OPPOSITE[action]:
            self._sizes[axis] = max(self._sizes[axis] / 2.0, self._least)
            self._last[axis] = int(action)
            action = SECOND[case]
        if action is Action.CLOSE and not may_close:
            action = Action.FORWARD
        self._last[_AXIS[action]] = int(action)
        if action is Action.CLOSE:
            return Motion(action, self._closing)
        # Halved steps are for an object in sight; the approach to one that is not takes whole steps.
        nearing = action is Action.FORWARD and (case is Visibility.NONE or RECOVERY[case] is not action)
        return Motion(action, self._step if nearing else self._sizes[_AXIS[action]])

    def get_state(self) -> tuple[dict[str, float], dict[str, int]]:
        """Return steps and last actions."""
        return dict(self._sizes), dict(self._last)

    def set_state(self, state: tuple[dict[str, float], dict[str, int]]) -> None:
        """Restore a state that `get_state` gave."""
        sizes, last = state
        self._sizes, self._last = dict(sizes), dict(last)


def displaced(x: tuple[float, ...], motion: Motion) -> tuple[float, ...]:
    """Return x = [p_x, p_y, yaw, sigma] after a motion: linear ones in the hand's axes, the thumb's side at -y."""
    p_x, p_y, yaw, sigma = x
    if motion.action is Action.CLOSE:
        return (p_x, p_y, yaw, sigma + motion.size)
    forward, left = {
        Action.FORWARD: (1.0, 0.0),
        Action.BACK: (-1.0, 0.0),
        Action.TO_THUMB: (0.0, -1.0),
        Action.TO_FINGERS: (0.0, 1.0),
    }[motion.action]
    c, s = math.cos(yaw), math.sin(yaw)
    return (p_x + motion.size * (c * forward - s * left), p_y + motion.size * (s * forward + c * left), yaw, sigma)
