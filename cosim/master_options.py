"""How a master couples its units."""

import enum
from dataclasses import dataclass

from cosim.adaptive_step import AdaptiveStep
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
        adaptive: how the step follows the error; None for fixed steps.
        compiled: whether a plain system (fixed steps, no events) may run as a compiled plan.
    """

    algorithm: Algorithm = Algorithm.GAUSS_SEIDEL
    extrapolation: Extrapolation = Extrapolation.HOLD
    adaptive: AdaptiveStep | None = None
    compiled: bool = True

    @property
    def order(self) -> int:
        """The power of the step with which the error of a run goes: see `Extrapolation`."""
        return 2 if self.extrapolation is Extrapolation.LINEAR else 1
