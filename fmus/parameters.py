"""Reads a block's parameters, and single values, from the buffers and checks them against their declarations."""

import enum
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.start_values import fault_of
from handover.cosim.blocks.variable import Variable
from handover.fmus.buffers import Buffers, to_unsigned
from handover.fmus.layout import Buffer, Slot


class ParameterOutOfRange(ValueError):
    """A parameter's value is outside its declared range."""

    is_refusal = True

    def __init__(self, variable: Variable, fault: str) -> None:
        super().__init__(f"parameter '{variable.name}' ({variable.description}): {fault}")
        self.variable, self.fault = variable, fault


class UnknownItem(ValueError):
    """An enumeration was set to a number that is none of its items."""

    is_refusal = True

    def __init__(self, variable: Variable, items: type[enum.IntEnum], value: int) -> None:
        listed = ", ".join(f"{int(item)} {item.name}" for item in items)
        super().__init__(f"{variable.causality.value} '{variable.name}' is {value}; its items are {listed}")
        self.variable, self.value = variable, value


def read_parameters(buffers: Buffers) -> Any:
    """Return a block's parameters from the buffers.

    Raises:
        ParameterOutOfRange, UnknownItem: a value is not one that its declaration allows.
    """
    layout = buffers.layout
    values: dict[str, Any] = {}
    for v in layout.description.parameters:
        values[v.name] = read_value(buffers, layout.slots[v.name])
        fault = fault_of(v, values[v.name])
        if fault:
            raise ParameterOutOfRange(v, fault)
    return layout.description.params_type(**values)


def read_value(buffers: Buffers, slot: Slot) -> Any:
    """Return a copy of a variable's value, of its declared type.

    Raises:
        UnknownItem: an enumeration's number is none of its items.
    """
    v = slot.variable
    if slot.buffer is Buffer.FLOAT64:
        values = buffers.floats[slot.entries]
        return np.array(values).reshape(v.shape) if v.shape else values.item()
    if slot.buffer is Buffer.INT64:
        number = int(buffers.integers[slot.offset])
        if v.width is Width.UINT64:
            return to_unsigned(number)
        return number if v.enumeration is None else _item(v, v.enumeration, number)
    if slot.buffer is Buffer.BOOLEAN:
        return bool(buffers.booleans[slot.offset])
    if slot.buffer is Buffer.STRING:
        return buffers.strings[slot.offset].decode()
    return buffers.binaries[slot.offset][: int(buffers.sizes[slot.offset])].tobytes()


def _item(variable: Variable, items: type[enum.IntEnum], value: int) -> enum.IntEnum:
    try:
        return items(value)
    except ValueError:
        raise UnknownItem(variable, items, value) from None
