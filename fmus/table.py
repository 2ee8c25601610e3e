"""The table that describes an instance's buffers and value references to the C runtime, which reads no XML.

A header, then the binary buffers, the variables by value reference, and their names: structures of runtime/instance.h.
"""

import struct

from handover.cosim.blocks.variable import Causality
from handover.fmus.buffers import Buffers
from handover.fmus.layout import TIME, Buffer, Form, Type, type_of

HEADER = struct.Struct("=14Q")
BINARY_BUFFER = struct.Struct("=3Q")
VARIABLE = struct.Struct("=BBHIII")

CAUSALITIES = {Causality.PARAMETER: 0, Causality.INPUT: 1, Causality.OUTPUT: 2}
INDEPENDENT = 3

HAS_EVENTS, HAS_DERIVATIVES, HAS_CLOCK = 1, 2, 4


def table(buffers: Buffers, form: Form) -> bytes:
    """Return the table; the form determines the value references."""
    layout = buffers.layout
    names = bytearray()
    rows: list[bytes] = []

    def add(buffer: Buffer, fmi_type: Type, causality: int, count: int, offset: int, name: str) -> None:
        rows.append(VARIABLE.pack(buffer, causality, fmi_type, count, offset, len(names)))
        names.extend(name.encode() + b"\0")

    if form.fmi == 3:
        add(Buffer.FLOAT64, Type.FLOAT64, INDEPENDENT, 1, 0, TIME)
    for v in layout.shown(form):
        add(v.buffer, type_of(v.variable), CAUSALITIES[v.variable.causality], len(v.entries), v.offset, v.name)
    binaries = [
        BINARY_BUFFER.pack(buffer.ctypes.data, buffer.nbytes, v.raster is not None)
        for v, buffer in zip(buffers.binary_variables, buffers.binaries, strict=True)
    ]
    spans = [layout.span(causality, Buffer.FLOAT64) for causality in (Causality.INPUT, Causality.OUTPUT)]
    addresses = [a.ctypes.data for a in (buffers.floats, buffers.integers, buffers.booleans, buffers.sizes)]
    places = [n for span in spans for n in (span.start, span.stop - span.start)]
    block = layout.description
    abilities = HAS_EVENTS * block.has_events + HAS_DERIVATIVES * block.has_derivatives
    abilities += HAS_CLOCK * layout.has_clock(form)
    period = (0, 0) if block.period is None else (block.period.numerator, block.period.denominator)
    return (
        HEADER.pack(*addresses, *places, len(rows), len(binaries), len(names), abilities, *period)
        + b"".join(binaries)
        + b"".join(rows)
        + bytes(names)
    )
