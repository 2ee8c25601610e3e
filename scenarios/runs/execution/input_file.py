"""Inputs of one unit over time, from a CSV file: a column `time`, and a column for each input or entry of one.

Lines are separated into cells by commas. Times are in seconds and do not descend; of one that is given twice the last
line counts from there on. Numbers are in the units of the inputs. Continuous reals lie on lines between two times, all
else is held until the next one.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.start_values import range_of
from handover.cosim.blocks.variable import Kind, element_names
from handover.cosim.exceptions import MOST_FAULTS, first_faults, nearest
from handover.cosim.files import read_csv, reading_fault
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.fmu.start_values import entries_of, parsed_number
from handover.cosim.system.time_series import TimeSeries
from handover.scenarios.runs.execution.errors import UsageError

TIME = "time"

Column = tuple[FmuPort, int]
"""An input and which of its entries, counted from 0 in row-major order."""


@dataclass(frozen=True)
class InputTable:
    """What inputs follow over time.

    Attributes:
        series: by input.
        columns: the names of the columns, inputs and entries of some.
    """

    series: Mapping[str, TimeSeries]
    columns: Collection[str] = ()

    def faults(self, ports: Mapping[str, FmuPort], names: Collection[str]) -> list[str]:
        """Return a line for each name of which nothing would come if it had a start value: the table has it all."""
        covered = {*self.columns}
        covered |= {p.name for p in ports.values() if p.name in self.series and covered.issuperset(element_names(p))}
        return [f"{name}: the table of inputs gives it; give one of them" for name in names if name in covered]

    def notes(self, start: float, stop: float) -> list[str]:
        """Return a line if none of several times lies within the run, so that inputs stay at one value."""
        times = next(iter(self.series.values())).times if self.series else ()
        if len(times) < 2 or (times[0] < stop and times[-1] > start):
            return []
        stay = "first" if times[0] >= stop else "last"
        span = f"from {times[0]:g} to {times[-1]:g} s, and the run goes from {start:g} to {stop:g} s"
        return [f"the table of inputs goes {span}: they stay at its {stay} values"]


def columns_of(ports: Mapping[str, FmuPort]) -> dict[str, Column]:
    """Return the names of all scalars among some ports: a port's own, or of an array `p[1]`, `p[2]`, ..."""
    return {name: (p, k) for p in ports.values() for k, name in enumerate(element_names(p))}


def read_inputs(path: Path, inputs: Mapping[str, FmuPort], start: Mapping[str, Any]) -> InputTable:
    """Read what inputs follow over time; entries of an array without a column keep their start values.

    Args:
        path: the file.
        inputs: the unit's inputs, by name.
        start: start values that are not those of the FMU.

    Raises:
        UsageError: the file cannot be read or is not of this form; the message has all faults of one kind.
    """
    try:
        rows = [(i, row) for i, row in read_csv(path) if row]
    except OSError as e:
        raise UsageError(f"{path}: {reading_fault(e)}") from e
    except ValueError as e:
        raise UsageError(f"{path}: not a CSV file in UTF-8: {e}") from e
    if not rows:
        raise UsageError(f"{path}: it is empty; a line of names is wanted, {TIME} and inputs, then lines of numbers")
    (_, header), *lines = rows
    names = [name.strip() for name in header]
    if len(names) == 1 and (found := next((c for c in ";\t" if c in names[0]), None)):
        raise UsageError(f"{path}: its cells are separated by {found!r}; expected commas, and points in numbers")
    columns = _columns(path, names, inputs)
    if not lines:
        raise UsageError(f"{path}: there is no line of numbers after the names")
    _refuse(path, [f"line {i}: {len(row)} cells for {len(names)} names" for i, row in lines if len(row) != len(names)])
    faults: list[str] = []
    k = names.index(TIME)
    times = _numbers([(i, row[k]) for i, row in lines], TIME, float, faults)
    pairs = zip(lines[1:], times, times[1:], strict=False)
    faults += [f"line {i}: time {b:g} s comes after {a:g} s: times must not descend" for (i, _), a, b in pairs if b < a]
    values: dict[str, list[Any]] = {}
    for name, (port, _) in columns.items():
        column = names.index(name)
        cells = [(i, row[column]) for i, row in lines]
        values[name] = _numbers(cells, name, partial(_value, port), faults)
    _refuse(path, faults)
    series = {port.name: _series(port, times, columns, values, start) for port, _ in columns.values()}
    return InputTable(series, columns)


