"""Visual servoing of the Helix arm to a ball that a hand offers. [Vervloet2025] sec. 3.4, algorithm 3."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from handover.controllers.helix.servo.arm_motion import Response, Shaper
from handover.controllers.helix.servo.arm_paths import Recovery
from handover.controllers.helix.servo.constant_curvature import W_FROM_B, forward_kinematics, linearise, tendon_lengths
from handover.controllers.helix.servo.estimation import optimise_state, weights_of_state
from handover.controllers.helix.servo.jacobian_control import Damping, Limits, blend, control_step, is_reachable
from handover.controllers.helix.servo.servo_parameters import Inputs, InvalidServoParameters, Params
from handover.controllers.helix.servo.task import SAME_TIME, Phase, Task, Verdict
from handover.controllers.helix.servo.tracking import UP, Tracker
from handover.cosim.blocks.ports import Floats, Vector3, Vector9, output
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, Number, Radian

__all__ = ["Inputs", "InvalidServoParameters", "Outputs", "Params", "Phase", "Verdict", "VisualServo"]

_RESPONSE_MEMORY = 1.5  # s; one swing of the arm and a half (own choice)
_LARGEST_STEP, _HALF_STEP_ERROR = 0.8, 0.08  # of the way; m, at which a growing step is half of that (own choices)
_AT_LIMIT = 1e-6  # rad, m


@dataclass(kw_only=True)
class Outputs:
    """Command, phase and estimates; rotations of q are in rad, lengths in m."""

    dl_t: Vector9[Metre] = output("tendon length change from calibration")
    closure: Number = output("gripper command: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    phase: Phase = output("what the arm is doing")
    q_est: Vector9[Number] = output("state that explains the measured pose: Dx, Dy (rad), l (m) of each segment")
    q_sys: Vector9[Number] = output(
        "commanded state, before it is averaged over shaping_time: Dx, Dy (rad), l (m) of each segment"
    )
    error: Metre = output(
        "distance of the gripper from its goal, or norm over wrist and gripper; of no meaning in WAIT"
    )
    tilt: Radian = output("angle of the gripper from straight down")
    verdict: Verdict = output("why the arm has given up")
    p_WO_est: Vector3[Metre] = output("filtered position of the ball")
    p_WR_est: Vector3[Metre] = output("filtered position of the wrist")
    p_WG_est: Vector3[Metre] = output("filtered position of the gripper")
    estimate_converged: bool = output("the last state optimisation, if any, came to its optimum, eq. (16)")
    step_converged: bool = output("the last loop of algorithm 1, if any, came within epsilon_control of its goal")


class VisualServo:
    """Algorithm 3: filter, estimate the state (eq. 16), step towards the goal (algorithm 1), close when it is reached.

    The command is updated once in each control_period (give or take its jitter), at the beginning of a step. Between
    updates it is held, and with filter_pictures the measurements are filtered in each step. A longer step is one
    control period. The goal pose has the gripper pointing down, at the ball or (APPROACH) d_grasp_offset above it:
    X_goal = [p_WG_goal + d_gripper z, p_WG_goal]. The mount, B, is at the origin of W.

    The error is the distance of the gripper from its goal (judge_apart), or the norm |X_goal - X_meas| over all six
    coordinates, in m. The source prints its square and compares it with metres.

    Own additions: see `Params`. The command is held while the ring is not seen, since there is no feedback. Without
    ring or ball for lost_after the phase is RECOVER: back along the last commands, then a search. A ball without a ring
    from the start leads there, too. An error above threshold_retreat in DESCEND (the ball was moved), or above
    threshold_reopen while the gripper closes, leads back to APPROACH. An error that makes no progress leads to
    GIVEN_UP, which does not close; `verdict` gives the reason. It is OUT_OF_REACH if no search within the limits brings
    the model's gripper to its goal. Else it is LIMITS if the command is at one or at windup, else NO_PROGRESS.

    A state optimisation or a loop of algorithm 1 that does not converge is used as far as it came, and signalled by
    `estimate_converged` and `step_converged`.

    With `delivers`, HOLD is followed by CARRY and DROP: see `Delivery`. `Task` has the phases.

    Raises:
        InvalidServoParameters: values that contradict each other or are out of range; all faults are named.
        InvalidMeasurement: a measurement that is marked as seen is not finite.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        (
            *("dl_t", "closure", "phase", "q_est", "q_sys", "error", "tilt", "verdict"),
            *("p_WO_est", "p_WR_est", "p_WG_est", "estimate_converged", "step_converged"),
        ),
        ("p_WO_meas", "p_WR_meas", "p_WG_meas", "cov_O", "cov_R", "cov_G", "seen_O", "seen_R"),
    )
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal(
            "measurements",
            TerminalKind.MEASUREMENTS,
            *("p_WO_meas", "p_WR_meas", "p_WG_meas"),
            *("cov_O", "cov_R", "cov_G", "seen_O", "seen_R"),
        ),
        terminal("actuators", TerminalKind.COMMAND, "dl_t", "closure"),
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
        self._estimate_converged = self._step_converged = True
        self._tracker = Tracker(p)
        self._task = Task(p, self._tracker)
        self._recovery = Recovery(self._q_calib)
        self._response = Response(_RESPONSE_MEMORY, p.response_time, p.least_response)
        self._shaper = Shaper(p.shaping_time, self._q_calib)
        self._rng = np.random.default_rng(p.seed)
        self._t_next = -math.inf
        self._t_filtered = -math.inf

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command in force: no time passes, so nothing is filtered or decided."""
        return Outputs(
            dl_t=tendon_lengths(self._shaper.q, self.params.d) - self._l_t_calib,
            closure=1.0 if self._task.closes else 0.0,
            phase=self._task.phase,
            q_est=np.array(self._q_est),
            q_sys=np.array(self._q_sys),
            error=self._task.error,
            tilt=self._task.tilt,
            verdict=self._task.verdict,
            p_WO_est=np.array(self._tracker.ball.position),
            p_WR_est=np.array(self._tracker.wrist.position),
            p_WG_est=self._tracker.p_WG,
            estimate_converged=self._estimate_converged,
            step_converged=self._step_converged,
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
        self._task.decide(t, self._why_stuck)
        if self._task.phase is Phase.RECOVER:
            self._q_sys = self._recovery.next(self._q_sys)
        elif sees and self._task.moves(t):
            self._move()
        self._shape(t)
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return filters, states, phase and times."""
        times = (self._t_next, self._t_filtered)
        believed = (
            self._tracker.get_state(),
            self._task.get_state(),
            self._recovery.get_state(),
            self._response.get_state(),
            self._shaper.get_state(),
            self._rng.bit_generator,
        )
        converged = (self._estimate_converged, self._step_converged)
        return pack_state((believed, self._q_sys, self._q_est, times, converged))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        saved: Any = unpack_state(state)
        believed, self._q_sys, self._q_est, times, converged = saved
        tracker, task, recovery, response, shaper, drawn = believed
        self._tracker.set_state(tracker)
        self._task.set_state(task)
        self._recovery.set_state(recovery)
        self._response.set_state(response)
        self._shaper.set_state(shaper)
        self._rng.bit_generator.state = drawn
        self._t_next, self._t_filtered = times
        self._estimate_converged, self._step_converged = converged

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
        found = optimise_state(self._q_sys, self._X_meas(), self._q_est, A=A, bound=bound, d_gripper=p.d_gripper)
        self._q_est, self._estimate_converged = found.q_est, found.converged

    def _why_stuck(self) -> Verdict:
        p, goal = self.params, self._pointing_down(self._task.p_WG_goal)[3:]
        starts = (self._q_calib, self._q_sys, self._q_est)
        if not is_reachable(goal, starts, p.K_initialize, self._limits, p.d_gripper):
            return Verdict.OUT_OF_REACH
        d = np.hypot(self._q_sys[0::3], self._q_sys[1::3])
        q_DL = np.column_stack([d, self._q_sys[2::3]]).reshape(6)
        room = np.minimum(self._limits.UB - q_DL, np.where(self._limits.LB > 0.0, q_DL - self._limits.LB, math.inf))
        wound_up = p.windup > 0.0 and self._ahead(self._q_sys) > 0.95 * p.windup
        return Verdict.LIMITS if wound_up or room.min() < _AT_LIMIT else Verdict.NO_PROGRESS

    def _move(self) -> None:
        p, error, X_meas = self.params, self._task.error, self._X_meas()
        growing = _LARGEST_STEP * error / (error + _HALF_STEP_ERROR)
        alpha = min(_LARGEST_STEP, max(p.alpha, growing)) if p.adaptive_step else p.alpha
        alpha = min(alpha / self._response.part, max(alpha, _LARGEST_STEP))
        commanded = control_step(
            self._q_sys,
            self._q_est,
            blend(self._pointing_down(self._task.p_WG_next), X_meas, alpha, p.d_gripper),
            X_meas,
            K=p.K_initialize,
            limits=self._limits,
            epsilon_control=p.epsilon_control,
            N_max_iter=p.N_max_iter,
            d_gripper=p.d_gripper,
            damping=Damping(p.damping, p.tilt_weight * self._task.progress.tilt_share) if p.judge_apart else None,
            dq_0=self._towards_posture() if p.posture > 0.0 else None,
        )
        self._step_converged = commanded.converged
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

    def _pointing_down(self, p_WG: Floats) -> Floats:
        """Return the pose of a gripper at a place in W that points down, in B."""
        return W_FROM_B * np.concatenate([p_WG + self.params.d_gripper * UP, p_WG])
