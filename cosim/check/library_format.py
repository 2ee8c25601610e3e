"""For which platforms a shared library is made, by its first bytes: ELF, PE and Mach-O."""

import struct

HEAD = 4096  # bytes that hold what is read here

_ELF = {3: "x86", 40: "arm", 62: "x86_64", 183: "aarch64"}
_PE = {0x14C: "x86", 0x8664: "x86_64", 0xAA64: "aarch64"}
_MACH = {0x7: "x86", 0x1000007: "x86_64", 0x100000C: "aarch64"}


def platforms_of(head: bytes) -> tuple[str, ...]:
    """Return the platforms of a library by FMI 3.0's names, such as `x86_64-linux`; none if it is no library."""
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


def _mach(processor: int) -> str:
    return f"{_MACH.get(processor, f'machine {processor}')}-darwin"
