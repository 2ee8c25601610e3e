"""Where the visual servo has ball, wrist and gripper: what it expects, corrected by what is seen."""

import math
from typing import Any

import numpy as np

from handover.controllers.helix.servo.arm_motion import FirstOrderLag
from handover.controllers.helix.servo.estimation import PositionFilter
from handover.controllers.helix.servo.servo_parameters import Params
from handover.cosim.blocks.ports import Floats

UP = np.array([0.0, 0.0, 1.0])


class Tracker:
    """Filters of ball, wrist and the gripper's direction, [Vervloet2025] eqs. (14)-(15), in W.

    With `predict_motion` the wrist and the direction are expected to move as they are commanded to: by J dq, which the
    motors let arrive with the response time. With `gate`, what is farther from what is expected than so many standard
    deviations is refused, unless `gate_steps` measurements in a row are.

    Attributes:
        ball, wrist, direction: the filters, of p_WO, p_WR and p_WG - p_WR.
        unseen_O, unseen_R: seconds since ball and ring were last seen and taken; infinite before.
    """

    def __init__(self, p: Params) -> None:
        self._params = p
        self.ball = PositionFilter("ball", np.zeros(3), p.P_init, p.Q_ball, p.R_ball)
        self.wrist = PositionFilter("wrist", -p.l_calib.sum() * UP, p.P_init, p.Q_wrist, p.R_wrist)
        self.direction = PositionFilter("direction", -p.d_gripper * UP, p.P_init, p.Q_direction, p.R_direction)
        self.unseen_O = self.unseen_R = math.inf
        self._motion = FirstOrderLag(6, p.response_time)  # of wrist and direction, as commanded
        self._refused = [0, 0]

    @property
    def p_WG(self) -> Floats:
        """Position of the gripper, shape (3,), m."""
        return self.wrist.position + self.direction.position

    @property
    def pose_deviation(self) -> float:
        """Standard deviation of the filtered pose, m: the root of the trace of the covariances of wrist and gripper."""
        P_R, P_direction = self.wrist.covariance, self.direction.covariance
        return math.sqrt(float(np.trace(2.0 * P_R + P_direction)))

    def expect(self, moved: Floats) -> None:
        """Expect the wrist and the direction to move by J dq, shape (6,), in W, m."""
        self._motion.add(moved)

    def advance(self, dt: float) -> None:
        """Let time pass, s; the variances grow by the part of Q that belongs to it, eq. (14)."""
        p = self._params
        share = dt / p.control_period if p.filter_pictures else 1.0
        for f in (self.ball, self.wrist, self.direction):
            f.predict(share)
        if self._motion.pending.any():
            arrived = self._motion.advance(dt)
            self.wrist.position = self.wrist.position + arrived[:3]
            self._turn(self.direction.position + arrived[3:])
        self.unseen_O += dt
        self.unseen_R += dt

    def see_ball(self, p_WO: Floats, covariance: Floats) -> None:
        """Take a measurement of the ball, eq. (15)."""
        R = covariance + self._params.ball_motion**2 * np.eye(3) if self._params.use_covariance else None
        if self._is_taken(0, self.ball, p_WO, R):
            self.ball.update(p_WO, R)
            self.unseen_O = 0.0

    def see_ring(self, p_WR: Floats, p_WG: Floats, cov_R: Floats, cov_G: Floats) -> None:
        """Take a measurement of wrist and gripper; the gripper keeps its length, eq. (13).

        Assumed: errors of wrist and gripper are independent; they come from one fit, so this overstates the
        direction's.
        """
        uses = self._params.use_covariance
        if self._is_taken(1, self.wrist, p_WR, cov_R if uses else None):
            self.wrist.update(p_WR, cov_R if uses else None)
            before = self.direction.position
            self.direction.update(p_WG - p_WR, cov_R + cov_G if uses else None)
            updated, self.direction.position = self.direction.position, before
            self._turn(updated)
            self.unseen_R = 0.0

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state."""
        filters = [f.get_state() for f in (self.ball, self.wrist, self.direction)]
        return filters, self.unseen_O, self.unseen_R, self._motion.pending, list(self._refused)

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        filters, self.unseen_O, self.unseen_R, self._motion.pending, self._refused = state
        for f, kept in zip((self.ball, self.wrist, self.direction), filters, strict=True):
            f.set_state(kept)

    def _is_taken(self, which: int, f: PositionFilter, X_new: Floats, R: Floats | None) -> bool:
        """Return whether a measurement passes the gate; count those in a row that do not."""
        p = self._params
        passes = p.gate == 0.0 or not f.seen or f.deviation(X_new, R) <= p.gate
        self._refused[which] = 0 if passes else self._refused[which] + 1
        if passes or self._refused[which] < p.gate_steps:
            return passes
        self._refused[which] = 0
        return True

    def _turn(self, direction: Floats) -> None:
        """Take a new direction, at the gripper's length, unless it is none."""
        length = math.sqrt(direction @ direction)
        if length > 1e-9:
            self.direction.position = direction * (self._params.d_gripper / length)
