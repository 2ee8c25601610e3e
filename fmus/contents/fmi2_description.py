"""modelDescription.xml of FMI 2.0: arrays become scalars, named `p_WG[1]` or `cov_O[1,1]`, in row-major order."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.variable import Causality, Kind, Variable
from handover.fmus.contents.model_description import (
    GENERATOR,
    Model,
    add_default_experiment,
    add_log_categories,
    add_units,
    boolean,
    bounds,
    enumerations,
    initial_dependencies,
    number,
    to_xml,
    variability,
)
from handover.fmus.layout import Form, HostVariable


class NoFmi2Form(ValueError):
    """A unit has ports that FMI 2 cannot represent; `reason` says why."""

    def __init__(self, unit: str, reason: str, ports: list[str]) -> None:
        super().__init__(f"{unit} has no FMI 2 form: {reason} ({', '.join(ports)}); use FMI 3")
        self.unit, self.ports = unit, ports


def fmi2_description(model: Model) -> bytes:
    """Return the model description as XML.

    Raises:
        NoFmi2Form: the block has binary ports, or an integer starts beyond 32 bits.
    """
    _check_form(model)
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model.name,
        guid=model.token,
        description=model.summary,
        generationTool=GENERATOR,
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model.name,
        needsExecutionTool=boolean(model.needs_python),
        canHandleVariableCommunicationStepSize=boolean(model.variable_step),
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
        attrib={"providesDirectionalDerivative": "true"} if model.description.has_derivatives else {},
    )
    add_units(root, model.description.variables)
    _add_types(root, model.description.variables)
    add_log_categories(root)
    add_default_experiment(root, model)
    variables = ET.SubElement(root, "ModelVariables")
    for v in model.layout.shown(Form.FMI2):
        _add_variable(variables, model, v)
    _add_structure(root, model)
    return to_xml(root)


def _check_form(model: Model) -> None:
    shown = model.description.variables
    binaries = [v.name for v in shown if v.kind is Kind.BINARY]
    if binaries:
        raise NoFmi2Form(model.name, "FMI 2 has no binary variables", binaries)
    long = [v.name for v in shown if v.kind is Kind.INTEGER and not Width.INT32.holds(v.start)]
    if long:
        raise NoFmi2Form(model.name, "FMI 2's integers have 32 bits, too few for start values", long)


def _add_types(root: ET.Element, variables: Iterable[Variable]) -> None:
    used = enumerations(variables)
    if not used:
        return
    definitions = ET.SubElement(root, "TypeDefinitions")
    for enumeration in used:
        simple = ET.SubElement(definitions, "SimpleType", name=enumeration.__name__)
        items = ET.SubElement(simple, "Enumeration")
        for item in enumeration:
            ET.SubElement(items, "Item", name=item.name, value=str(int(item)))


def _add_variable(variables: ET.Element, model: Model, shown: HostVariable) -> None:
    v = shown.variable
    is_parameter, is_output = v.causality is Causality.PARAMETER, v.causality is Causality.OUTPUT
    scalar = ET.SubElement(
        variables,
        "ScalarVariable",
        name=shown.name,
        valueReference=str(shown.reference),
        description=v.description,
        causality=v.causality.value,
        variability="fixed" if is_parameter else variability(model, v),
        attrib={"initial": "exact"} if is_parameter else {"initial": "calculated"} if is_output else {},
    )
    tag, attributes = _type(v)
    start = {} if is_output else {"start": _start(v, shown.entries.start)}
    ET.SubElement(scalar, tag, {**attributes, **start})


def _type(v: Variable) -> tuple[str, dict[str, str]]:
    if v.kind is Kind.REAL:
        return "Real", {"unit": v.unit.symbol, **bounds(v)}
    if v.kind is Kind.INTEGER:
        return "Integer", _integer_bounds(v)
    if v.enumeration is not None:
        return "Enumeration", {"declaredType": v.enumeration.__name__, **bounds(v)}
    return {Kind.BOOLEAN: "Boolean", Kind.STRING: "String"}[v.kind], {}


def _integer_bounds(v: Variable) -> dict[str, str]:
    """Return `min` and `max`, those of the width if none are declared; bounds outside of 32 bits are left out."""
    limits = {} if v.width in (None, Width.INT32) else {"min": str(v.width.lowest), "max": str(v.width.highest)}
    return {name: bound for name, bound in {**limits, **bounds(v)}.items() if Width.INT32.holds(int(bound))}


def _start(v: Variable, i: int) -> str:
    if v.kind is Kind.REAL:
        return number(np.ravel(v.start)[i])
    if v.kind is Kind.BOOLEAN:
        return boolean(v.start)
    return str(v.start) if v.kind is Kind.STRING else str(int(v.start))


def _add_structure(root: ET.Element, model: Model) -> None:
    """Add outputs and initial unknowns with their dependencies, as indices that count the scalar variables from 1."""
    references = model.layout.references(Form.FMI2)

    def indices(names: Iterable[str]) -> list[int]:
        return [reference + 1 for name in names for reference in references[name]]

    structure = ET.SubElement(root, "ModelStructure")
    outputs = ET.SubElement(structure, "Outputs")
    initial = ET.SubElement(structure, "InitialUnknowns")
    for v in model.description.outputs:
        dependencies = " ".join(map(str, sorted(indices(model.description.feedthrough.get(v.name, ())))))
        initial_ones = " ".join(map(str, sorted(indices(initial_dependencies(model, v.name)))))
        for index in indices([v.name]):
            ET.SubElement(outputs, "Unknown", index=str(index), dependencies=dependencies)
            ET.SubElement(initial, "Unknown", index=str(index), dependencies=initial_ones)
    for empty in (e for e in (outputs, initial) if len(e) == 0):
        structure.remove(empty)
