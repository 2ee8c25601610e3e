"""The clocks that an FMI 3 FMU declares in its model description. FMI 3.0, sec. 2.2.9."""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

from handover.cosim.fmu.file.xml import XmlElement

_MOST_DIGITS = 400
"""Before the decimal point or behind it; an exact number of 1e999999999 would take minutes."""


@dataclass(frozen=True, kw_only=True)
class FmuClock:
    """A clock of an FMU.

    `variability` is the standard's `intervalVariability`. A time-based clock ticks every `interval` seconds, first at
    `shift`; where `interval` is None it is read from the unit, see `handover.cosim.fmu.event_instance`.
    """

    name: str
    reference: int
    is_input: bool
    variability: str
    interval: Fraction | None = None
    shift: Fraction = Fraction(0)
    supports_fraction: bool = False

    @property
    def is_triggered(self) -> bool:
        """Whether it ticks at events, not at times known beforehand."""
        return self.variability == "triggered"

    @property
    def signature(self) -> str:
        """Kind, as in `triggered clock`, for messages."""
        return f"{self.variability} clock"


def clocks_of(root: XmlElement) -> dict[str, FmuClock]:
    """Read the input and output clocks off a model description.

    Raises:
        ValueError: an interval or a shift is not a number, or is out of range.
    """
    elements = root.named("ModelVariables", "Clock")
    return {e.get("name"): _clock(e) for e in elements if e.get("causality") in ("input", "output")}


def without_clocks(clocks: Mapping[str, FmuClock]) -> bool:
    """Return whether a unit with these clocks can run without event mode: it has at most constant input clocks."""
    return all(c.is_input and c.variability == "constant" for c in clocks.values())


def _clock(e: XmlElement) -> FmuClock:
    interval = _seconds(e, "interval")
    shift = _seconds(e, "shift") or Fraction(0)
    if (interval is not None and interval <= 0) or shift < 0:
        raise ValueError(f"its clock {e.get('name')!r} ticks every {interval} s from {shift} s on")
    return FmuClock(
        name=e.get("name"),
        reference=int(e.get("valueReference")),
        is_input=e.get("causality") == "input",
        variability=e.get("intervalVariability"),
        interval=interval,
        shift=shift,
        supports_fraction=e.get("supportsFraction") in ("true", "1"),
    )


def _seconds(e: XmlElement, what: str) -> Fraction | None:
    """Return an interval or a shift exactly: the fraction where one is given, else the decimal as written."""
    counter, resolution, decimal = e.get(f"{what}Counter"), e.get("resolution"), e.get(f"{what}Decimal")
    try:
        if counter and resolution:
            return Fraction(int(counter), int(resolution))
        if decimal and abs(Decimal(decimal).adjusted()) > _MOST_DIGITS:
            raise ValueError(f"{decimal[:40]} is not of a size that a double can have")
        return Fraction(decimal) if decimal else None
    except (ArithmeticError, ValueError) as error:
        raise ValueError(f"the {what} of its clock {e.get('name')!r} is not a number: {error}") from error
