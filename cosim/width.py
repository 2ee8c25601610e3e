"""Types of numbers at an FMU's boundary."""

import enum

import numpy as np


class Width(enum.Enum):
    """How many bits a real or integer variable has at an FMU's boundary; the values are FMI 3's names.

    A block itself counts with Python's numbers, whatever the width. FMI 2 has two types of number: reals are 64 bits
    wide, integers 32.
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
        """The least number; of the integer widths an int."""
        if self.is_real:
            return float(np.finfo(self.value.lower()).min)
        return int(np.iinfo(self.value.lower()).min)

    @property
    def highest(self) -> float:
        """The greatest number; of the integer widths an int."""
        if self.is_real:
            return float(np.finfo(self.value.lower()).max)
        return int(np.iinfo(self.value.lower()).max)

    @property
    def told(self) -> str:
        """Name and range, for messages."""
        return f"{self.value} (from {self.lowest!r} to {self.highest!r})"

    def holds(self, number: float) -> bool:
        """Tell whether a number has a place, be it rounded."""
        return self.lowest <= number <= self.highest

    def rounded(self, number: float) -> float:
        """Return the nearest number of this width to one that has a place in it."""
        return float(np.float32(number)) if self is Width.FLOAT32 else number
