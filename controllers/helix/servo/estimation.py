"""The visual servo's estimates: filtered positions, and the state that explains a measured pose.

`PositionFilter` is a Kalman filter, [Vervloet2025] eqs. (14)-(15), of a position that is expected to stay where it is.
`optimise_state` finds the state nearest to the commanded one that explains the measured pose, eq. (16).
"""

import math
from typing import NamedTuple

import numpy as np

from handover.controllers.helix.servo.constant_curvature import linearise
from handover.cosim.blocks.ports import Floats


class InvalidMeasurement(ValueError):
    """A measurement that is marked as seen holds numbers that are not finite."""

    def __init__(self, what: str, X_new: Floats) -> None:
        super().__init__(
            f"measurement {X_new.tolist()} of the {what} is not finite; clear its `seen` flag where nothing is seen"
        )
        self.what, self.X_new = what, X_new


class PositionFilter:
    """Position X, shape (3,), in m, and its covariance P, shape (3, 3), in m^2, from measurements.

    Q, P and R start as multiples of the identity, in m^2. In the long run only Q/R acts on X, as long as R is constant.
    `seen` says whether there ever was a measurement; `what` whose position it is, for errors.
    """

    def __init__(self, what: str, X: Floats, P: float, Q: float, R: float) -> None:
        self._what = what
        self.position: Floats = np.array(X)
        self.covariance: Floats = P * np.eye(3)
        self.seen = False
        self._Q: Floats = Q * np.eye(3)
        self._R: Floats = R * np.eye(3)

    def predict(self, share: float = 1.0) -> None:
        """X <- X, P <- P + Q, eq. (14); of Q only a share, where the filter runs more often than Q is meant for."""
        self.covariance = self.covariance + share * self._Q

    def deviation(self, X_new: Floats, R: Floats | None = None) -> float:
        """Return how many standard deviations a measurement lies from what is expected; its covariance is as below."""
        r = X_new - self.position
        return math.sqrt(max(float(r @ np.linalg.solve(self.covariance + (self._R if R is None else R), r)), 0.0))

    def update(self, X_new: Floats, R: Floats | None = None) -> None:
        """X <- X + K (X_new - X), P <- P - K P with K = P (P + R)^-1, eq. (15).

        Args:
            X_new: the measurement, shape (3,), in m.
            R: its covariance, shape (3, 3), in m^2, where it is not the filter's own.

        Raises:
            InvalidMeasurement: X_new is not finite.
        """
        if not np.isfinite(X_new).all():
            raise InvalidMeasurement(self._what, X_new)
        X, P = self.position, self.covariance
        K = np.transpose(np.linalg.solve(P + (self._R if R is None else R), P))  # P and R are symmetric
        P_new = P - K @ P
        self.position = X + K @ (X_new - X)
        self.covariance = 0.5 * (P_new + np.transpose(P_new))  # stays symmetric under rounding
        self.seen = True

    def get_state(self) -> tuple[Floats, Floats, bool]:
        """Return position, covariance and `seen`."""
        return self.position, self.covariance, self.seen

    def set_state(self, state: tuple[Floats, Floats, bool]) -> None:
        """Restore what `get_state` gave."""
        self.position, self.covariance, self.seen = state


def weights_of_state(A: Floats, q_sys: Floats, l_calib: Floats, fall: float) -> Floats:
    """Return the weights A_pose_upd for a commanded state, shape (9,), as [Vervloet2025] sec. 5.4.3 suggests.

    Tendons slacken the more, the longer a segment is and the more it and those above are bent, and there the arm will
    be farther from its command. How, the thesis leaves open; here segment i's weights are

        A_i / (1 + c (max(0, l_i / l_calib_i - 1) + sum of theta_j, j <= i)),  theta_j = |(d_x, d_y)_j|.

    Args:
        A: weights of a straight arm, shape (9,).
        q_sys: commanded state, shape (9,), rad and m.
        l_calib: lengths after calibration, shape (3,), m.
        fall: c; 0: the weights stay as they are.
    """
    q = q_sys.reshape(3, 3)
    bent = np.cumsum(np.hypot(q[:, 0], q[:, 1]))
    return A / np.repeat(1.0 + fall * (np.maximum(0.0, q[:, 2] / l_calib - 1.0) + bent), 3)


