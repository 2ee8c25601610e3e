"""Values of an FMU's variables over time as CSV: a column `time` in seconds, then a column an entry of a variable.

Columns are named as FMI 2 names the entries of arrays, `p[1]` or `R[1,1]`, whatever the form of the FMU. Booleans are
`true` or `false`, enumerations the names of their items; numbers in their place are read, too. Binary variables and
arrays of more than 1000 entries have no columns: pictures would be the most of a file, and are equal only where every
rounding is.
"""

import csv
import ctypes
import io
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from handover.cosim.blocks.start_values import range_of
from handover.cosim.blocks.variable import Kind, element_names
from handover.cosim.exceptions import first_faults, hints
from handover.cosim.fmu.buffers import Views
from handover.cosim.fmu.file.default_experiment import exact_seconds
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.fmu.start_values import parsed_number

TIME = "time"
MAX_ENTRIES = 1000
"""Entries of an array that has columns."""

_SHARE_OF_STEP = 0.01
"""By which a rounded time may lie off a step's end, at most."""

Column = tuple[FmuPort, int]
"""A variable and the place of one of its entries in row-major order."""


class InvalidTable(ValueError):
    """A table is not what it should be; the message lists what is wrong, each with its line or column."""

    def __init__(self, name: str, faults: Sequence[str]) -> None:
        super().__init__(f"{name}: {'; '.join(first_faults(faults))}")
        self.name, self.faults = name, tuple(faults)


@dataclass(frozen=True)
class SignalTable:
    """Values over time.

    Attributes:
        times: in seconds, rising.
        columns: by name, a value for each time: a number, or a text of a string.
        resolutions: for each time that was read, a unit in the last of its written digits, in seconds.
    """

    times: Sequence[Fraction]
    columns: Mapping[str, Sequence[Any]]
    resolutions: Sequence[float] = ()

    def snapped(self, start: Fraction, step: Fraction | None) -> "SignalTable":
        """Return the table with times on a grid that are there but for rounding, such as 0.0333333 s for 1/30 s.

        Those are nearer to the grid than a unit in the last of their digits, and than a hundredth of a step. Where two
        rows would have one time, all stay.
        """
        if step is None or not self.resolutions:
            return self
        times = [_snapped(t, start, step, unit) for t, unit in zip(self.times, self.resolutions, strict=True)]
        return replace(self, times=times) if all(a < b for a, b in itertools.pairwise(times)) else self


def _snapped(t: Fraction, start: Fraction, step: Fraction, resolution: float) -> Fraction:
    nearest_point = start + round((t - start) / step) * step
    return nearest_point if abs(t - nearest_point) <= min(resolution, _SHARE_OF_STEP * float(step)) else t


def has_columns(port: FmuPort) -> bool:
    """Return whether a variable has columns: see above; nor has one that can be reached only while a clock ticks."""
    return port.kind is not Kind.BINARY and port.size <= MAX_ENTRIES and not port.clocks


def columns_of(ports: Iterable[FmuPort]) -> dict[str, Column]:
    """Return the columns of variables, by name."""
    columns: dict[str, Column] = {}
    for port in filter(has_columns, ports):
        columns |= {name: (port, i) for i, name in enumerate(element_names(port))}
    return columns


def entries_in(port: FmuPort, views: Views) -> list[Any]:
    """Return the entries of a variable that its buffers hold: numbers, or texts."""
    if port.kind is Kind.STRING:
        return [ctypes.string_at(int(a)).decode("utf-8", "replace") if a else "" for a in views[0]]
    return views[0].tolist()


