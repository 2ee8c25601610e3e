"""Visual servoing of the Helix arm to a ball that a hand offers. [Vervloet2025] sec. 3.4, algorithm 3."""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from handover.controllers.helix.constant_curvature import tendon_lengths
from handover.controllers.helix.estimation import PositionFilter, optimise_state
from handover.controllers.helix.jacobian_control import Limits, blend, control_step
from handover.controllers.helix.servo_parameters import InvalidServoParameters, Params
from handover.cosim.blocks.ports import Floats, Matrix3, Vector3, Vector9, output, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Metre, Number, SquareMetre

__all__ = ["Inputs", "InvalidServoParameters", "Outputs", "Params", "Phase", "VisualServo"]

_W_FROM_B = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])  # R_WB = diag(1, -1, -1), for both points of a pose
_UP = np.array([0.0, 0.0, 1.0])
_SAME_TIME = 1e-9  # s; rounding of a time that a host adds up from steps


class Phase(enum.IntEnum):
    """What the arm is doing."""

    WAIT = 0
    APPROACH = 1
    DESCEND = 2
    GRASP = 3
    HOLD = 4
    GIVEN_UP = 5


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
    q_sys: Vector9[Number] = output("state that is commanded: Dx, Dy (rad), l (m) of each segment")
    error: Metre = output("norm of X_goal - X_meas over wrist and gripper; of no meaning in WAIT")
    p_WO_est: Vector3[Metre] = output("filtered position of the ball")
    p_WR_est: Vector3[Metre] = output("filtered position of the wrist")
    p_WG_est: Vector3[Metre] = output("filtered position of the gripper")


