"""Moves values between an instance's buffers and its block: inputs, outputs and directional derivatives.

Most of what a step costs beyond the block's own work is spent here, so all that can be prepared is prepared once, as a
function.
"""

import functools
import operator
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.description import place_of
from handover.cosim.blocks.ports import Raster, Width
from handover.cosim.blocks.variable import Causality, Variable
from handover.fmus.buffers import Buffers, to_signed
from handover.fmus.layout import Buffer, Slot, capacity
from handover.fmus.parameters import read_value

NOT_REAL = (Buffer.INT64, Buffer.BOOLEAN, Buffer.STRING, Buffer.BINARY)


class InvalidReturn(TypeError):
    """A method of a block returned something else than it must."""

    def by(self, method: object) -> "InvalidReturn":
        """Return the same, said of a method: its name, and where it is defined."""
        return InvalidReturn(f"{getattr(method, '__qualname__', 'a method')}{place_of(method)}: {self}")


class InvalidOutput(InvalidReturn):
    """A block gave an output that is not of the declared type or shape."""

    def __init__(self, variable: Variable, value: object) -> None:
        declared = f"array of shape {variable.shape}" if variable.shape else variable.kind.value
        if variable.width and not variable.width.is_real:
            declared = variable.width.range_text
        if variable.items:
            declared = "one of " + ", ".join(f"{number} {name}" for name, number in variable.items)
        if variable.raster:
            declared = f"uint8 array of shape {(variable.raster.height, variable.raster.width, 3)}"
        given, shown = type(value).__name__, " ".join(repr(value).split())
        if isinstance(value, np.ndarray):
            given = f"{value.dtype} array of shape {value.shape}"
        super().__init__(f"output '{variable.name}' is declared as {declared}; the block gave {given}: {shown:.80}")
        self.variable, self.value = variable, value


class OtherReturn(InvalidReturn):
    """A method of a block returned an object of another kind; `example` is what would be right."""

    def __init__(self, value: object, example: str) -> None:
        shown = "" if value is None else f": {' '.join(repr(value).split()):.80}"
        kind = "None" if value is None else type(value).__name__
        super().__init__(f"returned {kind}{shown}; expected {example}")


def input_reader(buffers: Buffers) -> Callable[[], Any]:
    """Return a function that fills an inputs object, always the same one, from the buffers and returns it.

    Arrays in it are read-only views. The function raises UnknownItem for a number that is no item of its enumeration.
    """
    layout = buffers.layout
    inputs = layout.description.inputs_type()
    reals = layout.of(Causality.INPUT, Buffer.FLOAT64)
    scalars = [s.variable.name for s in reals if not s.variable.shape]
    for slot in reals[len(scalars) :]:
        setattr(inputs, slot.variable.name, buffers.array(slot, writeable=False))
    names: dict[str, Any] = {"bit": buffers.booleans.item, "number": buffers.integers.item}
    lines = [_scalar_reading(buffers, reals, scalars, names)]
    for i, slot in enumerate(s for buffer in NOT_REAL for s in layout.of(Causality.INPUT, buffer)):
        if slot.variable.raster:
            setattr(inputs, slot.variable.name, buffers.picture(slot, slot.variable.raster, writeable=False))
        else:
            lines.append(f"x.{slot.variable.name} = {_reading(buffers, slot, i, names)}")
    return functools.partial(_compiled([*lines, "return x"], names), inputs)


def output_writer(buffers: Buffers) -> Callable[[Any], None]:
    """Return a function that writes a block's outputs into the buffers.

    It raises InvalidOutput if an output is not of its declared type or shape, OtherReturn if it gets no outputs. It
    tries the exact types first, which is fast; only if that fails it goes through the outputs one after another,
    converts what may be converted and finds the output at fault.
    """
    layout = buffers.layout
    reals = layout.of(Causality.OUTPUT, Buffer.FLOAT64)
    scalars = [s.variable for s in reals if not s.variable.shape]
    write_scalars = _compiled([_scalar_writing(buffers, reals, scalars, names := dict[str, Any]())], names)
    arrays = [(s.variable, s.variable.shape, buffers.array(s, writeable=True)) for s in reals[len(scalars) :]]
    slots = [s for buffer in NOT_REAL for s in layout.of(Causality.OUTPUT, buffer)]
    others = [(s.variable, _writer(buffers, s)) for s in slots]
    write_exact = _exact_writer(buffers, reals, scalars, slots)

    def write(y: Any) -> None:
        try:
            write_exact(y)
        except (struct.error, TypeError, ValueError, OverflowError):
            write_checked(y)
        except AttributeError as error:
            outputs = layout.description.outputs_type
            if isinstance(y, outputs):
                raise
            names = ", ".join(f"{v.name}=..." for v in layout.description.outputs)
            raise OtherReturn(y, f"its outputs, such as {outputs.__name__}({names})") from error

    def write_checked(y: Any) -> None:
        try:
            write_scalars(y)
        except struct.error:
            _raise_for_invalid_scalar(scalars, y)
        for variable, shape, view in arrays:
            value = getattr(y, variable.name)
            array: NDArray[Any] = np.asarray(value)
            if array.shape != shape or array.dtype.kind not in "fiu":
                raise InvalidOutput(variable, value)
            view[...] = array
        for variable, put in others:
            value = getattr(y, variable.name)
            try:
                put(value)
            except (TypeError, ValueError, OverflowError) as error:
                raise InvalidOutput(variable, value) from error

    return write


