"""The pseudo-rigid chain that stands for the VSL arm's upper links: its bodies, springs and masses."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.parameters import Link, Params

Complexes = NDArray[np.complex128]

POINTS_A_LINK = 12


class Springs(NamedTuple):
    """Compliances at some pressure: of the hinge at each body's root, rad/(N m), and of its shear, m/N (0: none)."""

    hinge: list[float]
    shear: list[float]


class Pose(NamedTuple):
    """Where the chain is: angles from the horizontal, rad, and shears, m, of all bodies, from shoulder to tip.

    `torque` is what the chain's joints, J2 and J3, hold their links with, in N m, positive upwards; `droop` is how far
    their servos turn short of what they aim at, in rad.
    """

    angles: Floats
    shears: Floats
    torque: tuple[float, ...]
    droop: tuple[float, ...]


class _Body(NamedTuple):
    """Length, the length of what shears of it, m, and mass, kg."""

    length: float
    shearing: float
    mass: float


class VslChain:
    """A plane pseudo-rigid chain: bodies on springs at their roots, that yield to shear along their own normals.

    A flexible link of length L has n hinges of compliance h / EI, h = (L - 2 cap) / n, in the middle of n equal pieces
    of its flexible part, so its first and last body are half a piece and a cap. A body of which the length f is
    flexible yields by s = V f / (shear_0 + p pi R^2) to the shear force V; EI = EI_0 + EI_p p. A rigid link has
    EI_rigid and does not shear. The springs at J2 and J3 are what yields behind the encoders. A third link is screwed
    to link 3: the last body of the one and the first of the other are one body.

    With u_k = (l_k + i s_k) exp(i phi_k) in the plane of the arm (real part outwards, imaginary part up), body i ends
    at the sum of u_k, k <= i; its mass is taken at the middle of u_i, with the inertia of an even rod.

    Args:
        params: of the arm.
        hinges: number of hinges of a flexible link.
    """

    def __init__(self, params: Params, hinges: int) -> None:
        self._params = params
        self._kinds = params.kinds
        links = [
            _bodies(kind, L, params.cap, hinges, params.link_mass * factor)
            for kind, L, factor in zip(self._kinds, params.lengths, params.mass_factor.tolist(), strict=False)
        ]
        self._shearing = [[body.shearing for body in link] for link in links]
        self._pieces = [(L - 2.0 * params.cap) / hinges for L in params.lengths]
        self._EI_factor = params.EI_factor.tolist()
        self._joint = (params.joint_stiffness * params.joint_factor).tolist()
        bodies = [body for link in links[:2] for body in link]
        self.joints = [0, len(links[0])][: len(links)]
        """Indices of the bodies at J2 and, if there is one, J3."""
        self.sensors = [(n - 1, 1.0) for n in (len(links[0]), len(bodies))][: len(links)]
        """Where a link's inertial sensor is, at its end: on which body, and where along that, from 0 to 1."""
        for link in links[2:]:
            last, first = bodies.pop(), link[0]
            self.sensors[-1] = len(bodies), last.length / (last.length + first.length)
            bodies += [_Body(*(a + b for a, b in zip(last, first, strict=True))), *link[1:]]
            self.sensors.append((len(bodies) - 1, 1.0))
        self.lengths = [body.length for body in bodies]
        self.shearing = [body.shearing for body in bodies]
        """Lengths of what shears of each body, in m."""
        own = [body.mass for body in bodies]
        self.inertia = np.array(own) * np.square(self.lengths) / 12.0
        """Of each body about its middle, in kg m2."""
        shares, masses = self._points(own)
        self.coupling = np.transpose(shares * masses[:, None]) @ shares
        """C of the kinetic energy, the sum of C_kj Re(u_k' conj(u_j')) / 2, without load, (n, n), in kg."""
        self.carried = masses @ shares
        """Mass that u_k lifts, without load, (n,), in kg."""
        self._drawn = self._evenly_spaced()

    def __len__(self) -> int:
        return len(self.lengths)

    def springs(self, p: Sequence[float]) -> Springs:
        """Return compliances at the links' pressures p, in Pa."""
        P = self._params
        hinge: list[float] = []
        shear: list[float] = []
        for link, (first, *others) in enumerate(self._shearing):
            if self._kinds[link] is Link.VSL:
                bending = self._pieces[link] / ((P.EI_0 + P.EI_p * p[link]) * self._EI_factor[link])
                give = 1.0 / (P.shear_0 + math.pi * P.R_link**2 * p[link])
            else:
                bending, give = self._pieces[link] / (P.EI_rigid * self._EI_factor[link]), 0.0
            if link < len(self.joints):
                hinge.append(1.0 / self._joint[link])
                shear.append(give * first)
            else:
                shear[-1] += give * first
            hinge += [bending] * len(others)
            shear += [give * f for f in others]
        return Springs(hinge, shear)

    def ends(self, pose: Pose) -> Complexes:
        """Return the ends of the bodies seen from the shoulder, which comes first, (n + 1,), in m."""
        points = np.zeros(len(self) + 1, dtype=np.complex128)
        np.cumsum((self.lengths + 1j * pose.shears) * np.exp(1j * pose.angles), out=points[1:])
        return points

    def centre_line(self, ends: Complexes) -> Complexes:
        """Return evenly spaced points along the links, (24,), from the shoulder to the tip."""
        body, along = self._drawn
        return ends[body] + along * (ends[body + 1] - ends[body])

    def inertia_about_J1(self, pose: Pose, load: float) -> float:
        """Return the inertia of the masses about the vertical axis, in kg m2."""
        x = (self.lengths * np.cos(pose.angles)) - pose.shears * np.sin(pose.angles)
        return float(x @ (self.coupling + load) @ x)

    def _points(self, own: list[float]) -> tuple[Floats, Floats]:
        """Return the shares of u_k in the places of all masses, (m, n), and those masses, (m,).

        They are the bodies', that of the servo J3, if there is one, and that of the gripper.
        """
        n, servos = len(self), self.joints[1:]
        shares = np.tril(np.ones((n + len(servos) + 1, n)), -1)
        shares[np.arange(n), np.arange(n)] = 0.5
        for row, elbow in enumerate(servos, n):
            shares[row, elbow:] = 0.0
        return shares, np.array([*own, *(self._params.servo_mass for _ in servos), self._params.gripper_mass])

    def _evenly_spaced(self) -> tuple[NDArray[np.intp], Floats]:
        """Return on which body, and where along it, from 0 to 1, the points of the centre line are.

        Half of them are before the elbow.
        """
        starts = np.concatenate(([0.0], np.cumsum(self.lengths)))
        tip = float(starts[-1])
        if len(self.joints) == 1:
            s: Floats = np.linspace(0.0, tip, 2 * POINTS_A_LINK)
        else:
            elbow = float(starts[self.joints[1]])
            upper: Floats = np.linspace(0.0, elbow, POINTS_A_LINK, endpoint=False)
            s = np.concatenate((upper, np.linspace(elbow, tip, POINTS_A_LINK)))
        body = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, len(self) - 1)
        return body, (s - starts[body]) / np.array(self.lengths)[body]


def _bodies(kind: Link, L: float, cap: float, hinges: int, mass: float) -> list[_Body]:
    """Return a link's bodies."""
    h = (L - 2.0 * cap) / hinges
    lengths = [cap + h / 2.0, *[h] * (hinges - 1), cap + h / 2.0]
    shearing = [h / 2.0, *[h] * (hinges - 1), h / 2.0]
    return [_Body(l, s if kind is Link.VSL else 0.0, mass * l / L) for l, s in zip(lengths, shearing, strict=True)]
