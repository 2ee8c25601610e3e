"""Where a block's variables lie in an instance's buffers, and which value references they have.

There is one buffer per kind of variable. The real one begins with the time and the step size; then, as in every buffer,
come the parameters, the inputs and the outputs, of each the scalars before the arrays, so that all real input scalars
are one slice.
"""

import dataclasses
import enum
from collections.abc import Mapping
from dataclasses import dataclass

from handover.cosim.blocks.description import Description
from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.variable import Causality, Kind, Variable, element_names

CLOCK = 2
"""Entries at the start of the real buffer: the time and the step size."""

TIME = "time"
"""Name of the independent variable in FMI 3."""

SAMPLE_CLOCK = "sample_clock"
"""Name of a sampled unit's clock in FMI 3; it has no place in the buffers."""

BYTES_CAPACITY = 1 << 16
"""Maximum size, in bytes, of a binary variable that is not a picture."""


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


class Form(enum.Enum):
    """How an FMU presents a block's variables to its host; the values are part of files' names."""

    FMI2 = "fmi2"
    FMI3 = "fmi3"
    FMI3_SCALAR = "fmi3-scalar"

    @property
    def fmi(self) -> int:
        """Version of the standard."""
        return 2 if self is Form.FMI2 else 3

    @property
    def has_arrays(self) -> bool:
        """Whether an array is one variable; else each of its entries is one."""
        return self is Form.FMI3


CAUSALITIES = (Causality.PARAMETER, Causality.INPUT, Causality.OUTPUT)


class DuplicateName(ValueError):
    """Two of a block's parameters, inputs and outputs have the same name, but an FMU has one list of variables.

    In FMI 3 the time is one of them, and so is a sampled block's clock.
    """

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


class Type(enum.IntEnum):
    """Type of a variable in FMI 3; the numbers are those of `Type` in runtime/instance.h."""

    FLOAT64 = 1
    FLOAT32 = 2
    INT8 = 3
    UINT8 = 4
    INT16 = 5
    UINT16 = 6
    INT32 = 7
    UINT32 = 8
    INT64 = 9
    UINT64 = 10
    ENUMERATION = 11
    BOOLEAN = 12
    STRING = 13
    BINARY = 14


def type_of(variable: Variable) -> Type:
    """Return a variable's type in FMI 3."""
    return Type[variable.width.name if variable.width else variable.kind.name]


@dataclass(frozen=True)
class HostVariable:
    """A variable as a host sees it: one of the block's, or one entry of an array.

    Attributes:
        variable: the block's variable.
        name: `p_WG`, or an entry's `p_WG[1]`, `cov_O[1,1]`.
        reference: the value reference.
        buffer, offset: place of its first value.
        entries: indices of its values among the entries of the block's variable, in row-major order.
        shape: empty for a scalar.
    """

    variable: Variable
    name: str
    reference: int
    buffer: Buffer
    offset: int
    entries: range
    shape: tuple[int, ...]


class Layout:
    """The places of all variables of a block.

    Raises:
        DuplicateName: two variables share a name, or one has that of the time or of a sampled block's clock.
    """

    def __init__(self, description: Description) -> None:
        names = [v.name for v in description.variables]
        fmu_names = [TIME, *names] if description.period is None else [TIME, SAMPLE_CLOCK, *names]
        duplicates = sorted({name for name in fmu_names if fmu_names.count(name) > 1})
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

    def has_clock(self, form: Form) -> bool:
        """Return whether the host sees a clock.

        There is none in the scalar form, which is for tools that support little of FMI 3: when Ecos 0.7 unloads a unit
        with a clock, it crashes with `double free`.
        """
        return form is Form.FMI3 and self.description.period is not None

    def shown(self, form: Form) -> list[HostVariable]:
        """Return the variables as a host sees them, by value reference. FMI 3's value reference 0 is the time.

        In FMI 3's scalar form integers are Int32 if their start value and range allow it: Ecos, for which that form is
        made, has 32 bits for each and writes beyond its memory when it reads several Int64 in one call.
        """
        variables: list[HostVariable] = []
        first = 0 if form is Form.FMI2 else 1
        for name, slot in self.slots.items():
            v = _narrow(slot.variable) if form is Form.FMI3_SCALAR else slot.variable
            if form.has_arrays:
                reference = first + len(variables)
                variables.append(HostVariable(v, name, reference, slot.buffer, slot.offset, range(v.size), v.shape))
                continue
            for i, element in enumerate(element_names(v)):
                reference, offset = first + len(variables), slot.offset + i
                variables.append(HostVariable(v, element, reference, slot.buffer, offset, range(i, i + 1), ()))
        return variables

    def references(self, form: Form) -> dict[str, tuple[int, ...]]:
        """Return the value references by the block's variables' names: one each, or one for each entry of an array."""
        references: dict[str, tuple[int, ...]] = {}
        for shown in self.shown(form):
            name = shown.variable.name
            references[name] = (*references.get(name, ()), shown.reference)
        return references


def _narrow(v: Variable) -> Variable:
    declared = [n for n in (v.start, v.minimum, v.maximum) if n is not None]
    fits = v.width is Width.INT64 and all(map(Width.INT32.holds, declared))
    return dataclasses.replace(v, width=Width.INT32) if fits else v


def capacity(variable: Variable) -> int:
    """Return the size of a binary variable's buffer in bytes."""
    return variable.raster.size if variable.raster else BYTES_CAPACITY
