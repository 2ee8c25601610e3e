"""Between the C runtime's vectors of derivatives and a block's `directional_derivative`."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.variable import Causality
from handover.fmus.buffers import Buffers
from handover.fmus.layout import Buffer, Slot

Derivative = float | NDArray[np.float64]


class UnfitDerivative(TypeError):
    """A block gave a derivative that is no real output's, or not of that output's shape."""

    def __init__(self, name: str, fault: str) -> None:
        super().__init__(f"directional_derivative gave {name!r}: {fault}")
        self.name, self.fault = name, fault


def derivative_reader(
    buffers: Buffers,
) -> Callable[[bytes], tuple[dict[str, Derivative], Callable[[Mapping[str, Any]], bytes]]]:
    """Return a function that turns a seed into what a block takes and what turns the block's answer into a vector.

    Seed and answer are float64, the real inputs and the real outputs as they lie in the buffer. The block gets the
    inputs by name of which an entry is not zero. What turns its answer raises UnfitDerivative.
    """
    inputs = buffers.layout.of(Causality.INPUT, Buffer.FLOAT64)
    outputs = {s.variable.name: s for s in buffers.layout.of(Causality.OUTPUT, Buffer.FLOAT64)}
    span = buffers.layout.span(Causality.OUTPUT, Buffer.FLOAT64)

    def write(dy: Mapping[str, Any]) -> bytes:
        vector = np.zeros(span.stop - span.start)
        for name, value in dy.items():
            slot = outputs.get(name)
            if slot is None:
                raise UnfitDerivative(name, f"no such real output; it has {', '.join(outputs)}")
            if np.shape(value) != slot.variable.shape:
                raise UnfitDerivative(name, f"shape {np.shape(value)} where {slot.variable.shape} is declared")
            vector[slot.offset - span.start : slot.entries.stop - span.start] = np.ravel(value)
        return vector.tobytes()

    def read(seed: bytes) -> tuple[dict[str, Derivative], Callable[[Mapping[str, Any]], bytes]]:
        return _directions(inputs, np.frombuffer(seed)), write

    return read


def _directions(inputs: list[Slot], vector: NDArray[np.float64]) -> dict[str, Derivative]:
    du: dict[str, Derivative] = {}
    first = inputs[0].offset if inputs else 0
    for slot in inputs:
        part = vector[slot.offset - first : slot.entries.stop - first]
        if np.any(part):
            du[slot.variable.name] = part.reshape(slot.variable.shape) if slot.variable.shape else float(part[0])
    return du
