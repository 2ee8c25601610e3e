"""The task of the arm: to come to a ball, grip it, and carry it to a known place. [Vervloet2025] secs. 3.4 and 3.5.

`Task` decides which phase comes next, where the gripper is to be in it, and when the task is given up. Its parts are
`Delivery`, what is done with the ball, and `Progress`, whether the arm still comes nearer.
"""

import enum
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from handover.controllers.helix.servo.arm_paths import next_place
from handover.controllers.helix.servo.servo_parameters import Params
from handover.controllers.helix.servo.tracking import UP, Tracker
from handover.cosim.blocks.ports import Floats

SAME_TIME = 1e-9
"""Rounding of a time that a host adds up from steps, s."""
_TILT_MARGIN = 0.9
"""Part of threshold_tilt below which the gripper comes down onto the ball (own choice)."""
_REGAIN, _FADE, _RISE, _LEAST = 1.05, 0.85, 1.5, 0.05
"""Factors of the tilt's share for a control step with progress, one without, and one for the tilt; its least value."""


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
    """Where the gripper goes after HOLD, and when it opens there; with `delivers` false it stays in HOLD. Sec. 3.5.3.

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


class Task:
    """Phases, goals and the verdict, from where the tracker has ball, wrist and gripper; see `VisualServo`.

    Args:
        params: of the servo.
        tracker: says where ball, wrist and gripper are, and since when they are not seen.

    Attributes:
        phase: the present one.
        verdict: why the task was given up.
        progress: of the arm towards the goal of the phase.
    """

    def __init__(self, params: Params, tracker: Tracker) -> None:
        self._params, self._tracker = params, tracker
        self.phase, self.verdict = Phase.WAIT, Verdict.NONE
        self.progress = Progress(params, tracker.ball.position)
        self._delivery = Delivery(params)
        self._t_close = 0.0
        self._settled = 0
        self._searched = 0

    @property
    def p_WG_goal(self) -> Floats:
        """Where the gripper is to be in this phase, pointing down, in W, shape (3,), m."""
        if self._delivery.p_WG_goal is not None:
            return self._delivery.p_WG_goal
        above = self.phase in (Phase.WAIT, Phase.APPROACH)
        return self._tracker.ball.position + (self._params.d_grasp_offset * UP if above else 0.0)

    @property
    def p_WG_next(self) -> Floats:
        """Where the gripper goes on its way to that goal, in W, shape (3,), m."""
        if self._delivery.p_WG_goal is not None or self.phase is Phase.GRASP:
            return self.p_WG_goal
        p, tracker = self._params, self._tracker
        return next_place(
            tracker.p_WG,
            tracker.ball.position,
            self.p_WG_goal,
            standoff=p.standoff,
            over=p.d_grasp_offset,
            excess=self._excess,
        )

    @property
    def error(self) -> float:
        """Distance of the gripper from its goal, or with judge_apart false the norm over wrist and gripper, m."""
        e_G = self.p_WG_goal - self._tracker.p_WG
        if self._params.judge_apart:
            return math.sqrt(e_G @ e_G)
        e_R = self.p_WG_goal + self._params.d_gripper * UP - self._tracker.wrist.position
        e = np.concatenate([e_R, e_G])
        return math.sqrt(e @ e)

    @property
    def tilt(self) -> float:
        """Angle of the gripper from straight down, rad."""
        d = self._tracker.direction.position
        return math.atan2(math.hypot(d[0], d[1]), -d[2])

    @property
    def closes(self) -> bool:
        """Whether the gripper is to be closed."""
        return self.phase in (Phase.GRASP, Phase.HOLD) or self._delivery.keeps_closed

    def moves(self, t: float) -> bool:
        """Return whether the arm moves towards its goal."""
        return self.phase in (Phase.APPROACH, Phase.DESCEND, Phase.CARRY) or self._follows(t)

    def decide(self, t: float, why_stuck: Callable[[], Verdict]) -> None:
        """Go to another phase, if that is due.

        Args:
            t: time, s.
            why_stuck: says why an arm that makes no progress is given up.
        """
        following = self._following(t)
        if following is not self.phase:
            self._enter(following)
        error, p = self.error, self._params
        may_close = self.phase is Phase.DESCEND and not (p.judge_apart and self.tilt > p.threshold_tilt)
        self._settled = self._settled + 1 if may_close and error < p.threshold_grasp else 0
        if self._settled >= p.settle_steps:
            self._close(t)
        elif self.phase in (Phase.APPROACH, Phase.DESCEND):
            if self._lost():
                self._enter(Phase.RECOVER)
            elif not self._goes_on(error):
                if may_close and error < p.threshold_accept:
                    self._close(t)
                else:
                    self._give_up(why_stuck())
        elif self.phase is Phase.CARRY and not self._goes_on(error):
            self._give_up(Verdict.LOST_RING if self._lost() is Verdict.LOST_RING else why_stuck())
        elif self.phase is Phase.RECOVER:
            self._searched += 1
            if self._searched > p.search_steps and (lost := self._lost()):
                self._give_up(lost)

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state, but for the tracker's."""
        counters = (self._t_close, self._settled, self._searched)
        return int(self.phase), int(self.verdict), counters, self._delivery.get_state(), self.progress.get_state()

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        phase, verdict, counters, delivery, progress = state
        self.phase, self.verdict = Phase(phase), Verdict(verdict)
        self._t_close, self._settled, self._searched = counters
        self._delivery.set_state(delivery)
        self.progress.set_state(progress)

    def _following(self, t: float) -> Phase:
        """Return the phase that comes after this one, before it is judged whether the gripper is to close."""
        p, error, ball, wrist = self._params, self.error, self._tracker.ball, self._tracker.wrist
        if self.phase is Phase.WAIT and ball.seen and wrist.seen:
            return Phase.APPROACH
        if self.phase is Phase.WAIT and ball.seen and 0.0 < p.lost_after <= t:  # it may hide the ring
            return Phase.RECOVER
        if self.phase is Phase.APPROACH and error < p.threshold:
            return Phase.DESCEND
        if self.phase is Phase.DESCEND and error > p.threshold_retreat:
            return Phase.APPROACH
        if self.phase is Phase.GRASP and t - self._t_close >= p.closing_time - SAME_TIME:
            return Phase.HOLD
        if (self._follows(t) and error > p.threshold_reopen) or (self.phase is Phase.RECOVER and not self._lost()):
            return Phase.APPROACH
        return self._delivery.following(self.phase, t - self._t_close, error, self.tilt)

    def _follows(self, t: float) -> bool:
        """Return whether the arm follows the ball although the gripper closes."""
        p = self._params
        return self.phase is Phase.GRASP and t - self._t_close < p.follow_until * p.closing_time - SAME_TIME

    def _goes_on(self, error: float) -> bool:
        """Return whether the arm still makes progress."""
        levels = self.phase is Phase.DESCEND and self._params.standoff > 0.0 and self._excess > 0.0
        return self.progress.goes_on(error, self._tracker.ball.position, levels)

    @property
    def _excess(self) -> float:
        """By how much the gripper is tilted too much to come down onto the ball, rad."""
        return self.tilt - _TILT_MARGIN * self._params.threshold_tilt

    def _lost(self) -> Verdict:
        """Return whether ring or ball are lost, by the verdict for it, else NONE."""
        lost_after = self._params.lost_after
        if lost_after == 0.0:
            return Verdict.NONE
        if self._tracker.unseen_R >= lost_after:
            return Verdict.LOST_RING
        return Verdict.LOST_BALL if self._tracker.unseen_O >= lost_after else Verdict.NONE

    def _close(self, t: float) -> None:
        self._t_close = t
        self._enter(Phase.GRASP)

    def _enter(self, phase: Phase) -> None:
        self.phase, self._searched = phase, 0
        self.progress.restart(self._tracker.ball.position)

    def _give_up(self, verdict: Verdict) -> None:
        self.verdict = verdict
        self._enter(Phase.GIVEN_UP)
