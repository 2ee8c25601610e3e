"""Description of a parameter, input or output: name, kind, causality, unit, shape, width, start value, range."""

import dataclasses
import enum
import itertools
import math
import re
from typing import Any

from handover.cosim.blocks.origins import Origin
from handover.cosim.blocks.ports import Raster, Width
from handover.cosim.blocks.units import ONE, Unit

SUBSCRIPT = re.compile(r"\[(\d{1,9}(?:,\d{1,9}){0,15})\]$")
"""The end of a name that is an entry of an array, of no more dimensions than any has, counted from 1."""
ELEMENT = re.compile(rf"(?P<base>.+){SUBSCRIPT.pattern}")


class Kind(enum.Enum):
    """Kind of a variable."""

    REAL = "real"
    INTEGER = "integer"
    BOOLEAN = "boolean"
    ENUMERATION = "enumeration"
    STRING = "string"
    BINARY = "binary"


class Causality(enum.Enum):
    """Role of a variable. A block declares no locals; those of FMUs matter where they have start values."""

    PARAMETER = "parameter"
    INPUT = "input"
    OUTPUT = "output"
    LOCAL = "local"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Declared:
    """What a block and an FMU alike declare of a parameter, input or output.

    `items` are the names and values of an enumeration; reals and integers have a `width`.
    """

    name: str
    kind: Kind
    causality: Causality
    description: str = ""
    shape: tuple[int, ...] = ()
    unit: Unit = ONE
    minimum: float | None = None
    maximum: float | None = None
    items: tuple[tuple[str, int], ...] = ()
    width: Width | None = None

    @property
    def size(self) -> int:
        """Number of entries; 1 for a scalar."""
        return math.prod(self.shape)

    @property
    def type_name(self) -> str:
        """Kind, with the width of numbers where it is not the usual one, as in `integer (Int16)`."""
        usual = self.width in (None, Width.FLOAT64, Width.INT64)
        return self.kind.value if usual or self.width is None else f"{self.kind.value} ({self.width.value})"


def indices_of(shape: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return the indices of an array's entries, counted from 1, in row-major order; one empty index for a scalar."""
    return list(itertools.product(*(range(1, n + 1) for n in shape)))


def subscript(index: tuple[int, ...]) -> str:
    """Return what the structured naming of FMI puts behind an array's name: `[1]`, `[2,1]`; nothing for a scalar."""
    return f"[{','.join(map(str, index))}]" if index else ""


def element_names(variable: Declared) -> list[str]:
    """Return the names of a variable's entries, `p_WG[1]` or `cov_O[1,1]`, in row-major order; a scalar's own name."""
    return [variable.name + subscript(index) for index in indices_of(variable.shape)]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Variable(Declared):
    """All that a block declares of a parameter, input or output."""

    start: Any
    origin: Origin | None = None
    enumeration: type[enum.IntEnum] | None = None
    raster: Raster | None = None

    @property
    def mime(self) -> str | None:
        """MIME type of a picture; None of anything else."""
        return self.raster.mime if self.raster else None
