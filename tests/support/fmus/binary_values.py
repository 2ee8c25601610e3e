"""Binary values through the C interface of FMI 3."""

import ctypes

from support.fmus.ctypes_host import OK, SIZE, CtypesHost

SIZE_OF_PICTURE = 1280 * 720 * 3


def put(host: CtypesHost, name: str, data: bytes) -> int:
    sizes, values = (ctypes.c_size_t * 1)(len(data)), (ctypes.c_char_p * 1)(data)
    reference = (ctypes.c_uint32 * 1)(host.references[name])
    return host.call("SetBinary", reference, SIZE(1), sizes, values, SIZE(1))


def take(host: CtypesHost, name: str) -> tuple[int, int]:
    """Return address and size."""
    sizes, values = (ctypes.c_size_t * 1)(), (ctypes.c_void_p * 1)()
    reference = (ctypes.c_uint32 * 1)(host.references[name])
    assert host.call("GetBinary", reference, SIZE(1), sizes, values, SIZE(1)) == OK, host.log[-1]
    return values[0] or 0, sizes[0]