_STEP_TOLERANCE = 1e-7  # rad and m; the constraint is then met to the square of it
_MAX_ITERATIONS = 60
_EXTRAPOLATE_EVERY, _MAX_RATIO = 5, 0.9
_MAX_NEWTON_STEPS = 60


class StateEstimate(NamedTuple):
    """Estimate q_est, shape (9,); whether it is the optimum; Gauss-Newton steps taken."""

    q_est: Floats
    converged: bool
    iterations: int


def optimise_state(
    q_sys: Floats, X_meas: Floats, q_start: Floats, *, A: Floats, bound: float, d_gripper: float
) -> StateEstimate:
    """SOF: minimise |A (q_est - q_sys)| with |f(q_est) - X_meas| <= bound, eq. (16).

    The printed constraint compares the squared norm with a bound in metres; here it is the norm. Each Gauss-Newton step
    solves the problem with f linearised exactly. Where they shrink slowly, they do so in a constant ratio, and every
    fifth one is extrapolated to the end of the geometric series.

    Args:
        q_sys: state that was commanded, shape (9,).
        X_meas: measured pose [p_BR, p_BG], shape (6,), in m; wrist and gripper d_gripper apart.
        q_start: where the search starts, shape (9,): the last estimate.
        A: diagonal of the weight A_pose_upd, shape (9,).
        bound: epsilon_pose_bound, in m.
        d_gripper: distance of wrist and gripper, in m.
    """
    q, last = q_start, np.zeros(9)
    for iteration in range(1, _MAX_ITERATIONS + 1):
        X, J = linearise(q, d_gripper)
        B = J / A
        y = _nearest_in_ball(B, X - X_meas - J @ (q - q_sys), bound)
        step = q_sys + y / A - q
        if np.abs(step).max() < _STEP_TOLERANCE:
            return StateEstimate(q + step, True, iteration)
        q = q + (step / (1.0 - _ratio(step, last)) if iteration % _EXTRAPOLATE_EVERY == 0 else step)
        last = step
    return StateEstimate(q, False, _MAX_ITERATIONS)


def _ratio(step: Floats, last: Floats) -> float:
    """Return the ratio of successive steps, within the bounds for which their series converges."""
    return min(_MAX_RATIO, max(-_MAX_RATIO, float(step @ last) / float(last @ last)))


def _nearest_in_ball(B: Floats, r: Floats, bound: float) -> Floats:
    """Return the shortest y with |B y + r| <= bound.

    y = -B^T (B B^T + 1/nu)^-1 r, where the multiplier nu >= 0 solves phi(nu) = |(1 + nu B B^T)^-1 r| = bound. 1/phi is
    concave, so Newton's method on it rises from nu = 0 to the root without a safeguard. The linearised gripper cannot
    be stretched, so far from the solution the ball can be out of reach: then the residual is made as short as can be.
    """
    if math.sqrt(r @ r) <= bound:
        return np.zeros(9)
    lam, V = np.linalg.eigh(B @ np.transpose(B))
    rho = r @ V
    reachable = lam > 1e-9 * lam[-1]
    lam = np.where(reachable, lam, 0.0)
    if math.sqrt(float(np.sum(rho[~reachable] ** 2))) >= 0.99 * bound:
        return -(V @ (rho * reachable / np.where(reachable, lam, 1.0))) @ B
    nu = 0.0
    for _ in range(_MAX_NEWTON_STEPS):
        shrink = 1.0 / (1.0 + nu * lam)
        square = (rho * shrink) ** 2
        phi2 = float(square.sum())
        phi = math.sqrt(phi2)
        if phi <= bound * (1.0 + 1e-12):
            break
        nu += (phi / bound - 1.0) * phi2 / float(square @ (lam * shrink))
    return -(V @ (rho * nu / (1.0 + nu * lam))) @ B