def write_table(table: SignalTable, columns: Mapping[str, Column]) -> bytes:
    """Return a table as CSV; numbers have all digits that distinguish them."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([TIME, *table.columns])
    texts = [[_text(columns[name][0], value) for value in values] for name, values in table.columns.items()]
    writer.writerows(zip((repr(float(t)) for t in table.times), *texts, strict=True))
    return file.getvalue().encode()


def _text(port: FmuPort, value: Any) -> str:
    if port.kind is Kind.BOOLEAN:
        return "true" if value else "false"
    if port.kind is Kind.ENUMERATION:
        return {number: name for name, number in port.items}.get(value, str(value))
    return repr(float(value)) if port.kind is Kind.REAL else str(value)


def read_header(content: bytes, name: str) -> list[str]:
    """Return the names of a table's columns, without the time.

    Raises:
        InvalidTable: it is not CSV in UTF-8, its first column is not the time, or a column is there twice.
    """
    header, _ = _rows(content, name)
    return header


def read_table(content: bytes, name: str, columns: Mapping[str, Column], *, in_range: bool = False) -> SignalTable:
    """Read those columns of a table that `columns` has; others are left out.

    Args:
        content: CSV in UTF-8, with commas.
        name: of the file, for messages.
        columns: those that there may be.
        in_range: whether values must lie in the ranges that the variables declare.

    Raises:
        InvalidTable: as `read_header`; or there are no rows, a row has another number of values than the first, a
            value is none of its variable's type or not finite, or times do not rise.
    """
    header, rows = _rows(content, name)
    faults: list[str] = [] if rows else ["it has no rows of values"]
    times: list[Fraction] = []
    resolutions: list[float] = []
    values: list[list[Any]] = [[] for _ in header]
    for line, row in rows:
        if len(row) != len(header) + 1:
            faults.append(f"line {line} has {len(row)} values; expected {len(header) + 1}, as in the first line")
            continue
        t = _finite(row[0])
        if t is None:
            faults.append(f"line {line}: time {row[0]!r} is not a finite number of seconds")
            continue
        if times and exact_seconds(t) <= times[-1]:
            faults.append(f"line {line}: the time {row[0]} s is not after {float(times[-1]):g} s, the one before")
        times.append(exact_seconds(t))
        resolutions.append(_resolution(row[0]))
        for text, column, into in zip(row[1:], header, values, strict=True):
            if column in columns:
                value, fault = _parsed(columns[column][0], text, in_range=in_range)
                into.append(value)
                if fault:
                    faults.append(f"line {line}, column {column!r}: {text!r}: {fault}")
    if faults:
        raise InvalidTable(name, faults)
    return SignalTable(times, {c: v for c, v in zip(header, values, strict=True) if c in columns}, resolutions)


def unknown_columns(header: Sequence[str], known: Iterable[str], what: str) -> list[str]:
    """Return a fault for each name that is not known; `what` says what the names should be of."""
    names = dict.fromkeys(known)
    unknown = (c for c in header if c not in names)
    return [f"column {c!r}: the FMU has no such {what}: {near}" for c, near in hints(unknown, names)]


def _rows(content: bytes, name: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    try:
        reader = csv.reader(io.StringIO(content.decode("utf-8-sig"), newline=""), strict=True)
        rows = [(reader.line_num, row) for row in reader if row]
    except UnicodeDecodeError as e:
        raise InvalidTable(name, [f"it is not UTF-8: {e.reason} at byte {e.start}"]) from e
    except csv.Error as e:
        raise InvalidTable(name, [f"it is not CSV: {e}"]) from e
    if not rows or rows[0][1][0].strip().lower() != TIME:
        given = repr(rows[0][1][0][:40]) if rows else "nothing"
        raise InvalidTable(name, [f"its first line begins with {given}; expected names, of which time is the first"])
    header = [cell.strip() for cell in rows[0][1][1:]]
    if twice := sorted({c for c in header if header.count(c) > 1}):
        raise InvalidTable(name, [f"column {c!r} is there twice" for c in twice])
    return header, rows[1:]


def _parsed(port: FmuPort, text: str, *, in_range: bool) -> tuple[Any, str]:
    """Return a value, and what is wrong with it."""
    if port.kind is Kind.STRING:
        return text, ""
    try:
        number = parsed_number(port, text.strip())
    except ValueError as e:
        return 0, str(e)
    if isinstance(number, float) and not math.isfinite(number):
        return 0, "expected a finite number"
    if port.width is not None and not port.width.holds(number):
        return 0, f"it does not fit {port.width.range_text}"
    low, high = port.minimum, port.maximum
    if in_range and ((low is not None and number < low) or (high is not None and number > high)):
        return 0, f"it is out of range: {range_of(port)}"
    return number, ""


def _resolution(number: str) -> float:
    """Return a unit in the last digit of a number as written: 1e-4 of 0.0333 and of 3.33e-2."""
    mantissa, _, exponent = number.strip().lower().partition("e")
    try:
        return float(f"1e{int(exponent or 0) - len(mantissa.partition('.')[2])}")
    except ValueError:  # the exponent has thousands of digits
        return 0.0


def _finite(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
