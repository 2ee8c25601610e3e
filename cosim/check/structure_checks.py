"""Whether what a model description refers to is there: indices and value references of its variables."""

from collections.abc import Collection, Iterator, Sequence

from handover.cosim.check.described_variable import DescribedVariable
from handover.cosim.check.finding import Finding, fault
from handover.cosim.fmu.xml import XmlElement

_FMI3_UNKNOWNS = ("Output", "ContinuousStateDerivative", "ClockedState", "InitialUnknown", "EventIndicator")


def structure_findings(root: XmlElement, fmi: int, variables: Sequence[DescribedVariable]) -> Iterator[Finding]:
    """Yield references in ModelStructure and of derivatives that lead to no variable, and unlisted outputs."""
    if fmi == 2:
        valid: Collection[str] = {str(i + 1) for i in range(len(list(root.named("ModelVariables", "ScalarVariable"))))}
        unknowns = [
            u for group in root.named("ModelStructure") for part in group.children for u in part.named("Unknown")
        ]
        key, told = "index", f"there are variables 1 to {len(valid)}"
    else:
        valid = {v.reference for v in variables}
        unknowns = [u for group in root.named("ModelStructure") for u in group.children if u.tag in _FMI3_UNKNOWNS]
        key, told = "valueReference", "no variable has it"
    for u in unknowns:
        for name in (key, "dependencies"):
            for missing in (r for r in u.get(name).split() if r not in valid):
                where = f"ModelStructure (line {u.line})"
                yield fault(f"{name} {missing} leads to no variable", where=where, cure=told)
    for v in variables:
        derivative = v.values.get("derivative")
        if derivative and derivative not in valid:
            yield fault(f"it is the derivative of {derivative}, which leads to no variable", where=v.where, cure=told)
    yield from _unlisted_outputs(root, fmi, variables)


def _unlisted_outputs(root: XmlElement, fmi: int, variables: Sequence[DescribedVariable]) -> Iterator[Finding]:
    """Yield the outputs that are not listed; FMPy says that some are not, but not which."""
    if fmi == 2:
        listed = {u.get("index") for u in root.named("ModelStructure", "Outputs", "Unknown")}
        positions = {id(e): str(i + 1) for i, e in enumerate(root.named("ModelVariables", "ScalarVariable"))}
        missing = [v for v in variables if v.causality == "output" and positions[id(v.element)] not in listed]
    else:
        listed = {u.get("valueReference") for u in root.named("ModelStructure", "Output")}
        missing = [v for v in variables if v.causality == "output" and v.reference not in listed]
    for v in missing:
        yield fault("an output that ModelStructure does not list among the outputs", where=v.where)
