"""Visual servoing of the Helix arm to a ball that a hand offers. [Vervloet2025] sec. 3.4, algorithm 3."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from handover.controllers.helix.servo.approach_path import next_place
from handover.controllers.helix.servo.arm_motion import Response, Shaper
from handover.controllers.helix.servo.constant_curvature import W_FROM_B, forward_kinematics, linearise, tendon_lengths
from handover.controllers.helix.servo.delivery import SAME_TIME, Delivery, Phase, Verdict
from handover.controllers.helix.servo.estimation import optimise_state, weights_of_state
from handover.controllers.helix.servo.jacobian_control import Damping, Limits, blend, control_step, is_reachable
from handover.controllers.helix.servo.progress import Progress
from handover.controllers.helix.servo.recovery import Recovery
from handover.controllers.helix.servo.servo_parameters import InvalidServoParameters, Params
from handover.controllers.helix.servo.tracking import Tracker
from handover.cosim.blocks.ports import Floats, Matrix3, Vector3, Vector9, output, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Metre, Number, Radian, SquareMetre

__all__ = ["Inputs", "InvalidServoParameters", "Outputs", "Params", "Phase", "Verdict", "VisualServo"]

_UP = np.array([0.0, 0.0, 1.0])
_RESPONSE_MEMORY = 1.5  # s; one swing of the arm and a half (own choice)
_LARGEST_STEP, _HALF_STEP_ERROR = 0.8, 0.08  # of the way; m, at which a growing step is half of that (own choices)
_AT_LIMIT = 1e-6  # rad, m
_TILT_MARGIN = 0.9  # of threshold_tilt, below which the gripper comes down onto the ball (own choice)


@dataclass(kw_only=True)
class Inputs:
    """Measurements, in W; one that is not seen is ignored."""

    p_WO_meas: Vector3[Metre] = port(np.zeros(3), "measured position of the ball")
    p_WR_meas: Vector3[Metre] = port(np.zeros(3), "measured position of the wrist")
    p_WG_meas: Vector3[Metre] = port(np.zeros(3), "measured position of the gripper")
    cov_O: Matrix3[SquareMetre] = port(np.zeros((3, 3)), "covariance of p_WO_meas")
    cov_R: Matrix3[SquareMetre] = port(np.zeros((3, 3)), "covariance of p_WR_meas")
    cov_G: Matrix3[SquareMetre] = port(np.zeros((3, 3)), "covariance of p_WG_meas")
    seen_O: bool = port(False, "the ball is seen")
    seen_R: bool = port(False, "the marker ring is seen, and so wrist and gripper")


@dataclass(kw_only=True)
class Outputs:
    """Command, phase and estimates; rotations of q are in rad, lengths in m."""

    dl_t: Vector9[Metre] = output("tendon length change from calibration")
    closure: Number = output("gripper command: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    phase: Phase = output("what the arm is doing")
    q_est: Vector9[Number] = output("state that explains the measured pose: Dx, Dy (rad), l (m) of each segment")
    q_sys: Vector9[Number] = output(
        "state that is commanded, before it is averaged over shaping_time: Dx, Dy (rad), l (m) of each segment"
    )
    error: Metre = output(
        "distance of the gripper from its goal, or norm over wrist and gripper; of no meaning in WAIT"
    )
    tilt: Radian = output("angle of the gripper from straight down")
    verdict: Verdict = output("why the arm has given up")
    p_WO_est: Vector3[Metre] = output("filtered position of the ball")
    p_WR_est: Vector3[Metre] = output("filtered position of the wrist")
    p_WG_est: Vector3[Metre] = output("filtered position of the gripper")


class VisualServo:
    """Algorithm 3: filter, estimate the state (eq. 16), step towards the goal (algorithm 1), close when it is reached.

    The command is updated once in each control_period (give or take its jitter), at the beginning of a step; between,
    it is held, and with filter_pictures the measurements are filtered in each step. A longer step is one control
    period. The goal pose has the gripper pointing down, at the ball or (APPROACH) d_grasp_offset above it: X_goal =
    [p_WG_goal + d_gripper z, p_WG_goal]. The mount, B, is at the origin of W.

    The error is the distance of the gripper from its goal (judge_apart), or the norm |X_goal - X_meas| over all six
    coordinates, in m, where the source prints its square and compares it with metres.

    Own additions: see `Params`. The command is held while the ring is not seen, since there is no feedback. Without
    ring or ball for lost_after the phase is RECOVER: back along the last commands, then a search; a ball without a ring
    from the start leads there, too. An error above threshold_retreat in DESCEND (the ball was moved), or above
    threshold_reopen while the gripper closes, leads back to APPROACH. An error that makes no progress leads to
    GIVEN_UP, which does not close; `verdict` says why: OUT_OF_REACH if no state within the limits brings the model's
    gripper to its goal, else LIMITS if the command is at one or at windup, else NO_PROGRESS.

    With `delivers`, HOLD is followed by CARRY and DROP: see `Delivery`.

    Raises:
        InvalidServoParameters: values that contradict each other or are out of range; all faults are named.
        InvalidMeasurement: a measurement that is marked as seen is not finite.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        (
            *("dl_t", "closure", "phase", "q_est", "q_sys", "error", "tilt", "verdict"),
            *("p_WO_est", "p_WR_est", "p_WG_est"),
        ),
        ("p_WO_meas", "p_WR_meas", "p_WG_meas", "cov_O", "cov_R", "cov_G", "seen_O", "seen_R"),
    )
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        params.check()
        self.params = p = params
        self._limits = Limits(p.L_sys_LB, p.L_sys_UB)
        self._q_calib = np.array([0.0, 0.0, p.l_calib[0], 0.0, 0.0, p.l_calib[1], 0.0, 0.0, p.l_calib[2]])
        self._l_t_calib = np.repeat(p.l_calib, 3)
        self._q_sys: Floats = self._q_calib
        self._q_est: Floats = self._q_calib
        self._tracker = Tracker(p)
        self._recovery = Recovery(self._q_calib)
        self._response = Response(_RESPONSE_MEMORY, p.response_time, p.least_response)
        self._shaper = Shaper(p.shaping_time, self._q_calib)
        self._delivery = Delivery(p)
        self._rng = np.random.default_rng(p.seed)
        self._phase = Phase.WAIT
        self._verdict = Verdict.NONE
        self._t_next = -math.inf
        self._t_filtered = -math.inf
        self._t_close = 0.0
        self._settled = 0
        self._searched = 0
        self._progress = Progress(p, self._tracker.ball.position)

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command in force: no time passes, so nothing is filtered or decided."""
        return Outputs(
            dl_t=tendon_lengths(self._shaper.q, self.params.d) - self._l_t_calib,
            closure=1.0 if self._phase in (Phase.GRASP, Phase.HOLD) or self._delivery.keeps_closed else 0.0,
            phase=self._phase,
            q_est=np.array(self._q_est),
            q_sys=np.array(self._q_sys),
            error=self._error(),
            tilt=self._tilt(),
            verdict=self._verdict,
            p_WO_est=np.array(self._tracker.ball.position),
            p_WR_est=np.array(self._tracker.wrist.position),
            p_WG_est=self._tracker.p_WG,
        )

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Run the main loop of algorithm 3 once if a control period has passed since it ran."""
        due = t >= self._t_next - SAME_TIME
        if due or self.params.filter_pictures:
            self._filter(t, u)
        if not due:
            self._shape(t)
            return self.outputs(t + dt, u)
        period = self._draw_period()
        following = self._t_next + period
        self._t_next = following if following > t + SAME_TIME else t + period
        sees = self._sees_ring(u)
        if sees:
            self._estimate()
            self._response.observe(self._tracker.p_WG, t)
        self._decide(t)
        if self._phase is Phase.RECOVER:
            self._q_sys = self._recovery.next(self._q_sys)
        elif sees and (self._phase in (Phase.APPROACH, Phase.DESCEND, Phase.CARRY) or self._follows(t)):
            self._move()
        self._shape(t)
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return filters, states, phase and counters."""
        counters = (self._settled, self._searched)
        times = (self._t_next, self._t_filtered, self._t_close)
        believed = (
            self._tracker.get_state(),
            self._recovery.get_state(),
            self._response.get_state(),
            self._shaper.get_state(),
            self._delivery.get_state(),
            self._progress.get_state(),
            self._rng.bit_generator,
        )
        return pack_state((believed, self._q_sys, self._q_est, int(self._phase), int(self._verdict), times, counters))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        saved: Any = unpack_state(state)
        believed, self._q_sys, self._q_est, phase, verdict, times, counters = saved
        tracker, recovery, response, shaper, delivery, progress, drawn = believed
        self._tracker.set_state(tracker)
        self._recovery.set_state(recovery)
        self._response.set_state(response)
        self._shaper.set_state(shaper)
        self._delivery.set_state(delivery)
        self._progress.set_state(progress)
        self._rng.bit_generator.state = drawn
        self._phase, self._verdict = Phase(phase), Verdict(verdict)
        self._t_next, self._t_filtered, self._t_close = times
        self._settled, self._searched = counters

    def _draw_period(self) -> float:
        p = self.params
        return p.control_period * (1.0 + p.jitter * self._rng.uniform(-1.0, 1.0) if p.jitter > 0.0 else 1.0)

    def _filter(self, t: float, u: Inputs) -> None:
        elapsed = t - self._t_filtered
        self._tracker.advance(min(elapsed, self.params.control_period))
        self._t_filtered = t
        if u.seen_O:
            self._tracker.see_ball(u.p_WO_meas, u.cov_O)
        if u.seen_R:
            self._tracker.see_ring(u.p_WR_meas, u.p_WG_meas, u.cov_R, u.cov_G)

    def _sees_ring(self, u: Inputs) -> bool:
        """Return whether the wrist is known: from this picture, or from one since the last control step."""
        if not self.params.filter_pictures:
            return u.seen_R
        return self._tracker.unseen_R < self.params.control_period - SAME_TIME

    def _estimate(self) -> None:
        p = self.params
        A = weights_of_state(p.A_pose_upd, self._q_sys, p.l_calib, p.weight_fall)
        bound = self._tracker.pose_deviation if p.bound_by_covariance else p.epsilon_pose_bound
        self._q_est = optimise_state(
            self._q_sys, self._X_meas(), self._q_est, A=A, bound=bound, d_gripper=p.d_gripper
        ).q_est

    def _decide(self, t: float) -> None:
        p, error, tracker = self.params, self._error(), self._tracker
        if self._phase is Phase.WAIT and tracker.ball.seen and tracker.wrist.seen:
            self._enter(Phase.APPROACH)
        elif self._phase is Phase.WAIT and tracker.ball.seen and 0.0 < p.lost_after <= t:  # it may hide the ring
            self._enter(Phase.RECOVER)
        elif self._phase is Phase.APPROACH and error < p.threshold:
            self._enter(Phase.DESCEND)
        elif self._phase is Phase.DESCEND and error > p.threshold_retreat:
            self._enter(Phase.APPROACH)
        elif self._phase is Phase.GRASP and t - self._t_close >= p.closing_time - SAME_TIME:
            self._enter(Phase.HOLD)
        elif (self._follows(t) and error > p.threshold_reopen) or (self._phase is Phase.RECOVER and not self._lost()):
            self._enter(Phase.APPROACH)
        else:
            self._deliver(t)
        error = self._error()
        near = self._phase is Phase.DESCEND and error < p.threshold_grasp
        near = near and not (p.judge_apart and self._tilt() > p.threshold_tilt)
        self._settled = self._settled + 1 if near else 0
        if self._settled >= p.settle_steps:
            self._t_close = t
            self._enter(Phase.GRASP)
        elif self._phase in (Phase.APPROACH, Phase.DESCEND):
            if self._lost():
                self._enter(Phase.RECOVER)
            elif not self._goes_on(error):
                self._give_up(self._why_stuck())
        elif self._phase is Phase.CARRY and not self._goes_on(error):
            self._give_up(Verdict.LOST_RING if self._lost() is Verdict.LOST_RING else self._why_stuck())
        elif self._phase is Phase.RECOVER:
            self._searched += 1
            if self._searched > p.search_steps and (lost := self._lost()):
                self._give_up(lost)

    def _goes_on(self, error: float) -> bool:
        """Return whether the arm still makes progress."""
        levels = self._phase is Phase.DESCEND and self.params.standoff > 0.0 and self._excess() > 0.0
        return self._progress.goes_on(error, self._tracker.ball.position, levels)

    def _excess(self) -> float:
        """Return by how much the gripper is tilted too much to come down onto the ball, rad."""
        return self._tilt() - _TILT_MARGIN * self.params.threshold_tilt

    def _deliver(self, t: float) -> None:
        following = self._delivery.following(self._phase, t - self._t_close, self._error(), self._tilt())
        if following is not self._phase:
            self._enter(following)

    def _lost(self) -> Verdict:
        """Return whether ring or ball are lost, by the verdict for it, else NONE."""
        lost_after = self.params.lost_after
        if lost_after == 0.0:
            return Verdict.NONE
        if self._tracker.unseen_R >= lost_after:
            return Verdict.LOST_RING
        return Verdict.LOST_BALL if self._tracker.unseen_O >= lost_after else Verdict.NONE

    def _why_stuck(self) -> Verdict:
        p, goal = self.params, self._X_goal()[3:]
        starts = (self._q_calib, self._q_sys, self._q_est)
        if not is_reachable(goal, starts, p.K_initialize, self._limits, p.d_gripper):
            return Verdict.OUT_OF_REACH
        d = np.hypot(self._q_sys[0::3], self._q_sys[1::3])
        q_DL = np.column_stack([d, self._q_sys[2::3]]).reshape(6)
        room = np.minimum(self._limits.UB - q_DL, np.where(self._limits.LB > 0.0, q_DL - self._limits.LB, math.inf))
        wound_up = p.windup > 0.0 and self._ahead(self._q_sys) > 0.95 * p.windup
        return Verdict.LIMITS if wound_up or room.min() < _AT_LIMIT else Verdict.NO_PROGRESS

    def _follows(self, t: float) -> bool:
        """Return whether the arm follows the ball although the gripper closes."""
        p = self.params
        return self._phase is Phase.GRASP and t - self._t_close < p.follow_until * p.closing_time - SAME_TIME

    def _move(self) -> None:
        p, error, X_meas = self.params, self._error(), self._X_meas()
        growing = _LARGEST_STEP * error / (error + _HALF_STEP_ERROR)
        alpha = min(_LARGEST_STEP, max(p.alpha, growing)) if p.adaptive_step else p.alpha
        alpha = min(alpha / self._response.part, max(alpha, _LARGEST_STEP))
        commanded = control_step(
            self._q_sys,
            self._q_est,
            blend(self._X_next(), X_meas, alpha, p.d_gripper),
            X_meas,
            K=p.K_initialize,
            limits=self._limits,
            epsilon_control=p.epsilon_control,
            N_max_iter=p.N_max_iter,
            d_gripper=p.d_gripper,
            damping=Damping(p.damping, p.tilt_weight * self._progress.tilt_share) if p.judge_apart else None,
            dq_0=self._towards_posture() if p.posture > 0.0 else None,
        )
        dq = self._without_windup(commanded.q_sys) - self._q_sys
        if p.lost_after > 0.0:
            self._recovery.keep(self._q_sys)
        self._q_sys = self._q_sys + dq

    def _shape(self, t: float) -> None:
        """Average the command, and expect the arm to move as the average does."""
        before = self._shaper.q
        self._shaper.advance(t, self._q_sys)
        if np.array_equal(before, self._shaper.q):
            return
        motion = self._motion(self._shaper.q - before)
        self._response.command(motion[3:])
        if self.params.predict_motion:
            moved = self._response.part * motion
            self._tracker.expect(np.concatenate([moved[:3], moved[3:] - moved[:3]]))

    def _motion(self, dq: Floats) -> Floats:
        """Return by how much a change of the state moves wrist and gripper in W, J dq, shape (6,), m."""
        return W_FROM_B * (linearise(self._q_est, self.params.d_gripper)[1] @ dq)

    def _towards_posture(self) -> Floats:
        """Return the change that shortens the segments, shape (9,)."""
        dq_0 = np.zeros(9)
        dq_0[2::3] = self.params.posture * (self.params.l_preferred - self._q_sys[2::3])
        return dq_0

    def _without_windup(self, q_sys: Floats) -> Floats:
        """Return the command, or as much of its change as does not take it farther from the arm than `windup`."""
        p = self.params
        if p.windup == 0.0:
            return q_sys
        allowed = max(p.windup, self._ahead(self._q_sys))
        for share in (1.0, 0.5, 0.25):
            q = self._q_sys + share * (q_sys - self._q_sys)
            if self._ahead(q) <= allowed:
                return q
        return self._q_sys

    def _ahead(self, q_sys: Floats) -> float:
        """Return the distance of the commanded state's gripper from the measured one, m."""
        d = forward_kinematics(q_sys, self.params.d_gripper)[3:] - self._X_meas()[3:]
        return math.sqrt(d @ d)

    def _X_meas(self) -> Floats:
        """Filtered pose, eq. (12), in B."""
        return W_FROM_B * np.concatenate([self._tracker.wrist.position, self._tracker.p_WG])

    def _X_goal(self) -> Floats:
        """Goal of the phase, in B."""
        p_WG = self._delivery.p_WG_goal
        if p_WG is None:
            above = self._phase in (Phase.WAIT, Phase.APPROACH)
            p_WG = self._tracker.ball.position + (self.params.d_grasp_offset * _UP if above else 0.0)
        return W_FROM_B * np.concatenate([p_WG + self.params.d_gripper * _UP, p_WG])

    def _X_next(self) -> Floats:
        """Pose to go to on the way to the goal, in B."""
        X_goal = self._X_goal()
        if self._delivery.p_WG_goal is not None or self._phase is Phase.GRASP:
            return X_goal
        p, tracker = self.params, self._tracker
        p_WG_goal = (W_FROM_B * X_goal)[3:]
        p_WG = next_place(
            tracker.p_WG,
            tracker.ball.position,
            p_WG_goal,
            standoff=p.standoff,
            over=p.d_grasp_offset,
            excess=self._excess(),
        )
        return W_FROM_B * np.concatenate([p_WG + p.d_gripper * _UP, p_WG])

    def _error(self) -> float:
        e = self._X_goal() - self._X_meas()
        return math.sqrt(e[3:] @ e[3:] if self.params.judge_apart else e @ e)

    def _tilt(self) -> float:
        d = self._tracker.direction.position
        return math.atan2(math.hypot(d[0], d[1]), -d[2])

    def _enter(self, phase: Phase) -> None:
        self._phase, self._searched = phase, 0
        self._progress.restart(self._tracker.ball.position)

    def _give_up(self, verdict: Verdict) -> None:
        self._verdict = verdict
        self._enter(Phase.GIVEN_UP)
