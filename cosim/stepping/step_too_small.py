"""A step that cannot be made as small as its error asks for."""

from typing import ClassVar

from cosim.exceptions import UnitFailure


class StepTooSmall(UnitFailure):
    """The smallest step is not small enough for the tolerances.

    Attributes:
        signal: the scalar output with the largest error, `unit.port`.
        error: its error in units of what is tolerated; up to 1 is good.
        step: the step that was tried last, in seconds.
    """

    kind: ClassVar[str] = "step too small"

    def __init__(self, unit: str, signal: str, t: float, step: float, error: float) -> None:
        self.signal, self.error, self.step = signal, error, step
        fault = f"with a step of {step:.3g} s the error of {signal} is {error:.3g} times what is tolerated"
        super().__init__(unit, "control of the step", t, "Error", (f"{fault}; if it is noise, leave it uncontrolled",))
