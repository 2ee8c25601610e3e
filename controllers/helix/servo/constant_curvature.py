"""Piecewise constant curvature kinematics of a three-segment tendon arm. [Vervloet2025] eqs. (1)-(7), sec. 3.1.

The state is q = [Dx_1, Dy_1, l_1, ..., Dx_3, Dy_3, l_3], shape (9,): the rotation of a segment along its x and y axes,
in rad, and its length, in m. Positions are in the base frame B, z along the hanging arm.

With D = sqrt(Dx^2 + Dy^2), A = (1 - cos D) / D^2 and S = sin D / D, eqs. (4) and (5) read

    R = [[1 - A Dx^2, -A Dx Dy, S Dx], [-A Dx Dy, 1 - A Dy^2, S Dy], [-S Dx, -S Dy, cos D]],   t = l [A Dx, A Dy, S],

which is regular at D = 0. In the print, (1) and (4) have the second 1 in entry (2, 1), and (5) a prefactor l / theta
and factors d_i.
"""

import math

import numpy as np

from handover.cosim.blocks.ports import Floats

W_FROM_B = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""Factors that turn both points of a pose from B into W, and back: R_WB = diag(1, -1, -1), the mount at W's origin."""

_SERIES_BELOW = 0.05  # rad; both forms are exact to 1e-13 there
_TENDON_ANGLES = np.radians([0.0, 120.0, 240.0])
_TENDON_DIRECTIONS = np.array([np.cos(_TENDON_ANGLES), np.sin(_TENDON_ANGLES)])


def forward_kinematics(q: Floats, d_gripper: float) -> Floats:
    """Return X = f(q) = [p_BR, p_BG], shape (6,), in m: wrist, and gripper d_gripper beyond it, eqs. (6) and (12)."""
    pose: list[float] = []
    for d in (0.0, d_gripper):
        x, y, z = 0.0, 0.0, d
        for i in (6, 3, 0):
            Dx, Dy, l = q[i : i + 3].tolist()
            A, S, C, _, _ = _curvature_functions(Dx, Dy)
            m = l - Dx * x - Dy * y
            w = A * m + S * z
            x, y, z = x + Dx * w, y + Dy * w, S * m + C * z
        pose += (x, y, z)
    return np.array(pose)


def linearise(q: Floats, d_gripper: float) -> tuple[Floats, Floats]:
    """Return the pose X = f(q), shape (6,), and its Jacobian J = df/dq, shape (6, 9), of rank 5.

    The rank is 5 since the distance of wrist and gripper is fixed, eq. (13).
    """
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, d_gripper)]
    J = np.zeros((2, 3, 9))
    for i in (6, 3, 0):  # from the tip: points, and the columns found so far, are in the frame of the segment's end
        Dx, Dy, l = q[i : i + 3].tolist()
        A, S, C, a, s = _curvature_functions(Dx, Dy)
        if i < 6:
            J[:, :, i + 3 :] = _rotation(Dx, Dy, A, S, C) @ J[:, :, i + 3 :]
        for p, (x, y, z) in enumerate(points):
            m = l - Dx * x - Dy * y
            w = A * m + S * z
            dw = a * m + s * z  # along Dx: w changes by Dx dw - A x, z by Dx dz - S x; likewise along Dy
            dz = s * m - S * z
            wx, wy = Dx * dw - A * x, Dy * dw - A * y
            J[p, :, i : i + 3] = (
                (w + Dx * wx, Dx * wy, Dx * A),
                (Dy * wx, w + Dy * wy, Dy * A),
                (Dx * dz - S * x, Dy * dz - S * y, S),
            )
            points[p] = (x + Dx * w, y + Dy * w, S * m + C * z)
    return np.array(points[0] + points[1]), J.reshape(6, 9)


def orientation(q: Floats) -> Floats:
    """Return R_BG of eq. (5), shape (3, 3): of the arm's end, and so of wrist and gripper, without twist."""
    segments: list[Floats] = []
    for i in (0, 3, 6):
        Dx, Dy, _ = q[i : i + 3].tolist()
        segments.append(_rotation(Dx, Dy, *_curvature_functions(Dx, Dy)[:3]))
    return segments[0] @ segments[1] @ segments[2]


def tendon_lengths(q: Floats, d: float) -> Floats:
    """Return l_t = g(q), shape (9,), in m: tendons at d from the axis, at 0, 120 and 240 degrees in each segment."""
    segments = q.reshape(3, 3)
    return (segments[:, 2:] - d * segments[:, :2] @ _TENDON_DIRECTIONS).reshape(9)


def state_of(l_t: Floats, d: float) -> Floats:
    """Return the state q, shape (9,), of which `tendon_lengths` gives l_t, shape (9,), m: its inverse.

    Three tendons have two rotations and a length, so that each l_t is that of one state.
    """
    tendons = l_t.reshape(3, 3)
    rotations = -2.0 / (3.0 * d) * tendons @ np.transpose(_TENDON_DIRECTIONS)
    return np.column_stack([rotations, tendons.mean(axis=1)]).reshape(9)


def _curvature_functions(Dx: float, Dy: float) -> tuple[float, float, float, float, float]:
    """Return A, S, cos D, A'/D and S'/D."""
    DD = Dx * Dx + Dy * Dy
    D = math.sqrt(DD)
    if D < _SERIES_BELOW:
        A = 1 / 2 - DD * (1 / 24 - DD * (1 / 720 - DD / 40320))
        S = 1 - DD * (1 / 6 - DD * (1 / 120 - DD / 5040))
        a = -1 / 12 + DD * (1 / 180 - DD * (1 / 6720 - DD / 453600))
        s = -1 / 3 + DD * (1 / 30 - DD * (1 / 840 - DD / 45360))
        return A, S, math.cos(D), a, s
    return _closed_functions(D)


def _closed_functions(D: float) -> tuple[float, float, float, float, float]:
    A, S, C = 2 * (math.sin(D / 2) / D) ** 2, math.sin(D) / D, math.cos(D)
    return A, S, C, (S - 2 * A) / (D * D), (C - S) / (D * D)


def _rotation(Dx: float, Dy: float, A: float, S: float, C: float) -> Floats:
    return np.array(
        [
            [1 - A * Dx * Dx, -A * Dx * Dy, S * Dx],
            [-A * Dx * Dy, 1 - A * Dy * Dy, S * Dy],
            [-S * Dx, -S * Dy, C],
        ]
    )
