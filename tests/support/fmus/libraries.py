"""Properties of a shared library, read with lief: alike for ELF, PE and Mach-O."""

import hashlib
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lief

from handover.fmus.compile import cache_folder

lief.logging.disable()

ADDED_BY_MACOS = {"__mh_dylib_header", "___dso_handle"}
"""Zig's linker exports the two names by which a library on macOS finds itself."""


@dataclass(frozen=True)
class Facts:
    """A library of one platform.

    Attributes:
        platform: by its name of FMI 3.
        exported: functions, as C names them.
        needed: the libraries that it loads.
        oldest: the oldest system it runs on: version of glibc or macOS; empty for Windows.
    """

    platform: str
    exported: frozenset[str]
    needed: frozenset[str]
    oldest: tuple[int, ...]


def facts(content: bytes) -> Facts:
    """Read a library's bytes."""
    parsed: Any = lief.parse(list(content))
    if isinstance(parsed, lief.ELF.Binary):
        return _elf(parsed)
    return _pe(parsed) if isinstance(parsed, lief.PE.Binary) else _mach_o(parsed)


def _elf(parsed: Any) -> Facts:
    versions = [v.name for r in parsed.symbols_version_requirement for v in r.get_auxiliary_symbols()]
    return Facts(
        f"{_processor(parsed.header.machine_type)}-linux",
        frozenset(str(s.name) for s in parsed.exported_symbols),
        frozenset(parsed.libraries),
        max(tuple(int(n) for n in v.removeprefix("GLIBC_").split(".")) for v in versions),
    )


def _pe(parsed: Any) -> Facts:
    platform = f"{_processor(parsed.header.machine)}-windows"
    exported = frozenset(str(e.name) for e in parsed.get_export().entries)
    return Facts(platform, exported, frozenset(i.name for i in parsed.imports), ())


def _mach_o(parsed: Any) -> Facts:
    exported = {str(e.symbol.name) for e in parsed.dyld_info.exports} - ADDED_BY_MACOS
    needed = [c for c in parsed.libraries if c.command == lief.MachO.LoadCommand.TYPE.LOAD_DYLIB]
    return Facts(
        f"{_processor(parsed.header.cpu_type)}-darwin",
        frozenset(name.removeprefix("_") for name in exported),
        frozenset(c.name for c in needed),
        tuple(parsed.build_version.minos),
    )


def _processor(constant: Any) -> str:
    """Return FMI 3's name of a processor that lief names."""
    name = str(constant).rpartition(".")[2]
    return {"X86_64": "x86_64", "AMD64": "x86_64", "AARCH64": "aarch64", "ARM64": "aarch64"}[name]


def slices(content: bytes) -> Iterator[bytes]:
    """Cut a universal file into the libraries it holds; each must begin at a page of its own."""
    magic, count = struct.unpack_from(">2I", content)
    assert magic == 0xCAFEBABE
    for i in range(count):
        _, _, offset, size, alignment = struct.unpack_from(">5I", content, 8 + 20 * i)
        assert alignment == 14
        assert offset % 2**alignment == 0
        yield content[offset : offset + size]


def expect_no_folder(content: bytes, sources: Path) -> None:
    """Fail where a library tells of a folder of the machine that compiled it."""
    folders = {str(p).encode() for p in (Path(__file__).parents[3], sources, Path.home(), cache_folder())}
    assert [folder for folder in folders if folder in content] == []
    assert not re.search(rb"compiling-|[\w/]{3,}\.[ch]\0|\.pdb\0", content)


def is_signed(content: bytes) -> bool:
    """Return whether a Mach-O library has an ad-hoc signature whose hashes are those of its pages."""
    parsed: Any = lief.parse(list(content))
    if not parsed.has_code_signature:
        return False
    place = parsed.code_signature.data_offset
    (offset,) = (o for kind, o in _blobs(content, place) if kind == 0)  # the code directory
    directory = place + offset
    magic, _, _, flags, hashes, _, _, n_hashes, limit = struct.unpack_from(">9I", content, directory)
    size, kind, _, page = struct.unpack_from(">4B", content, directory + 36)
    assert (magic, size, kind) == (0xFADE0C02, 32, 2)  # SHA-256
    assert limit == place  # all that lies before the signature is signed
    pages = [content[i : min(i + 2**page, limit)] for i in range(0, limit, 2**page)]
    stored = [content[directory + hashes + 32 * i :][:32] for i in range(n_hashes)]
    return bool(flags & 2) and stored == [hashlib.sha256(p).digest() for p in pages]


def _blobs(content: bytes, place: int) -> Iterator[tuple[int, int]]:
    magic, _, count = struct.unpack_from(">3I", content, place)
    assert magic == 0xFADE0CC0
    for i in range(count):
        yield struct.unpack_from(">2I", content, place + 12 + 8 * i)
