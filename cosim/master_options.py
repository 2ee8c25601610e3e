"""How a master couples its units."""

import enum
from dataclasses import dataclass

from cosim.extrapolation import Extrapolation


class Algorithm(enum.Enum):
    """How units that are due at the same time get their inputs.

    JACOBI: all from the values at that time. GAUSS_SEIDEL: one after another, each from the newest values.
    """

    JACOBI = "jacobi"
    GAUSS_SEIDEL = "gauss-seidel"


@dataclass(frozen=True, kw_only=True)
class MasterOptions:
    """How a master couples its units.

    Attributes:
        algorithm: see `Algorithm`.
        extrapolation: what inputs are between communication points; see `Extrapolation`.
        compiled: whether a plain system (fixed steps, no events) may run as a compiled plan.
    """

    algorithm: Algorithm = Algorithm.GAUSS_SEIDEL
    extrapolation: Extrapolation = Extrapolation.HOLD
    compiled: bool = True