class VisualServo:
    """Algorithm 3: filter, estimate the state (eq. 16), step towards the goal (algorithm 1), close when it is reached.

    Inputs are read, and the command is updated, once in each control_period, at the beginning of a step; between,
    the outputs are held. A longer step is one control period. The goal pose has the gripper pointing down, at the ball
    or (APPROACH) d_grasp_offset above it: X_goal = [p_WG_goal + d_gripper z, p_WG_goal]. The error is the norm |X_goal
    - X_meas| over all six coordinates, in m, where the source prints its square and compares it with metres.

    Own additions: the command is held while the ring is not seen, since there is no feedback; an
    error above threshold_retreat in DESCEND (the ball was moved) leads back to APPROACH; an error that makes no
    progress leads to GIVEN_UP, which does not close. GRASP, HOLD and GIVEN_UP hold the command, and have the ball as
    goal. The mount, B, is at the origin of W.

    Raises:
        InvalidServoParameters: values that contradict each other or are out of range; all faults are named.
        InvalidMeasurement: a measurement that is marked as seen is not finite.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("dl_t", "closure", "phase", "q_est", "q_sys", "error", "p_WO_est", "p_WR_est", "p_WG_est"),
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
        self._ball = PositionFilter(np.zeros(3), p.P_init, p.Q_ball, p.R_ball)
        self._wrist = PositionFilter(-p.l_calib.sum() * _UP, p.P_init, p.Q_wrist, p.R_wrist)
        self._direction = PositionFilter(-p.d_gripper * _UP, p.P_init, p.Q_direction, p.R_direction)
        self._phase = Phase.WAIT
        self._t_next = -math.inf
        self._t_close = 0.0
        self._settled = 0
        self._steps = 0
        self._stalled = 0
        self._best = math.inf
        self._p_WO_best: Floats = self._ball.position

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command in force: no time passes, so nothing is filtered or decided."""
        return Outputs(
            dl_t=tendon_lengths(self._q_sys, self.params.d) - self._l_t_calib,
            closure=1.0 if self._phase in (Phase.GRASP, Phase.HOLD) else 0.0,
            phase=self._phase,
            q_est=np.array(self._q_est),
            q_sys=np.array(self._q_sys),
            error=self._error(),
            p_WO_est=np.array(self._ball.position),
            p_WR_est=np.array(self._wrist.position),
            p_WG_est=self._wrist.position + self._direction.position,
        )

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Run the main loop of algorithm 3 once if a control period has passed since it ran."""
        if t < self._t_next - _SAME_TIME:
            return self.outputs(t + dt, u)
        following = self._t_next + self.params.control_period
        self._t_next = following if following > t + _SAME_TIME else t + self.params.control_period
        self._filter(u)
        if u.seen_R:
            self._estimate()
        self._decide(t)
        if u.seen_R and self._phase in (Phase.APPROACH, Phase.DESCEND):
            self._move()
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return filters, states, phase and counters."""
        filters = [f.get_state() for f in (self._ball, self._wrist, self._direction)]
        counters = (self._t_next, self._t_close, self._settled, self._steps, self._stalled, self._best, self._p_WO_best)
        return pack_state((filters, self._q_sys, self._q_est, int(self._phase), counters))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        saved: Any = unpack_state(state)
        filters, self._q_sys, self._q_est, phase, counters = saved
        for f, s in zip((self._ball, self._wrist, self._direction), filters, strict=True):
            f.set_state(s)
        self._phase = Phase(phase)
        self._t_next, *counters = counters
        self._t_close, self._settled, self._steps, self._stalled, self._best, self._p_WO_best = counters

    def _filter(self, u: Inputs) -> None:
        p = self.params
        for f in (self._ball, self._wrist, self._direction):
            f.predict()
        if u.seen_O:
            self._ball.update(u.p_WO_meas, u.cov_O if p.use_covariance else None)
        if u.seen_R:
            self._wrist.update(u.p_WR_meas, u.cov_R if p.use_covariance else None)
            direction = self._direction.position
            self._direction.update(u.p_WG_meas - u.p_WR_meas, u.cov_R + u.cov_G if p.use_covariance else None)
            # eq. (13): the gripper's length is fixed
            length = math.sqrt(self._direction.position @ self._direction.position)
            self._direction.position = self._direction.position * (p.d_gripper / length) if length > 1e-9 else direction

    def _estimate(self) -> None:
        p = self.params
        self._q_est = optimise_state(
            self._q_sys, self._X_meas(), self._q_est, A=p.A_pose_upd, bound=p.epsilon_pose_bound, d_gripper=p.d_gripper
        ).q_est

    def _decide(self, t: float) -> None:
        p, error = self.params, self._error()
        if self._phase is Phase.WAIT and self._ball.seen and self._wrist.seen:
            self._enter(Phase.APPROACH)
        elif self._phase is Phase.APPROACH and error < p.threshold:
            self._enter(Phase.DESCEND)
        elif self._phase is Phase.DESCEND and error > p.threshold_retreat:
            self._enter(Phase.APPROACH)
        elif self._phase is Phase.GRASP and t - self._t_close >= p.closing_time - 1e-9:
            self._enter(Phase.HOLD)
        error = self._error()
        near = self._phase is Phase.DESCEND and error < p.threshold_grasp
        self._settled = self._settled + 1 if near else 0
        if self._settled >= p.settle_steps:
            self._t_close = t
            self._enter(Phase.GRASP)
        elif self._phase in (Phase.APPROACH, Phase.DESCEND) and not self._makes_progress(error):
            self._enter(Phase.GIVEN_UP)

    def _move(self) -> None:
        p, error, X_meas = self.params, self._error(), self._X_meas()
        alpha = min(0.8, max(p.alpha, 0.8 * error / (error + 0.08))) if p.adaptive_step else p.alpha
        self._q_sys = control_step(
            self._q_sys,
            self._q_est,
            blend(self._X_goal(), X_meas, alpha, p.d_gripper),
            X_meas,
            K=p.K_initialize,
            limits=self._limits,
            epsilon_control=p.epsilon_control,
            N_max_iter=p.N_max_iter,
            d_gripper=p.d_gripper,
        ).q_sys

    def _X_meas(self) -> Floats:
        """Filtered pose, eq. (12), in B."""
        return _W_FROM_B * np.concatenate([self._wrist.position, self._wrist.position + self._direction.position])

    def _X_goal(self) -> Floats:
        """Goal of the phase, in B."""
        above = self._phase in (Phase.WAIT, Phase.APPROACH)
        p_WG = self._ball.position + (self.params.d_grasp_offset * _UP if above else 0.0)
        return _W_FROM_B * np.concatenate([p_WG + self.params.d_gripper * _UP, p_WG])

    def _error(self) -> float:
        e = self._X_goal() - self._X_meas()
        return math.sqrt(e @ e)

    def _enter(self, phase: Phase) -> None:
        self._phase = phase
        self._reset_progress()

    def _reset_progress(self) -> None:
        self._stalled, self._best, self._p_WO_best = 0, math.inf, self._ball.position

    def _makes_progress(self, error: float) -> bool:
        """Count the step and what it gained; return whether to go on. A ball that has moved restarts the count."""
        p, moved = self.params, self._ball.position - self._p_WO_best
        if math.sqrt(moved @ moved) > p.threshold:
            self._reset_progress()
        self._steps += 1
        self._stalled += 1
        if error < self._best - p.progress:
            self._stalled, self._best, self._p_WO_best = 0, error, self._ball.position
        return self._stalled < p.patience and self._steps <= p.max_steps
