"""Preallocated buffers through which all variables of one FMI type of an instance are set or read in one call.

`SignalBuffer` sets and reads; `OutputBuffer` also copies strings and binaries, whose memory belongs to the unit;
`InputDerivatives` sets the first time derivatives of inputs, for FMI 2 units that interpolate. Each port has views into
its buffer's memory, so a connection is a copy between views, and `joined` merges copies that are adjacent in memory.
"""

import ctypes
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.start_values import numbers_of
from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.file.description import FmuPort

_POINTER: Callable[[Any], Any] = ctypes.POINTER

Views = tuple[NDArray[Any], ...]
"""The memory of a port's value. Numbers: one array. Binaries: addresses and sizes. Strings: addresses."""

Copy = tuple[NDArray[Any], NDArray[Any]]
"""Target and source of a copy."""

SUCCEEDED = (0, 1)
"""OK and Warning. Any other status is a failure, also one that the standards do not know, such as -2."""

_VALUES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int32,
    "Float32": ctypes.c_float,
    "Float64": ctypes.c_double,
    **{f"Int{b}": getattr(ctypes, f"c_int{b}") for b in (8, 16, 32, 64)},
    **{f"UInt{b}": getattr(ctypes, f"c_uint{b}") for b in (8, 16, 32, 64)},
}


@dataclass(frozen=True)
class NativeCall:
    """What C code needs to make a buffer's FMI call itself.

    Attributes:
        fmi: version of the standard, 2 or 3.
        function: address of the FMI function.
        component: address of the instance.
        references: the value references.
        arrays: the memory: values; addresses and sizes for binaries.
    """

    fmi: int
    function: int
    component: int
    references: "ctypes.Array[ctypes.c_uint]"
    arrays: Views


class SignalBuffer:
    """The variables of one FMI type of one instance, in the order given, in one block of memory.

    Calling the buffer makes the FMI call `name`, with arguments that are prepared once. `views[port]` is the part of a
    port, in row-major order; a connection copies one port's views into another's.
    """

    def __init__(self, name: str, function: Any, component: Any, fmi: int, ports: Sequence[FmuPort]) -> None:
        self.name = name
        fmi_type = ports[0].fmi_type
        references = [r for p in ports for r in p.references]
        n = sum(p.size for p in ports)
        self._function = function
        vrs = (ctypes.c_uint * len(references))(*references)
        self._arrays, arguments = _arrays(fmi_type, fmi, n)
        count = () if fmi == 2 else (n,)
        self._arguments: tuple[Any, ...] = (component, vrs, len(references), *arguments, *count)
        self._fmi = fmi
        self.views: dict[str, Views] = {}
        begin = 0
        for p in ports:
            self.views[p.name] = tuple(a[begin : begin + p.size] for a in self._arrays)
            begin += p.size

    def __call__(self) -> int:
        """Set or get all values; return the FMI status."""
        return self._function(*self._arguments)

    @property
    def native(self) -> NativeCall:
        """The same call for C code."""
        component, references, *_ = self._arguments
        function = ctypes.cast(self._function, ctypes.c_void_p).value or 0
        return NativeCall(self._fmi, function, component, references, self._arrays)

    def contents(self) -> list[bytes]:
        """Return what the buffer holds."""
        return [a.tobytes() for a in self._arrays]

    def refill(self, contents: Sequence[bytes]) -> None:
        """Hold what `contents` gave, be it in another process."""
        for array, content in zip(self._arrays, contents, strict=True):
            array[:] = np.frombuffer(content, dtype=array.dtype)


class OutputBuffer(SignalBuffer):
    """A buffer for reading binaries or strings. They are copied: the unit may reuse its memory at the next call.

    Attributes:
        kept_elsewhere: keeps memory alive to which C code copies them instead of this buffer.
        copies: False where they stay, until they are read again, in memory that an isolated unit shares.
    """

    kept_elsewhere: object = None
    copies: bool = True

    def __init__(self, name: str, function: Any, component: Any, fmi: int, ports: Sequence[FmuPort]) -> None:
        super().__init__(name, function, component, fmi, ports)
        self._is_text = ports[0].fmi_type == "String"
        self._kept: list[Any] = [ctypes.create_string_buffer(1) for _ in range(len(self._arrays[0]))]

    def __call__(self) -> int:
        """Get and copy all values; return the FMI status."""
        status = super().__call__()
        if status in SUCCEEDED and self.copies:
            for i in range(len(self._kept)):
                self._keep(i)
        return status

    def missing(self) -> str:
        """Return which binary the unit gave a size but no memory; empty if there is none."""
        if self._is_text:
            return ""
        for name, (addresses, sizes) in self.views.items():
            if np.any((addresses == 0) & (sizes > 0)):
                return f"NULL for {name}, a binary of {int(sizes.max())} bytes"
        return ""

    def contents(self) -> list[bytes]:
        """Return the texts or binaries that the buffer holds."""
        addresses = map(int, self._arrays[0])
        if self._is_text:
            return [ctypes.string_at(a) if a else b"" for a in addresses]
        return [ctypes.string_at(a, int(size)) for a, size in zip(addresses, self._arrays[1], strict=True)]

    def refill(self, contents: Sequence[bytes]) -> None:
        """Hold what `contents` gave, be it in another process."""
        self._kept = [ctypes.create_string_buffer(content) for content in contents]
        self._arrays[0][:] = [ctypes.addressof(kept) for kept in self._kept]
        if not self._is_text:
            self._arrays[1][:] = [len(content) for content in contents]

    def _keep(self, i: int) -> None:
        addresses = self._arrays[0]
        address = int(addresses[i])
        if self._is_text:
            self._kept[i] = ctypes.create_string_buffer(ctypes.string_at(address) if address else b"")
        else:
            size = int(self._arrays[1][i])
            if size and not address:
                return  # see `missing`
            if ctypes.sizeof(self._kept[i]) < size:
                self._kept[i] = ctypes.create_string_buffer(size)
            ctypes.memmove(self._kept[i], address, size)
        addresses[i] = ctypes.addressof(self._kept[i])


