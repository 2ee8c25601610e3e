"""An instance's variables in memory: buffers that the C runtime reads and writes, and Python sees as arrays."""

import struct
import sys
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.block import InvalidState
from handover.cosim.blocks.ports import Floats, Raster
from handover.cosim.blocks.variable import Causality, Variable
from handover.fmus.layout import Buffer, Layout, Slot, capacity

ALIGNMENT = 64
"""Bytes: arrays begin at multiples of a cache line in their memory."""


class Buffers:
    """The buffers of one instance. Their addresses never change.

    Attributes:
        floats: the time and the step size in s, then the real variables in SI units.
        integers: int64 whatever the width; a UInt64 variable's 64 bits are read as int64.
        strings: UTF-8, as the host sees them.
        binaries: a buffer of fixed capacity for each of `binary_variables`, of which `sizes` are in use.

    Args:
        layout: of the variables.
        memory: allocates that many bytes for all variables but the strings, for instance shared with a host in another
            process; they need not be zero. Without it the memory is this process's own.
    """

    def __init__(self, layout: Layout, memory: Callable[[int], Any] | None = None) -> None:
        self.layout = layout
        self.strings = [b""] * layout.lengths[Buffer.STRING]
        self.binary_variables = [slot.variable for slot in layout.in_buffer(Buffer.BINARY)]
        sizes: list[tuple[int, type[np.generic]]] = [
            (layout.lengths[Buffer.FLOAT64], np.float64),
            (layout.lengths[Buffer.INT64], np.int64),
            (layout.lengths[Buffer.BOOLEAN], np.bool_),
            (len(self.binary_variables), np.uint64),
            *((capacity(v), np.uint8) for v in self.binary_variables),
        ]
        arrays = _arrays(sizes, memory or (lambda size: np.zeros(size, dtype=np.uint8)))
        self.floats, self.integers, self.booleans, self.sizes, *self.binaries = arrays
        self.reset()

    def reset(self) -> None:
        """Give all variables their start values; the time is 0, pictures are black."""
        self.floats[:] = 0.0
        for slot in self.layout.slots.values():
            self._start(slot, slot.variable.start)

    def _start(self, slot: Slot, start: Any) -> None:
        if slot.buffer is Buffer.FLOAT64:
            self.floats[slot.entries] = np.ravel(start)
        elif slot.buffer is Buffer.INT64:
            self.integers[slot.offset] = to_signed(int(start))
        elif slot.buffer is Buffer.BOOLEAN:
            self.booleans[slot.offset] = start
        elif slot.buffer is Buffer.STRING:
            self.strings[slot.offset] = str(start).encode()
        else:
            self.binaries[slot.offset][:] = 0
            self.sizes[slot.offset] = capacity(slot.variable) if slot.variable.raster else 0

    def array(self, slot: Slot, *, writeable: bool) -> Floats:
        """Return a real array variable as a view of the buffer."""
        view = self.floats[slot.entries].reshape(slot.variable.shape)
        view.flags.writeable = writeable
        return view

    def picture(self, slot: Slot, raster: Raster, *, writeable: bool) -> NDArray[np.uint8]:
        """Return a picture as a view of its buffer, shape (height, width, 3)."""
        view = self.binaries[slot.offset].reshape(raster.height, raster.width, 3)
        view.flags.writeable = writeable
        return view

    def parameters(self) -> bytes:
        """Return the values of all parameters as bytes: equal bytes make equal blocks."""
        arrays = {Buffer.FLOAT64: self.floats, Buffer.INT64: self.integers, Buffer.BOOLEAN: self.booleans}
        parts = [array[self.layout.span(Causality.PARAMETER, buffer)].tobytes() for buffer, array in arrays.items()]
        return join(parts + self.strings[self.layout.span(Causality.PARAMETER, Buffer.STRING)])

    def to_bytes(self) -> bytes:
        """Return the values of all variables and the time."""
        used = [buffer[: int(n)].tobytes() for buffer, n in zip(self.binaries, self.sizes, strict=True)]
        return join([self.floats.tobytes(), self.integers.tobytes(), self.booleans.tobytes(), *used, *self.strings])

    def from_bytes(self, state: bytes) -> None:
        """Restore what `to_bytes` returned.

        Raises:
            InvalidState: the bytes are of other variables; nothing is changed.
        """
        parts = split(state)
        if len(parts) != 3 + len(self.binaries) + len(self.strings):
            raise InvalidState
        numbers, rest = parts[:3], parts[3:]
        used, strings = rest[: len(self.binaries)], rest[len(self.binaries) :]
        arrays = (self.floats, self.integers, self.booleans)
        fit = all(a.nbytes == len(p) for a, p in zip(arrays, numbers, strict=True))
        if not fit or not all(_fits(v, p) for v, p in zip(self.binary_variables, used, strict=True)):
            raise InvalidState
        for array, part in zip(arrays, numbers, strict=True):
            array[:] = np.frombuffer(part, dtype=array.dtype)
        for i, part in enumerate(used):
            self.binaries[i][: len(part)] = np.frombuffer(part, dtype=np.uint8)
            self.sizes[i] = len(part)
        self.strings[:] = strings


def _arrays(sizes: list[tuple[int, type[np.generic]]], memory: Callable[[int], Any]) -> list[NDArray[Any]]:
    """Return arrays of these lengths and types, one after another in one piece of memory."""
    places = [0]
    for n, kind in sizes:
        end = places[-1] + n * np.dtype(kind).itemsize
        places.append(end + -end % ALIGNMENT)
    whole = np.frombuffer(memory(places[-1]), dtype=np.uint8)
    return [
        whole[at : at + n * np.dtype(kind).itemsize].view(kind) for at, (n, kind) in zip(places, sizes, strict=False)
    ]


def to_signed(number: int) -> int:
    """Return the int64 with the same 64 bits as a uint64 that is too large for one; smaller numbers as they are."""
    return number - 2**64 if number >= 2**63 else number


def to_unsigned(number: int) -> int:
    """Return the uint64 from which `to_signed` made a number."""
    return number + 2**64 if number < 0 else number


def _fits(variable: Variable, part: bytes) -> bool:
    return len(part) == capacity(variable) if variable.raster else len(part) <= capacity(variable)


def join(parts: Iterable[bytes]) -> bytes:
    """Return the parts as one, each preceded by its length (uint64, native byte order)."""
    return b"".join(struct.pack("=Q", len(part)) + part for part in parts)


def split(whole: bytes) -> list[bytes]:
    """Return the parts from which `join` made the whole.

    Raises:
        InvalidState: the bytes were not made by `join`.
    """
    parts: list[bytes] = []
    at = 0
    while at < len(whole):
        start = at + 8
        n = int.from_bytes(whole[at:start], sys.byteorder)
        at = start + n
        if at > len(whole):
            raise InvalidState
        parts.append(whole[start:at])
    return parts
