"""Model descriptions of very many variables, reduced as they are read to what a co-simulation sets, gets or refers to.

A tree of a million variables takes gigabytes, and most of them are local: no call of a co-simulation depends on them.
They are dropped as they are read, so neither the tree nor FMPy's objects of them are ever whole in memory.
"""

import importlib
import io
import re
import zipfile
from functools import lru_cache
from pathlib import Path
from typing import Any

from handover.cosim.fmu.file.archive import DESCRIPTION, FmuArchive, description_state
from handover.cosim.fmu.file.xml import UnsafeXml, check_xml, in_utf8, tree_of, with_prefixes

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
    return _reduced(archive.path, *description_state(archive.path))


def xml_source_of(archive: FmuArchive) -> str | io.BytesIO:
    """Return what FMPy reads a checked FMU's XML files from: see `FmuArchive.xml_source`; reduced if it is large."""
    if not is_large(archive):
        return archive.xml_source()
    source = io.BytesIO()
    with zipfile.ZipFile(source, "w") as z:
        z.writestr(DESCRIPTION, description_of(archive))
    source.seek(0)
    return source


@lru_cache(maxsize=4)
def _reduced(path: Path, _changed: int, _size: int) -> bytes:
    content = in_utf8(FmuArchive(path).description())
    try:
        used, numbers = _without_unused(content)
    except UnsafeXml:  # nothing else that is wrong passes the next line; this way a sound one is checked once
        used, numbers = _without_unused(with_prefixes(content))
    root = tree_of(used)
    _keep_structure(root, numbers)
    return _etree.tostring(root, encoding="utf-8", xml_declaration=True)


def _without_unused(content: bytes) -> tuple[bytes, dict[int, int]]:
    """Return a description without unused variables, and the numbers of the others by their numbers in the whole.

    Kept are those that can be set or got, that size an array, or whose value can be set before the start. Numbers begin
    at 1. No tree is made: this runs for each of a million variables as the document is checked.
    """
    sizes = {reference.decode() for reference in _SIZES.findall(content)}
    numbers, parts = dict[int, int](), [0]  # where a part begins that is kept, ends, the next one begins, ...
    depth = count = begin = 0
    is_list = is_unused = is_started = False

    def watch(parser: Any) -> None:
        def ends() -> None:
            if begin and not is_unused:
                numbers[count] = len(numbers) + 1
            elif begin and parts[-1] == begin:
                parts[-1] = parser.CurrentByteIndex
            elif begin:
                parts.extend((begin, parser.CurrentByteIndex))

        def start(tag: str, attributes: dict[str, str]) -> None:
            nonlocal depth, count, begin, is_list, is_unused, is_started
            depth += 1
            if depth == 2:
                is_list = tag == "ModelVariables"
            if depth == 3 and is_list:
                ends()
                begin, count = parser.CurrentByteIndex, count + 1
                is_size = tag != "ScalarVariable" and attributes.get("valueReference") in sizes
                is_unused = tag in _TAGS and attributes.get("causality", "local") in _UNUSED and not is_size
                is_started = attributes.get("initial") in ("exact", "approx")
            if is_list and is_started and "start" in attributes and depth in (3, 4):
                is_unused = False

        def end(_: str) -> None:
            nonlocal depth, begin, is_list
            depth -= 1
            if depth == 1 and is_list:
                ends()
                begin, is_list = 0, False

        parser.ordered_attributes = False
        parser.StartElementHandler, parser.EndElementHandler = start, end

    check_xml(content, watch)
    parts.append(len(content))
    return b"".join(content[a:b] for a, b in zip(parts[::2], parts[1::2], strict=True)), numbers


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