def _exact_writer(
    buffers: Buffers, reals: Sequence[Slot], scalars: Sequence[Variable], others: Sequence[Slot]
) -> Callable[[Any], None]:
    """Return a function that writes outputs that have exactly the declared types.

    It raises TypeError for all others, although some of them can be converted, such as an array of integers, and
    struct.error for a scalar that is not a number. As generated code the checks take half the time of a loop over
    variables.
    """
    names: dict[str, Any] = {"array": np.ndarray, "real": np.dtype(np.float64)}
    lines = [_scalar_writing(buffers, reals, scalars, names)]
    for i, slot in enumerate([*reals[len(scalars) :], *others]):
        inexact, write = _exact_statement(buffers, slot, i, names)
        lines += [f"y{i} = x.{slot.variable.name}", f"if {inexact}: raise TypeError", write]
    return _compiled(lines, names)


def _exact_statement(buffers: Buffers, slot: Slot, i: int, names: dict[str, Any]) -> tuple[str, str]:
    """Return the condition under which output y<i> is inexact and the statement that writes it."""
    at, v = slot.offset, slot.variable
    if slot.buffer is Buffer.FLOAT64:
        names[f"to{i}"], names[f"shape{i}"] = buffers.array(slot, writeable=True), v.shape
        inexact = f"y{i}.__class__ is not array or y{i}.shape != shape{i} or y{i}.dtype is not real"
        return inexact, f"to{i}[...] = y{i}"
    if slot.buffer is Buffer.BOOLEAN or (slot.buffer is Buffer.INT64 and v.width in (None, Width.INT64)):
        is_boolean = slot.buffer is Buffer.BOOLEAN
        names[f"to{i}"] = buffers.booleans if is_boolean else buffers.integers
        names[f"type{i}"] = bool if is_boolean else int if v.enumeration is None else v.enumeration
        return f"y{i}.__class__ is not type{i}", f"to{i}[{at}] = y{i}"
    names[f"put{i}"] = _writer(buffers, slot)
    return "False", f"put{i}(y{i})"


def _reading(buffers: Buffers, slot: Slot, i: int, names: dict[str, Any]) -> str:
    """Return the expression for the value of input i, which is not real."""
    v = slot.variable
    if slot.buffer is Buffer.BOOLEAN:
        return f"bit({slot.offset})"
    if slot.buffer is Buffer.INT64 and v.enumeration is None and v.width is not Width.UINT64:
        return f"number({slot.offset})"
    names[f"value{i}"] = functools.partial(read_value, buffers, slot)
    return f"value{i}()"


def _scalar_reading(buffers: Buffers, reals: Sequence[Slot], scalars: Sequence[str], names: dict[str, Any]) -> str:
    """Return the statement that sets all real scalars."""
    if not scalars:
        return "pass"
    names.update(memory=buffers.floats.data.cast("B"), take=struct.Struct(f"={len(scalars)}d").unpack_from)
    return "".join(f"x.{name}, " for name in scalars) + f"= take(memory, {8 * reals[0].offset})"


def _scalar_writing(buffers: Buffers, reals: Sequence[Slot], scalars: Sequence[Variable], names: dict[str, Any]) -> str:
    """Return the statement that writes all real scalars; it raises struct.error for one that is not a number."""
    if not scalars:
        return "pass"
    names.update(memory=buffers.floats.data.cast("B"), put=struct.Struct(f"={len(scalars)}d").pack_into)
    return f"put(memory, {8 * reals[0].offset}" + "".join(f", x.{v.name}" for v in scalars) + ")"


def _compiled(lines: Sequence[str], names: dict[str, Any]) -> Callable[[Any], Any]:
    """Return a function of x that runs generated code.

    It gets or sets a dozen attributes in a third of the time that a loop over their names takes.
    """
    exec("def run(x):\n    " + "\n    ".join(lines), names)
    run: Callable[[Any], Any] = names.pop("run")  # else the function and its names would hold each other
    return run


