"""Jacobian based control with a virtual stiffness that keeps the limits. [Vervloet2025] algorithms 1 and 2."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from handover.controllers.helix.servo.constant_curvature import linearise
from handover.cosim.blocks.ports import Floats

REACH_TOLERANCE = 0.003
"""Distance of the model's gripper from a goal, m, beyond which the goal is out of its reach."""

STIFFENING = 100.0
"""How much stiffer a state becomes that is at its limit, sec. 3.3.3; algorithm 2, lines 11, 17 and 20."""

_RANK_TOLERANCE = 1e-9
_MAX_REACH_STEPS, _REACHED = 200, 0.001
_INSIDE = 1.0 - 1e-15  # a cropped rotation is not to exceed its bound by rounding


class Damping(NamedTuple):
    """How much of the error is left for a shorter step, where the goal cannot be met: position first, then tilt.

    Attributes:
        length: error of the gripper's position, m, that weighs as much as a change dq of the state with dq^T K dq = 1.
        tilt_weight: weight of the error of the vector from the wrist to the gripper, beside the position's 1.
    """

    length: float
    tilt_weight: float


class Limits(NamedTuple):
    """Bounds of q_DL = [d_1, l_1, d_2, l_2, d_3, l_3], eqs. (8)-(11): rotations d_i, in rad, and lengths l_i, in m."""

    LB: Floats
    UB: Floats


class ControlStep(NamedTuple):
    """Command q_sys, shape (9,), estimate q_est, shape (9,), that follows it, error |X_goal_alpha - f(q_est)|, in m.

    `converged` says whether the error is below epsilon_control; if not, this is the best iterate, or where the arm is
    if no iterate is nearer to the goal. Algorithm 1 returns nothing when it does not converge.
    """

    q_sys: Floats
    q_est: Floats
    error: float
    converged: bool


def blend(X_goal: Floats, X_meas: Floats, alpha: float, d_gripper: float) -> Floats:
    """Return X_goal_alpha = alpha X_goal + (1 - alpha) X_meas, eq. (21), shape (6,), in m.

    The blend of two directions is shorter than they are, so the gripper's length is restored.
    """
    X = alpha * X_goal + (1.0 - alpha) * X_meas
    direction = X[3:] - X[:3]
    length = math.sqrt(direction @ direction)
    if length > 1e-9 * d_gripper:  # else they are opposite, and one direction is as good as the other
        X[3:] = X[:3] + direction * (d_gripper / length)
    return X


def control_step(
    q_sys: Floats,
    q_est: Floats,
    X_goal_alpha: Floats,
    X_meas: Floats,
    *,
    K: Floats,
    limits: Limits,
    epsilon_control: float,
    N_max_iter: int,
    d_gripper: float,
    damping: Damping | None = None,
    dq_0: Floats | None = None,
) -> ControlStep:
    """JBC, algorithm 1: move q_sys and q_est so that f(q_est) comes to X_goal_alpha and q_sys keeps its limits.

    The error is compared as a norm (the printed one is squared, and compared with metres). As printed, the first error
    is taken from the measurement and the following ones from f(q_est), which the state optimisation leaves
    epsilon_pose_bound away from it.

    Args:
        q_sys: command in force, shape (9,).
        q_est: estimated state, shape (9,).
        X_goal_alpha: blended goal, shape (6,), in m, eq. (21).
        X_meas: measured pose, shape (6,), in m.
        K: diagonal of the virtual stiffness, shape (9,).
        limits: bounds of q_sys.
        epsilon_control: error at which the iteration ends, in m.
        N_max_iter: iterations at most.
        d_gripper: distance of wrist and gripper, in m.
        damping: own addition, see `damped_step`; the error is that of position and weighted tilt. None: as printed.
        dq_0: own addition, with damping: a change that is wanted where the goal leaves it open, shape (9,).
    """
    K_inv = 1.0 / K
    e = X_goal_alpha - X_meas
    X_est, jacobian = linearise(q_est, d_gripper)
    stay = ControlStep(q_sys, q_est, _size(X_goal_alpha - X_est, damping), False)
    best = ControlStep(q_sys, q_est, math.inf, False)
    for _ in range(N_max_iter):
        dq_J = damped_step(jacobian, K_inv, e, damping, dq_0) if damping else _weighted_step(jacobian, K_inv, e)
        dq_0 = None  # once a control period
        q_sys_J = q_sys + dq_J
        q_sys, K_inv = keep_limits(q_sys_J, K_inv, limits)
        q_est = q_est + dq_J + (q_sys - q_sys_J)
        X_est, jacobian = linearise(q_est, d_gripper)
        e = X_goal_alpha - X_est
        error = _size(e, damping)
        if error < best.error:
            best = ControlStep(q_sys, q_est, error, error < epsilon_control)
        if best.converged:
            break
    return best if best.converged or best.error < stay.error else stay


