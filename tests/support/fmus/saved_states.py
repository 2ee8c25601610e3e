"""Saving an instance's state through the C interface, whatever the standard."""

import ctypes

from support.fmus.ctypes_host import OK, SIZE, CtypesHost


def called(host: CtypesHost, name: str) -> str:
    """Return the standard's spelling of a function's name."""
    if host.fmi == 3:
        return name.replace("state", "State")
    return name.replace("Deserialize", "DeSerialize")


def save(host: CtypesHost) -> ctypes.c_void_p:
    state = ctypes.c_void_p()
    assert host.call(called(host, "GetFMUstate"), ctypes.byref(state)) == OK
    return state


def serialised(host: CtypesHost, state: ctypes.c_void_p) -> bytes:
    size = ctypes.c_size_t()
    assert host.call(called(host, "SerializedFMUstateSize"), state, ctypes.byref(size)) == OK
    data = ctypes.create_string_buffer(size.value)
    assert host.call(called(host, "SerializeFMUstate"), state, data, size) == OK
    return data.raw


def deserialise(host: CtypesHost, data: bytes) -> tuple[int, ctypes.c_void_p]:
    state = ctypes.c_void_p()
    return host.call(called(host, "DeserializeFMUstate"), data, SIZE(len(data)), ctypes.byref(state)), state


def digest(*parts: bytes) -> int:
    """Return the digest that the runtime has of a state: FNV-1a by words of each part, the upper half folded in."""
    value = 0xCBF29CE484222325
    for part in parts:
        for at in range(0, len(part), 8):
            word = int.from_bytes(part[at : at + 8].ljust(8, b"\0"), "little")
            value = (value ^ word) * 0x100000001B3 % 2**64
            value ^= value >> 32
    return value
