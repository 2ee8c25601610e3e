"""The two-mass oscillator in closed form, and as native units coupled by force and displacement."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from native_units import native_fmu
from numpy.typing import NDArray
from scipy.linalg import expm

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

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

    def exact(self, t: float) -> NDArray[np.float64]:
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
        solution: NDArray[np.float64] = expm(a * t) @ np.array([self.x_0[0], 0.0, self.x_0[1], 0.0])
        return solution

    def two_units(self, period: Fraction, fmi: int) -> System:
        """Return a mass that takes a force, and one that takes displacements, which holds the coupling spring."""
        s = System()
        a = s.add("a", native_fmu("mass", fmi), period=period, **self._mass(0))
        b = s.add("b", native_fmu("sprung_mass", fmi), period=period, k_c=self.k_c, d_c=self.d_c, **self._mass(1))
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

    def _mass(self, i: int) -> dict[str, Any]:
        return {"m": self.m[i], "k": self.k[i], "d": self.d[i], "x0": self.x_0[i]}


PLAIN = Oscillator()
STIFF = Oscillator(m=(1.0, 1.0), k=(100.0, 1.0), d=(20.0, 2.0), k_c=5.0, d_c=0.0)
"""One mass is at rest after half a second, the other after several: both critically damped but for the coupling."""
