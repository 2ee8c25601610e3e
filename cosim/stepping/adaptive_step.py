"""How the step is controlled where it is to follow the error."""

import math
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.exceptions import BadOptions


@dataclass(frozen=True, kw_only=True)
class AdaptiveStep:
    """Tolerances and limits of a step that follows the error; see `AdaptiveStepper`.

    Attributes:
        relative: error tolerated in a step, relative to the largest magnitude that the signal has had.
        absolute: error tolerated besides, relative to the signal's nominal value, which is 1 in its unit where its FMU
            does not say.
        smallest, largest: limits of the step in seconds; without a largest one, only instants of sampled units and the
            stop time limit it.
        initial: the first step to try in seconds; by default the shortest step that units would take by themselves.
        uncontrolled: outputs, `unit.port`, whose error is not looked at: such as noise, which no step makes smooth.

    Raises:
        BadOptions: with everything that is wrong.
    """

    relative: float = 1e-4
    absolute: float = 1e-6
    smallest: Fraction = Fraction(1, 10**6)
    largest: Fraction | None = None
    initial: Fraction | None = None
    uncontrolled: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        faults = [
            f"the {name} tolerance is {value!r}; a number from 0 on is right"
            for name, value in (("relative", self.relative), ("absolute", self.absolute))
            if not (math.isfinite(value) and value >= 0)
        ]
        if self.relative == self.absolute == 0:
            faults.append("both tolerances are 0, which no step meets; let one be above")
        if self.smallest <= 0:
            faults.append(f"the smallest step is {float(self.smallest):g} s; it must be above 0 s")
        if self.largest is not None and self.largest < self.smallest:
            faults.append(f"the largest step, {float(self.largest):g} s, is below the smallest, {self._least}")
        if self.initial is not None and not self.smallest <= self.initial <= (self.largest or self.initial):
            most = "" if self.largest is None else f" to {float(self.largest):g} s"
            faults.append(f"the first step, {float(self.initial):g} s, is out of the range from {self._least}{most}")
        if faults:
            raise BadOptions(faults)

    @property
    def _least(self) -> str:
        return f"{float(self.smallest):g} s"
