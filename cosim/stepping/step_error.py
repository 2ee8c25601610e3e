"""How far a step of an ensemble is from two steps of half the length."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handover.cosim.ensemble import Ensemble
from handover.cosim.stepping.adaptive_step import AdaptiveStep
from handover.cosim.system.signals import Column

Values = NDArray[np.float64]


@dataclass(frozen=True)
class WorstSignal:
    """The scalar output with the largest error, in units of what is tolerated; infinite where it is not a number."""

    unit: str
    name: str
    error: float


class StepError:
    """Compares outputs of units: their connected real outputs that are continuous; all such where none is connected.

    Outputs that are not to be controlled are left out.

    Richardson's estimate: if the error of one step goes with its length to the power of order + 1, two steps of half
    the length are off by |y_halves - y_whole| / (2^order - 1). It is tolerated relative to the largest magnitude that
    the signal has had, so that passing through zero asks for no more than the rest of its course.

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
        """Take note of the outputs' magnitudes."""
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
        """Go back to what `get_state` gave."""
        self._largest = np.array(state, dtype=np.float64)


def _compared(ensemble: Ensemble, unit: str, uncontrolled: Collection[str]) -> list[Column]:
    columns = [c for c in ensemble.signals().columns() if c.name.startswith(f"{unit}.") and c.port.is_continuous]
    columns = [c for c in columns if f"{unit}.{c.port.name}" not in uncontrolled]
    feeding = {c.source.port for c in ensemble.system.connections if c.source.unit == unit}
    return [c for c in columns if c.port.name in feeding] or columns
