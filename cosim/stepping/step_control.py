"""Control of an adaptive step: the error of a step by doubling, the next length by a PI controller, and statistics."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.options import AdaptiveStep
from handover.cosim.system.signals import Column

Values = NDArray[np.float64]

_K_I, _K_P = 0.3, 0.4
_SAFETY = 0.9
_MIN_FACTOR, _MAX_FACTOR = 0.2, 5.0
"""How much a step may shrink or grow from one to the next."""
_FLOOR = 1e-10
"""An error of 0 would ask for an infinite step."""


class PiController:
    """Proportional-integral control of the step, which is smoother than following the last error alone.

    After a step with the error r, in units of what is tolerated, the next one is longer by
    s (1/r)^(k_I/k) (r_before/r)^(k_P/k), k_I = 0.3, k_P = 0.4, for an error of order k in the step; s is a safety
    factor. After a rejected step, and in the first step after that, the error alone counts: s (1/r)^(1/k).

    Source: K. Gustafsson, Control theoretic techniques for stepsize selection in explicit Runge-Kutta methods, ACM
    Trans. Math. Softw. 17 (1991) 533-554.
    """

    def __init__(self, power: int) -> None:
        self._power = power
        self._before: float | None = None

    def after_acceptance(self, error: float) -> float:
        """Return the ratio of the next step's length to that of an accepted one with this error."""
        r = max(error, _FLOOR)
        if self._before is None:
            change = _SAFETY * r ** (-1 / self._power)
        else:
            change = _SAFETY * r ** (-_K_I / self._power) * (self._before / r) ** (_K_P / self._power)
        self._before = r
        return min(max(change, _MIN_FACTOR), _MAX_FACTOR)

    def after_rejection(self, error: float) -> float:
        """Return the ratio of the next attempt's length to that of a rejected step with this error."""
        self._before = None
        change = _SAFETY * error ** (-1 / self._power) if error < float("inf") else _MIN_FACTOR
        return min(max(change, _MIN_FACTOR), _SAFETY)

    def get_state(self) -> Mapping[str, Any]:
        """Return what is remembered as JSON can hold it."""
        return {"before": self._before}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        self._before = state["before"]


@dataclass(frozen=True)
class WorstSignal:
    """The scalar output with the largest error, in units of what is tolerated; infinite where it is NaN."""

    unit: str
    name: str
    error: float


class StepError:
    """Compares outputs of units: their connected real outputs that are continuous; all such where none is connected.

    Outputs that are not to be controlled are left out.

    Richardson's estimate: if the error of a step is proportional to its length to the power of order + 1, that of two
    steps of half the length is |y_halves - y_whole| / (2^order - 1). It is tolerated relative to the largest magnitude
    that the signal has had, so that it does not need shorter steps where it passes through zero.

    Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, sec. II.4; for coupled units
    T. Schierz, M. Arnold, C. Clauss, Co-simulation with communication step size control in an FMI compatible master
    algorithm, 9th International Modelica Conference (2012).
    """

    def __init__(self, ensemble: Ensemble, units: Sequence[str], control: AdaptiveStep, order: int) -> None:
        self._columns = [(unit, c) for unit in units for c in _compared(ensemble, unit, control.uncontrolled)]
        self._control = control
        self._divisor = 2.0**order - 1
        self._largest: Values = np.abs(self.values())
        self._absolute = np.array([control.absolute * abs(c.port.nominal or 1.0) for _, c in self._columns])

    def values(self) -> Values:
        """Return the outputs as they are."""
        return np.array([c.values[c.index] for _, c in self._columns], dtype=np.float64)

    def accept(self) -> None:
        """Raise the magnitudes to those of the present outputs."""
        self._largest = np.maximum(self._largest, np.abs(self.values()))

    def worst(self, whole: Values, halves: Values) -> WorstSignal:
        """Return the largest error after two half steps."""
        if not self._columns:
            return WorstSignal("", "", 0.0)
        tolerated = self._absolute + self._control.relative * np.maximum(self._largest, np.abs(halves))
        with np.errstate(invalid="ignore", divide="ignore"):
            errors = np.abs(halves - whole) / (self._divisor * tolerated)
        errors[(halves == whole) & (tolerated == 0)] = 0.0
        errors[np.isnan(errors)] = math.inf
        i = int(np.argmax(errors))
        unit, column = self._columns[i]
        return WorstSignal(unit, column.name, float(errors[i]))

    def get_state(self) -> list[float]:
        """Return what is remembered as JSON can hold it."""
        return self._largest.tolist()

    def set_state(self, state: list[float]) -> None:
        """Restore what `get_state` returned."""
        self._largest = np.array(state, dtype=np.float64)


def _compared(ensemble: Ensemble, unit: str, uncontrolled: Collection[str]) -> list[Column]:
    columns = [c for c in ensemble.signals().columns() if c.name.startswith(f"{unit}.") and c.port.is_continuous]
    columns = [c for c in columns if f"{unit}.{c.port.name}" not in uncontrolled]
    feeding = {c.source.port for c in ensemble.system.connections if c.source.unit == unit}
    return [c for c in columns if c.port.name in feeding] or columns


@dataclass(kw_only=True)
class StepStatistics:
    """Counts of steps, and the range of those that were accepted, in seconds."""

    accepted: int = 0
    rejected: int = 0
    shortest: float = 0.0
    longest: float = 0.0

    def accept(self, step: float) -> None:
        """Count a step that was accepted."""
        self.shortest = step if self.accepted == 0 else min(self.shortest, step)
        self.longest = max(self.longest, step)
        self.accepted += 1
