"""What an FMU says of itself as a whole: its kind, its names, what it can do and what it needs."""

import math
import re
from collections.abc import Iterator

from handover.cosim.check.finding import Finding, fault, note, warning
from handover.cosim.fmu.xml import XmlElement

_KINDS = {
    "ModelExchange": "model exchange",
    "CoSimulation": "co-simulation",
    "ScheduledExecution": "scheduled execution",
}
_IDENTIFIER = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def interface_findings(root: XmlElement, fmi: int) -> Iterator[Finding]:
    """Yield what is wrong with, or good to know of, an FMU's co-simulation interface and default experiment."""
    version = root.get("fmiVersion")
    if "-" in version:
        yield warning(f"a draft of the standard, {version}", cure="its functions may differ from those of FMI 3.0")
    co_simulation = next(root.named("CoSimulation"), None)
    if co_simulation is None:
        kinds = [told for tag, told in _KINDS.items() if next(root.named(tag), None) is not None]
        yield fault(
            f"an FMU for {' and '.join(kinds) or 'nothing'}, without a co-simulation interface",
            where="modelDescription.xml",
            cure="export it for co-simulation",
        )
        return
    where = f"CoSimulation (line {co_simulation.line})"
    identifier = co_simulation.get("modelIdentifier")
    if not _IDENTIFIER.fullmatch(identifier):
        yield fault(f"modelIdentifier {identifier!r} is not an identifier of C", where=where, cure="letters, digits, _")
    yield from _capabilities(co_simulation, fmi)
    for experiment in root.named("DefaultExperiment"):
        yield from _experiment_findings(experiment)


def default_step(root: XmlElement) -> float | None:
    """Return the step size that an FMU asks for, or None."""
    for experiment in root.named("DefaultExperiment"):
        step = _number(experiment.get("stepSize"))
        if 0 < step < math.inf:
            return step
    internal = [_number(c.get("fixedInternalStepSize")) for c in root.named("CoSimulation")]
    return next((step for step in internal if 0 < step < math.inf), None)


def default_start(root: XmlElement) -> float:
    """Return the time at which an FMU asks to start, or 0."""
    starts = [_number(e.get("startTime")) for e in root.named("DefaultExperiment")]
    return next((t for t in starts if math.isfinite(t)), 0.0)


def says(element: XmlElement, flag: str) -> bool:
    """Tell whether a capability flag is set."""
    return element.get(flag) in ("true", "1")


def _capabilities(co_simulation: XmlElement, fmi: int) -> Iterator[Finding]:
    if says(co_simulation, "needsExecutionTool"):
        yield note(
            "needs other software on each machine that runs it: the tool that it was exported from, or an interpreter"
        )
    if says(co_simulation, "canBeInstantiatedOnlyOncePerProcess"):
        yield note("can be in a system only once: it allows one instance in a process")
    if not says(co_simulation, f"canGetAndSetFMU{'state' if fmi == 2 else 'State'}"):
        yield note("cannot be rolled back: its state can be neither kept nor restored")


def _experiment_findings(experiment: XmlElement) -> Iterator[Finding]:
    where = f"DefaultExperiment (line {experiment.line})"
    step = experiment.attributes.get("stepSize")
    if step is not None and not 0 < _number(step) < math.inf:
        yield fault(f"stepSize {step!r}", where=where, cure="a positive number of seconds is right")
    if _number(experiment.get("stopTime")) < _number(experiment.get("startTime", "0")):
        yield fault("stopTime is before startTime", where=where)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
