"""The two-mass oscillator in closed form, and as native units that are coupled. [Busch2016], sec. 2.4"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from support.cosim.native_units import native_fmu

Floats = NDArray[np.float64]
STATES = ("a.x", "a.v", "b.x", "b.v")


@dataclass(frozen=True)
class Oscillator:
    """m1 x1'' = f - k1 x1 - d1 x1',  m2 x2'' = -f - k2 x2 - d2 x2',  f = k_c (x2 - x1) + d_c (x2' - x1')."""

    m: tuple[float, float] = (1.0, 2.0)
    k: tuple[float, float] = (10.0, 20.0)
    d: tuple[float, float] = (0.5, 0.3)
    k_c: float = 30.0
    d_c: float = 0.4
    x_0: tuple[float, float] = (1.0, -0.5)

    def exact(self, t: float) -> Floats:
        """Return x1, v1, x2, v2 by the matrix exponential."""
        (m1, m2), (k1, k2), (d1, d2) = self.m, self.k, self.d
        a = np.array(
            [
                [0, 1, 0, 0],
                [-(k1 + self.k_c) / m1, -(d1 + self.d_c) / m1, self.k_c / m1, self.d_c / m1],
                [0, 0, 0, 1],
                [self.k_c / m2, self.d_c / m2, -(k2 + self.k_c) / m2, -(d2 + self.d_c) / m2],
            ]
        )
        return expm(a * t) @ self._start

    def implicit(self, dt: float, n: int) -> Floats:
        """Return the states of two units after n steps dt in each of which they get what the other gives at its end."""
        a, in_a, b, in_b, C = self._held(dt)
        # z = a z0 + in_a f of mass a, w = b w0 + in_b z of mass b, f = C (w - z)
        left = np.block([[np.eye(2) + in_a @ C, -in_a @ C], [-in_b, np.eye(2)]])
        right = np.block([[a, np.zeros((2, 2))], [np.zeros((2, 2)), b]])
        return np.linalg.matrix_power(np.linalg.solve(left, right), n) @ self._start

    def gain(self, dt: float) -> float:
        """Return by how much the force that comes out at the end of a step changes with the force that goes in."""
        _, in_a, _, in_b, C = self._held(dt)
        return float((C @ (in_b - np.eye(2)) @ in_a)[0, 0])

    def _held(self, dt: float) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        (m1, m2), (k1, k2), (d1, d2) = self.m, self.k, self.d
        a = held([[0, 1], [-k1 / m1, -d1 / m1]], [[0], [1 / m1]], dt)
        ends = [-(k2 + self.k_c) / m2, -(d2 + self.d_c) / m2]
        b = held([[0, 1], ends], [[0, 0], [self.k_c / m2, self.d_c / m2]], dt)
        return *a, *b, np.array([[self.k_c, self.d_c]])

    def two_units(self, period: Fraction, fmi: int = 3, **flags: bool) -> System:
        """Return a mass that takes a force, and one that takes displacements, which holds the coupling spring."""
        s = System()
        a = s.add("a", native_fmu("mass", fmi, **flags), period=period, **self._mass(0))
        coupling = {"k_c": self.k_c, "d_c": self.d_c}
        b = s.add("b", native_fmu("sprung_mass", fmi, **flags), period=period, **coupling, **self._mass(1))
        s.connect(a.y.x, b.u.x1)
        s.connect(a.y.v, b.u.v1)
        s.connect(b.y.f, a.u.f)
        return s

    def three_units(self, period: Fraction, fmi: int, **flags: bool) -> System:
        """Return two masses and the coupling spring between them; `flags` are capabilities of all: `native_fmu`."""
        s = System()
        a = s.add("a", native_fmu("mass", fmi, **flags), period=period, **self._mass(0))
        b = s.add("b", native_fmu("mass", fmi, **flags), period=period, **self._mass(1))
        spring = s.add("spring", native_fmu("spring", fmi, **flags), period=period, k=self.k_c, d=self.d_c)
        for mass, end in ((a, "1"), (b, "2")):
            s.connect(mass.y.x, getattr(spring.u, f"x{end}"))
            s.connect(mass.y.v, getattr(spring.u, f"v{end}"))
            s.connect(getattr(spring.y, f"f{end}"), mass.u.f)
        return s

    def error_of(self, system: System, options: MasterOptions, stop: Fraction = Fraction(1)) -> float:
        """Return the largest error of a state at the end of a run."""
        with Master(system, options) as master:
            master.run(stop)
            return self._error(float(stop), master.signals)

    def largest_error_of(self, master: Master, stop: Fraction) -> float:
        """Run; return the largest error of a state at any communication point."""
        errors: list[float] = []
        master.run(stop, [lambda t, signals: errors.append(self._error(t, signals))])
        return max(errors)

    def _error(self, t: float, signals: Signals) -> float:
        states = np.array([float(signals[s]) for s in STATES])
        return float(np.max(np.abs(states - self.exact(t))))

    @property
    def _start(self) -> Floats:
        return np.array([self.x_0[0], 0.0, self.x_0[1], 0.0])

    def _mass(self, i: int) -> dict[str, Any]:
        return {"m": self.m[i], "k": self.k[i], "d": self.d[i], "x0": self.x_0[i]}


PLAIN = Oscillator()
STIFF = Oscillator(m=(1.0, 1.0), k=(100.0, 1.0), d=(20.0, 2.0), k_c=5.0, d_c=0.0)
"""One mass is at rest after half a second, the other after several: both critically damped but for the coupling."""


def equal_masses(k_c: float, d_c: float = 0.1) -> Oscillator:
    """Return two masses of 1 kg, each with a weak spring of its own, that start together."""
    return Oscillator(m=(1.0, 1.0), k=(4.0, 4.0), d=(0.1, 0.1), k_c=k_c, d_c=d_c, x_0=(1.0, 1.0))


def held(a: object, b: object, dt: float) -> tuple[Floats, Floats]:
    """Return x(t + dt) = a x(t) + b u of x' = A x + B u with u held."""
    A, B = np.array(a, dtype=np.float64), np.array(b, dtype=np.float64)
    n, m = B.shape
    whole = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt)
    return whole[:n, :n], whole[:n, n:]
