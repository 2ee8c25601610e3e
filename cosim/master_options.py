"""How a master couples its units."""

import enum
import math
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
        cpu_times: whether `Master.cpu` has the CPU time of every step; to take it costs 0.2 us a step.
        compiled: whether a plain system (fixed steps, no events) may run as a compiled plan.
        repeat_discarded: whether a step that a unit discards is repeated shorter, by all units. They then save their
            states at every step; else a discarded step ends the run. Systems with events do so anyway.
        call_limit: seconds of wall time that a unit may take for one call; None: any.
        pace: simulated seconds per second of wall time that a run keeps to; None: as fast as it goes.
    """

    algorithm: Algorithm = Algorithm.GAUSS_SEIDEL
    extrapolation: Extrapolation = Extrapolation.HOLD
    cpu_times: bool = False
    compiled: bool = True
    repeat_discarded: bool = False
    call_limit: float | None = None
    pace: float | None = None

    def __post_init__(self) -> None:
        for name in ("call_limit", "pace"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise ValueError(f"{name} = {value}: a finite number above 0 is right")