def value_of(port: FmuPort, text: str) -> int | float:
    """Return one entry of a port that is a number, a boolean or an enumeration, from its text.

    Raises:
        ValueError: it is none, or out of range; the message says what is expected.
    """
    return _value(port, text.strip())


def _columns(path: Path, names: Sequence[str], inputs: Mapping[str, FmuPort]) -> dict[str, Column]:
    valid = columns_of({n: p for n, p in inputs.items() if p.kind not in (Kind.STRING, Kind.BINARY)})
    faults = [f"there is no column {TIME!r}, in seconds"] if TIME not in names else []
    for n in dict.fromkeys(names):
        if names.count(n) > 1:
            faults.append(f"there are {names.count(n)} columns {n!r}")
        if n in valid or n == TIME:
            continue
        if n in inputs and inputs[n].kind in (Kind.STRING, Kind.BINARY):
            faults.append(f"the input {n!r} is a {inputs[n].kind.value}, which cannot follow values over time")
        elif n in inputs:
            entries = [name for name, (port, _) in valid.items() if port.name == n]
            faults.append(f"the input {n!r} is an array: expected columns {entries[0]} to {entries[-1]}")
        else:
            near = nearest(n, valid) if len(faults) < MOST_FAULTS else ""
            faults.append(f"no input {n!r}; {near}")
    if not faults and names == [TIME]:
        faults.append(f"there is no column but {TIME!r}; {nearest('', valid)}")
    _refuse(path, faults)
    return {n: valid[n] for n in names if n != TIME}


def _numbers(
    cells: Sequence[tuple[int, str]], column: str, convert: Callable[[str], int | float], faults: list[str]
) -> list[Any]:
    """Return the values of a column; what is wrong is added to the faults, with its line."""
    values: list[Any] = []
    for line, cell in cells:
        try:
            value = convert(cell.strip())
            if not math.isfinite(value):
                raise ValueError("it is not finite")
        except ValueError as e:
            reason = f"; {e}" if convert is not float else ": expected a finite number"
            faults.append(f"line {line}, column {column!r}: {cell[:40]!r}{reason}")
            value = 0
        values.append(value)
    return values


def _value(port: FmuPort, text: str) -> int | float:
    value = parsed_number(port, text)
    low, high = port.minimum, port.maximum
    if (low is not None and value < low) or (high is not None and value > high):
        raise ValueError(f"it is out of range: {range_of(port)}")
    if port.kind is Kind.INTEGER and port.width is not None and not port.width.holds(value):
        raise ValueError(f"it does not fit {port.width.range_text}")
    return value


def _series(
    port: FmuPort,
    times: Sequence[float],
    columns: Mapping[str, Column],
    values: Mapping[str, Sequence[Any]],
    start: Mapping[str, Any],
) -> TimeSeries:
    numbers = np.float64 if port.kind is Kind.REAL else np.uint64 if port.fmi_type == "UInt64" else np.int64
    rows = np.array([entries_of(port, start)] * len(times), dtype=numbers)
    for name, (other, k) in columns.items():
        if other.name == port.name:
            rows[:, k] = values[name]
    return TimeSeries(times, rows, linear=port.is_continuous)


def _refuse(path: Path, faults: Sequence[str]) -> None:
    if faults:
        raise UsageError(f"{path}: {'; '.join(first_faults(faults))}")
