"""A chain of rigid pieces on springs, as the controller's own model of how the VSL arm bends under its weight.

It is what learns least: three stiffnesses, and for commands the servos' droop. Weights and lengths are as a pair of
scales and a ruler give them; the load follows from the currents of joints 2 and 3. Law and weights are those of the
unit `VslArm`, so its errors there are smaller than on a real arm, of which no law is known exactly.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.learned_model import Domain
from handover.cosim.blocks.ports import Floats

Pair = tuple[Any, Any]
"""Of links or joints 2 and 3, or outwards and upwards: floats, or arrays of one shape."""

HINGES = 3
"""Of each link (own choice): of 12 the tip is 0.1 mm away."""

_ITERATIONS = 4
"""Of the fixed point, each of which leaves about a tenth of the error (own choice)."""

_SMALL = 1e-9
"""Square of a torque by load, (N m/kg)^2, that keeps the load finite where the arm stands upright."""

_DIFFERENCES = np.array([1e-5, 1e-5, 1e-5, 10.0, 10.0, 1e-4, 1e-4])
"""Of angles, rad, pressures, Pa, and currents, A, of which a Jacobian is made."""

MAX_LOAD = 0.3
"""Load up to which currents are believed, kg (assumed)."""


class Stiffness(NamedTuple):
    """What is fitted.

    Attributes:
        EI_0: bending stiffness of a link without pressure, N m2.
        EI_p: what pressure adds to it, N m2/Pa.
        joint: of gear and bracket of joints 2 and 3, behind the encoders, N m/rad.
    """

    EI_0: float
    EI_p: float
    joint: float


class Weights(NamedTuple):
    """What is known of the arm; assumed, but for the kind of motor.

    Attributes:
        link, elbow, gripper: masses of a link, of the servo at the elbow and of the gripper, kg.
        cap: length of the rigid cap at each end of a link, m.
        kt: torque by current, N m/A.
        gravity: m/s2.
    """

    link: float = 0.14
    elbow: float = 0.125
    gripper: float = 0.035
    cap: float = 0.03
    kt: float = 1.78
    gravity: float = 9.81


@dataclass(frozen=True)
class Beam:
    """Links 2 and 3 as pieces on springs, in the plane that joint 1 turns.

    A link has `HINGES` hinges of compliance h / (EI_0 + EI_p p), h the length of its flexible part for each, in the
    middle of as many equal pieces; the joints yield by 1 / joint. With phi_k from the horizontal the pieces' ends are
    at the sums of l_k exp(i phi_k); each weight's torque on a hinge is its horizontal distance from it. phi follows
    from the torques and they from phi: a fixed point. The load is what explains the currents of both joints best.

    All quantities are floats, or arrays of one shape: of one point it is computed in Python's own numbers, which
    takes a tenth of the time of arrays as small as that.
    """

    kinematics: VslKinematics
    stiffness: Stiffness
    weights: Weights

    def bent(self, q: Pair, p: Pair, i: Pair) -> tuple[Pair, Pair]:
        """Return where the tip is as seen from the shoulder, outwards and upwards, m, and the joints' torques, N m.

        Args:
            q: angles of joints 2 and 3 by the encoders, rad.
            p: pressures, Pa.
            i: currents of joints 2 and 3, A.
        """
        m, compliances, straight = _math_of(q[0]), self._compliances(p), self._straight(q)
        phi, torques = straight, (q[0], q[0])
        for _ in range(_ITERATIONS):
            phi, torques = self._sagged(m, straight, phi, compliances, i)
        by_2, by_3 = self._steps(m, phi)
        return (by_2[0] + by_3[0], by_2[1] + by_3[1]), torques

    def commanded(self, tip: Pair, q: Pair, p: Pair, i: Pair) -> tuple[Pair, Pair]:
        """Return the encoders' angles at which the tip is where it is wanted, rad, and the joints' torques there, N m.

        Args:
            tip: as seen from the shoulder, outwards and upwards, m.
            q: angles of joints 2 and 3 of a rigid arm there, rad.
            p: pressures, Pa.
            i: currents of joints 2 and 3, A.
        """
        m, compliances = _math_of(q[0]), self._compliances(p)
        phi, torques = self._straight(q), (q[0], q[0])
        for _ in range(_ITERATIONS):
            phi, torques = self._sagged(m, self._straight(q), phi, compliances, i)
            turn = _newton_turn(*self._steps(m, phi), tip)
            q = q[0] + turn[0], q[1] + turn[1]
            phi = [a + b for a, b in zip(phi, self._straight(turn), strict=True)]
        return q, torques

    def _sagged(self, m: Any, straight: list[Any], phi: list[Any], compliances: list[Any], i: Pair) -> tuple[Any, Pair]:
        """Return the pieces' angles under the torques that they have at angles phi, and those of the joints."""
        own, by_load = 0.0, 0.0  # torques on a hinge: of the arm itself, N m, and by the load, N m/kg
        owns, by_loads = list[Any](), list[Any]()
        for angle, (pull, mass) in zip(reversed(phi), self._pulls, strict=True):
            x = pull * m.cos(angle)
            own, by_load = own + mass * x, by_load + x
            owns.append(own)
            by_loads.append(by_load)
        own_2, own_3, by_load_2, by_load_3 = owns[-1], owns[HINGES], by_loads[-1], by_loads[HINGES]
        left_2, left_3 = self.weights.kt * i[0] - own_2, self.weights.kt * i[1] - own_3
        squares = by_load_2 * by_load_2 + by_load_3 * by_load_3 + _SMALL
        load = m.clamp((by_load_2 * left_2 + by_load_3 * left_3) / squares)
        sag, sagged = 0.0, list[Any]()
        for straight_k, c, own, by_load in zip(straight, compliances, reversed(owns), reversed(by_loads), strict=True):
            sag = sag + c * (own + load * by_load)
            sagged.append(straight_k - sag)
        return sagged, (own_2 + load * by_load_2, own_3 + load * by_load_3)

    def _steps(self, m: Any, phi: list[Any]) -> tuple[Pair, Pair]:
        """Return how far each link goes, outwards and upwards, m."""
        n, L = HINGES + 1, self._lengths
        x = [l * m.cos(angle) for l, angle in zip(L, phi, strict=True)]
        z = [l * m.sin(angle) for l, angle in zip(L, phi, strict=True)]
        return (sum(x[:n]), sum(z[:n])), (sum(x[n:]), sum(z[n:]))

    def _straight(self, q: Pair) -> list[Any]:
        """Return the angles of all pieces from the horizontal of an arm that does not bend."""
        return [q[0]] * (HINGES + 1) + [q[0] + q[1]] * (HINGES + 1)

    def _compliances(self, p: Pair) -> list[Any]:
        """Return the compliance at the root of each piece, rad/(N m)."""
        s, parts = self.stiffness, list[Any]()
        for h, pressure in zip(self._parts, p, strict=True):
            parts += [1.0 / s.joint, *[h / (s.EI_0 + s.EI_p * pressure)] * HINGES]
        return parts

    @cached_property
    def _parts(self) -> list[float]:
        k = self.kinematics
        return [(L - 2.0 * self.weights.cap) / HINGES for L in (k.L_2, k.L_3)]

    @cached_property
    def _lengths(self) -> list[float]:
        cap = self.weights.cap
        return [l for h in self._parts for l in (cap + h / 2.0, *[h] * (HINGES - 1), cap + h / 2.0)]

    @cached_property
    def _pulls(self) -> list[tuple[float, float]]:
        """Return gravity times length of each piece, N m/kg, and mass on its end and half its own, kg; tip first."""
        w, n = self.weights, HINGES + 1
        lengths = [self.kinematics.L_2] * n + [self.kinematics.L_3] * n
        masses = [w.link * l / L for l, L in zip(self._lengths, lengths, strict=True)]
        beyond = [sum(masses[k + 1 :]) + w.gripper + (w.elbow if k < n else 0.0) for k in range(2 * n)]
        pulls = [(w.gravity * l, b + m / 2.0) for l, b, m in zip(self._lengths, beyond, masses, strict=True)]
        return pulls[::-1]


