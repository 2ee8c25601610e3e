"""What the hand does in a grasp, and why its refinement ended."""

import enum

from handover.controllers.ir_grasp.descent import Verdict
from handover.controllers.ir_grasp.following import Mode, Termination


class Phase(enum.IntEnum):
    """What the hand is doing; CHECK to STEP are the steps 3 to 9 of algorithm 1, SEARCH and TRACK are on the move."""

    REACH = 0
    CHECK = 1
    APPROACH = 2
    RECOVER = 3
    PROBE = 4
    STEP = 5
    CLOSE = 6
    PULL = 7
    SHAKE = 8
    DONE = 9
    SEARCH = 10
    TRACK = 11


class Stop(enum.IntEnum):
    """Why the refinement ended.

    The cost is small, steps, recoveries or way are used up, there is no progress, no finger sees the object, the limit
    of the wrist's reach is in the way of the next move (REACH), or the strategy has no refinement. Of the correction on
    the move: ways across change nothing of what is seen while a finger touches the object, which so goes along (PUSHED;
    also where no joint is measured); the object is deep between two fingers that are equally far from it, or presses a
    finger outwards there (CONTACT). Of the strategy CONTACT: it felt the object between the fingers, or its way ahead
    was at its end before (REACH).
    """

    RUNNING = 0
    THRESHOLD = 1
    PATIENCE = 2
    STALLED = 3
    OUT_OF_SIGHT = 4
    BLIND = 5
    FORWARD = 6
    PUSHED = 7
    CONTACT = 8
    CENTRED = 9
    REACH = 10


STOPS = {Verdict.REACHED: Stop.THRESHOLD, Verdict.STALLED: Stop.STALLED, Verdict.USED_UP: Stop.PATIENCE}
TERMINATIONS = {
    Termination.REACHED: Stop.THRESHOLD,
    Termination.SETTLED: Stop.STALLED,
    Termination.LOST: Stop.OUT_OF_SIGHT,
    Termination.USED_UP: Stop.PATIENCE,
    Termination.REACH: Stop.REACH,
    Termination.PUSHED: Stop.PUSHED,
    Termination.CENTRED: Stop.CENTRED,
    Termination.CONTACT: Stop.CONTACT,
}
PHASES = {Mode.SEARCH: Phase.SEARCH, Mode.ONE_SIDED: Phase.RECOVER, Mode.TRACK: Phase.TRACK}
