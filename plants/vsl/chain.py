"""The pseudo-rigid chain that stands for the VSL arm's two upper links: its bodies, springs and masses."""

import math
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

    `torque` is what J2 and J3 hold their links with, in N m, positive upwards; `droop` is how far their servos turn
    short of what they aim at, in rad.
    """

    angles: Floats
    shears: Floats
    torque: tuple[float, float]
    droop: tuple[float, float]


class VslChain:
    """A plane pseudo-rigid chain: bodies on springs at their roots, that yield to shear along their own normals.

    A flexible link of length L has n hinges of compliance h / EI, h = (L - 2 cap) / n, in the middle of n equal pieces
    of its flexible part, so its first and last body are half a piece and a cap. A body of which the length f is
    flexible yields by s = V f / (shear_0 + p pi R^2) to the shear force V; EI = EI_0 + EI_p p. A rigid link has
    EI_rigid and does not shear. The springs at J2 and J3 are what yields behind the encoders.

    With u_k = (l_k + i s_k) exp(i phi_k) in the plane of the arm (real part outwards, imaginary part up), body i ends
    at the sum of u_k, k <= i; its mass is taken at the middle of u_i, with the inertia of an even rod.

    Args:
        params: of the arm.
        hinges: number of hinges of a flexible link.
    """

    def __init__(self, params: Params, hinges: int) -> None:
        self._params = params
        self._links = (params.link_2, params.link_3)
        both = (params.L_2, params.L_3)
        bodies = [_bodies(link, L, params.cap, hinges) for link, L in zip(self._links, both, strict=True)]
        self.elbow = len(bodies[0])
        """Index of the first body of link 3."""
        self.lengths = [length for link in bodies for length, _ in link]
        self.shearing = [shearing for link in bodies for _, shearing in link]
        """Lengths of what shears of each body, in m."""
        self._pieces = [(L - 2.0 * params.cap) / hinges for L in both]
        own = [params.link_mass * length / L for link, L in zip(bodies, both, strict=True) for length, _ in link]
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

    def springs(self, p: tuple[float, float]) -> Springs:
        """Return compliances at the pressures p of links 2 and 3, in Pa."""
        P = self._params
        hinge: list[float] = []
        shear: list[float] = []
        for link, (first, last) in enumerate(((0, self.elbow), (self.elbow, len(self)))):
            if self._links[link] is Link.VSL:
                bending = self._pieces[link] / (P.EI_0 + P.EI_p * p[link])
                give = 1.0 / (P.shear_0 + math.pi * P.R_link**2 * p[link])
            else:
                bending, give = self._pieces[link] / P.EI_rigid, 0.0
            hinge += [1.0 / P.joint_stiffness] + [bending] * (last - first - 1)
            shear += [give * f for f in self.shearing[first:last]]
        return Springs(hinge, shear)

    def ends(self, pose: Pose) -> Complexes:
        """Return the ends of the bodies seen from the shoulder, which comes first, (n + 1,), in m."""
        points = np.zeros(len(self) + 1, dtype=np.complex128)
        np.cumsum((self.lengths + 1j * pose.shears) * np.exp(1j * pose.angles), out=points[1:])
        return points

    def centre_line(self, ends: Complexes) -> Complexes:
        """Return evenly spaced points along both links, (24,), from the shoulder to the tip."""
        body, along = self._drawn
        return ends[body] + along * (ends[body + 1] - ends[body])

    def inertia_about_J1(self, pose: Pose, load: float) -> float:
        """Return the inertia of the masses about the vertical axis, in kg m2."""
        x = (self.lengths * np.cos(pose.angles)) - pose.shears * np.sin(pose.angles)
        return float(x @ (self.coupling + load) @ x)

    def _points(self, own: list[float]) -> tuple[Floats, Floats]:
        """Return the shares of u_k in the places of all masses, (n + 2, n), and those masses, (n + 2,)."""
        n = len(self)
        shares = np.tril(np.ones((n + 2, n)), -1)
        shares[np.arange(n), np.arange(n)] = 0.5
        shares[n, self.elbow :] = 0.0
        return shares, np.array([*own, self._params.servo_mass, self._params.gripper_mass])

    def _evenly_spaced(self) -> tuple[NDArray[np.intp], Floats]:
        """Return on which body, and where along it, from 0 to 1, the points of the centre line are."""
        starts = np.concatenate(([0.0], np.cumsum(self.lengths)))
        elbow = float(starts[self.elbow])
        upper: Floats = np.linspace(0.0, elbow, POINTS_A_LINK, endpoint=False)
        fore: Floats = np.linspace(elbow, float(starts[-1]), POINTS_A_LINK)
        s = np.concatenate((upper, fore))
        body = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, len(self) - 1)
        return body, (s - starts[body]) / np.array(self.lengths)[body]


def _bodies(link: Link, length: float, cap: float, hinges: int) -> list[tuple[float, float]]:
    """Return lengths of a link's bodies and of what shears of them, in m."""
    h = (length - 2.0 * cap) / hinges
    lengths = [cap + h / 2.0, *[h] * (hinges - 1), cap + h / 2.0]
    shearing = [h / 2.0, *[h] * (hinges - 1), h / 2.0]
    return [(l, s if link is Link.VSL else 0.0) for l, s in zip(lengths, shearing, strict=True)]
