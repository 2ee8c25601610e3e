"""A free-flyer's model of itself with a moving arm: J, B, C of [Fernandes2020] eqs. (3.10)-(3.24), with twists.

xi' = (v_WB, w_WB, q_J'), (6 + n,), in W: with angular velocities for rates of Euler angles, N of eq. (3.4) is the
identity and Q of eq. (3.5) is R_WB^T. x' = (v_WG, w_WG).
"""

from dataclasses import dataclass

import numpy as np

from handover.controllers.free_flyer.body import FlyerBody
from handover.cosim.blocks.geometry import rotation_by, skew
from handover.cosim.blocks.plain_rotation import cross, vector
from handover.cosim.blocks.ports import Floats


@dataclass(frozen=True, kw_only=True)
class ArmModel:
    """Base and arm of n joints, by the first n rows and entries; at zero angles the links have the axes of B.

    Attributes:
        joints: n.
        mass, I_B: of the base, kg and (3, 3) kg m^2 about its centre of mass B.
        p_BG: gripper at zero angles, (3,), m.
        axes: unit vectors of the joints, (3, 3).
        links: from a link's joint to the next one's, or to G, (3, 3), m.
        centres: where along a link its centre of mass is, as a share of it, (3,).
        masses: of links, (3,), kg.
        inertias: principal moments of links, about their centres of mass, (3, 3), kg m^2.
        rotors: inertia of the drives' rotors about the joints, as seen behind their gears, (3,), kg m^2.
    """

    joints: int
    mass: float
    I_B: Floats
    p_BG: Floats
    axes: Floats
    links: Floats
    centres: Floats
    masses: Floats
    inertias: Floats
    rotors: Floats

    def faults(self) -> list[str]:
        """Return what is impossible for such a robot."""
        faults = FlyerBody(mass=self.mass, I_B=self.I_B, p_BG=self.p_BG).faults()
        for j in range(self.joints):
            if not abs(float(np.linalg.norm(self.axes[j])) - 1.0) <= 1e-6:
                faults.append(f"axis_J[{j + 1}] = {self.axes[j].tolist()} must be finite and not zero")
            if not 0.0 < self.masses[j] < np.inf:
                faults.append(f"mass_L[{j + 1}] = {self.masses[j]:g} kg must be positive and finite")
            small, middle, large = moments = sorted(float(moment) for moment in self.inertias[j])
            if not all(0.0 < moment < np.inf for moment in moments):
                faults.append(f"I_L[{j + 1}] = {moments} kg m2 must be positive and finite")
            elif large > (small + middle) * (1.0 + 1e-9):
                faults.append(f"I_L[{j + 1}] = {moments} kg m2: the largest may not exceed the sum of the others")
            if not np.all(np.isfinite(self.links[j])):
                faults.append(f"link[{j + 1}] = {self.links[j].tolist()} m must be finite")
        return faults

    def whole(self, q_J: Floats) -> FlyerBody:
        """Return base and arm as one body with fixed joints; its frame stands at the centre of mass, with B's axes."""
        chain = Chain(self, np.eye(3), np.zeros(3), q_J)
        M = mass_matrix(chain)[:6, :6]
        m, first = float(M[0, 0]), M[:3, 3:]
        c = np.array([first[1, 2], first[2, 0], first[0, 1]]) / m
        inertia = M[3:, 3:] - m * (c @ c * np.eye(3) - np.outer(c, c))
        return FlyerBody(mass=m, I_B=(inertia + np.transpose(inertia)) / 2.0, p_BG=chain.p[-1] - c)


