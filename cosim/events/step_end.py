"""How a step of a unit ended."""

from dataclasses import dataclass


@dataclass(frozen=True)
class StepEnd:
    """What a unit answered to a step.

    Attributes:
        reached: the time where it stands, s.
        early: whether that is before the step's end.
        event: whether it has an event there, which event mode is to handle.
        discarded: whether it did not carry the step out; a unit of FMI 2 tells by `reached` how far it came, one of
            FMI 3 stands where it stood.
    """

    reached: float
    early: bool = False
    event: bool = False
    discarded: bool = False
