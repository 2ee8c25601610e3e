"""Empty shared libraries in place of those that are linked to but never called, such as OpenGL where nothing is drawn.

Before the dynamic linker of Linux looks for a library's file, it compares the name that is wanted with the names
(DT_SONAME) of the libraries that are loaded. So one of that name that holds nothing serves, as long as functions are
bound at their first call. It is what a compiler makes of an empty file, some 400 bytes that are alike on all systems;
written here, it travels with an FMU's sources, and needs neither a compiler nor a file for each platform.
Standard library only.
"""

import contextlib
import ctypes
import os
import platform
import struct
import sys
import tempfile
from collections.abc import Generator

_MACHINES = {"x86_64": 62, "aarch64": 183}
"""ELF's number of each architecture (EM_X86_64, EM_AARCH64)."""

_PAGE = 0x10000  # the largest of AArch64; linkers align to it there


def can_be_empty() -> bool:
    """Return whether empty libraries can be made for this system: Linux on x86-64 or AArch64."""
    return sys.platform == "linux" and platform.machine() in _MACHINES


def can_be_loaded(name: str) -> bool:
    """Return whether the dynamic linker finds a library and can load it; it stays loaded then."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def load_empty(name: str) -> None:
    """Load an empty library of this name, which then counts as loaded for all that is linked to it.

    Raises:
        OSError: no folder for temporary files can be written.
    """
    with tempfile.NamedTemporaryFile(suffix=".so") as file:  # the mapping keeps what the name no longer does
        file.write(empty_library(name, platform.machine()))
        file.flush()
        ctypes.CDLL(file.name, mode=ctypes.RTLD_GLOBAL)


@contextlib.contextmanager
def bound_at_first_call() -> Generator[None]:
    """Let modules that are imported meanwhile look up functions when they call them first, and not before."""
    flags = sys.getdlopenflags()
    sys.setdlopenflags(os.RTLD_LAZY | flags & ~os.RTLD_NOW)
    try:
        yield
    finally:
        sys.setdlopenflags(flags)


def empty_library(name: str, machine: str) -> bytes:
    """Return a shared library in ELF that has a name (DT_SONAME) and no symbols, for `x86_64` or `aarch64`."""
    strings = b"\0" + name.encode("ascii") + b"\0"
    headers = 64 + 3 * 56
    hashes = headers + 7 * 16
    symbols = hashes + 16
    end = symbols + 24
    size = end + len(strings)
    ident = b"\x7fELF" + bytes([2, 1, 1]) + bytes(9)  # 64 bits, little-endian, version 1
    header = struct.pack("<HHIQQQIHHHHHH", 3, _MACHINES[machine], 1, 0, 64, 0, 0, 64, 56, 3, 64, 0, 0)  # ET_DYN
    readable, writable = 4, 2
    segments = (
        (1, readable | writable, 0, size, _PAGE),  # PT_LOAD: the linker relocates the dynamic section in place
        (2, readable | writable, headers, hashes - headers, 8),  # PT_DYNAMIC
        (0x6474E551, readable | writable, 0, 0, 16),  # PT_GNU_STACK: no executable stack, which glibc 2.41 refuses
    )
    dynamic = (
        (14, 1),  # DT_SONAME, as an offset in the strings
        (4, hashes),  # DT_HASH
        (5, end),  # DT_STRTAB
        (6, symbols),  # DT_SYMTAB
        (10, len(strings)),  # DT_STRSZ
        (11, 24),  # DT_SYMENT
        (0, 0),  # DT_NULL
    )
    return b"".join(
        (
            ident,
            header,
            *(struct.pack("<IIQQQQQQ", kind, flags, at, at, at, n, n, align) for kind, flags, at, n, align in segments),
            *(struct.pack("<qQ", *entry) for entry in dynamic),
            struct.pack("<4I", 1, 1, 0, 0),  # a hash table of one bucket, which is empty
            bytes(24),  # the symbol that every table begins with
            strings,
        )
    )
