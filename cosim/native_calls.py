"""What a program in C needs to make the calls of a unit that Python would make: addresses."""

import ctypes
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

Views = tuple[NDArray[Any], ...]
"""Where a port's value lives. Plain values: one array. Binary: addresses and sizes. Strings: addresses."""


@dataclass(frozen=True)
class NativeCall:
    """How variables of one type are set or read.

    Attributes:
        function: the function's address.
        component: the instance's.
        references: the value references.
        arrays: the memory: values; of binaries addresses and sizes.
    """

    fmi: int
    function: int
    component: int
    references: "ctypes.Array[ctypes.c_uint]"
    arrays: Views


@dataclass(frozen=True)
class NativeStep:
    """How a unit steps; `flags` are where FMI 3 tells of a step."""

    fmi: int
    function: int
    component: int
    flags: tuple[int, ...]
