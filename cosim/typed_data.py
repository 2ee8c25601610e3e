"""Data from outside, JSON files and messages, read as what annotations declare. The declared types are msgspec's.

| declared | what is taken |
|---|---|
| `TypedDict` | an object with all required keys; keys that are not declared are kept as they are |
| dataclass | likewise, without keys that are not declared |
| `msgspec.Struct` with `forbid_unknown_fields` | the same; other keys are refused |
| `float`, `int`, `str`, `bool`, `None`, `list`, `tuple`, `dict`, `Literal`, unions | values of these types, finite |
| `Annotated[T, Meta(ge=0, le=9)]`, `Meta(pattern=..., max_length=...)` | those within a range, or of a form |
"""

from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast, get_args

import msgspec
from msgspec import Meta, inspect

from handover.cosim.exceptions import hints, one_line
from handover.cosim.files import MOST, read_regular

T = TypeVar("T")

NotNegative = Annotated[float, Meta(ge=0.0)]
"""A number such as seconds that have passed."""
Count = Annotated[int, Meta(ge=0, le=2**63 - 1)]
"""A whole number such as rows of a record."""
GREATEST_SEED = 2**63 - 1
Seed = Annotated[int, Meta(ge=0, le=GREATEST_SEED)]
"""A seed of random numbers."""
ExactSeconds = Annotated[str, Meta(pattern=r"^(?!0+(/|$))[0-9]{1,308}(/[1-9][0-9]{0,307})?$")]
"""A positive number of seconds, as `str` writes a fraction."""
ExactTime = Annotated[str, Meta(pattern=r"^-?[0-9]{1,308}(/[1-9][0-9]{0,307})?$")]
"""A time in seconds, likewise; it may be 0 or before 0 s."""
_MOST_EXACT = 10**308


def is_exact_time(seconds: Fraction) -> bool:
    """Return whether `ExactTime` takes a time: neither number of its fraction has more than 308 digits."""
    return max(abs(seconds.numerator), seconds.denominator) < _MOST_EXACT


NOT_BLANK = r"\S"
Text = Annotated[str, Meta(pattern=NOT_BLANK)]
"""A text that is not empty."""
Name = Annotated[str, Meta(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
"""A name of any kind that could be a column's."""
UNIT_NAME = r" *[^\s\x00-\x1f][^\x00-\x1f]*"
"""A unit's name in a system: something that is seen, in one line."""
PortName = Annotated[str, Meta(pattern=rf"(?s)^{UNIT_NAME}\..")]
"""A port with its unit, `UNIT.PORT`."""
FilePath = Annotated[str, Meta(pattern=r"^[^\x00]+$", max_length=4096)]
"""The path of a file."""


class InvalidData(ValueError):
    """Data from outside is not what is declared; the message says where, and what would be right."""


def decoded(content: bytes | str, declared: type[T]) -> T:
    """Return what a JSON text says; see the table above.

    Raises:
        InvalidData: it is not JSON, nested too deeply, or not of the declared type.
    """
    try:
        data: Any = msgspec.json.decode(content)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as e:
        raise InvalidData(f"it is not JSON: {one_line(e)}") from e
    return checked(data, declared)


def checked(data: Any, declared: type[T]) -> T:
    """Return decoded JSON as the declared type.

    Raises:
        InvalidData: it is not of that type.
    """
    try:
        made: T = msgspec.convert(data, declared)
    except (msgspec.ValidationError, RecursionError) as e:
        raise InvalidData(one_line(e)) from e
    return cast(T, data) if isinstance(made, dict) else made


def read_typed(file: Path, declared: type[T], most: float = MOST) -> T:
    """Return what a JSON file holds.

    Raises:
        OSError: it cannot be read, is not a regular file, or longer than `most` bytes.
        InvalidData: as by `decoded`.
    """
    return decoded(read_regular(file, most), declared)


def all_faults(data: Any, declared: Any, where: str = "") -> Iterator[str]:
    """Yield what is wrong with data that people write, each with its place; `checked` stops at the first fault."""
    try:
        msgspec.convert(data, declared)
    except (msgspec.ValidationError, RecursionError):
        kind, before = inspect.type_info(declared), f"{where}." if where else ""
        if isinstance(kind, inspect.StructType) and isinstance(data, dict):
            fields, table = {f.encode_name: f for f in msgspec.structs.fields(kind.cls)}, cast(dict[str, Any], data)
            for name, field in fields.items():
                if name in table:
                    yield from all_faults(table[name], field.type, before + name)
                elif field.required:
                    yield f"{before}{name}: it is missing; expected {_expected(inspect.type_info(field.type))}"
            yield from unknown_names(table, fields, where)
        elif isinstance(kind, inspect.DictType) and isinstance(data, dict):
            name_type, value_type = get_args(declared)
            for name, value in cast(dict[str, Any], data).items():
                yield from all_faults(name, name_type, before + name)
                yield from all_faults(value, value_type, before + name)
        elif isinstance(kind, inspect.ListType) and isinstance(kind.item_type, inspect.StructType) and data:
            for k, value in enumerate(cast(list[Any], data) if isinstance(data, list) else [data], 1):
                yield from all_faults(value, get_args(declared)[0], f"{where}[{k}]")
        else:
            yield f"{where}: it is {data!r:.60}; expected {_expected(kind)}"


def unknown_names(table: Mapping[str, Any], known: Mapping[str, Any], where: str) -> Iterator[str]:
    """Yield a fault for each key of a table that is not known."""
    for name, near in hints((n for n in table if n not in known), known):
        yield f"{where}{'.' if where else ''}{name}: no such key; {near}"


def _expected(kind: inspect.Type) -> str:
    match kind:
        case inspect.IntType(ge=low, le=high):
            return f"a whole number from {low} to {high}"
        case inspect.FloatType(ge=low, le=high):
            return f"a number from {low:g} to {high:g}"
        case inspect.BoolType():
            return "true or false"
        case inspect.LiteralType(values=values):
            return " or ".join(map(repr, values))
        case inspect.StrType(pattern=pattern):
            return "a non-empty string" if pattern == NOT_BLANK else "a name of letters, digits and underscores"
        case inspect.ListType(item_type=inspect.StrType()):
            return 'a list of non-empty strings, such as ["a", "b"]'
        case inspect.ListType():
            return f"a list, each entry of it {_expected(kind.item_type)}"
        case inspect.UnionType():
            return "a string, a number, true, false or a list of them"
        case _:
            return "a table"
