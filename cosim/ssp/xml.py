"""XML files of an SSP: read with checks whose faults name file and line, written, and the names of their elements.

Elements are named by the prefixes that the standard uses for their namespaces, such as `ssd:System`. They are written
with these prefixes too: libcosim knows elements by them, not by their namespaces.
"""

import functools
import importlib
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fmpy

from handover.cosim.exceptions import InvalidSsp
from handover.cosim.fmu.file.xml import UnsafeXml, XmlElement, tree_of, with_prefixes

NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
}
"""The same in SSP 1.0 and 2.0."""

STRUCTURE = "SystemStructure.ssd"
"""The file at the top of an SSP's archive."""

STEP_ANNOTATION = "handover.communication"
"""Type of the annotation of a component whose communication step is not the one that its FMU proposes, and of a system
whose units take another one where they step in parallel."""

OMS_ANNOTATION, OMS_NAMESPACE = (
    "org.openmodelica",
    "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
)
"""Type of the annotations of OMSimulator, which imports no system without one, and their namespace."""

OSP_ANNOTATION, OSP_NAMESPACE = (
    "com.opensimulationplatform",
    "http://opensimulationplatform.com/SSP/OSPAnnotations",
)
"""Type of the annotations that libcosim and Ecos read, and their namespace."""

VERSIONS = ("1.0", "2.0")
"""Versions of SSP that can be read."""

_PREFIXES = {uri: prefix for prefix, uri in NAMESPACES.items()}


def tag(name: str) -> str:
    """Return an element's full name: `{http://...}System` for `ssd:System`."""
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"


def short_name(full: str) -> str:
    """Return an element's short name: `ssd:System` for `{http://...}System`."""
    uri, _, local = full.removeprefix("{").rpartition("}")
    return f"{_PREFIXES[uri]}:{local}" if uri in _PREFIXES else local


def shortened(message: str) -> str:
    """Return a message in which full names of elements are short ones."""
    for uri, prefix in _PREFIXES.items():
        message = message.replace(f"{{{uri}}}", f"{prefix}:")
    return message


def local(full: str) -> str:
    """Return an element's name without its namespace."""
    return full.rpartition("}")[2]


_etree: Any = importlib.import_module("lxml.etree")  # has no types, nor have its classes

_SCHEMAS = {
    "ssd:SystemStructureDescription": "SystemStructureDescription.xsd",
    "ssv:ParameterSet": "SystemStructureParameterValues.xsd",
    "ssm:ParameterMapping": "SystemStructureParameterMapping.xsd",
}
_MAX_REPORTED = 3
"""Violations of the schema in an error: further ones mostly follow from the first."""


class SspPart:
    """An XML file of an SSP. One of version 1.0 is validated by the standard's schema; for 2.0 there is none here.

    Args:
        path: the SSP.
        member: the file in it.
        content: the file's content.
        wanted: name of its root, such as `ssv:ParameterSet`.
        of: the file that refers to it, where what is left out of it and what is tolerated is listed, too.

    Raises:
        InvalidSsp: it is malformed, unsafe, of another version, invalid, or has another root.
    """

    def __init__(self, path: Path, member: str, content: bytes, wanted: str, of: "SspPart | None" = None) -> None:
        self.path, self.member = path, member
        self.unsupported = list[str]() if of is None else of.unsupported
        """What was left out, all of it a fault: reading goes on, so that it is reported with all others."""
        self.tolerated = list[str]() if of is None else of.tolerated
        """What is not as it should be and does not matter."""
        try:
            declared = with_prefixes(content)
            self.root = XmlElement(tree := tree_of(declared))
        except UnsafeXml as e:
            raise InvalidSsp(path, [f"{self._file or 'it'} cannot be read: {e}"]) from e
        self.check_root(self.root, wanted)
        if self.root.get("version") == "1.0":
            faults = _schema_faults(tree, wanted)
            if faults:
                raise InvalidSsp(path, [self._located(fault) for fault in faults])
        if declared is not content:
            self.tolerated.append(f"{member}: it uses prefixes of names that it does not declare (xmlns)")

    def check_root(self, root: XmlElement, wanted: str) -> None:
        """Check the name and the version of a file's root, or of an element in its place inside another file.

        Raises:
            InvalidSsp: it has another name or version.
        """
        if root.tag != tag(wanted):
            raise self.fault(root, f"expected <{wanted}>, not <{short_name(root.tag)[:80]}>")
        if root.get("version") not in VERSIONS:
            version = root.get("version")[:80] or "none"
            raise self.fault(root, f"the version of <{wanted}> is {version}; {' and '.join(VERSIONS)} can be read")

    def fault(self, element: XmlElement, fault: str) -> InvalidSsp:
        """Return the exception for a fault at an element."""
        return InvalidSsp(self.path, [self.where(element, fault)])

    def leave_out(self, element: XmlElement, fault: str) -> None:
        """Note a fault without which the rest can be read."""
        self.unsupported.append(self.where(element, fault))

    def where(self, element: XmlElement, fault: str) -> str:
        """Return a fault with the file and line of its element before it."""
        return self._located(f"line {element.line}: {fault}")

    @property
    def _file(self) -> str:
        """The file within the SSP; "" of an `.ssd` that was given by itself, which messages begin with already."""
        return "" if self.path.suffix.lower() == ".ssd" and self.path.name == self.member else self.member

    def _located(self, line: str) -> str:
        return f"{self._file}, {line}" if self._file else line

    def children(self, parent: XmlElement, *names: str) -> Iterator[XmlElement]:
        """Yield the elements at a path of names such as `ssd:Elements`."""
        return parent.named(*map(tag, names))

    def text(self, element: XmlElement, name: str) -> str:
        """Return a required attribute.

        Raises:
            InvalidSsp: it is missing.
        """
        if name not in element.attributes:
            raise self.fault(element, f"<{short_name(element.tag)}> has no attribute {name!r}")
        return element.attributes[name]

    def number(self, element: XmlElement, name: str, default: float | None = None) -> float:
        """Return an attribute that is a finite number; it is required if there is no default.

        Raises:
            InvalidSsp: it is missing, or no finite number.
        """
        if default is not None and name not in element.attributes:
            return default
        given = self.text(element, name)
        try:
            number = float(given)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise self.fault(element, f"{name}={given[:80]!r} is not a finite number")
        return number

    def flag(self, element: XmlElement, name: str) -> bool:
        """Return an attribute that is true or false, false if it is not there.

        Raises:
            InvalidSsp: it is neither.
        """
        given = element.get(name, "false")
        if given not in ("true", "false", "1", "0"):
            raise self.fault(element, f"{name}={given[:80]!r} is neither true nor false")
        return given in ("true", "1")


@functools.cache
def _schema(wanted: str) -> Any:
    return _etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "ssp" / "schema" / _SCHEMAS[wanted]))


def _schema_faults(tree: Any, wanted: str) -> list[str]:
    schema = _schema(wanted)
    schema.validate(tree)
    return [f"line {entry.line}: {shortened(str(entry.message))}" for entry in schema.error_log][:_MAX_REPORTED]


def root_element(name: str, version: str, called: str) -> ET.Element:
    """Return a file's outermost element."""
    prefix = name.partition(":")[0]
    namespaces = {f"xmlns:{p}": NAMESPACES[p] for p in (prefix, "ssc")}
    return ET.Element(name, {**namespaces, "version": version, "name": called, "generationTool": "handover"})


def document(root: ET.Element) -> bytes:
    """Return a file's content."""
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
