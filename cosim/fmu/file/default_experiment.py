"""The default experiment of an FMU: where it starts and stops, and the communication step that it proposes.

Runs and checks both take the step from here, so that they propose the same one.
"""

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.fmu.file.xml import XmlElement

SHORTEST_STEP = 1e-12
"""Seconds; a shorter step would be lost in the rounding of times, which doubles hold to some 1e-16 of their size."""

_MAX_DENOMINATOR = 10**6
"""Of times that are taken for rounded fractions."""

_PARTS = 500
"""Steps of a default experiment whose length is not given."""

NO_STEP = "its FMU proposes no communication step"
INVALID_STEP = f"is not a communication step; expected a number from {SHORTEST_STEP:g} s on"
"""What is wrong with a text that should be a step."""


class NoStep(str):
    """The fault of a unit that has no communication step, with the remedy, to which commands add their option."""

    __slots__ = ()

    def __new__(cls, unit: str, reason: str) -> "NoStep":
        """Make the text of the fault of a unit, for a reason."""
        return super().__new__(cls, f"{unit}: {reason}; give one that is above 0 s")


@dataclass(frozen=True)
class DefaultExperiment:
    """What an FMU proposes for a run. What is not given, or is not finite, is None.

    Attributes:
        start, stop: times in seconds.
        tolerance: relative, of the unit's own solver; one that is not above 0 is None, too.
        step: communication step in seconds.
        step_fault: what is wrong with its stepSize, in one line with the place; empty where nothing is.
    """

    start: float | None = None
    stop: float | None = None
    tolerance: float | None = None
    step: float | None = None
    step_fault: str = ""

    @property
    def presumed_step(self) -> Fraction | None:
        """The step to take where none is proposed, by the length of the experiment; None where that is not given."""
        return None if self.stop is None else presumed_step(self.stop - (self.start or 0.0))


def default_experiment(root: XmlElement) -> DefaultExperiment:
    """Read the default experiment off a model description.

    The step is its `stepSize` or, where there is none, the `fixedInternalStepSize` of FMI 3's co-simulation interface.
    """
    experiment = next(root.named("DefaultExperiment"), None)
    given: Mapping[str, str] = {} if experiment is None else experiment.attributes
    start, stop, tolerance = (_finite(given.get(name)) for name in ("startTime", "stopTime", "tolerance"))
    tolerance = tolerance if tolerance is not None and tolerance > 0 else None
    text = given.get("stepSize")
    if text is None or experiment is None:
        internal = (_step(c.attributes.get("fixedInternalStepSize")) for c in root.named("CoSimulation"))
        return DefaultExperiment(start, stop, tolerance, next(internal, None))
    step = _step(text)
    if step is not None:
        return DefaultExperiment(start, stop, tolerance, step)
    where = f"stepSize={text[:80]!r} of its DefaultExperiment (line {experiment.line})"
    return DefaultExperiment(start, stop, tolerance, None, f"{where} {INVALID_STEP}")


def proposed_step(step: float | None) -> Fraction | None:
    """Return a step as an exact number; one with few digits, as 0.0333333, is taken as the fraction 1/30."""
    if not step or step < 0:
        return None
    whole = round(1 / step)
    if whole and abs(1 / whole - step) <= 2e-6 * step:
        return Fraction(1, whole)
    return Fraction(repr(step))


def exact_text(seconds: object) -> str:
    """Return how a time that is no fraction is written as one, `Fraction('7/100')`; an example where it is no time."""
    try:
        return f"Fraction('{Fraction(str(seconds))}')"
    except (ValueError, ZeroDivisionError):
        return "a fraction, such as Fraction('1/100')"


def presumed_step(duration: float | Fraction) -> Fraction | None:
    """Return a 500th of a duration in seconds, to one significant digit; None where that is not a step."""
    if duration > sys.float_info.max:
        return None
    step = Fraction(f"{float(duration) / _PARTS:.0e}")
    return step if step >= SHORTEST_STEP else None


def exact_seconds(seconds: float) -> Fraction:
    """Return a time as the fraction meant, such as 1/3 for 0.3333333333333333."""
    near = Fraction(seconds).limit_denominator(_MAX_DENOMINATOR)
    return near if float(near) == seconds else Fraction(repr(seconds))


def _step(text: str | None) -> float | None:
    number = _finite(text)
    return number if number is not None and number >= SHORTEST_STEP else None


def is_finite(text: str) -> bool:
    """Return whether an attribute's text is a finite number."""
    return _finite(text) is not None


def _finite(text: str | None) -> float | None:
    try:
        number = math.nan if text is None or "_" in text else float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
