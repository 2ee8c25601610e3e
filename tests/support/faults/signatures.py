"""What the standards' functions take, read from their official headers, which FMPy brings along."""

import ctypes
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy

HEADERS = Path(fmpy.__file__).parent / "c-code"

BOOLEAN: Mapping[int, Any] = {2: ctypes.c_int, 3: ctypes.c_bool}

SCALARS: Mapping[str, Any] = {
    "Real": ctypes.c_double,
    "Float32": ctypes.c_float,
    "Float64": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Int8": ctypes.c_int8,
    "UInt8": ctypes.c_uint8,
    "Int16": ctypes.c_int16,
    "UInt16": ctypes.c_uint16,
    "Int32": ctypes.c_int32,
    "UInt32": ctypes.c_uint32,
    "Int64": ctypes.c_int64,
    "UInt64": ctypes.c_uint64,
    "Clock": ctypes.c_bool,
    "ValueReference": ctypes.c_uint32,
    "Type": ctypes.c_int,
    "StatusKind": ctypes.c_int,
}
"""Types of C by the names after `fmi2` and `fmi3`; those not listed, strings and callbacks among them, are pointers."""


def signatures(fmi: int) -> dict[str, list[Any]]:
    """Return the types of each function's arguments by the name after `fmi2` or `fmi3`; `fmi` is 2 or 3."""
    text = (HEADERS / f"fmi{fmi}FunctionTypes.h").read_text(encoding="utf-8")
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    found = re.findall(rf"typedef\s+[\w\s\*]+?\bfmi{fmi}(\w+)TYPE\s*\(([^)]*)\)\s*;", text)
    return {
        name: [_type(a.strip(), fmi) for a in arguments.split(",") if a.strip() != "void"] for name, arguments in found
    }


def _type(argument: str, fmi: int) -> Any:
    if "*" in argument or "[" in argument:
        return ctypes.c_void_p
    if argument.startswith("size_t"):
        return ctypes.c_size_t
    name = argument.removeprefix("const ").split()[0].removeprefix(f"fmi{fmi}")
    return BOOLEAN[fmi] if name == "Boolean" else SCALARS.get(name, ctypes.c_void_p)
