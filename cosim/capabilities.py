"""What an FMU can do beyond stepping: the capability flags of its co-simulation interface."""

from collections.abc import Callable
from dataclasses import dataclass

from handover.cosim.fmu_xml import XmlElement


@dataclass(frozen=True, kw_only=True)
class Capabilities:
    """Capability flags, in one wording for both standards; what a standard does not know is False.

    Attributes:
        varies_step: its communication step may change during a run.
        saves_state, serialises_state: its state can be fetched and set again, also as bytes.
        interpolates_inputs: it takes derivatives of its inputs (FMI 2).
        output_derivatives: the highest order of output derivatives that it gives.
        directional_derivatives: it gives directional derivatives.
        event_mode, returns_early: it has event mode, and may end a step before its end (FMI 3).
        once_per_process: a process may hold one instance of it only.
    """

    varies_step: bool = False
    saves_state: bool = False
    serialises_state: bool = False
    interpolates_inputs: bool = False
    output_derivatives: int = 0
    directional_derivatives: bool = False
    event_mode: bool = False
    returns_early: bool = False
    once_per_process: bool = False


def capabilities_of(root: XmlElement, fmi: int) -> Capabilities:
    """Read the flags off a model description."""
    element = next(root.named("CoSimulation"), None)
    if element is None:
        return Capabilities()
    flag = _flags(element)
    state = "FMUstate" if fmi == 2 else "FMUState"
    return Capabilities(
        varies_step=flag("canHandleVariableCommunicationStepSize"),
        saves_state=flag(f"canGetAndSet{state}"),
        serialises_state=flag(f"canSerialize{state}"),
        interpolates_inputs=fmi == 2 and flag("canInterpolateInputs"),
        output_derivatives=int(element.get("maxOutputDerivativeOrder", "0")),
        directional_derivatives=flag("providesDirectionalDerivative" + ("" if fmi == 2 else "s")),
        event_mode=fmi == 3 and flag("hasEventMode"),
        returns_early=fmi == 3 and flag("mightReturnEarlyFromDoStep"),
        once_per_process=flag("canBeInstantiatedOnlyOncePerProcess"),
    )


def _flags(element: XmlElement) -> Callable[[str], bool]:
    return lambda name: element.get(name) in ("true", "1")
