"""The two-mass oscillator, coupled by force and displacement, in three forms. [Busch2016], sec. 2.4

A mass takes the force and gives its position and speed; a sprung mass, which holds the spring and the damper between
them, takes those and gives the force.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from native_units import native_fmu
from numpy.typing import NDArray
from scipy.linalg import expm

from handover.cosim.system.system import System

Floats = NDArray[np.float64]
SIGNALS = ("a.x", "a.v", "b.x", "b.v")


@dataclass(frozen=True)
class TwoMasses:
    """Parameters: masses in kg, springs in N/m, dampers in N.s/m; `c` is the coupling. It starts at x = 1 m, v = 0."""

    k_c: float
    d_c: float = 0.1
    k: float = 4.0
    d: float = 0.1
    m: float = 1.0

    def system(self, period: Fraction, fmi: int = 3, **flags: bool) -> System:
        """Return it as two units."""
        s = System()
        own: Mapping[str, Any] = {"m": self.m, "k": self.k, "d": self.d, "x0": 1.0}
        a = s.add("a", native_fmu("mass", fmi, **flags), period=period, **own)
        b = s.add("b", native_fmu("sprung_mass", fmi, **flags), period=period, k_c=self.k_c, d_c=self.d_c, **own)
        s.connect(a.y.x, b.u.x1)
        s.connect(a.y.v, b.u.v1)
        s.connect(b.y.f, a.u.f)
        return s

    def exact(self, t: float) -> Floats:
        """Return positions and speeds at a time, in the order of SIGNALS, by the matrix exponential."""
        k, d, m = self.k + self.k_c, self.d + self.d_c, self.m
        ends = [-k / m, -d / m, self.k_c / m, self.d_c / m]
        A = np.array([[0, 1, 0, 0], ends, [0, 0, 0, 1], [*ends[2:], *ends[:2]]])
        return expm(A * t) @ START

    def implicit(self, dt: float, n: int) -> Floats:
        """Return the states after n steps dt in each of which units get what the other one gives at its end."""
        a, in_a, b, in_b, C = self._held(dt)
        # z = a z0 + in_a f of mass a, w = b w0 + in_b z of mass b, f = C (w - z)
        left = np.block([[np.eye(2) + in_a @ C, -in_a @ C], [-in_b, np.eye(2)]])
        right = np.block([[a, np.zeros((2, 2))], [np.zeros((2, 2)), b]])
        return np.linalg.matrix_power(np.linalg.solve(left, right), n) @ START

    def gain(self, dt: float) -> float:
        """Return by how much the force that comes out at the end of a step changes with the force that goes in."""
        _, in_a, _, in_b, C = self._held(dt)
        return float((C @ (in_b - np.eye(2)) @ in_a)[0, 0])

    def _held(self, dt: float) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        k, d = self.k + self.k_c, self.d + self.d_c
        a = held([[0, 1], [-self.k / self.m, -self.d / self.m]], [[0], [1 / self.m]], dt)
        b = held([[0, 1], [-k / self.m, -d / self.m]], [[0, 0], [self.k_c / self.m, self.d_c / self.m]], dt)
        return *a, *b, np.array([[self.k_c, self.d_c]])


START = np.array([1.0, 0.0, 1.0, 0.0])


def held(a: object, b: object, dt: float) -> tuple[Floats, Floats]:
    """Return x(t + dt) = a x(t) + b u of x' = A x + B u with u held."""
    A, B = np.array(a, dtype=np.float64), np.array(b, dtype=np.float64)
    n, m = B.shape
    whole = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt)
    return whole[:n, :n], whole[:n, n:]
