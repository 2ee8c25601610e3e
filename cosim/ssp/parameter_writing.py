"""Writes the start values of a unit as a parameter set (SSV)."""

import xml.etree.ElementTree as ET
from typing import Any

from handover.cosim.blocks.start_values import numbers_of
from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.description import FmuPort
from handover.cosim.ssp.connected_ports import entry_names, ports_of
from handover.cosim.ssp.described_types import DescribedTypes, add_dimensions
from handover.cosim.ssp.xml_writing import document, root_element
from handover.cosim.system.system import PlacedUnit


def bound_values(unit: PlacedUnit) -> dict[str, tuple[FmuPort, Any]]:
    """Return the start values to bind, by port.

    An enumeration that is what the FMU starts with anyway is left out: libcosim ends its process at enumerations.
    """
    ports = ports_of(unit.description)
    values = {name: (ports[name], value) for name, value in unit.start.items()}
    return {
        name: (port, value)
        for name, (port, value) in values.items()
        if port.kind is not Kind.ENUMERATION or port.start != str(int(numbers_of(port, value)[0]))
    }


def parameter_set(unit: PlacedUnit, version: str, name: str) -> bytes:
    """Return the SSV file of a unit's start values.

    All units' sets have one name: Ecos applies the sets of the name that it is told.
    """
    values = bound_values(unit)
    types = DescribedTypes(port for port, _ in values.values() if port.kind is not Kind.ENUMERATION)
    root = root_element("ssv:ParameterSet", version, name)
    parameters = ET.SubElement(root, "ssv:Parameters")
    for port, value in values.values():
        texts, names = _texts(port, value), entry_names(port)
        if len(names) == 1:
            texts = [" ".join(texts) if port.shape else texts[0]]
        for name, text in zip(names, texts, strict=True):
            parameter = ET.SubElement(parameters, "ssv:Parameter", name=name)
            types.add_type(parameter, "ssv", port).set("value", text)
            add_dimensions(parameter, port.shape if len(names) == 1 else ())
    types.add_units(root, "ssv")
    return document(root)


def _texts(port: FmuPort, value: Any) -> list[str]:
    if port.kind is Kind.STRING:
        return [str(value)]
    if port.kind is Kind.BINARY:
        return [bytes(value).hex()]
    numbers = numbers_of(port, value).tolist()
    if port.kind is Kind.BOOLEAN:
        return ["true" if x else "false" for x in numbers]
    if port.kind is Kind.ENUMERATION:
        names = {number: name for name, number in port.items}
        return [names[int(x)] for x in numbers]
    return [repr(float(x)) if port.kind is Kind.REAL else str(int(x)) for x in numbers]
