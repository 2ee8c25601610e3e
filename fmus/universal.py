"""Joins libraries for both kinds of Mac into one file, as FMI 2 has a single folder for them."""

import struct

MAGIC = 0xCAFEBABE
ALIGNMENT = 14
"""Slices begin at multiples of 2**14 bytes, the page size of the larger kind."""


def universal(libraries: list[bytes]) -> bytes:
    """Return a universal binary of Mach-O files, each of its own processor."""
    whole = struct.pack(">2I", MAGIC, len(libraries))
    offset = _aligned(len(whole) + 20 * len(libraries))
    body = b""
    for content in libraries:
        processor = struct.unpack_from("<2I", content, 4)  # type and subtype
        whole += struct.pack(">5I", *processor, offset + len(body), len(content), ALIGNMENT)
        body += content.ljust(_aligned(len(content)), b"\0")
    return whole.ljust(offset, b"\0") + body


def _aligned(n: int) -> int:
    return (n + (1 << ALIGNMENT) - 1) >> ALIGNMENT << ALIGNMENT
