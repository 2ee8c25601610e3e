"""Where a block's variables lie in an instance's buffers, and by which value reference a host finds them.

There is one buffer per kind. The real one begins with the time and the step size; then, as in every buffer, come the
parameters, the inputs and the outputs. Scalars stand before arrays, so that all real input scalars are one slice.
"""

import enum
from collections.abc import Mapping
from dataclasses import dataclass

from cosim.block import Causality, Description, Kind, Variable

CLOCK = 2
"""Entries at the start of the real buffer: the time and the step size."""

SAMPLE_CLOCK = "sample_clock"
"""Name of a sampled unit's clock in FMI 3; it has no place in the buffers."""

BYTES_CAPACITY = 1 << 16
"""Most bytes in a binary variable that is not a picture."""


class Buffer(enum.IntEnum):
    """Kind of a buffer; the numbers are those of `Kind` in runtime/instance.h."""

    FLOAT64 = 0
    INT64 = 1
    BOOLEAN = 2
    STRING = 3
    BINARY = 4


BUFFER_OF = {
    Kind.REAL: Buffer.FLOAT64,
    Kind.INTEGER: Buffer.INT64,
    Kind.ENUMERATION: Buffer.INT64,
    Kind.BOOLEAN: Buffer.BOOLEAN,
    Kind.STRING: Buffer.STRING,
    Kind.BINARY: Buffer.BINARY,
}

CAUSALITIES = (Causality.PARAMETER, Causality.INPUT, Causality.OUTPUT)


class DuplicateName(ValueError):
    """A parameter, an input, an output and the clock must not share a name: an FMU has one list of variables."""

    def __init__(self, block: str, names: list[str]) -> None:
        super().__init__(f"{block}: more than one variable is named {', '.join(names)}; rename all but one")
        self.block, self.names = block, names


@dataclass(frozen=True)
class Slot:
    """A variable's place: `variable.size` entries from `offset` on in its buffer."""

    variable: Variable
    buffer: Buffer
    offset: int

    @property
    def entries(self) -> slice:
        """The place as a slice of the buffer."""
        return slice(self.offset, self.offset + self.variable.size)


class Layout:
    """The places of all variables of a block.

    Raises:
        DuplicateName: two variables share a name, or one has that of a sampled block's clock.
    """

    def __init__(self, description: Description) -> None:
        names = [v.name for v in description.variables]
        taken = names if description.period is None else [*names, SAMPLE_CLOCK]
        duplicates = sorted({name for name in taken if taken.count(name) > 1})
        if duplicates:
            raise DuplicateName(description.name, duplicates)
        self.description = description
        self.lengths = {buffer: CLOCK if buffer is Buffer.FLOAT64 else 0 for buffer in Buffer}
        slots: dict[str, Slot] = {}
        for v in sorted(description.variables, key=lambda v: (CAUSALITIES.index(v.causality), len(v.shape) > 0)):
            buffer = BUFFER_OF[v.kind]
            slots[v.name] = Slot(v, buffer, self.lengths[buffer])
            self.lengths[buffer] += v.size
        self.slots: Mapping[str, Slot] = {name: slots[name] for name in names}

    def in_buffer(self, buffer: Buffer) -> list[Slot]:
        """Return the slots in one buffer, by offset."""
        return sorted((s for s in self.slots.values() if s.buffer is buffer), key=lambda s: s.offset)

    def of(self, causality: Causality, buffer: Buffer) -> list[Slot]:
        """Return the slots of one causality in one buffer, by offset."""
        return [s for s in self.in_buffer(buffer) if s.variable.causality is causality]

    def span(self, causality: Causality, buffer: Buffer) -> slice:
        """Return the slice of a buffer that holds all variables of one causality."""
        slots = self.of(causality, buffer)
        return slice(slots[0].offset, slots[-1].entries.stop) if slots else slice(0, 0)

    def references(self, fmi: int) -> dict[str, int]:
        """Return each variable's value reference; in FMI 2 that of its first entry, the others follow.

        FMI 3's value reference 0 is the time.
        """
        if fmi == 3:
            return {name: 1 + i for i, name in enumerate(self.slots)}
        references: dict[str, int] = {}
        following = 0
        for name, slot in self.slots.items():
            references[name] = following
            following += slot.variable.size
        return references


def capacity(variable: Variable) -> int:
    """Return how many bytes a binary variable's buffer has."""
    return variable.raster.size if variable.raster else BYTES_CAPACITY