def joined(copies: Iterable[Copy]) -> list[Copy]:
    """Return equivalent copies, joining those whose targets and sources both follow each other in memory."""
    merged: list[Copy] = []
    for target, source in sorted(copies, key=lambda copy: copy[0].ctypes.data):
        whole_target = _joined(merged[-1][0], target) if merged else None
        whole_source = _joined(merged[-1][1], source) if merged else None
        if whole_target is not None and whole_source is not None:
            merged[-1] = (whole_target, whole_source)
        else:
            merged.append((target, source))
    return merged


def _joined(first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any] | None:
    """Return two views of one array as one view, or None if the second does not follow the first."""
    whole = first.base
    if whole is None or whole is not second.base:
        return None
    begin, middle, end = (
        (address - whole.ctypes.data) // whole.itemsize
        for address in (first.ctypes.data, second.ctypes.data, second.ctypes.data + second.nbytes)
    )
    return whole[begin:end] if begin + len(first) == middle else None


def _arrays(fmi_type: str, fmi: int, n: int) -> tuple[Views, tuple[Any, ...]]:
    """Return numpy arrays and the same memory as arguments of an FMI call."""
    if fmi_type == "Binary":
        sizes, addresses = np.zeros(n, dtype=np.uint64), np.zeros(n, dtype=np.uint64)
        pointer = ctypes.POINTER(ctypes.POINTER(ctypes.c_uint8))
        return (addresses, sizes), (_pointer(sizes, ctypes.c_size_t), ctypes.cast(addresses.ctypes.data, pointer))
    if fmi_type == "String":
        addresses = np.zeros(n, dtype=np.uint64)
        return (addresses,), (_pointer(addresses, ctypes.c_char_p),)
    if fmi_type == "Boolean":
        c_type = ctypes.c_int32 if fmi == 2 else ctypes.c_bool
    elif fmi_type == "Enumeration":
        c_type = ctypes.c_int32 if fmi == 2 else ctypes.c_int64
    else:
        c_type = _VALUES[fmi_type]
    values = np.zeros(n, dtype=np.dtype(c_type))
    return (values,), (_pointer(values, c_type),)


def _pointer(array: NDArray[Any], c_type: Any) -> Any:
    return ctypes.cast(array.ctypes.data, _POINTER(c_type))


def content_of(port: FmuPort, views: Views) -> bytes:
    """Return a port's value as bytes, to compare it; of strings and binaries the contents, not their addresses."""
    if port.kind is Kind.STRING:
        texts = (ctypes.string_at(int(a)) if a else b"" for a in views[0])
        return b"\0".join(texts)
    if port.kind is Kind.BINARY:
        pairs = zip(views[0], views[1], strict=True)  # with sizes before them, since binaries may hold any byte
        return b"".join(int(n).to_bytes(8, "little") + ctypes.string_at(int(a), int(n)) for a, n in pairs)
    return views[0].tobytes()


def fill(port: FmuPort, views: Views, value: Any) -> object:
    """Write a value of a port to its views; return the memory of a text or binary, which the views only point to."""
    if port.kind is Kind.STRING:
        content = ctypes.create_string_buffer(str(value).encode())
        views[0][0] = ctypes.addressof(content)
        return content
    if port.kind is Kind.BINARY:
        content = ctypes.create_string_buffer(bytes(value), len(value))
        views[0][0], views[1][0] = ctypes.addressof(content), len(value)
        return content
    views[0][:] = numbers_of(port, value)
    return None


class InputDerivatives(SignalBuffer):
    """A buffer for the first time derivatives of real inputs (FMI 2); calling it sets them all."""

    def __init__(self, function: Callable[..., int], component: Any, ports: Sequence[FmuPort]) -> None:
        super().__init__("fmi2SetRealInputDerivatives", function, component, 2, ports)
        instance, references, count, values = self._arguments
        orders = (ctypes.c_int * count)(*(1 for _ in range(count)))
        self._arguments = (instance, references, count, orders, values)
