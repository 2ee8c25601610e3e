"""Variables inside of an FMU that a run can read besides its outputs: local ones and parameters, also calculated ones.

There may be very many, so a description has none of them but what can be set; they are read where somebody asks.
"""

from collections.abc import Iterator
from pathlib import Path

from handover.cosim.blocks.units import UNKNOWN, BaseExponents, Unit
from handover.cosim.blocks.variable import Causality
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.described_variable import variables_of
from handover.cosim.fmu.file.description import KINDS, FmuPort
from handover.cosim.fmu.file.fmpy_edge import checked_xml
from handover.cosim.fmu.file.xml import XmlElement, collection_paused

LOCAL = ("local", "calculatedParameter")
"""Causalities of what the unit computes."""

PARAMETERS = ("parameter", "structuralParameter")
"""Causalities of what is set before the start."""


@collection_paused()
def internal_ports(path: Path, fmi: int) -> dict[str, tuple[str, FmuPort]]:
    """Return the variables inside of an FMU by name, each with its causality, as ports that can be read.

    Raises:
        InvalidFmu: the file cannot be read.
    """
    return ports_inside(checked_xml(FmuArchive(path), whole=True), fmi, (*LOCAL, *PARAMETERS))


def ports_inside(root: XmlElement, fmi: int, causalities: tuple[str, ...]) -> dict[str, tuple[str, FmuPort]]:
    """Return variables of some causalities that a model description has, and that can be read at any time."""
    variables = variables_of(root, fmi)
    starts_of, units = {v.reference: v.values.get("start") for v in variables}, dict(_units(root))
    types = {t.get("name"): _unit_name(t) for group in root.named("TypeDefinitions") for t in group.children}
    found: dict[str, tuple[str, FmuPort]] = {}
    for v in variables:
        shape, kind = v.shape(starts_of), KINDS.get(v.type)
        is_free = v.causality in causalities and "clocks" not in v.element.attributes and v.reference.isdecimal()
        if is_free and kind is not None and shape is not None and 0 not in shape:
            symbol = v.values.get("unit") or types.get(v.values.get("declaredType"), "")
            port = FmuPort(
                name=v.name,
                kind=kind,
                causality=Causality.OUTPUT,
                fmi_type=v.type,
                references=(int(v.reference),),
                shape=shape,
                unit=units.get(symbol, Unit(symbol, defined=False)) if symbol else UNKNOWN,
                description=v.element.get("description"),
                discrete=v.element.get("variability", "continuous") != "continuous",
            )
            found[v.name] = v.causality, port
    return found


def _unit_name(declared: XmlElement) -> str:
    """Return the unit that a declared type names, in FMI 2 in the element in it."""
    return next((e.get("unit") for e in (declared, *declared.children) if e.get("unit")), "")


def _units(root: XmlElement) -> Iterator[tuple[str, Unit]]:
    for element in root.named("UnitDefinitions", "Unit"):
        for base in element.named("BaseUnit"):
            exponents = {n: int(base.get(n, "0")) for n in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
            factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
            yield element.get("name"), Unit(element.get("name"), BaseExponents(**exponents), factor, offset)
