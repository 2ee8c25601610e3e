"""Checks of a model description, as far as they matter in a run and FMPy's validation does not make them.

`interface_findings` checks the co-simulation interface and the default experiment, `structure_findings` whether indices
and value references lead to variables, `variable_findings` start values, ranges, types, units and dimensions.
"""

import math
import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

from handover.cosim.fmu.file.default_experiment import default_experiment
from handover.cosim.fmu.file.described_variable import REALS, DescribedVariable
from handover.cosim.fmu.file.model_structure import lost_references
from handover.cosim.fmu.file.xml import XmlElement
from handover.cosim.probe.finding import Finding, fault, note, warning

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
        kinds = [value for tag, value in _KINDS.items() if next(root.named(tag), None) is not None]
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
    yield from _capability_findings(co_simulation, fmi)
    yield from _experiment_findings(root)


def says(element: XmlElement, flag: str) -> bool:
    """Return whether a capability flag is set."""
    return element.get(flag) in ("true", "1")


def _capability_findings(co_simulation: XmlElement, fmi: int) -> Iterator[Finding]:
    if says(co_simulation, "needsExecutionTool"):
        yield note(
            "needs other software on each machine that runs it: the tool that it was exported from, or an interpreter"
        )
    if says(co_simulation, "canBeInstantiatedOnlyOncePerProcess"):
        yield note("allows one instance in a process: several in a system are isolated, each in a process of its own")
    if not says(co_simulation, f"canGetAndSetFMU{'state' if fmi == 2 else 'State'}"):
        yield note("cannot be rolled back: its state can be neither kept nor restored")


def _experiment_findings(root: XmlElement) -> Iterator[Finding]:
    proposed = default_experiment(root)
    if proposed.step_fault:
        yield fault(proposed.step_fault)
    for experiment in root.named("DefaultExperiment"):
        if proposed.stop is not None and proposed.stop < (proposed.start or 0.0):
            yield fault("stopTime is before startTime", where=f"DefaultExperiment (line {experiment.line})")


def structure_findings(root: XmlElement, fmi: int, variables: Sequence[DescribedVariable]) -> Iterator[Finding]:
    """Yield references in ModelStructure and of derivatives that lead to no variable, and unlisted outputs."""
    for lost in lost_references(root, fmi):
        yield fault(lost.what, where=lost.where, cure=lost.cure)
    if fmi == 2:
        count = len(list(root.named("ModelVariables", "ScalarVariable")))
        valid: Collection[str] = {str(i + 1) for i in range(count)}
        entries = f"there are variables 1 to {count}"
    else:
        valid, entries = {v.reference for v in variables}, "no variable has it"
    for v in variables:
        derivative = v.values.get("derivative")
        if derivative and derivative not in valid:
            yield fault(
                f"it is the derivative of {derivative}, which leads to no variable", where=v.where, cure=entries
            )
    yield from _unlisted_outputs(root, fmi, variables)


def _unlisted_outputs(root: XmlElement, fmi: int, variables: Sequence[DescribedVariable]) -> Iterator[Finding]:
    """Yield the outputs that are not listed; FMPy says that some are not, but not which."""
    if fmi == 2:
        listed = {u.get("index") for u in root.named("ModelStructure", "Outputs", "Unknown")}
        positions = {e: str(i + 1) for i, e in enumerate(root.named("ModelVariables", "ScalarVariable"))}
        missing = [v for v in variables if v.causality == "output" and positions[v.element] not in listed]
    else:
        listed = {u.get("valueReference") for u in root.named("ModelStructure", "Output")}
        missing = [v for v in variables if v.causality == "output" and v.reference not in listed]
    for v in missing:
        what = "an output that ModelStructure does not list among the outputs"
        yield fault(what, where=v.where, cure="a run takes it to depend on all inputs")


_CLASSES = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean", "String": "String"}


def variable_findings(root: XmlElement, fmi: int, variables: Sequence[DescribedVariable]) -> Iterator[Finding]:
    """Yield what is wrong with variables' start values, ranges, types, dimensions and value references."""
    types = _declared_types(root, fmi)
    starts_of = {v.reference: v.values.get("start") for v in variables} if fmi == 3 else {}
    for v in variables:
        declared = types.get(v.values.get("declaredType"))
        yield from _range_findings(v, declared)
        yield from _start_findings(v, declared, v.shape(starts_of) if fmi == 3 else ())
        if v.type == "Enumeration":
            yield from _enumeration_findings(v, declared)
    yield from _unit_findings(root, variables, types)
    if fmi == 2:
        yield from _shared_references(variables)
    else:
        yield from _dimension_findings(variables)


def description_findings(root: XmlElement, fmi: int, variables: Sequence[DescribedVariable]) -> list[Finding]:
    """Return what is wrong with variables and with the references to them."""
    return [*variable_findings(root, fmi, variables), *structure_findings(root, fmi, variables)]


def _declared_types(root: XmlElement, fmi: int) -> dict[str, XmlElement]:
    """Return the elements that hold the attributes of declared types, by the types' names."""
    if fmi == 3:
        return {t.get("name"): t for group in root.named("TypeDefinitions") for t in group.children}
    simple = root.named("TypeDefinitions", "SimpleType")
    return {t.get("name"): t.children[0] for t in simple if t.children}


