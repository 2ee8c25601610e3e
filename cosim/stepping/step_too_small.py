"""A step that cannot be made as small as its error asks for."""

from typing import ClassVar

from handover.cosim.exceptions import UnitFailure


class StepTooSmall(UnitFailure):
    """The smallest step is not small enough for the tolerances.

    Attributes:
        signal: the scalar output with the largest error, `unit.port`.
        error: its error in units of what is tolerated; up to 1 is good.
        step: the step that was tried last, in seconds.
    """

    kind: ClassVar[str] = "step_too_small"
    verdict: ClassVar[str] = "the step could not follow its error"

    def __init__(self, unit: str, signal: str, t: float, step: float, error: float) -> None:
        self.signal, self.error, self.step = signal, error, step
        super().__init__(unit, "control of the step", t, "no step is short enough")

    @property
    def what(self) -> str:
        """What happened, to be read after the call."""
        return f"found none that is short enough: {self.told}"

    @property
    def told(self) -> str:
        """The signal with the largest error, and what may help."""
        return (
            f"with a step of {self.step:.3g} s the error of {self.signal} is {self.error:.3g} times what is tolerated; "
            "if it is noise, leave it uncontrolled"
        )
