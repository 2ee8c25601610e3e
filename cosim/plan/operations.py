"""Operations of a plan as `plan.h` lays them out, 72 bytes each."""

import ctypes
import enum
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Width
from handover.cosim.fmu.buffers import NativeCall, Views
from handover.cosim.fmu.calls import NativeStep
from handover.cosim.system.conversion import Linear

SIZE = 72
_COPY, _CHECK, _ACCESS, _KEEP, _STEP, _PLAIN = "PPNiidd", "PNqqQ", "PPPNPNP", "PPNP", "PPdPPPP", ""
_TYPES = {
    np.dtype(name): number
    for number, name in enumerate(
        ("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64")
    )
}


class _Kind(enum.IntEnum):
    COPY = 0
    CONVERT = 1
    SCALE = 2
    FITS = 3
    FINITE = 4
    ACCESS_2 = 5
    ACCESS_3 = 6
    BINARIES_3 = 7
    KEEP_BYTES = 8
    KEEP_TEXTS = 9
    STEP_2 = 10
    STEP_3 = 11
    START_CLOCK = 12
    CHARGE = 13


def copy(unit: int, target: NDArray[Any], source: NDArray[Any]) -> bytes:
    """Copy numbers or addresses, which become numbers of the target's type."""
    a, b = _TYPES[source.dtype], _TYPES[target.dtype]
    kind, n = (_Kind.COPY, source.nbytes) if a == b else (_Kind.CONVERT, len(source))
    return _packed(_COPY, kind, unit, target.ctypes.data, source.ctypes.data, n, b, a, 1.0, 0.0)


def scale(unit: int, target: NDArray[Any], source: NDArray[Any], linear: Linear) -> bytes:
    """Set reals to others times a factor plus an offset, each rounded once."""
    types = _TYPES[target.dtype], _TYPES[source.dtype]
    addresses = target.ctypes.data, source.ctypes.data
    return _packed(_COPY, _Kind.SCALE, unit, *addresses, len(source), *types, linear.factor, linear.offset)


def fits(unit: int, values: NDArray[Any], width: Width) -> bytes:
    """Stop where an integer does not fit a width."""
    where = values.ctypes.data, len(values), _TYPES[values.dtype]
    return _packed(_CHECK, _Kind.FITS, unit, *where, int(width.lowest), int(width.highest))


def finite(unit: int, values: NDArray[Any]) -> bytes:
    """Stop where a real is infinite or not a number."""
    return _packed(_CHECK, _Kind.FINITE, unit, values.ctypes.data, len(values), _TYPES[values.dtype], 0, 0)


def access(unit: int, call: NativeCall, arrays: Views, code: int) -> bytes:
    """Set or get variables from or to these arrays; `code` names the call in the heartbeat."""
    is_binary = len(arrays) == 2
    kind = _Kind.ACCESS_2 if call.fmi == 2 else _Kind.BINARIES_3 if is_binary else _Kind.ACCESS_3
    fixed = call.function, call.component, ctypes.addressof(call.references), len(call.references)
    sizes = arrays[1].ctypes.data if is_binary else 0
    return _packed(_ACCESS, kind, unit, *fixed, arrays[0].ctypes.data, len(arrays[0]), sizes, code=code)


def keep(unit: int, arrays: Views, kept: int) -> bytes:
    """Copy binaries, or texts, which have no sizes, to the memory that the `Kept` at address `kept` hold."""
    kind, sizes = (_Kind.KEEP_BYTES, arrays[1].ctypes.data) if len(arrays) == 2 else (_Kind.KEEP_TEXTS, 0)
    return _packed(_KEEP, kind, unit, arrays[0].ctypes.data, sizes, len(arrays[0]), kept)


def step(unit: int, call: NativeStep, dt: float, code: int) -> bytes:
    """Let a unit step by dt; `code` names the call in the heartbeat."""
    kind = _Kind.STEP_2 if call.fmi == 2 else _Kind.STEP_3
    return _packed(_STEP, kind, unit, call.function, call.component, dt, *(call.flags or (0, 0, 0, 0)), code=code)


def start_clock() -> bytes:
    """Read the CPU clock."""
    return _packed(_PLAIN, _Kind.START_CLOCK, 0)


def charge(unit: int) -> bytes:
    """Charge the CPU time since the clock was last read to a unit."""
    return _packed(_PLAIN, _Kind.CHARGE, unit)


def _packed(form: str, kind: _Kind, unit: int, *fields: Any, code: int = -1) -> bytes:
    return struct.pack(f"@iiq{form}", kind, unit, code, *fields).ljust(SIZE, b"\0")