class _OfFloats:
    cos, sin = math.cos, math.sin

    @staticmethod
    def clamp(load: float) -> float:
        return min(max(load, 0.0), MAX_LOAD)


class _OfArrays:
    cos, sin = np.cos, np.sin

    @staticmethod
    def clamp(load: Floats) -> Floats:
        return np.clip(load, 0.0, MAX_LOAD)


def _math_of(value: Any) -> Any:
    return _OfFloats if isinstance(value, float) else _OfArrays


def _newton_turn(link_2: Pair, link_3: Pair, tip: Pair) -> Pair:
    """Return the turns of joints 2 and 3 that bring the tip of links of these steps where it is wanted, rad.

    An arm that is stretched out exactly, at which no turn of a joint brings the tip nearer, is left as it is.
    """
    x, z = link_2[0] + link_3[0], link_2[1] + link_3[1]
    off_x, off_z = tip[0] - x, tip[1] - z
    determinant = link_3[0] * -z + link_3[1] * x
    if isinstance(determinant, float) and determinant == 0.0:
        return 0.0, 0.0
    return (off_x * link_3[0] + off_z * link_3[1]) / determinant, -(off_x * x + off_z * z) / determinant


@dataclass(frozen=True)
class BentTip(Domain):
    """Eq. (10) by a `Beam`: how far the tip is off where encoders and rigid links put it, in the arm's plane."""

    beam: Beam

    @property
    def domain(self) -> Domain:
        """The inputs that the beam was fitted on."""
        return self

    def predict(self, x: Floats) -> Floats:
        """Return outwards, sideways and upwards, shape (..., 3), m, of inputs x, shape (..., 7)."""
        q, p, i = _pairs(x)
        tip, _ = self.beam.bent(q, p, i)
        rigid = _rigid(self.beam.kinematics, q)
        return _vectors(tip[0] - rigid[0], 0.0, tip[1] - rigid[1])

    def jacobian(self, x: Floats) -> Floats:
        """Return dy/dx at inputs x, shape (7,), as shape (3, 7), by central differences."""
        return _differenced(self, x)


