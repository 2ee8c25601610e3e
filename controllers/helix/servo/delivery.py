"""What the arm does with a ball that it has taken: carry it to a known place, and open. [Vervloet2025] sec. 3.5.3.

Besides, the phases of the whole task and the reasons for which it is given up, which the visual servo shares.
"""

import enum
from typing import Any

from handover.controllers.helix.servo.servo_parameters import Params
from handover.cosim.blocks.ports import Floats

SAME_TIME = 1e-9
"""Rounding of a time that a host adds up from steps, s."""


class Phase(enum.IntEnum):
    """What the arm is doing."""

    WAIT = 0
    APPROACH = 1
    DESCEND = 2
    GRASP = 3
    HOLD = 4
    GIVEN_UP = 5
    RECOVER = 6
    CARRY = 7
    DROP = 8


class Verdict(enum.IntEnum):
    """Why the arm has given up."""

    NONE = 0
    NO_PROGRESS = 1
    OUT_OF_REACH = 2
    LIMITS = 3
    LOST_RING = 4
    LOST_BALL = 5


class Delivery:
    """Where the gripper goes after HOLD, and when it opens there; with `delivers` false it stays in HOLD.

    - CARRY, `carry_after` after the gripper has closed: the goal is p_WG_drop, the gripper pointing down, with the same
      control law, step size and error as towards the ball. The thesis's place of the bowl is in its program, and no
      camera looks for it.
    - DROP, the last one: once the error has been below `threshold_drop` for `settle_steps` control steps, and the tilt
      below `threshold_tilt` where it is judged apart, the command is held and the gripper opens.

    Nothing tells it whether there is a ball in the gripper, as on the thesis's arm.
    """

    def __init__(self, params: Params) -> None:
        self._params = params
        self._settled = 0
        self._has_set_off = False
        self._has_opened = False

    @property
    def p_WG_goal(self) -> Floats | None:
        """Where the gripper goes, in W, shape (3,), m; None before CARRY."""
        return self._params.p_WG_drop if self._has_set_off else None

    @property
    def keeps_closed(self) -> bool:
        """Whether the gripper is to stay closed on its way, be it given up or not."""
        return self._has_set_off and not self._has_opened

    def following(self, phase: Phase, closing_for: float, error: float, tilt: float) -> Phase:
        """Return the phase that comes now, the same or the next one.

        Args:
            phase: the present one.
            closing_for: time since the gripper began to close, s.
            error: as the servo judges it, m.
            tilt: of the gripper from straight down, rad.
        """
        p = self._params
        if phase is Phase.HOLD and p.delivers and closing_for >= p.closing_time + p.carry_after - SAME_TIME:
            self._has_set_off = True
            return Phase.CARRY
        if phase is not Phase.CARRY:
            return phase
        is_there = error < p.threshold_drop and not (p.judge_apart and tilt > p.threshold_tilt)
        self._settled = self._settled + 1 if is_there else 0
        self._has_opened = self._settled >= p.settle_steps
        return Phase.DROP if self._has_opened else Phase.CARRY

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state."""
        return self._settled, self._has_set_off, self._has_opened

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        self._settled, self._has_set_off, self._has_opened = state
