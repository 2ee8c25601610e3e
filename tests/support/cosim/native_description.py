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


def description2(d: Declaration, step: float, dependencies: bool, flags: Mapping[str, bool]) -> str:
    assert not d.needs_fmi3, f"{d.name}: FMI 2 has no such variables"
    root = ElementTree.Element(
        "fmiModelDescription", fmiVersion="2.0", modelName=d.name, guid=d.name, variableNamingConvention="structured"
    )
    states = not d.abilities & NO_STATES
    given = {
        "canHandleVariableCommunicationStepSize": not d.abilities & FIXED_STEP,
        "canInterpolateInputs": bool(d.abilities & INTERPOLATES),
        "canGetAndSetFMUstate": states,
        "canSerializeFMUstate": states,
        "providesDirectionalDerivative": bool(d.abilities & DERIVATIVES),
    }
    ElementTree.SubElement(root, "CoSimulation", {"modelIdentifier": d.name, **_booleans({**given, **flags})})
    _add_units(root, d)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(step))
    rows = ElementTree.SubElement(root, "ModelVariables")
    for v in d.variables:
        ends = {"name": v.name, "valueReference": str(d.reference(v.name, fmi=2)), **_kind(d, v)}
        row = ElementTree.SubElement(rows, "ScalarVariable", ends)
        ElementTree.SubElement(row, FMI2_TYPES[v.type], {**_start(v), **({"unit": v.unit} if v.unit else {})})
    structure = ElementTree.SubElement(root, "ModelStructure")
    has_outputs = any(v.causality == OUTPUT for v in d.variables)
    for group in ("Outputs", "InitialUnknowns") if has_outputs else ():
        unknowns = ElementTree.SubElement(structure, group)
        for v in d.variables:
            if v.causality == OUTPUT:
                known = _dependencies(d, v, with_parameters=group == "InitialUnknowns") if dependencies else {}
                ElementTree.SubElement(unknowns, "Unknown", {"index": str(v.place), **known})
    return _text(root)


def description3(d: Declaration, step: float, dependencies: bool, flags: Mapping[str, bool]) -> str:
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=d.name,
        instantiationToken=d.name,
        variableNamingConvention="structured",
    )
    states = not d.abilities & NO_STATES
    given = {
        "canHandleVariableCommunicationStepSize": not d.abilities & FIXED_STEP,
        "canGetAndSetFMUState": states,
        "canSerializeFMUState": states,
        "providesDirectionalDerivatives": bool(d.abilities & DERIVATIVES),
        "hasEventMode": bool(d.abilities & EVENTS),
        "mightReturnEarlyFromDoStep": bool(d.abilities & EARLY_RETURN),
    }
    ElementTree.SubElement(root, "CoSimulation", {"modelIdentifier": d.name, **_booleans({**given, **flags})})
    _add_units(root, d)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(step))
    rows = ElementTree.SubElement(root, "ModelVariables")
    time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    ElementTree.SubElement(rows, "Float64", time)
    for v in d.variables:
        _add_variable3(rows, d, v)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for group in ("Output", "InitialUnknown"):
        for v in d.variables:
            if v.causality == OUTPUT and (group == "Output" or not v.clock):
                known = _dependencies(d, v, with_parameters=group == "InitialUnknown") if dependencies else {}
                ElementTree.SubElement(structure, group, {"valueReference": str(v.place), **known})
    return _text(root)


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


def _text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=False)
