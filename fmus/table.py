"""The table from which the C runtime knows an instance's buffers and value references; it reads no XML.

A header, then the binary buffers, the variables by value reference, and their names: structures of runtime/instance.h.
"""

import itertools
import struct

from cosim.block import Causality, Variable
from fmus.buffers import Buffers
from fmus.layout import Buffer

HEADER = struct.Struct("=14Q")
BINARY_BUFFER = struct.Struct("=3Q")
VARIABLE = struct.Struct("=BBHIII")

CAUSALITIES = {Causality.PARAMETER: 0, Causality.INPUT: 1, Causality.OUTPUT: 2}
INDEPENDENT = 3

HAS_EVENTS, HAS_DERIVATIVES = 1, 2


def table(buffers: Buffers, fmi: int) -> bytes:
    """Return the table; `fmi` is the standard's version, 2 or 3, and decides what a value reference stands for."""
    layout = buffers.layout
    names = bytearray()
    rows: list[bytes] = []

    def add(buffer: Buffer, causality: int, count: int, offset: int, name: str) -> None:
        rows.append(VARIABLE.pack(buffer, causality, 0, count, offset, len(names)))
        names.extend(name.encode() + b"\0")

    if fmi == 3:
        add(Buffer.FLOAT64, INDEPENDENT, 1, 0, "time")
    for slot in layout.slots.values():
        v = slot.variable
        if fmi == 3:
            add(slot.buffer, CAUSALITIES[v.causality], v.size, slot.offset, v.name)
            continue
        for i, name in enumerate(element_names(v)):
            add(slot.buffer, CAUSALITIES[v.causality], 1, slot.offset + i, name)
    binaries = [
        BINARY_BUFFER.pack(buffer.ctypes.data, buffer.nbytes, v.raster is not None)
        for v, buffer in zip(buffers.binary_variables, buffers.binaries, strict=True)
    ]
    spans = [layout.span(causality, Buffer.FLOAT64) for causality in (Causality.INPUT, Causality.OUTPUT)]
    addresses = [a.ctypes.data for a in (buffers.floats, buffers.integers, buffers.booleans, buffers.sizes)]
    places = [n for span in spans for n in (span.start, span.stop - span.start)]
    block = layout.description
    abilities = HAS_EVENTS * block.has_events + HAS_DERIVATIVES * block.has_derivatives
    period = (0, 0) if block.period is None else (block.period.numerator, block.period.denominator)
    return (
        HEADER.pack(*addresses, *places, len(rows), len(binaries), len(names), abilities, *period)
        + b"".join(binaries)
        + b"".join(rows)
        + bytes(names)
    )


def element_names(variable: Variable) -> list[str]:
    """Return the names of a variable's entries in FMI 2: `p_WG[1]`, `cov_O[1,1]`; a scalar's own name."""
    if not variable.shape:
        return [variable.name]
    indices = itertools.product(*(range(1, extent + 1) for extent in variable.shape))
    return [f"{variable.name}[{','.join(map(str, index))}]" for index in indices]