def _raise_for_invalid_scalar(scalars: Sequence[Variable], y: Any) -> None:
    for variable in scalars:
        value = getattr(y, variable.name)
        try:
            struct.pack("=d", value)
        except struct.error:
            raise InvalidOutput(variable, value) from None


def _writer(buffers: Buffers, slot: Slot) -> Callable[[Any], None]:
    """Return a function that writes one output that is not real; it raises TypeError, ValueError or OverflowError."""
    at = slot.offset
    if slot.buffer is Buffer.INT64:
        number = functools.partial(_number, slot.variable)
        return lambda value: buffers.integers.__setitem__(at, number(value))
    if slot.buffer is Buffer.BOOLEAN:
        return lambda value: buffers.booleans.__setitem__(at, _instance(value, bool, np.bool_))
    if slot.buffer is Buffer.STRING:
        return lambda value: buffers.strings.__setitem__(at, _instance(value, str).encode())
    if slot.variable.raster:
        return _picture_writer(buffers, slot, slot.variable.raster)
    return functools.partial(_write_bytes, buffers, slot)


def _instance(value: Any, *types: type[Any]) -> Any:
    if not isinstance(value, types):
        raise TypeError("not of the declared type")
    return value


def _number(variable: Variable, value: Any) -> int:
    if isinstance(value, bool):
        raise TypeError("a truth value is not a number")
    number = operator.index(value)
    if variable.enumeration is not None:
        return variable.enumeration(number)
    if variable.width and not variable.width.holds(number):
        raise ValueError(f"no {variable.width.value}")
    return to_signed(number)


def _picture_writer(buffers: Buffers, slot: Slot, raster: Raster) -> Callable[[Any], None]:
    view = buffers.picture(slot, raster, writeable=True)

    def write(value: Any) -> None:
        if not isinstance(value, np.ndarray) or value.dtype != np.uint8 or value.shape != view.shape:
            raise TypeError("not a picture of the declared size")
        view[...] = value

    return write


def _write_bytes(buffers: Buffers, slot: Slot, value: Any) -> None:
    _instance(value, bytes)
    if len(value) > capacity(slot.variable):
        raise ValueError(f"{len(value)} bytes where {capacity(slot.variable)} fit")
    buffers.binaries[slot.offset][: len(value)] = np.frombuffer(value, dtype=np.uint8)
    buffers.sizes[slot.offset] = len(value)


Derivative = float | NDArray[np.float64]


class InvalidDerivative(InvalidReturn):
    """A block returned a derivative of something that is not a real output, or not of that output's shape."""

    def __init__(self, name: str, fault: str) -> None:
        super().__init__(f"gave {name!r}: {fault}")
        self.name, self.fault = name, fault


def derivative_reader(
    buffers: Buffers,
) -> Callable[[bytes], tuple[dict[str, Derivative], Callable[[Mapping[str, Any]], bytes]]]:
    """Return a function that turns a seed into a block's du, and a function that turns the block's dy into a vector.

    Seed and vector are float64: one entry for each entry of the real inputs and of the real outputs, in the buffer's
    order. In du are the inputs, by name, with an entry that is not zero. The second function raises InvalidDerivative.
    """
    inputs = buffers.layout.of(Causality.INPUT, Buffer.FLOAT64)
    outputs = {s.variable.name: s for s in buffers.layout.of(Causality.OUTPUT, Buffer.FLOAT64)}
    span = buffers.layout.span(Causality.OUTPUT, Buffer.FLOAT64)

    def to_vector(dy: Mapping[str, Any]) -> bytes:
        vector = np.zeros(span.stop - span.start)
        for name, value in dy.items():
            slot = outputs.get(name)
            if slot is None:
                raise InvalidDerivative(name, f"no such real output; it has {', '.join(outputs)}")
            if np.shape(value) != slot.variable.shape:
                raise InvalidDerivative(name, f"shape {np.shape(value)} where {slot.variable.shape} is declared")
            vector[slot.offset - span.start : slot.entries.stop - span.start] = np.ravel(value)
        return vector.tobytes()

    def from_seed(seed: bytes) -> tuple[dict[str, Derivative], Callable[[Mapping[str, Any]], bytes]]:
        return _directions(inputs, np.frombuffer(seed)), to_vector

    return from_seed


def _directions(inputs: list[Slot], vector: NDArray[np.float64]) -> dict[str, Derivative]:
    du: dict[str, Derivative] = {}
    first = inputs[0].offset if inputs else 0
    for slot in inputs:
        part = vector[slot.offset - first : slot.entries.stop - first]
        if np.any(part):
            du[slot.variable.name] = part.reshape(slot.variable.shape) if slot.variable.shape else float(part[0])
    return du
