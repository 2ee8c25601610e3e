"""What is wrong with a component's connectors, compared with the variables of its FMU."""

from collections.abc import Mapping

from handover.cosim.blocks.units import Unit
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import nearest
from handover.cosim.fmu.description import FmuDescription, FmuPort
from handover.cosim.ssp.changes import converted
from handover.cosim.ssp.connected_ports import find_entry, ports_of, variable_names
from handover.cosim.ssp.structure import SspComponent, SspConnector

GIVES = {"output", "calculatedParameter"}
"""Kinds of connector that a component gives values by."""

TAKES = {"input", "parameter"}
"""Kinds of connector that a component takes values by."""

_WHOLE = (Kind.INTEGER, Kind.ENUMERATION)
_KINDS: Mapping[str, tuple[Kind, ...]] = {
    **dict.fromkeys(("Real", "Float32", "Float64"), (Kind.REAL,)),
    **dict.fromkeys(("Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))), _WHOLE),
    **{kind.value.capitalize(): (kind,) for kind in (Kind.BOOLEAN, Kind.STRING, Kind.ENUMERATION, Kind.BINARY)},
}
"""What a connector's type may be in an FMU."""


def connector_faults(component: SspComponent, path: str, d: FmuDescription) -> list[str]:
    """Return what is wrong with the connectors of a component; `path` is its name, with those of the systems around it.

    Connectors of other kinds than inputs, outputs and parameters are not looked at: they cannot be connected here.
    """
    ports = ports_of(d)
    faults: list[str] = []
    for c in component.connectors.values():
        found = find_entry(ports, c.name)
        if found is not None and c.kind in TAKES | GIVES:
            faults += [f"{c.where}{path}.{c.name} {fault}" for fault in _differences(c, found[0])]
        elif c.kind in ("input", "output", "parameter"):
            near = nearest(c.name, variable_names(d))
            faults.append(f"{c.where}the FMU of {path!r} has no variable {c.name!r}; {near}")
    return faults


def _differences(c: SspConnector, port: FmuPort) -> list[str]:
    found: list[str] = []
    if port.causality.value != c.kind:
        found.append(f"is of kind {c.kind} here and of causality {port.causality.value} in its FMU")
    if c.type_name in _KINDS and port.kind not in _KINDS[c.type_name]:
        found.append(f"is of type {c.type_name} here and {port.type_name} in its FMU")
    if _differ(c.unit, port.unit):
        undefined = "" if c.unit.defined else ", which <ssd:Units> does not define,"
        found.append(f"is in {c.unit.symbol}{undefined} here and in {port.unit.symbol} in its FMU")
    return found


def _differ(a: Unit, b: Unit) -> bool:
    try:
        return converted(a, b) is not None
    except ValueError:
        return True
