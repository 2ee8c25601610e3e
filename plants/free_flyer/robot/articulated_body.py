"""A floating base with a serial arm, in momenta: [Fernandes2020] eqs. (3.18)-(3.24) with twists for Euler angles."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Matrix,
    Quaternion,
    Vector,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    inverse_rotate,
    normalize,
    quaternion_add_scaled,
    quaternion_dot,
    quaternion_multiply,
    quaternion_runge_kutta_step,
    rotate,
    rotation_matrix,
    runge_kutta_step,
    scale,
    subtract,
    weighted_sum,
)
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.rigid_body import TurnsTooFast, Wrenches
from handover.plants.free_flyer.robot.arm import Arm, Joints, Posture

_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

State = tuple[Vector, Quaternion, Vector, Vector, Joints, Joints]
"""p_WC, q_WB, v_WC, L, q_J, momenta of the joints; C is the centre of mass of all."""


class Rates(NamedTuple):
    """Acceleration of C, L', q', q_J', and what changes the joints' momenta."""

    v: Vector
    L: Vector
    q: Quaternion
    q_J: Joints
    momenta: Joints


class ArticulatedBody:
    """Motion of base and links as their momenta drive it: h = H nu with nu = (w, q_J'), T = m v_C^2 / 2 + nu H nu / 2.

    In the axes of B and about the centre of mass C of all, L_B = R^T L and the joints' momenta pi are h = H(q_J) nu.
    H is B of eq. (3.22) without the motion of C, which a force alone changes: m v_C' = f. Then
    L' = moment of all forces about C + torques, pi_j' = dT/dq_j (nu held) + tau_j + J_j^T (wrenches), and with
    u_i, w_i velocity (less v_C) and angular velocity of link i,
    dT/dq_j = sum over i >= j of m_i u_i . (w_{j-1} x J_ij + a_j x s_ij) + (I_i w_i) . (w_{j-1} x a_j),
    where a_j is the joint's axis, J_ij = a_j x (r_i - o_j), and s_ij what joints j to i contribute to the velocity of
    link i. This is eq. (3.23); its C xi' is hidden in the momenta. So linear and angular momentum stay what they are,
    to the last bit, without wrench.

    Joints that are held do not turn: they have no equation, and their momentum follows from the others' motion.

    Args:
        mass: of the base, kg.
        I_B: inertia of the base about its centre of mass, (3, 3), kg m^2, positive definite.
        arm: the arm.
    """

    def __init__(self, mass: float, I_B: Floats, arm: Arm) -> None:
        self.arm = arm
        self.mass = mass + sum(arm.masses)
        self._roots: list[list[float]] = np.transpose(np.linalg.cholesky(I_B)).tolist()
        self._base = math.sqrt(mass)
        self._links = tuple(math.sqrt(m) for m in arm.masses)
        self._moments = tuple((math.sqrt(x), math.sqrt(y), math.sqrt(z)) for x, y, z in arm.inertias)
        self._rotors = np.diag([0.0, 0.0, 0.0, *arm.rotors])

    def posture(self, q_J: Joints) -> Posture:
        """Return where the arm is at angles in rad."""
        return Posture(self.arm, q_J, self.mass)

    def inertia(self, posture: Posture) -> Floats:
        """Return H (3 + n, 3 + n) as the product of its factor: each body's motion, times the root of its inertia."""
        c, shifts = posture.p_BC, posture.shifts
        rows: list[list[float]] = []
        for i, root in enumerate((self._base, *self._links)):
            d = subtract(posture.centres[i - 1], c) if i else scale(-1.0, c)
            moves = [cross(e, d) for e in _AXES]
            own = [column[i - 1] if i else ZERO for column in posture.columns]
            moves += [subtract(column, shift) for column, shift in zip(own, shifts, strict=True)]
            rows += [[root * move[k] for move in moves] for k in range(3)]
        idle = [0.0] * len(shifts)
        rows += [[*row, *idle] for row in self._roots]
        for i, (R, roots) in enumerate(zip(posture.turns, self._moments, strict=True)):
            turns = [inverse_rotate(R, e) for e in _AXES]
            turns += [inverse_rotate(R, a) if j <= i else ZERO for j, a in enumerate(posture.axes)]
            rows += [[roots[k] * turn[k] for turn in turns] for k in range(3)]
        G = np.array(rows)
        return np.transpose(G) @ G + self._rotors

    def rates(self, state: State, wrench: Wrenches, tau_J: Joints, drag: Joints, moving: Sequence[int]) -> Rates:
        """Return the rates of a state.

        Args:
            state: of base and arm.
            wrench: f_B and tau_B in B, f_G and tau_G in W, N and N m.
            tau_J: torques on the joints, N m.
            drag: torques against the joints' motion, N m s/rad times q_J'.
            moving: indices of the joints that are not held.
        """
        _, q, _, L, q_J, momenta = state
        R = rotation_matrix(q)
        posture = self.posture(q_J)
        w, v_J = self.velocities(posture, inverse_rotate(R, L), momenta, moving)
        c, shifts = posture.p_BC, posture.shifts
        f_B, tau_B, f_G, tau_G = wrench
        g_B, t_B = inverse_rotate(R, f_G), inverse_rotate(R, tau_G)
        f, arm = add(f_B, g_B), subtract(posture.p_BG, c)
        torque = add_cross(subtract(add(tau_B, t_B), cross(c, f_B)), arm, g_B)
        dL, a = rotate(R, torque), scale(1.0 / self.mass, rotate(R, f))
        along = self._energy_slopes(posture, w, v_J)
        dpi: list[float] = []
        for j, (axis, origin) in enumerate(zip(posture.axes, posture.origins, strict=True)):
            reach = cross(axis, subtract(posture.p_BG, origin))
            load = dot(reach, g_B) + dot(axis, t_B) - dot(shifts[j], f)
            dpi.append(along[j] + tau_J[j] + load - drag[j] * v_J[j])
        dq = quaternion_multiply(q, (0.0, *scale(0.5, w)))
        return Rates(a, dL, dq, v_J, tuple(dpi))

    def velocities(
        self, posture: Posture, L_B: Vector, momenta: Joints, moving: Sequence[int]
    ) -> tuple[Vector, Joints]:
        """Return w in the axes of B and q_J', which is zero for joints that are held."""
        return self._solve(self.inertia(posture), L_B, momenta, moving)

    def _solve(self, H: Floats, L_B: Vector, momenta: Joints, moving: Sequence[int]) -> tuple[Vector, Joints]:
        free = [0, 1, 2, *(3 + j for j in moving)]
        part = H if len(moving) == len(momenta) else H[np.ix_(free, free)]
        nu = np.linalg.solve(part, [*L_B, *(momenta[j] for j in moving)]).tolist()
        v_J = [0.0] * len(momenta)
        for j, v in zip(moving, nu[3:], strict=True):
            v_J[j] = v
        return (nu[0], nu[1], nu[2]), tuple(v_J)

    def runge_kutta_step(
        self, state: State, h: float, wrench: Wrenches, tau_J: Joints, drag: Joints, moving: Sequence[int]
    ) -> tuple[State, Joints]:
        """Return the state h seconds later, and the means of what changed the joints' momenta.

        The momenta of joints that are held are not those of that state: see `settle`.

        Raises:
            TurnsTooFast: the turn is so large that the quaternion's norm leaves 1 by 0.005.
        """
        p, q, v, L, q_J, pi = state

        def at(s: float, k: Rates) -> Rates:
            turned, spun = quaternion_add_scaled(q, s, k.q), add_scaled(L, s, k.L)
            middle = p, turned, v, spun, _ahead(q_J, s, k.q_J), _ahead(pi, s, k.momenta)
            return self.rates(middle, wrench, tau_J, drag, moving)

        a = self.rates(state, wrench, tau_J, drag, moving)
        b = at(0.5 * h, a)
        c = at(0.5 * h, b)
        d = at(h, c)
        turned = quaternion_runge_kutta_step(q, h, a.q, b.q, c.q, d.q)
        if not 0.99 < quaternion_dot(turned, turned) < 1.01:
            raise TurnsTooFast(2.0 * math.sqrt(quaternion_dot(a.q, a.q)), h)
        mean = _mean_rates(a.momenta, b.momenta, c.momenta, d.momenta)
        after = (
            weighted_sum(1.0, p, h, v, h * (h / 6.0), add(add(a.v, b.v), c.v)),
            normalize(turned),
            runge_kutta_step(v, h, a.v, b.v, c.v, d.v),
            runge_kutta_step(L, h, a.L, b.L, c.L, d.L),
            _ahead(q_J, h, _mean_rates(a.q_J, b.q_J, c.q_J, d.q_J)),
            _ahead(pi, h, mean),
        )
        return after, mean

    def settle(self, state: State, moving: Sequence[int]) -> tuple[State, Joints]:
        """Return the state with the momenta that held joints have by the others' motion, and q_J'."""
        p, q, v, L, q_J, pi = state
        H = self.inertia(self.posture(q_J))
        w, v_J = self._solve(H, inverse_rotate(rotation_matrix(q), L), pi, moving)
        found = (H[3:] @ np.array([*w, *v_J])).tolist()
        kept = tuple(pi[j] if j in moving else found[j] for j in range(len(pi)))
        return (p, q, v, L, q_J, kept), v_J

    def energy(self, state: State, moving: Sequence[int]) -> float:
        """Return the kinetic energy, in J."""
        _, q, v, L, q_J, pi = state
        L_B = inverse_rotate(rotation_matrix(q), L)
        w, v_J = self.velocities(self.posture(q_J), L_B, pi, moving)
        turning = dot(w, L_B) + sum(a * b for a, b in zip(v_J, pi, strict=True))
        return 0.5 * (self.mass * dot(v, v) + turning)

    def _energy_slopes(self, posture: Posture, w: Vector, v_J: Joints) -> list[float]:
        """Return dT/dq_j with w and q_J' held."""
        columns, shifts = posture.columns, posture.shifts
        drift = ZERO
        for v, shift in zip(v_J, shifts, strict=True):
            drift = add_scaled(drift, v, shift)
        c, turning, before = posture.p_BC, w, list[Vector]()
        slopes = [0.0] * len(v_J)
        for i, (axis, rate) in enumerate(zip(posture.axes, v_J, strict=True)):
            before.append(turning)
            turning = add_scaled(turning, rate, axis)
            s, own = ZERO, list[Vector]()
            for j in range(i, -1, -1):
                s = add_scaled(s, v_J[j], columns[j][i])
                own.append(s)
            u = subtract(add_cross(s, w, subtract(posture.centres[i], c)), drift)
            push = scale(self.arm.masses[i], u)
            spin = _spin(posture.turns[i], self.arm.inertias[i], turning)
            for j in range(i + 1):
                a = posture.axes[j]
                slopes[j] += dot(push, add_cross(cross(before[j], columns[j][i]), a, own[i - j]))
                slopes[j] += dot(spin, cross(before[j], a))
        return slopes


def _spin(R: Matrix, moments: Vector, w: Vector) -> Vector:
    """Return R diag(moments) R^T w."""
    x, y, z = inverse_rotate(R, w)
    a, b, c = moments
    return rotate(R, (a * x, b * y, c * z))


def _ahead(y: Joints, h: float, rate: Joints) -> Joints:
    return tuple(a + h * b for a, b in zip(y, rate, strict=True))


def _mean_rates(k_1: Joints, k_2: Joints, k_3: Joints, k_4: Joints) -> Joints:
    """Return the mean rate over a step by the classical rule of order 4."""
    return tuple((a + 2.0 * (b + c) + d) / 6.0 for a, b, c, d in zip(k_1, k_2, k_3, k_4, strict=True))
