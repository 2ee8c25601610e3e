"""Reads XML from untrusted files: document types and entities, which can exhaust memory or fetch files, are rejected.

defusedxml decides whether a document is safe; lxml, which knows the line of each element, then parses it.
"""

import gc
import importlib
import re
import xml.parsers.expat
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from xml.etree.ElementTree import ParseError

import defusedxml
import defusedxml.ElementTree

_etree: Any = importlib.import_module("lxml.etree")  # neither it nor its classes have types


_UNBOUND_PREFIX = xml.parsers.expat.errors.codes[xml.parsers.expat.errors.XML_ERROR_UNBOUND_PREFIX]
_PREFIX, _DECLARED = re.compile(rb"[<\s]([A-Za-z_][\w.-]*):[A-Za-z_]"), re.compile(rb"\bxmlns:([\w.-]+)\s*=")
_DECLARATION = re.compile(r"\A<\?xml\s[^>]*\?>")
_ROOT_TAG = re.compile(rb"(<[A-Za-z_][\w:.-]*)([^>]*)")

_MOST_MARKS = 10_000_000
"""Tags of a document, and tags and values of one that becomes a tree, which take some 200 bytes of memory each."""
_MOST_NAMESPACES = 1000
"""Prefixes that are declared at one place: lxml looks through all of them for each element."""


class UnsafeXml(ValueError):
    """XML that is malformed or unsafe to read; the message says what is wrong and where."""


class XmlElement:
    """An element with the line at which it begins; `tag` has its namespace before it, as in `{urn:x}name`.

    It is a view of lxml's: of a large document only what is looked at becomes Python objects. Views of the same element
    are equal.
    """

    __slots__ = ("_element",)

    def __init__(self, element: Any) -> None:
        self._element = element

    def __eq__(self, other: object) -> bool:
        return isinstance(other, XmlElement) and self._element is other._element

    def __hash__(self) -> int:
        return hash(self._element)

    @property
    def tag(self) -> str:
        """Its full name."""
        return self._element.tag

    @property
    def attributes(self) -> Mapping[str, str]:
        """Its attributes' values by name."""
        return dict(self._element.attrib)

    @property
    def line(self) -> int:
        """The line at which it begins, counted from 1."""
        return int(self._element.sourceline)

    @property
    def children(self) -> tuple["XmlElement", ...]:
        """The elements in it, without processing instructions."""
        return tuple(map(XmlElement, self._element.iterchildren("*")))

    def get(self, name: str, default: str = "") -> str:
        """Return an attribute's value."""
        return self._element.get(name, default)

    def named(self, *path: str) -> Iterator["XmlElement"]:
        """Yield the elements that are reached by a path of tags; by an empty one this element is."""
        if not path:
            yield self
            return
        rest = path[1:]
        for child in self._element.iterchildren(path[0]):
            if rest:
                yield from XmlElement(child).named(*rest)
            else:
                yield XmlElement(child)


def parse_xml(content: bytes) -> XmlElement:
    """Parse a document; prefixes that it does not declare do not matter, see `with_prefixes`.

    Raises:
        UnsafeXml: it is not well-formed, in an unknown encoding, or has a document type or entities.
    """
    return XmlElement(tree_of(with_prefixes(content)))


def tree_of(content: bytes) -> Any:
    """Return lxml's tree of a document that `check_xml` has checked.

    Raises:
        UnsafeXml: it is not well-formed, or its tree would take gigabytes.
    """
    _check_extent(content, b"<", b"=")
    try:
        parser = _etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True)
        return _etree.fromstring(content, parser)
    except SyntaxError as e:  # the base class of lxml's errors
        raise UnsafeXml(f"it is not well-formed: {' '.join(str(e).split())}") from e


def _check_extent(content: bytes, *marks: bytes) -> None:
    """Raise UnsafeXml where these marks are so many that they take minutes, or gigabytes: a small archive may do."""
    if sum(map(content.count, marks)) > _MOST_MARKS:
        raise UnsafeXml(f"it has over {_MOST_MARKS / 1e6:g} million tags and values")


def in_utf8(content: bytes) -> bytes:
    """Return a document of UTF-16, which is known by its first bytes, in UTF-8; of another encoding as it is.

    Raises:
        UnsafeXml: it is not what these bytes say.
    """
    if not content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content
    try:
        text = content.decode("utf-16")
    except UnicodeDecodeError as e:
        raise UnsafeXml(f"it is not well-formed: {e.reason}") from e
    return _DECLARATION.sub("", text, count=1).encode()


def with_prefixes(content: bytes) -> bytes:
    """Return a document in which prefixes of elements and attributes that it does not declare are declared at its root.

    Some tools leave that out where they annotate a file. One that declares all is returned as it is, see `in_utf8`.

    Raises:
        UnsafeXml: as `parse_xml`.
    """
    content = in_utf8(content)
    try:
        check_xml(content)
    except UnsafeXml as e:
        if not (isinstance(e.__cause__, ParseError) and e.__cause__.code == _UNBOUND_PREFIX):
            raise
        root = _ROOT_TAG.search(content)
        if root is None:
            raise
        prefixes = set(_PREFIX.findall(content)) - set(_DECLARED.findall(root[2])) - {b"xml", b"xmlns"}
        declared = b"".join(b' xmlns:%b="urn:undeclared:%b"' % (p, p) for p in sorted(prefixes))
        made = content[: root.end(1)] + declared + content[root.end(1) :]
        check_xml(made)
        return made
    return content


class _Nothing:
    """What a check makes of a document."""

    def close(self) -> None:
        """End the document."""


def check_xml(content: bytes, watch: Callable[[Any], None] | None = None) -> None:
    """Check that a document is safe for other parsers too.

    Args:
        content: the document.
        watch: is given the expat parser before it starts, to set its handlers of elements.

    Raises:
        UnsafeXml: as `parse_xml`.
    """
    _check_extent(content, b"<")
    in_scope = 0

    def declare(_prefix: str | None, _uri: str | None) -> None:
        nonlocal in_scope
        in_scope += 1
        if in_scope > _MOST_NAMESPACES:
            raise UnsafeXml(f"it has over {_MOST_NAMESPACES} prefixes of names at one place")

    def leave(_prefix: str | None) -> None:
        nonlocal in_scope
        in_scope -= 1

    try:
        parser = defusedxml.ElementTree.XMLParser(target=_Nothing(), forbid_dtd=True)
        parser.parser.DefaultHandlerExpand = None  # is called for each blank and text, and has nothing to do here
        parser.parser.StartNamespaceDeclHandler, parser.parser.EndNamespaceDeclHandler = declare, leave
        if watch is not None:
            watch(parser.parser)
        parser.feed(content)
        parser.close()
    except UnsafeXml:
        raise
    except ParseError as e:
        reason = str(e).replace("not well-formed (invalid token)", "invalid token")
        raise UnsafeXml(f"it is not well-formed: {reason}") from e
    except defusedxml.DTDForbidden as e:
        raise UnsafeXml(
            "it has a document type (<!DOCTYPE ...>), in which entities could be declared that exhaust memory or "
            "fetch other files; none is needed: remove it"
        ) from e
    except defusedxml.DefusedXmlException as e:
        raise UnsafeXml(f"it refers to what lies outside of it: {' '.join(str(e).split())}") from e
    except (LookupError, ValueError) as e:  # an encoding that is unknown or of several bytes per character
        raise UnsafeXml(f"its encoding cannot be read: {e}; use UTF-8") from e


@contextmanager
def collection_paused() -> Generator[None, None, None]:
    """Pause the collection of garbage: a description is all that is made, and searching it for some takes a third."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