def _range(v: DescribedVariable, declared: XmlElement | None) -> tuple[float, float]:
    """Return the bounds of a variable's values; those that cannot be read are reported by `_range_findings`."""
    bounds: list[float] = []
    for name, none in (("min", -math.inf), ("max", math.inf)):
        text = v.values.get(name) or (declared.get(name) if declared else "")
        try:
            bounds.append(float(v.parsed(text)) if text else none)
        except ValueError:
            bounds.append(none)
    return bounds[0], bounds[1]


def _range_findings(v: DescribedVariable, declared: XmlElement | None) -> Iterator[Finding]:
    if v.type in ("String", "Boolean", "Binary", "Clock"):
        return
    for name in ("min", "max"):
        if text := v.values.get(name):
            try:
                v.parsed(text)
            except ValueError as e:
                yield fault(f"{name} {e}", where=v.where)
    low, high = _range(v, declared)
    if low > high:
        yield fault(f"its min {low:g} is above its max {high:g}", where=v.where)


def _start_findings(
    v: DescribedVariable, declared: XmlElement | None, shape: tuple[int, ...] | None
) -> Iterator[Finding]:
    if v.starts is None or v.type == "Clock":
        return
    n = math.prod(shape) if shape is not None else None
    if n is not None and len(v.starts) not in (1, n):
        line = f"{len(v.starts)} start values for {n} entries, shape [{','.join(map(str, shape or ()))}]"
        yield fault(line, where=v.where, cure="one for each entry, or one for all")
    low, high = _range(v, declared)
    for text in v.starts:
        try:
            value = v.parsed(text)
        except ValueError as e:
            yield fault(f"start value {e}", where=v.where)
            return
        if isinstance(value, str):
            continue
        if isinstance(value, float) and not math.isfinite(value):
            yield warning(f"start value {text} is not finite", where=v.where)
            return
        if v.type != "Enumeration" and v.type != "Boolean" and not low <= value <= high:
            yield fault(f"start value {text} is out of its range, from {low:g} to {high:g}", where=v.where)
            return


def _enumeration_findings(v: DescribedVariable, declared: XmlElement | None) -> Iterator[Finding]:
    name = v.values.get("declaredType")
    if declared is None:
        what = f"its type {name!r} is not defined" if name else "an enumeration without a declaredType"
        yield fault(what, where=v.where, cure="a type with its items is wanted in TypeDefinitions")
        return
    items = [i.get("value") for i in declared.named("Item")]
    if len(set(items)) < len(items):
        yield fault(f"its type {name!r} (line {declared.line}) has a value twice", where=v.where)
    wrong = [s for s in v.starts or () if s not in items]
    if wrong:
        cure = f"valid: {', '.join(items[:20])}"
        yield fault(f"start value {wrong[0]} is not an item of its type {name!r}", where=v.where, cure=cure)


def _unit_findings(
    root: XmlElement, variables: Sequence[DescribedVariable], types: dict[str, XmlElement]
) -> Iterator[Finding]:
    """Yield display units without a unit: FMPy's validation stops at them without a word."""
    known = {u.get("name") for u in root.named("UnitDefinitions", "Unit")}
    for v in variables:
        declared = types.get(v.values.get("declaredType"))
        unit = v.values.get("unit") or (declared.get("unit") if declared else "")
        display = v.values.get("displayUnit")
        if display and unit not in known:
            what = (
                f"has the display unit {display!r}, but its unit {unit!r} is not defined"
                if unit
                else (f"has the display unit {display!r}, but no unit")
            )
            yield fault(what, where=v.where, cure="define the unit in UnitDefinitions")
        if v.type not in REALS and v.values.get("unit"):
            yield fault(f"is of type {v.type} and has a unit", where=v.where, cure="only real variables have one")


def _shared_references(variables: Sequence[DescribedVariable]) -> Iterator[Finding]:
    """Yield what FMI 2 forbids of aliases: value references are shared within a type, and one at most can be set."""
    groups: dict[tuple[str, str], list[DescribedVariable]] = defaultdict(list)
    for v in variables:
        groups[_CLASSES[v.type], v.reference].append(v)
    for (_, reference), sharing in groups.items():
        if len(sharing) == 1:
            continue
        types = {v.type for v in sharing}
        settable = [v for v in sharing if v.causality in ("input", "parameter")]
        if len(types) > 1:
            names = " and ".join(v.name for v in sharing[:3])
            yield fault(
                f"{names} share the value reference {reference}, but are of different types", where=sharing[1].where
            )
        for first, second in pairwise(settable):
            what = f"can be set and shares the value reference {reference} with {first.name!r}, which can be set too"
            yield fault(what, where=second.where, cure="of aliases, one at most is an input or a parameter")


def _dimension_findings(variables: Sequence[DescribedVariable]) -> Iterator[Finding]:
    by_reference = {v.reference: v for v in variables}
    for v in variables:
        for d in v.element.named("Dimension"):
            reference = d.get("valueReference")
            sizing = by_reference.get(reference)
            if reference and sizing is None:
                yield fault(f"its dimension has the value reference {reference}, which no variable has", where=v.where)
            elif sizing is not None and (sizing.type != "UInt64" or sizing.causality != "structuralParameter"):
                if not (sizing.type == "UInt64" and sizing.element.get("variability") == "constant"):
                    what = f"its dimension is {sizing.name!r}, a {sizing.causality} of type {sizing.type}"
                    yield fault(what, where=v.where, cure="expected a structural parameter of type UInt64")
            elif not reference and d.get("start") == "0":
                yield fault("has a dimension of 0", where=v.where)
