"""Types, units and enumerations of an FMU's ports, as an SSP names them."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence

from handover.cosim.blocks.units import Unit
from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.description import FmuPort

Items = tuple[tuple[str, int], ...]


class DescribedTypes:
    """Collects the units and enumerations that types refer to by name, and writes types.

    Units that have one name but are not the same cannot be told apart: then the FMUs' own count.
    """

    def __init__(self, ports: Iterable[FmuPort]) -> None:
        self._units: dict[str, Unit | None] = {}
        self._enumerations: dict[Items, str] = {}
        for port in ports:
            if port.kind is Kind.REAL and port.unit.defined:
                known = self._units.setdefault(port.unit.symbol, port.unit)
                self._units[port.unit.symbol] = port.unit if known == port.unit else None
            if port.kind is Kind.ENUMERATION and port.items not in self._enumerations:
                taken = list(self._enumerations.values())
                same = sum(name.partition("-")[0] == port.name for name in taken)
                self._enumerations[port.items] = f"{port.name}-{same + 1}" if same else port.name

    def add_type(self, parent: ET.Element, prefix: str, port: FmuPort) -> ET.Element:
        """Add the element that tells a port's type, such as `<ssc:Real unit="m"/>`."""
        attributes: dict[str, str] = {}
        if port.kind is Kind.REAL and self._units.get(port.unit.symbol) == port.unit:
            attributes["unit"] = port.unit.symbol
        if port.kind is Kind.ENUMERATION and prefix == "ssc":
            attributes["name"] = self._enumerations[port.items]
        if port.kind is Kind.BINARY and port.mime:
            attributes["mime-type"] = port.mime
        return ET.SubElement(parent, f"{prefix}:{port.fmi_type}", attributes)

    def add_enumerations(self, root: ET.Element, prefix: str) -> None:
        """Add the definitions of all enumerations, if there are any."""
        parent = ET.SubElement(root, f"{prefix}:Enumerations") if self._enumerations else root
        for items, name in self._enumerations.items():
            enumeration = ET.SubElement(parent, "ssc:Enumeration", name=name)
            for item, value in items:
                ET.SubElement(enumeration, "ssc:Item", name=item, value=str(value))

    def add_units(self, root: ET.Element, prefix: str) -> None:
        """Add the definitions of all units, if there are any."""
        units = [unit for unit in self._units.values() if unit is not None]
        parent = ET.SubElement(root, f"{prefix}:Units") if units else root
        for unit in units:
            base = {n: str(x) for n, x in unit.base.nonzero().items()}
            base |= {"factor": repr(unit.factor)} if unit.factor != 1 else {}
            base |= {"offset": repr(unit.offset)} if unit.offset != 0 else {}
            ET.SubElement(ET.SubElement(parent, "ssc:Unit", name=unit.symbol), "ssc:BaseUnit", base)


def add_dimensions(parent: ET.Element, shape: Sequence[int]) -> None:
    """Add the extents of an array that is one variable."""
    for extent in shape:
        ET.SubElement(parent, "ssc:Dimension", size=str(extent))
