"""Reads XML from untrusted files: document types and entities, which can exhaust memory or fetch files, are rejected.

defusedxml decides whether a document is safe; lxml, which knows the line of each element, then parses it.
"""

import importlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import ParseError

import defusedxml
import defusedxml.ElementTree

_etree: Any = importlib.import_module("lxml.etree")  # neither it nor its classes have types


class UnsafeXml(ValueError):
    """XML that is malformed or unsafe to read; the message says what is wrong and where."""


@dataclass(frozen=True)
class XmlElement:
    """An element with the line at which it begins; `tag` has its namespace before it, as in `{urn:x}name`."""

    tag: str
    attributes: Mapping[str, str]
    line: int
    children: tuple["XmlElement", ...]

    def get(self, name: str, default: str = "") -> str:
        """Return an attribute's value."""
        return self.attributes.get(name, default)

    def named(self, *path: str) -> Iterator["XmlElement"]:
        """Yield the elements that are reached by a path of tags."""
        if not path:
            yield self
        for child in self.children if path else ():
            if child.tag == path[0]:
                yield from child.named(*path[1:])


def parse_xml(content: bytes) -> XmlElement:
    """Parse a document.

    Raises:
        UnsafeXml: it is not well-formed, in an unknown encoding, or has a document type or entities.
    """
    check_xml(content)
    try:
        parser = _etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True)
        return _converted(_etree.fromstring(content, parser))
    except SyntaxError as e:  # the base class of lxml's errors
        raise UnsafeXml(f"it is not well-formed: {' '.join(str(e).split())}") from e


def check_xml(content: bytes) -> None:
    """Check that a document is safe for other parsers too.

    Raises:
        UnsafeXml: as `parse_xml`.
    """
    try:
        defusedxml.ElementTree.fromstring(content, forbid_dtd=True)
    except ParseError as e:
        raise UnsafeXml(f"it is not well-formed: {e}") from e
    except defusedxml.DTDForbidden as e:
        raise UnsafeXml(
            "it has a document type (<!DOCTYPE ...>), in which entities could be declared that exhaust memory or "
            "fetch other files; none is needed: remove it"
        ) from e
    except defusedxml.DefusedXmlException as e:
        raise UnsafeXml(f"it refers to what lies outside of it: {' '.join(str(e).split())}") from e
    except (LookupError, ValueError) as e:  # an encoding that is unknown or of several bytes per character
        raise UnsafeXml(f"its encoding cannot be read: {e}; use UTF-8") from e


def _converted(root: Any) -> XmlElement:
    """Convert lxml's tree, from its leaves up."""
    converted: dict[Any, list[XmlElement]] = {}  # by parent, its children so far
    for _, element in _etree.iterwalk(root, events=("end",)):
        if isinstance(element.tag, str):  # else a processing instruction
            attributes = {str(k): str(v) for k, v in element.attrib.items()}
            children = tuple(converted.pop(element, ()))
            one = XmlElement(element.tag, attributes, int(element.sourceline), children)
            converted.setdefault(element.getparent(), []).append(one)
    return converted[None][0]