def _weighted_step(J: Floats, K_inv: Floats, e: Floats) -> Floats:
    """Return J_K^+ e with J_K^+ = K^-1 J^T (J K^-1 J^T)^+, eq. (19).

    The wrist and gripper keep their distance, so J K^-1 J^T has no inverse: a truncated pseudo-inverse takes its place.
    """
    JK = J * K_inv
    lam, V = np.linalg.eigh(JK @ np.transpose(J))
    regular = lam > _RANK_TOLERANCE * lam[-1]
    return V @ ((e @ V) * regular / np.where(regular, lam, 1.0)) @ JK


def damped_step(J: Floats, K_inv: Floats, e: Floats, damping: Damping, dq_0: Floats | None = None) -> Floats:
    """Return the dq, shape (9,), that makes |D (z - J_z dq)|^2 + length^2 (dq - dq_0)^T K (dq - dq_0) least.

    z is the error of the gripper's position and of the vector to it from the wrist, which are the pose's last three
    entries, and those minus its first three; D is 1 for the former and the tilt's weight for the latter. So a goal
    whose tilt is out of reach is met in position, and one that is out of reach does not let dq grow.
    """
    J_z = np.concatenate([J[3:], J[3:] - J[:3]])
    z = np.concatenate([e[3:], e[3:] - e[:3]])
    JK = J_z * K_inv
    doubt = damping.length**2 * np.repeat([1.0, damping.tilt_weight**-2], 3)
    M = JK @ np.transpose(J_z) + np.diag(doubt)
    if dq_0 is None:
        return np.linalg.solve(M, z) @ JK
    return dq_0 + np.linalg.solve(M, z - J_z @ dq_0) @ JK


def nearest_distance(p_BG: Floats, q_start: Floats, K: Floats, limits: Limits, d_gripper: float) -> float:
    """Return how near the model's gripper comes to a point in B, in m, within the limits, by a search from q_start."""
    q, best = q_start, math.inf
    damping = Damping(length=0.003, tilt_weight=0.001)
    for _ in range(_MAX_REACH_STEPS):
        X, J = linearise(q, d_gripper)
        e = p_BG - X[3:]
        best = min(best, math.sqrt(e @ e))
        if best < _REACHED:
            break
        step = damped_step(J, 1.0 / K, np.tile(e, 2), damping)  # whatever the direction
        q, _ = keep_limits(q + step, 1.0 / K, limits)
    return best


def is_reachable(p_BG: Floats, starts: Sequence[Floats], K: Floats, limits: Limits, d_gripper: float) -> bool:
    """Return whether the model's gripper comes to a point in B, m, within the limits, by searches from these states."""
    return min(nearest_distance(p_BG, q, K, limits, d_gripper) for q in starts) <= REACH_TOLERANCE


def _size(e: Floats, damping: Damping | None) -> float:
    """Return the norm of an error of the pose, in m; with damping that of position and weighted tilt."""
    if damping is None:
        return math.sqrt(e @ e)
    tilt = damping.tilt_weight * (e[3:] - e[:3])
    return math.sqrt(e[3:] @ e[3:] + tilt @ tilt)


def keep_limits(q_sys: Floats, K_inv: Floats, limits: Limits) -> tuple[Floats, Floats]:
    """SKU, algorithm 2: return q_sys cropped to its limits, and K^-1 divided by 100 where it was cropped, both (9,).

    Of a rotation that is too large the component of greater magnitude is cropped, and keeps its sign; where the other
    one alone exceeds the bound, both are scaled alike. The printed one compares signed components and does not return
    K^-1.
    """
    q, k = q_sys.tolist(), K_inv.tolist()
    LB, UB = limits.LB.tolist(), limits.UB.tolist()
    for i in range(3):
        x, y, l = 3 * i, 3 * i + 1, 3 * i + 2
        if not LB[2 * i + 1] <= q[l] <= UB[2 * i + 1]:
            q[l] = min(max(q[l], LB[2 * i + 1]), UB[2 * i + 1])
            k[l] /= STIFFENING
        D, D_max = math.hypot(q[x], q[y]), UB[2 * i]
        if D_max >= D:
            continue
        large, small = (x, y) if abs(q[x]) > abs(q[y]) else (y, x)
        D_max *= _INSIDE
        if abs(q[small]) < D_max:
            q[large] = math.copysign(math.sqrt(D_max * D_max - q[small] * q[small]), q[large])
            k[large] /= STIFFENING
        else:
            q[x], q[y] = q[x] * (D_max / D), q[y] * (D_max / D)
            k[x], k[y] = k[x] / STIFFENING, k[y] / STIFFENING
    return np.array(q), np.array(k)
