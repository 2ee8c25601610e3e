"""Libraries of each format, as short as headers can be: complete, they pass; with a byte less, they are reported."""

import struct

import pytest

from handover.cosim.fmu.file.library_format import shortage

SEGMENT_64 = struct.pack("<II16s4Q", 0x19, 72, b"__TEXT", 0, 0x9000, 4096, 5000) + bytes(16)


def elf(*, wide: bool, order: str) -> bytes:
    """A library with one program header that promises 300 bytes from byte 200 on; the section headers end before."""
    ident = b"\x7fELF" + bytes([2 if wide else 1, 1 if order == "<" else 2]) + bytes(10)
    start, size, word = (64, 56, "Q") if wide else (52, 32, "I")
    head = struct.pack(f"{order}HHI3{word}I6H", 3, 62, 1, 0, start, 160, 0, start, size, 1, 40, 1, 0)
    program = struct.pack(f"{order}II4Q" if wide else f"{order}I4I", *((1, 5) if wide else (1,)), 200, 0, 0, 300)
    return ident + head + program


def pe() -> bytes:
    """A library with a section of 512 bytes from byte 1024 on, and one of zeros that is not in the file."""
    begin = b"MZ".ljust(0x3C, b"\0") + struct.pack("<I", 0x40)
    sections = [struct.pack("<8s4I", b".text", 9, 9, 512, 1024), struct.pack("<8s4I", b".bss", 9, 9, 99999, 0)]
    return (
        begin
        + struct.pack("<4sHH12sHH", b"PE\0\0", 0x8664, 2, b"", 0, 0)
        + b"".join(s.ljust(40, b"\0") for s in sections)
    )


def mach() -> bytes:
    return struct.pack("<8I", 0xFEEDFACF, 0x1000007, 3, 6, 1, 72, 0, 0) + SEGMENT_64


def universal() -> bytes:
    return struct.pack(">2I5I", 0xCAFEBABE, 1, 0x1000007, 3, 16384, 700, 14)


@pytest.mark.parametrize(
    ("head", "size"),
    [
        (elf(wide=True, order="<"), 500),
        (elf(wide=True, order=">"), 500),
        (elf(wide=False, order="<"), 500),
        (pe(), 1536),
        (mach(), 9096),
        (universal(), 17084),
    ],
    ids=["elf", "elf of high bytes first", "elf of 32 bits", "pe", "mach-o", "universal"],
)
def test_a_library_is_as_long_as_its_headers_say(head: bytes, size: int):
    assert shortage(head, size) == ""
    assert f"it has {size - 1} bytes of at least {size})" in shortage(head, size - 1)
