"""How a master couples its units."""

import enum
import math
from dataclasses import dataclass

from cosim.adaptive_step import AdaptiveStep
from cosim.exceptions import BadOptions
from cosim.extrapolation import Extrapolation


class Algorithm(enum.Enum):
    """How units that are due at the same time get their inputs.

    JACOBI: all from the values at that time. GAUSS_SEIDEL: one after another, each from the newest values; the units of
    an algebraic loop go over the step again until they agree. FIXED_POINT and NEWTON: the same for all units that are
    connected in a circle (iterated, strong or implicit coupling), with inputs of the end of the step, by relaxed
    fixed-point iteration or by Newton's method. Sampled units act one after another but in loops. The loops of all but
    FIXED_POINT, and those at the start, are solved by Newton's method.
    """

    JACOBI = "jacobi"
    GAUSS_SEIDEL = "gauss-seidel"
    FIXED_POINT = "fixed-point"
    NEWTON = "newton"

    @property
    def iterates(self) -> bool:
        """Whether all units that are connected in a circle go over steps again."""
        return self in (Algorithm.FIXED_POINT, Algorithm.NEWTON)


@dataclass(frozen=True, kw_only=True)
class MasterOptions:
    """How a master couples its units.

    Attributes:
        algorithm: see `Algorithm`.
        tolerance: the largest difference, relative to a signal's magnitude, at which iterated signals agree.
        most_iterations: after so many iterations of a step, the run fails.
        extrapolation: what inputs are between communication points; see `Extrapolation`.
        adaptive: how the step follows the error; None for fixed steps.
        cpu_times: whether `Master.cpu` has the CPU time of every step; to take it costs 0.2 us a step.
        compiled: whether a plain system (fixed steps, no events) may run as a compiled plan.
        call_limit: seconds of wall time that a unit may take for one call; None: any.
        pace: simulated seconds per second of wall time that a run keeps to; None: as fast as it goes.

    Raises:
        BadOptions: with everything that is wrong.
    """

    algorithm: Algorithm = Algorithm.GAUSS_SEIDEL
    tolerance: float = 1e-8
    most_iterations: int = 100
    extrapolation: Extrapolation = Extrapolation.HOLD
    adaptive: AdaptiveStep | None = None
    cpu_times: bool = False
    compiled: bool = True
    call_limit: float | None = None
    pace: float | None = None

    def __post_init__(self) -> None:
        faults: list[str] = []
        if not 0 < self.tolerance < 1:
            faults.append(f"the tolerance of iterated signals is {self.tolerance!r}; it must be above 0 and below 1")
        if self.most_iterations < 2:
            faults.append(f"{self.most_iterations} iterations at most; at least 2 are needed to see an agreement")
        for name in ("call_limit", "pace"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                faults.append(f"{name} = {value}: a finite number above 0 is right")
        if faults:
            raise BadOptions(faults)

    @property
    def order(self) -> int:
        """The power of the step with which the error of a run goes: see `Extrapolation`."""
        return 2 if self.extrapolation is Extrapolation.LINEAR else 1
