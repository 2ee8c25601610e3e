"""Reads the headers of shared libraries, ELF, PE and Mach-O: the platforms that they are for, and their length."""

import struct
from collections.abc import Iterator

HEAD = 4096  # bytes from the beginning, enough for the headers that are read here

_ELF = {3: "x86", 40: "arm", 62: "x86_64", 183: "aarch64"}
_PE = {0x14C: "x86", 0x8664: "x86_64", 0xAA64: "aarch64"}
_SEGMENT, _SEGMENT_64 = 0x1, 0x19  # Mach-O's load commands
_MACH = {0x7: "x86", 0x1000007: "x86_64", 0x100000C: "aarch64"}


def platforms_of(head: bytes) -> tuple[str, ...]:
    """Return the platforms of a library by FMI 3.0's names, such as `x86_64-linux`; none if it is not a library."""
    try:
        if head.startswith(b"\x7fELF"):
            order = "<" if head[5] == 1 else ">"
            (machine,) = struct.unpack_from(f"{order}H", head, 18)
            return (f"{_ELF.get(machine, f'machine {machine}')}-linux",)
        if head.startswith(b"MZ"):
            (at,) = struct.unpack_from("<I", head, 0x3C)
            signature, machine = struct.unpack_from("<4sH", head, at)
            return (f"{_PE.get(machine, f'machine {machine}')}-windows",) if signature == b"PE\0\0" else ()
        if head[:4] in (b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe"):
            return (_mach(*struct.unpack_from("<I", head, 4)),)
        if head.startswith(b"\xca\xfe\xba\xbe"):
            (count,) = struct.unpack_from(">I", head, 4)
            return tuple(_mach(*struct.unpack_from(">I", head, 8 + 20 * i)) for i in range(min(count, 8)))
    except (struct.error, IndexError):
        pass
    return ()


def shortage(head: bytes, size: int) -> str:
    """Return what is wrong with a library of `size` bytes that is cut off, by its first bytes; empty if it is whole.

    The system maps as much as the headers announce: a process that accesses the missing part is ended by SIGBUS.
    """
    announced = max(_ends(head), default=0)
    if announced <= size:
        return ""
    sizes = f"it has {size} bytes of at least {announced}"
    return f"the library is shorter than its headers say ({sizes}); export or copy the FMU again"


def _ends(head: bytes) -> Iterator[int]:
    """Yield where parts of a library end, in bytes from its beginning, as far as its headers are in `head`."""
    try:
        if head.startswith(b"\x7fELF"):
            yield from _elf_ends(head)
        elif head.startswith(b"MZ"):
            yield from _pe_ends(head)
        elif head[:4] in (b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe"):
            yield from _mach_ends(head)
        elif head.startswith(b"\xca\xfe\xba\xbe"):
            (count,) = struct.unpack_from(">I", head, 4)
            for i in range(min(count, 8)):
                yield sum(struct.unpack_from(">II", head, 16 + 20 * i))
    except (struct.error, IndexError):
        return  # the headers go on beyond `head`


def _elf_ends(head: bytes) -> Iterator[int]:
    order, wide = "<" if head[5] == 1 else ">", head[4] == 2
    programs, sections = struct.unpack_from(f"{order}{'QQ' if wide else 'II'}", head, 32 if wide else 28)
    sizes = struct.unpack_from(f"{order}4H", head, 54 if wide else 42)
    program_size, program_count, section_size, section_count = sizes
    yield programs + program_size * program_count
    yield sections + section_size * section_count
    for i in range(program_count):
        at = programs + program_size * i  # holds the part's offset in the file, two addresses, its size in the file
        offset, _, _, length = struct.unpack_from(f"{order}{'4Q' if wide else '4I'}", head, at + (8 if wide else 4))
        yield offset + length


def _pe_ends(head: bytes) -> Iterator[int]:
    (at,) = struct.unpack_from("<I", head, 0x3C)
    signature, _, count = struct.unpack_from("<4sHH", head, at)
    if signature != b"PE\0\0":
        return
    (optional,) = struct.unpack_from("<H", head, at + 20)
    for i in range(count):
        length, offset = struct.unpack_from("<II", head, at + 24 + optional + 40 * i + 16)
        if offset:  # sections of zeros have no bytes in the file
            yield offset + length


def _mach_ends(head: bytes) -> Iterator[int]:
    wide = head[0] == 0xCF
    (count,) = struct.unpack_from("<I", head, 16)
    at = 32 if wide else 28
    for _ in range(count):
        command, length = struct.unpack_from("<II", head, at)
        if command in (_SEGMENT, _SEGMENT_64):
            yield sum(struct.unpack_from("<QQ", head, at + 40) if wide else struct.unpack_from("<II", head, at + 32))
        at += max(length, 8)


def _mach(processor: int) -> str:
    return f"{_MACH.get(processor, f'machine {processor}')}-darwin"