@dataclass(frozen=True)
class BentCommand(Domain):
    """Eq. (11) by a `Beam`: by how much joints must turn further than a rigid arm's, the servos' droop included.

    Attributes:
        droop: turn by which a servo falls short of its command, rad/(N m), as its encoder shows.
    """

    beam: Beam
    droop: float

    @property
    def domain(self) -> Domain:
        """The inputs that the beam was fitted on."""
        return self

    def predict(self, x: Floats) -> Floats:
        """Return turns of all joints, shape (..., 3), rad, of inputs x, shape (..., 7)."""
        q, p, i = _pairs(x)
        turned, torque = self.beam.commanded(_rigid(self.beam.kinematics, q), q, p, i)
        turns = [turned[k] - q[k] + self.droop * torque[k] for k in range(2)]
        return _vectors(0.0, *turns)

    def jacobian(self, x: Floats) -> Floats:
        """Return dy/dx at inputs x, shape (7,), as shape (3, 7), by central differences."""
        return _differenced(self, x)


def _pairs(x: Floats) -> tuple[Pair, Pair, Pair]:
    """Return angles, pressures and currents of joints 2 and 3 of inputs x, shape (..., 7): floats of a single one."""
    values: list[Any] = x.tolist() if x.ndim == 1 else list(np.moveaxis(x, -1, 0))
    return (values[1], values[2]), (values[3], values[4]), (values[5], values[6])


def _vectors(first: Any, second: Any, third: Any) -> Floats:
    """Return what has these coordinates, shape (..., 3)."""
    if isinstance(third, float):
        return np.array([first, second, third])
    return np.stack(np.broadcast_arrays(first, second, third), axis=-1)


def _rigid(k: VslKinematics, q: Pair) -> Pair:
    """Return a rigid arm's tip as seen from the shoulder, outwards and upwards, m."""
    m = _math_of(q[0])
    outwards = k.L_2 * m.cos(q[0]) + k.L_3 * m.cos(q[0] + q[1])
    return outwards, k.L_2 * m.sin(q[0]) + k.L_3 * m.sin(q[0] + q[1])


def _differenced(bent: BentTip | BentCommand, x: Floats) -> Floats:
    shifts = np.diag(_DIFFERENCES)
    y = bent.predict(np.concatenate([x + shifts, x - shifts]))
    return np.transpose((y[:7] - y[7:]) / (2.0 * _DIFFERENCES[:, None]))


def stiffness_at(logarithms: Floats) -> Stiffness:
    """Return stiffnesses of which the logarithms are given, shape (3,)."""
    return Stiffness(*(math.exp(v) for v in logarithms.tolist()))
