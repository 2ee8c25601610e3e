"""Types and dataclass fields by which a block declares its ports and parameters.

A scalar port is a float with a unit (`handover.cosim.blocks.units`), an int, a bool, a str or an `enum.IntEnum`. An
array is one of the shapes below with the unit of its entries, as in `Vector3[Metre]`; `Polyline25[Metre]` holds 25
points in space. A camera picture is `Picture1280x720`.

At an FMU's boundary reals and integers have 64 bits, unless the type says otherwise: `Single[Metre]` and
`Single[Vector3[Metre]]` are reals of 32 bits, `Int8` ... `UInt64` integers of other widths. Within the block they are
float, array and int all the same.
"""

import enum
import re
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import TypeAliasType

from handover.cosim.blocks.origins import Origin


class Width(enum.Enum):
    """How many bits a real or integer variable has at an FMU's boundary; the values are FMI 3's names.

    A block itself computes with Python's numbers, whatever the width. FMI 2 has two numeric types: reals of 64 bits and
    integers of 32.
    """

    FLOAT32 = "Float32"
    FLOAT64 = "Float64"
    INT8 = "Int8"
    UINT8 = "UInt8"
    INT16 = "Int16"
    UINT16 = "UInt16"
    INT32 = "Int32"
    UINT32 = "UInt32"
    INT64 = "Int64"
    UINT64 = "UInt64"

    @property
    def is_real(self) -> bool:
        """Whether it is a width of real numbers."""
        return self in (Width.FLOAT32, Width.FLOAT64)

    @property
    def lowest(self) -> float:
        """The smallest number that fits; an int for integer widths."""
        if self.is_real:
            return float(np.finfo(self.value.lower()).min)
        return int(np.iinfo(self.value.lower()).min)

    @property
    def highest(self) -> float:
        """The largest number that fits; an int for integer widths."""
        if self.is_real:
            return float(np.finfo(self.value.lower()).max)
        return int(np.iinfo(self.value.lower()).max)

    @property
    def range_text(self) -> str:
        """Name and range, for messages."""
        return f"{self.value} (from {self.lowest!r} to {self.highest!r})"

    def holds(self, number: float) -> bool:
        """Return whether a number fits, rounded if need be."""
        return self.lowest <= number <= self.highest

    def rounded(self, number: float) -> float:
        """Return the nearest number of this width to one that fits."""
        return float(np.float32(number)) if self is Width.FLOAT32 else number


U = TypeVar("U")
T = TypeVar("T")

Floats = NDArray[np.float64]
"""Any array of float64: what the shapes below are to a type checker."""


@dataclass(frozen=True)
class Shape:
    """Extents of an array port."""

    extents: tuple[int, ...]


_RASTER_MIME = re.compile(r"image/x-raw-bgr; width=(\d{1,5}); height=(\d{1,5})")


@dataclass(frozen=True)
class Raster:
    """A raw picture, blue, green, red, 8 bits each, rows from the top: `width * height * 3` bytes."""

    width: int
    height: int

    @property
    def mime(self) -> str:
        """MIME type with the picture's size as its parameters."""
        return f"image/x-raw-bgr; width={self.width}; height={self.height}"

    @property
    def size(self) -> int:
        """Number of bytes."""
        return self.width * self.height * 3

    @classmethod
    def of_mime(cls, mime: str | None) -> "Raster | None":
        """Return the raster of a MIME type; None if it is another one."""
        found = _RASTER_MIME.fullmatch(mime or "")
        return None if found is None else cls(int(found[1]), int(found[2]))


Vector2 = TypeAliasType("Vector2", Annotated[Floats, Shape((2,))], type_params=(U,))
Vector3 = TypeAliasType("Vector3", Annotated[Floats, Shape((3,))], type_params=(U,))
Vector4 = TypeAliasType("Vector4", Annotated[Floats, Shape((4,))], type_params=(U,))
Vector5 = TypeAliasType("Vector5", Annotated[Floats, Shape((5,))], type_params=(U,))
Vector6 = TypeAliasType("Vector6", Annotated[Floats, Shape((6,))], type_params=(U,))
Vector8 = TypeAliasType("Vector8", Annotated[Floats, Shape((8,))], type_params=(U,))
Vector9 = TypeAliasType("Vector9", Annotated[Floats, Shape((9,))], type_params=(U,))
Vector12 = TypeAliasType("Vector12", Annotated[Floats, Shape((12,))], type_params=(U,))
Vector14 = TypeAliasType("Vector14", Annotated[Floats, Shape((14,))], type_params=(U,))
Matrix3 = TypeAliasType("Matrix3", Annotated[Floats, Shape((3, 3))], type_params=(U,))
Matrix3x4 = TypeAliasType("Matrix3x4", Annotated[Floats, Shape((3, 4))], type_params=(U,))
Corners8 = TypeAliasType("Corners8", Annotated[Floats, Shape((8, 2))], type_params=(U,))
Polyline25 = TypeAliasType("Polyline25", Annotated[Floats, Shape((25, 3))], type_params=(U,))

Single = TypeAliasType("Single", Annotated[U, Width.FLOAT32], type_params=(U,))

Int8 = Annotated[int, Width.INT8]
UInt8 = Annotated[int, Width.UINT8]
Int16 = Annotated[int, Width.INT16]
UInt16 = Annotated[int, Width.UINT16]
Int32 = Annotated[int, Width.INT32]
UInt32 = Annotated[int, Width.UINT32]
UInt64 = Annotated[int, Width.UINT64]

Picture1280x720 = Annotated[NDArray[np.uint8], Raster(1280, 720)]
"""Colour picture: array of shape (720, 1280, 3), see `Raster`."""

BLACK_1280X720 = np.zeros((720, 1280, 3), dtype=np.uint8)
"""Start value of a picture."""


@dataclass(frozen=True, kw_only=True)
class Declaration:
    """What a field declares of its port beyond its type."""

    description: str
    start: Any
    minimum: float | None = None
    maximum: float | None = None
    origin: Origin | None = None


def parameter(
    default: T,
    description: str,
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    origin: Origin | None = None,
) -> T:
    """Declare a parameter, as the default of a dataclass field: its value is fixed during a run.

    Bounds are inclusive and hold for every entry of an array. The origin says where the default comes from.
    """
    d = Declaration(description=description, start=default, minimum=minimum, maximum=maximum, origin=origin)
    return declared_field(d)


def port(start: T, description: str, *, minimum: float | None = None, maximum: float | None = None) -> T:
    """Declare an input, as the default of a dataclass field; `start` is its value while nothing is connected."""
    d = Declaration(description=description, start=start, minimum=minimum, maximum=maximum)
    return declared_field(d)


def output(description: str, *, minimum: float | None = None, maximum: float | None = None) -> Any:
    """Declare an output. It has no default: a block that forgets one in its `Outputs(...)` gets a TypeError."""
    d = Declaration(description=description, start=None, minimum=minimum, maximum=maximum)
    return field(metadata={"declaration": d})


def declared_field(declaration: Declaration, **metadata: Any) -> Any:
    """Return a dataclass field of a declaration, with its start value as the default, and more metadata."""
    default, metadata = declaration.start, {"declaration": declaration, **metadata}
    if isinstance(default, np.ndarray):
        dtype = np.uint8 if default.dtype == np.uint8 else np.float64
        array = np.asarray(default, dtype=dtype)

        def copy() -> Any:  # dataclasses would share one array between instances
            return np.array(array)

        return field(default_factory=copy, metadata=metadata)
    return field(default=default, metadata=metadata)
