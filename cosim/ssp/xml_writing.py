"""Makes the XML files of an SSP.

Elements have the standard's own prefixes in their names: libcosim knows elements by these, not by their namespaces.
"""

import xml.etree.ElementTree as ET

from handover.cosim.ssp.namespaces import NAMESPACES


def root_element(name: str, version: str, called: str) -> ET.Element:
    """Return a file's outermost element."""
    prefix = name.partition(":")[0]
    namespaces = {f"xmlns:{p}": NAMESPACES[p] for p in (prefix, "ssc")}
    return ET.Element(name, {**namespaces, "version": version, "name": called, "generationTool": "handover"})


def document(root: ET.Element) -> bytes:
    """Return a file's content."""
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
