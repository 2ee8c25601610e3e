"""Data from outside, JSON files and messages, read as what annotations declare. The declared types are msgspec's.

| declared | what is taken |
|---|---|
| `TypedDict` | an object with all required keys; keys that are not declared are kept as they are |
| dataclass | likewise, without keys that are not declared |
| `msgspec.Struct` with `forbid_unknown_fields` | likewise; other keys are refused |
| `float`, `int`, `str`, `bool`, `None`, `list`, `tuple`, `dict`, `Literal`, unions | values of these types, finite |
| `Annotated[T, Meta(ge=0, le=9)]`, `Meta(pattern=..., max_length=...)` | those within a range, or of a form |
"""

from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

import msgspec
from msgspec import Meta

from handover.cosim.exceptions import one_line
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
        OSError: it cannot be read, is no regular file, or longer than `most` bytes.
        InvalidData: as by `decoded`.
    """
    return decoded(read_regular(file, most), declared)
