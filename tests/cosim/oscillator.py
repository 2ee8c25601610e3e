"""The two-mass oscillator in closed form, and as native units coupled by force and displacement.

m1 x1'' = f - k1 x1 - d1 x1',  m2 x2'' = -f - k2 x2 - d2 x2',  f = k_c (x2 - x1) + d_c (x2' - x1').
"""

from fractions import Fraction
from typing import Any

import numpy as np
from native_units import native_fmu
from numpy.typing import NDArray
from scipy.linalg import expm

from cosim.master import Master
from cosim.master_options import MasterOptions
from cosim.system import System

_M = (1.0, 2.0)
_K, _K_C = (10.0, 20.0), 30.0
_D, _D_C = (0.5, 0.3), 0.4
_X_0 = np.array([1.0, 0.0, -0.5, 0.0])

STATES = ("a.x", "a.v", "b.x", "b.v")


def exact(t: float) -> NDArray[np.float64]:
    """Return x1, v1, x2, v2 by the matrix exponential."""
    (m1, m2), (k1, k2), (d1, d2) = _M, _K, _D
    a = np.array(
        [
            [0, 1, 0, 0],
            [-(k1 + _K_C) / m1, -(d1 + _D_C) / m1, _K_C / m1, _D_C / m1],
            [0, 0, 0, 1],
            [_K_C / m2, _D_C / m2, -(k2 + _K_C) / m2, -(d2 + _D_C) / m2],
        ]
    )
    solution: NDArray[np.float64] = expm(a * t) @ _X_0
    return solution


def two_units(period: Fraction, fmi: int) -> System:
    """Return a mass that takes a force, and one that takes displacements, which holds the coupling spring."""
    s = System()
    a = s.add("a", native_fmu("mass", fmi), period=period, **_mass(0))
    b = s.add("b", native_fmu("sprung_mass", fmi), period=period, k_c=_K_C, d_c=_D_C, **_mass(1))
    s.connect(a.y.x, b.u.x1)
    s.connect(a.y.v, b.u.v1)
    s.connect(b.y.f, a.u.f)
    return s


def three_units(period: Fraction, fmi: int, **flags: bool) -> System:
    """Return two masses and the coupling spring between them; `flags` are capabilities of all, see `native_fmu`."""
    s = System()
    a = s.add("a", native_fmu("mass", fmi, **flags), period=period, **_mass(0))
    b = s.add("b", native_fmu("mass", fmi, **flags), period=period, **_mass(1))
    spring = s.add("spring", native_fmu("spring", fmi, **flags), period=period, k=_K_C, d=_D_C)
    for mass, end in ((a, "1"), (b, "2")):
        s.connect(mass.y.x, getattr(spring.u, f"x{end}"))
        s.connect(mass.y.v, getattr(spring.u, f"v{end}"))
        s.connect(getattr(spring.y, f"f{end}"), mass.u.f)
    return s


def error_of(system: System, options: MasterOptions, stop: Fraction = Fraction(1)) -> float:
    """Return the largest error of a state at the end of a run."""
    with Master(system, options) as master:
        master.run(stop)
        states = [float(master.signals[s]) for s in STATES]
        return float(np.max(np.abs(np.array(states) - exact(float(stop)))))


def _mass(i: int) -> dict[str, Any]:
    return {"m": _M[i], "k": _K[i], "d": _D[i], "x0": float(_X_0[2 * i])}
