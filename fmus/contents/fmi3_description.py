"""modelDescription.xml of FMI 3.0: arrays with dimensions, values in row-major order; pictures as binary variables.

In the scalar form an array's entries are variables of their own, named as in FMI 2.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from fractions import Fraction

import numpy as np

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
from handover.fmus.layout import SAMPLE_CLOCK, TIME, HostVariable, capacity

BYTES_MIME_TYPE = "application/octet-stream"


def fmi3_description(model: Model) -> bytes:
    """Return the model description as XML."""
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=model.name,
        instantiationToken=model.token,
        description=model.summary,
        generationTool=GENERATOR,
        variableNamingConvention="structured",
    )
    _add_interface(root, model)
    add_units(root, model.description.variables)
    _add_types(root, model.description.variables)
    add_log_categories(root)
    add_default_experiment(root, model)
    variables = ET.SubElement(root, "ModelVariables")
    ET.SubElement(
        variables,
        "Float64",
        name=TIME,
        valueReference="0",
        description="time",
        causality="independent",
        variability="continuous",
    )
    for v in model.layout.shown(model.form):
        _add_variable(variables, model, v)
    if model.description.period is not None and model.layout.has_clock(model.form):
        _add_clock(variables, model.description.period)
    _add_structure(root, model)
    return to_xml(root)


def _add_interface(root: ET.Element, model: Model) -> None:
    block = model.description
    interface = ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model.name,
        needsExecutionTool=boolean(model.needs_python),
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize=boolean(model.variable_step),
    )
    if block.period is not None:
        interface.set("fixedInternalStepSize", number(float(block.period)))
    if model.layout.has_clock(model.form) or block.has_events:
        interface.set("hasEventMode", "true")
        interface.set("mightReturnEarlyFromDoStep", "true")
    if block.has_derivatives:
        interface.set("providesDirectionalDerivatives", "true")
        interface.set("providesAdjointDerivatives", "true")


def _add_clock(variables: ET.Element, period: Fraction) -> None:
    """Add a sampled unit's clock after all other variables: there the runtime expects its value reference.

    No port names it in its attribute `clocks`: a clocked variable has a value only while its clock is active, so hosts
    without event mode could not read it, although a sampled unit's outputs hold between ticks.
    """
    ET.SubElement(
        variables,
        "Clock",
        name=SAMPLE_CLOCK,
        valueReference=str(len(variables)),
        description="ticks at the start, and whenever a period has passed",
        causality="input",
        variability="discrete",
        intervalVariability="constant",
        intervalDecimal=number(float(period)),
        shiftDecimal="0.0",
        supportsFraction="true",
        resolution=str(period.denominator),
        intervalCounter=str(period.numerator),
        shiftCounter="0",
    )


def _add_types(root: ET.Element, variables: Iterable[Variable]) -> None:
    used = enumerations(variables)
    if not used:
        return
    definitions = ET.SubElement(root, "TypeDefinitions")
    for enumeration in used:
        items = ET.SubElement(definitions, "EnumerationType", name=enumeration.__name__)
        for item in enumeration:
            ET.SubElement(items, "Item", name=item.name, value=str(int(item)))


def _add_variable(variables: ET.Element, model: Model, shown: HostVariable) -> None:
    v = shown.variable
    is_parameter, is_output = v.causality is Causality.PARAMETER, v.causality is Causality.OUTPUT
    tag, type_attributes = _type(v)
    attributes = {
        "name": shown.name,
        "valueReference": str(shown.reference),
        "description": v.description,
        "causality": v.causality.value,
        "variability": "fixed" if is_parameter else variability(model, v),
    }
    if is_parameter or is_output:
        attributes["initial"] = "exact" if is_parameter else "calculated"
    attributes.update(type_attributes)
    start = None if is_output else _start(shown)
    in_attribute = v.kind not in (Kind.STRING, Kind.BINARY)
    if start is not None and in_attribute:
        attributes["start"] = start
    element = ET.SubElement(variables, tag, attributes)
    for extent in shown.shape:
        ET.SubElement(element, "Dimension", start=str(extent))
    if start is not None and not in_attribute:
        ET.SubElement(element, "Start", value=start)


def _type(v: Variable) -> tuple[str, dict[str, str]]:
    if v.width is not None:
        unit = {"unit": v.unit.symbol} if v.kind is Kind.REAL else {}
        return v.width.value, {**unit, **bounds(v)}
    if v.enumeration is not None:
        return "Enumeration", {"declaredType": v.enumeration.__name__, **bounds(v)}
    if v.kind is Kind.BINARY:
        mime = v.raster.mime if v.raster else BYTES_MIME_TYPE
        return "Binary", {"mimeType": mime, "maxSize": str(capacity(v))}
    return {Kind.BOOLEAN: "Boolean", Kind.STRING: "String"}[v.kind], {}


def _start(shown: HostVariable) -> str:
    """Return the start value; a picture's is empty, which means black to the runtime."""
    v = shown.variable
    if v.kind is Kind.REAL:
        return " ".join(number(np.ravel(v.start)[i]) for i in shown.entries)
    if v.kind is Kind.BOOLEAN:
        return boolean(v.start)
    if v.kind is Kind.BINARY:
        return ""
    return str(v.start) if v.kind is Kind.STRING else str(int(v.start))


def _add_structure(root: ET.Element, model: Model) -> None:
    references = model.layout.references(model.form)

    def listed(names: Iterable[str]) -> str:
        return " ".join(map(str, sorted(reference for name in names for reference in references[name])))

    structure = ET.SubElement(root, "ModelStructure")
    for v in model.description.outputs:
        dependencies = listed(model.description.feedthrough.get(v.name, ()))
        for reference in references[v.name]:
            ET.SubElement(structure, "Output", valueReference=str(reference), dependencies=dependencies)
    for v in model.description.outputs:
        initial_ones = listed(initial_dependencies(model, v.name))
        for reference in references[v.name]:
            ET.SubElement(structure, "InitialUnknown", valueReference=str(reference), dependencies=initial_ones)
