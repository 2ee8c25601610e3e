"""Model descriptions of native test units, in FMI 2.0 and 3.0."""

from collections.abc import Mapping
from xml.etree import ElementTree

from support.cosim.native_declaration import (
    BINARY,
    BOOLEAN,
    CLOCK,
    DERIVATIVES,
    EARLY_RETURN,
    EVENTS,
    FIXED_STEP,
    INPUT,
    INTERPOLATES,
    NO_STATES,
    OUTPUT,
    PARAMETER,
    REAL,
    TUNABLE_PARAMETERS,
    Declaration,
    Variable,
)

UNITS: dict[str, dict[str, str]] = {
    "m": {"m": "1"},
    "m/s": {"m": "1", "s": "-1"},
    "kg": {"kg": "1"},
    "N": {"kg": "1", "m": "1", "s": "-2"},
    "N/m": {"kg": "1", "s": "-2"},
    "N.s/m": {"kg": "1", "s": "-1"},
    "m/s2": {"m": "1", "s": "-2"},
    "s": {"s": "1"},
    "rad": {"rad": "1"},
    "rad/s": {"rad": "1", "s": "-1"},
    "deg": {"rad": "1", "factor": "0.017453292519943295"},
    "mm": {"m": "1", "factor": "0.001"},
    "K": {"K": "1"},
    "degC": {"K": "1", "offset": "273.15"},
}
FMI3_TYPES = ("Float64", "Int32", "Boolean", "Binary", "Clock")
FMI2_TYPES = ("Real", "Integer", "Boolean")


def description(d: Declaration, fmi: int, step: float, dependencies: bool, flags: Mapping[str, bool]) -> str:
    assert fmi == 3 or not d.needs_fmi3, f"{d.name}: FMI 2 has no such variables"
    token = {"guid" if fmi == 2 else "instantiationToken": d.name}
    names = {"fmiVersion": f"{fmi}.0", "modelName": d.name, "variableNamingConvention": "structured", **token}
    root = ElementTree.Element("fmiModelDescription", names)
    given = {**_abilities(d, fmi), **flags}
    ElementTree.SubElement(root, "CoSimulation", {"modelIdentifier": d.name, **_booleans(given)})
    _add_units(root, d)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(step))
    rows = ElementTree.SubElement(root, "ModelVariables")
    if fmi == 3:
        time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
        ElementTree.SubElement(rows, "Float64", time)
    for v in d.variables:
        (_add_variable2 if fmi == 2 else _add_variable3)(rows, d, v)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for group, initial in (("Output", False), ("InitialUnknown", True)):
        unknowns = [v for v in d.variables if v.causality == OUTPUT and not (initial and v.clock)]
        element, reference = (structure, "valueReference")
        if fmi == 2 and unknowns:
            element, group, reference = ElementTree.SubElement(structure, f"{group}s"), "Unknown", "index"
        for v in unknowns:
            known = _dependencies(d, v, with_parameters=initial) if dependencies else {}
            ElementTree.SubElement(element, group, {reference: str(v.place), **known})
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=False)


def _abilities(d: Declaration, fmi: int) -> dict[str, bool]:
    state = "FMUstate" if fmi == 2 else "FMUState"
    of_both = {
        "canHandleVariableCommunicationStepSize": not d.abilities & FIXED_STEP,
        f"canGetAndSet{state}": not d.abilities & NO_STATES,
        f"canSerialize{state}": not d.abilities & NO_STATES,
        "providesDirectionalDerivative" + "s" * (fmi == 3): bool(d.abilities & DERIVATIVES),
    }
    if fmi == 2:
        return {**of_both, "canInterpolateInputs": bool(d.abilities & INTERPOLATES)}
    events = {"hasEventMode": EVENTS, "mightReturnEarlyFromDoStep": EARLY_RETURN}
    return {**of_both, **{name: bool(d.abilities & flag) for name, flag in events.items()}}


def _add_variable2(rows: ElementTree.Element, d: Declaration, v: Variable) -> None:
    ends = {"name": v.name, "valueReference": str(d.reference(v.name, fmi=2)), **_kind(d, v)}
    row = ElementTree.SubElement(rows, "ScalarVariable", ends)
    ElementTree.SubElement(row, FMI2_TYPES[v.type], {**_start(v), **({"unit": v.unit} if v.unit else {})})


def _add_variable3(rows: ElementTree.Element, d: Declaration, v: Variable) -> None:
    row = ElementTree.SubElement(
        rows, FMI3_TYPES[v.type], {"name": v.name, "valueReference": str(v.place), **_kind(d, v)}
    )
    if v.unit:
        row.set("unit", v.unit)
    if v.clock:
        row.set("clocks", str(d.place(v.clock)))
    if v.type == BINARY:
        row.set("mimeType", "application/x-native")
        if v.causality == INPUT:
            ElementTree.SubElement(row, "Start", value="")
    elif v.type == CLOCK and v.counter:
        row.set("intervalVariability", "constant")
        row.set("supportsFraction", "true")
        row.set("intervalCounter", str(v.counter))
        row.set("resolution", str(v.resolution))
        row.set("intervalDecimal", repr(v.counter / v.resolution))
    elif v.type == CLOCK:
        row.set("intervalVariability", v.timing or "triggered")
    else:
        row.attrib.update(_start(v))
    if v.length:
        ElementTree.SubElement(row, "Dimension", start=str(v.length))


def _kind(d: Declaration, v: Variable) -> dict[str, str]:
    causality = ("parameter", "input", "output")[v.causality]
    variability = "continuous" if v.is_continuous else "discrete"
    if v.causality == PARAMETER:
        variability = "tunable" if d.abilities & TUNABLE_PARAMETERS else "fixed"
    return {"causality": causality, "variability": variability}


def _start(v: Variable) -> dict[str, str]:
    if v.causality == OUTPUT:
        return {}
    one = repr(v.start) if v.type == REAL else str(bool(v.start)).lower() if v.type == BOOLEAN else str(int(v.start))
    return {"start": " ".join([one] * (v.length or 1))}


def _dependencies(d: Declaration, v: Variable, with_parameters: bool) -> dict[str, str]:
    parameters = [p.name for p in d.variables if with_parameters and p.causality == PARAMETER]
    return {"dependencies": " ".join(str(d.place(name)) for name in (*v.depends, *parameters))}


def _add_units(root: ElementTree.Element, d: Declaration) -> None:
    used = sorted({v.unit for v in d.variables if v.unit})
    if used:
        definitions = ElementTree.SubElement(root, "UnitDefinitions")
        for symbol in used:
            unit = ElementTree.SubElement(definitions, "Unit", name=symbol)
            ElementTree.SubElement(unit, "BaseUnit", UNITS[symbol])


def _booleans(flags: Mapping[str, bool]) -> dict[str, str]:
    return {name: str(value).lower() for name, value in flags.items()}
