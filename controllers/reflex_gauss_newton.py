"""Gauss-Newton on residuals that only moves can tell. [Luberto] eqs. (4) to (10).

The control inputs are x = [p_x, p_y, yaw, sigma] (m, m, rad, 1), of different units, and there are fewer residuals r
(m) than inputs. So the step depends on what a unit of each input is worth: x = S z with S = diag(scale) is declared,
and steps and updates are those of least norm in z.
"""

import numpy as np

from handover.cosim.blocks.ports import Floats

_RANK_TOLERANCE = 1e-12


def cost(r: Floats) -> float:
    """Return f = 1/2 r^T r, eq. (4), in m2."""
    return 0.5 * float(r @ r)


def minimum_norm_step(J: Floats, r: Floats, scale: Floats, damping: float) -> Floats:
    """Return dx = -S J_z^T (J_z J_z^T + damping^2 I)^-1 r with J_z = J S: eq. (9), with the inverse that exists.

    Of all steps that the linear residual cannot tell apart it is the shortest in z. The printed left pseudo-inverse
    asks for as many residuals as inputs.

    Args:
        J: Jacobian of the residuals, shape (residuals, 4), in m per unit of each input.
        r: residuals, shape (residuals,), in m.
        scale: diagonal of S, shape (4,); an input of scale 0 stays where it is.
        damping: lambda, in m, above 0.
    """
    Jz = J * scale
    return -scale * (np.transpose(Jz) @ np.linalg.solve(Jz @ np.transpose(Jz) + damping**2 * np.eye(len(r)), r))


def printed_step(J: Floats, r: Floats, free: Floats) -> Floats:
    """Return dx = -(J^T J)^+ J^T r: eq. (9) as printed, with the inverse of J^T J as a Moore-Penrose inverse.

    With fewer residuals than inputs J^T J is singular at any pose. Its Moore-Penrose inverse is the reading that
    leaves the equation as it is wherever it has a value: (J^T J)^+ J^T = J^+. The step then is the shortest in x as it
    stands, a metre counting as a radian and as a whole closure, without damping.

    Args:
        J: Jacobian of the residuals, shape (residuals, 4).
        r: residuals, shape (residuals,), in m.
        free: shape (4,), 1 where an input may move, 0 where it stays.
    """
    Jf = J * free
    return -np.linalg.pinv(np.transpose(Jf) @ Jf, rcond=_RANK_TOLERANCE, hermitian=True) @ np.transpose(Jf) @ r


def broyden_update(J: Floats, dx: Floats, dr: Floats, scale: Floats) -> Floats:
    """Return the Jacobian nearest to J (in z) that explains the last move: J' dx = dr. Broyden's first update."""
    z = dx / scale
    length2 = float(z @ z)
    return J if length2 == 0.0 else J + np.outer(dr - J @ dx, z / scale) / length2


def step_scaling(dx: Floats, alpha: float, max_step: Floats) -> float:
    """Return alpha of eq. (10): as given, or smaller so that no input moves farther than max_step, shape (4,)."""
    over = np.max(np.abs(dx) / max_step)
    return min(alpha, 1.0 / float(over)) if over > 0.0 else alpha


def bounded_step(
    J: Floats,
    r: Floats,
    x: Floats,
    *,
    scale: Floats | None,
    damping: float,
    alpha: float,
    max_step: Floats,
    limits: tuple[Floats, Floats],
) -> Floats:
    """Return x + alpha dx, eq. (10), within limits, shape (4,).

    An input that the step would take out of its limits stays, and the others take over its part. `scale` is that of
    `minimum_norm_step`; None takes `printed_step`.
    """
    low, high = limits
    free = np.ones(len(x))
    dx = np.zeros(len(x))
    for _ in range(len(x)):
        dx = printed_step(J, r, free) if scale is None else minimum_norm_step(J, r, scale * free, damping)
        dx = step_scaling(dx, alpha, max_step) * dx
        out = (free > 0.0) & (((x + dx > high) & (dx > 0.0)) | ((x + dx < low) & (dx < 0.0)))
        if not np.any(out):
            break
        free[out] = 0.0
    return np.clip(x + dx, low, high)