class Chain:
    """The robot's links at an attitude R_WB (3, 3) and rate w_WB (3,) in W, and angles and rates of the joints (n,).

    Everything is in the axes of W, places seen from B.

    Attributes:
        axes, origins: of the joints, (n, 3).
        p: base, centres of mass of the links, and last the gripper, (n + 2, 3).
        R: orientation of base and links, (n + 1, 3, 3).
        w: angular velocity of base and links, (n + 1, 3).
        p_dot: velocities of p, as seen from B and in the axes of W, (n + 2, 3).
        axes_dot, origins_dot: rates of axes and origins, likewise.
    """

    def __init__(self, model: ArmModel, R_WB: Floats, w_WB: Floats, q_J: Floats, v_J: Floats | None = None) -> None:
        n = model.joints
        rates = np.zeros(n) if v_J is None else v_J
        root = R_WB @ (model.p_BG - np.sum(model.links[:n], axis=0))
        p, p_dot = np.zeros((n + 2, 3)), np.zeros((n + 2, 3))
        axes, origins = np.zeros((n, 3)), np.zeros((n, 3))
        axes_dot, origins_dot = np.zeros((n, 3)), np.zeros((n, 3))
        R, w = [R_WB], [np.asarray(w_WB)]
        end, end_dot = root, _cross(w_WB, root)
        for j in range(n):
            axes[j] = R[-1] @ model.axes[j]
            axes_dot[j] = _cross(w[-1], axes[j])
            origins[j], origins_dot[j] = end, end_dot
            R.append(R[-1] @ rotation_by(float(q_J[j]) * model.axes[j]))
            w.append(w[-1] + rates[j] * axes[j])
            along = R[-1] @ model.links[j]
            turning = _cross(w[-1], along)
            p[j + 1], p_dot[j + 1] = end + model.centres[j] * along, end_dot + model.centres[j] * turning
            end, end_dot = end + along, end_dot + turning
        p[-1], p_dot[-1] = end, end_dot
        self.model, self.R, self.w = model, np.array(R), np.array(w)
        self.axes, self.origins, self.p = axes, origins, p
        self.axes_dot, self.origins_dot, self.p_dot = axes_dot, origins_dot, p_dot

    def jacobian(self, i: int) -> Floats:
        """Return J (6, 6 + n) of place i of `p`: eq. (3.11); 0 is the base, n + 1 or -1 the gripper."""
        n = len(self.axes)
        place = i % (n + 2)
        J = np.zeros((6, 6 + n))
        J[:3, :3] = J[3:, 3:6] = np.eye(3)
        J[:3, 3:6] = -skew(self.p[place])
        for j in range(min(place, n)):
            J[:3, 6 + j] = _cross(self.axes[j], self.p[place] - self.origins[j])
            J[3:, 6 + j] = self.axes[j]
        return J

    def jacobian_rate(self, i: int) -> Floats:
        """Return J' (6, 6 + n) of place i of `p`, as in eq. (3.13)."""
        n = len(self.axes)
        place = i % (n + 2)
        J = np.zeros((6, 6 + n))
        J[:3, 3:6] = -skew(self.p_dot[place])
        for j in range(min(place, n)):
            r, r_dot = self.p[place] - self.origins[j], self.p_dot[place] - self.origins_dot[j]
            J[:3, 6 + j] = _cross(self.axes_dot[j], r) + _cross(self.axes[j], r_dot)
            J[3:, 6 + j] = self.axes_dot[j]
        return J

    def inertia(self, i: int) -> Floats:
        """Return the inertia (3, 3) of base (0) or link i about its centre of mass, in W."""
        I = self.model.I_B if i == 0 else np.diag(self.model.inertias[i - 1])
        return self.R[i] @ I @ np.transpose(self.R[i])

    def mass(self, i: int) -> float:
        """Return the mass of base (0) or link i, kg."""
        return self.model.mass if i == 0 else float(self.model.masses[i - 1])


def mass_matrix(chain: Chain) -> Floats:
    """Return B (6 + n, 6 + n), eq. (3.22): the sum of J_i^T diag(m_i, H_i) J_i over base and links, and the rotors."""
    n = len(chain.axes)
    total = np.diag([*np.zeros(6), *chain.model.rotors[:n]])
    for i in range(n + 1):
        J = chain.jacobian(i)
        total += chain.mass(i) * np.transpose(J[:3]) @ J[:3] + np.transpose(J[3:]) @ chain.inertia(i) @ J[3:]
    return total


def coriolis_matrix(chain: Chain) -> Floats:
    """Return C (6 + n, 6 + n) of eq. (3.23), with B' - 2 C skew: m J_v^T J_v' + J_w^T (H J_w' + [w]x H J_w), summed.

    Twists are no derivatives of coordinates, so Christoffel's symbols (3.24) do not hold for them; C xi' is the same.
    """
    n = len(chain.axes)
    total = np.zeros((6 + n, 6 + n))
    for i in range(n + 1):
        J, rate, H = chain.jacobian(i), chain.jacobian_rate(i), chain.inertia(i)
        total += chain.mass(i) * np.transpose(J[:3]) @ rate[:3]
        total += np.transpose(J[3:]) @ (H @ rate[3:] + skew(chain.w[i]) @ H @ J[3:])
    return total


@dataclass(frozen=True)
class OperationalSpace:
    """What a robot is at its gripper; errata of eq. (3.27) for J that is not square.

    Attributes:
        B_x: (J B^-1 J^T)^-1, (6, 6).
        J_bar: B^-1 J^T B_x, (6 + n, 6), J's dynamically consistent inverse: f_ext = J_bar^T u_ext.
        Z: motions that leave the gripper where it is, (6 + n, n), one for each joint: the base makes up for it.
        inertia: Z^T B Z, (n, n), that of these motions.
    """

    B_x: Floats
    J_bar: Floats
    Z: Floats
    inertia: Floats

    @classmethod
    def of(cls, J: Floats, B: Floats) -> "OperationalSpace":
        """Return it for a Jacobian J (6, 6 + n) and a mass matrix B."""
        compliance = np.linalg.solve(B, np.transpose(J))
        B_x: Floats = np.linalg.inv(J @ compliance).astype(np.float64)
        n = J.shape[1] - 6
        Z: Floats = np.vstack([-np.linalg.solve(J[:, :6], J[:, 6:]), np.eye(n)]).astype(np.float64)
        return cls(B_x=B_x, J_bar=compliance @ B_x, Z=Z, inertia=np.transpose(Z) @ B @ Z)


def operational_bias(J: Floats, J_rate: Floats, B: Floats, C: Floats, xi_dot: Floats) -> Floats:
    """Return C_x x' of eq. (3.26), (6,): B_x (J B^-1 C xi' - J' xi'), errata of eq. (3.27b)."""
    B_x = OperationalSpace.of(J, B).B_x
    return B_x @ (J @ np.linalg.solve(B, C @ xi_dot) - J_rate @ xi_dot)


def _cross(a: Floats, b: Floats) -> Floats:
    return np.array(cross(vector(a), vector(b)))
