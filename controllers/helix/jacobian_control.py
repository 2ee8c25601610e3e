"""Jacobian based control with a virtual stiffness that keeps the limits. [Vervloet2025] algorithms 1 and 2."""

import math
from typing import NamedTuple

import numpy as np

from handover.controllers.helix.constant_curvature import linearise
from handover.cosim.blocks.ports import Floats

_STIFFENING = 100.0
_RANK_TOLERANCE = 1e-9
_INSIDE = 1.0 - 1e-15  # a cropped rotation is not to exceed its bound by rounding


class Limits(NamedTuple):
    """Bounds of q_DL = [d_1, l_1, d_2, l_2, d_3, l_3], eqs. (8)-(11): rotations d_i, in rad, and lengths l_i, in m."""

    LB: Floats
    UB: Floats


class ControlStep(NamedTuple):
    """Command q_sys, shape (9,), estimate q_est, shape (9,), that follows it, error |X_goal_alpha - f(q_est)|, in m.

    `converged` says whether the error is below epsilon_control; if not, this is the best iterate, or where the arm is
    if no iterate is nearer to the goal.
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
    """
    K_inv = 1.0 / K
    e = X_goal_alpha - X_meas
    X_est, jacobian = linearise(q_est, d_gripper)
    stay = ControlStep(q_sys, q_est, float(np.linalg.norm(X_goal_alpha - X_est)), False)
    best = ControlStep(q_sys, q_est, math.inf, False)
    for _ in range(N_max_iter):
        dq_J = _weighted_step(jacobian, K_inv, e)
        q_sys_J = q_sys + dq_J
        q_sys, K_inv = keep_limits(q_sys_J, K_inv, limits)
        q_est = q_est + dq_J + (q_sys - q_sys_J)
        X_est, jacobian = linearise(q_est, d_gripper)
        e = X_goal_alpha - X_est
        error = math.sqrt(e @ e)
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


def keep_limits(q_sys: Floats, K_inv: Floats, limits: Limits) -> tuple[Floats, Floats]:
    """SKU, algorithm 2: return q_sys cropped to its limits, and K^-1 divided by 100 where it was cropped, both (9,).

    Of a rotation that is too large the component of greater magnitude is cropped, and keeps its sign; where the other
    one alone exceeds the bound, both are scaled alike.
    """
    q, k = q_sys.tolist(), K_inv.tolist()
    LB, UB = limits.LB.tolist(), limits.UB.tolist()
    for i in range(3):
        x, y, l = 3 * i, 3 * i + 1, 3 * i + 2
        if not LB[2 * i + 1] <= q[l] <= UB[2 * i + 1]:
            q[l] = min(max(q[l], LB[2 * i + 1]), UB[2 * i + 1])
            k[l] /= _STIFFENING
        D, D_max = math.hypot(q[x], q[y]), UB[2 * i]
        if D_max >= D:
            continue
        large, small = (x, y) if abs(q[x]) > abs(q[y]) else (y, x)
        D_max *= _INSIDE
        if abs(q[small]) < D_max:
            q[large] = math.copysign(math.sqrt(D_max * D_max - q[small] * q[small]), q[large])
            k[large] /= _STIFFENING
        else:
            q[x], q[y] = q[x] * (D_max / D), q[y] * (D_max / D)
            k[x], k[y] = k[x] / _STIFFENING, k[y] / _STIFFENING
    return np.array(q), np.array(k)
