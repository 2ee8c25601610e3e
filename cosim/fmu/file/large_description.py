"""Model descriptions of very many variables, reduced as they are read to what a co-simulation sets, gets or refers to.

A tree of a million variables takes gigabytes, and most of them are local: no call of a co-simulation depends on them.
They are dropped as they are read, so neither the tree nor FMPy's objects of them are ever whole in memory.
"""

import importlib
import io
import re
import zipfile
from typing import Any

from handover.cosim.fmu.file.archive import DESCRIPTION, FmuArchive
from handover.cosim.fmu.file.xml import UnsafeXml, check_xml

_etree: Any = importlib.import_module("lxml.etree")  # neither it nor its classes have types

LARGE = 8 << 20
"""Bytes of a description from which on it is reduced: some 80,000 variables."""

_UNUSED = ("local", "calculatedParameter")
_INTEGERS = tuple(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))
_TAGS = ("ScalarVariable", "Float32", "Float64", *_INTEGERS, "Boolean", "Enumeration", "String", "Binary")
"""Variables; those of other types are kept."""
_SIZES = re.compile(rb"<Dimension\b[^>]*\bvalueReference\s*=\s*[\"'](\d+)")


def is_large(archive: FmuArchive) -> bool:
    """Return whether a description is read in its reduced form."""
    return archive.description_name in archive.names and archive.size(archive.description_name) > LARGE


def description_of(archive: FmuArchive) -> bytes:
    """Return an FMU's description, in its reduced form if it is large.

    Raises:
        InvalidFmu: it is missing or damaged. UnsafeXml: it is large, and malformed or unsafe to read.
    """
    if not is_large(archive):
        return archive.description()
    if archive.reduced_description is None:
        archive.reduced_description = _reduced(archive.description())
    return archive.reduced_description


def xml_source_of(archive: FmuArchive) -> str | io.BytesIO:
    """Return what FMPy reads a checked FMU's XML files from: see `FmuArchive.xml_source`; reduced if it is large."""
    if not is_large(archive):
        return archive.xml_source()
    source = io.BytesIO()
    with zipfile.ZipFile(source, "w") as z:
        z.writestr(DESCRIPTION, description_of(archive))
    source.seek(0)
    return source


def _reduced(content: bytes) -> bytes:
    check_xml(content)
    sizes = {reference.decode() for reference in _SIZES.findall(content)}
    options = {"resolve_entities": False, "no_network": True, "load_dtd": False, "remove_comments": True}
    events: Any = _etree.iterparse(io.BytesIO(content), events=("end",), tag=_TAGS, **options)
    kept: dict[int, int] = {}
    count, dropped = 0, None
    try:
        for _, element in events:
            variables = element.getparent()
            if variables is None or variables.tag != "ModelVariables":
                continue
            count += 1
            if dropped is not None:  # the parser still needs the last one
                variables.remove(dropped)
            dropped = None if _is_used(element, sizes) else element
            if dropped is None:
                kept[count] = len(kept) + 1
    except SyntaxError as e:  # the base class of lxml's errors
        raise UnsafeXml(f"it is not well-formed: {' '.join(str(e).split())}") from e
    if dropped is not None:
        dropped.getparent().remove(dropped)
    root = events.root
    _keep_structure(root, kept)
    return _etree.tostring(root, encoding="utf-8", xml_declaration=True)


def _is_used(variable: Any, sizes: set[str]) -> bool:
    """Return whether a variable can be set or got, sizes an array, or has a value that can be set before the start."""
    if variable.get("causality", "local") not in _UNUSED:
        return True
    if variable.get("valueReference") in sizes and variable.tag != "ScalarVariable":
        return True
    starts = (variable, *variable.iterchildren("*"))
    return variable.get("initial") in ("exact", "approx") and any(v.get("start") is not None for v in starts)


def _keep_structure(root: Any, kept: dict[int, int]) -> None:
    """Leave out of the structure what refers to variables that are dropped; of FMI 2, count variables again."""
    is_fmi2 = root.get("fmiVersion", "").startswith("2")
    references = {v.get("valueReference") for v in root.iterfind("ModelVariables/*")}

    def renamed(text: str) -> str | None:
        if not is_fmi2:
            return text if text in references else None
        return str(kept[int(text)]) if text.isdecimal() and int(text) in kept else None

    name = "index" if is_fmi2 else "valueReference"
    for unknown in list(root.iterfind("ModelStructure//*")):
        if unknown.get(name) is None:
            continue
        new = renamed(unknown.get(name))
        if new is None:
            unknown.getparent().remove(unknown)
            continue
        unknown.set(name, new)
        if unknown.get("dependencies") is not None:
            given = unknown.get("dependencies").split()
            kinds = (unknown.get("dependenciesKind") or "").split()
            there = [k for k, reference in enumerate(given) if renamed(reference) is not None]
            unknown.set("dependencies", " ".join(renamed(given[k]) or "" for k in there))
            if len(kinds) == len(given):
                unknown.set("dependenciesKind", " ".join(kinds[k] for k in there))
