"""Outputs of a run that are NaN, infinite or out of their range in its record: which, from when on, and lines on them.

The master checks what feeds a unit, and a value that is not finite there ends the run. What feeds no unit harms none of
them: the run goes on, and they are reported at its end. So are numeric outputs beyond the ranges that their FMUs
declare.
"""

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.start_values import range_of
from handover.cosim.blocks.variable import SUBSCRIPT, Kind, element_names
from handover.cosim.exceptions import counted
from handover.cosim.system.system import System

MAX_LINES = 5
"""Outputs that are reported in a line each; of more there is the number."""


_ROUNDING, _LEAST_SLACK = 1e-6, 1e-12
"""By how much of its limits an output may be beyond one, as numbers of 32 bits are, and by how much at least."""


class NotFiniteData(TypedDict):
    """An output that was not finite: its instance, its name, and the first entry of an array that was not, else "".

    `entries` is how many of its entries were not finite, `time` the first recorded time at which one was not, in s,
    and `value` what it was then: NaN, infinity or -infinity. `feeds` says whether it feeds a unit, which would have
    failed at its next step.
    """

    instance: str
    output: str
    index: str
    entries: int
    value: str
    time: float
    feeds: bool


class OutOfRangeData(TypedDict):
    """An output that left its range, named as of `NotFiniteData`, with its first such value and the time, s.

    Of an array it is the entry that left first.
    """

    instance: str
    output: str
    index: str
    value: float
    time: float
    range: str


def outputs_not_finite(signals: Path, system: System) -> list[NotFiniteData]:
    """Return the outputs of a system that are not finite somewhere in the record of its run, in the record's order.

    The record is read a part at a time, and of it only the real numbers. A run that has none recorded nothing.
    """
    if not signals.exists():
        return []
    fed = {(c.source.unit, c.source.port) for c in system.connections}
    found: dict[tuple[str, str], NotFiniteData] = {}
    for name, row_time, value in _first(signals, None, lambda _name, values: ~np.isfinite(values)):
        index = SUBSCRIPT.search(name)
        unit, port = _ends(name if index is None else name[: index.start()], system)
        begun = found.get((unit, port))
        entries = 1 if begun is None else begun["entries"] + 1
        if begun is None or row_time < begun["time"]:
            begun = NotFiniteData(
                instance=unit, output=port, index=index[0] if index else "", entries=entries, value=_in_words(value),
                time=row_time,
                feeds=bool(fed & {(unit, port), (unit, name.removeprefix(f"{unit}."))}),
            )  # fmt: skip
        found[unit, port] = {**begun, "entries": entries}
    return list(found.values())


def outputs_out_of_range(signals: Path, system: System) -> list[OutOfRangeData]:
    """Return the numeric outputs of a system that leave their declared ranges somewhere in the record of its run."""
    bounded = {
        f"{unit.name}.{entry}": (unit.name, port)
        for unit in system.units.values()
        for port in unit.description.outputs.values()
        if port.kind in (Kind.REAL, Kind.INTEGER) and (port.minimum, port.maximum) != (None, None)
        for entry in element_names(port)
    }

    def leaves(name: str, values: NDArray[Any]) -> NDArray[Any]:
        _, port = bounded[name]
        low = -math.inf if port.minimum is None else port.minimum
        high = math.inf if port.maximum is None else port.maximum
        slack = max([_LEAST_SLACK, *(_ROUNDING * abs(x) for x in (low, high) if math.isfinite(x))])
        return np.isfinite(values) & ((values < low - slack) | (values > high + slack))

    found: dict[tuple[str, str], OutOfRangeData] = {}
    for name, time, value in _first(signals, bounded, leaves) if bounded and signals.exists() else ():
        unit, port = bounded[name]
        index = name.removeprefix(f"{unit}.{port.name}")
        first = OutOfRangeData(
            instance=unit, output=port.name, index=index, value=value, time=time, range=range_of(port)
        )  # fmt: skip
        if (unit, port.name) not in found or time < found[unit, port.name]["time"]:
            found[unit, port.name] = first
    return list(found.values())


def _ends(name: str, system: System) -> tuple[str, str]:
    """Return the unit and the port of a signal; names of units may have dots in them, as those of nested systems."""
    units = [unit for unit in system.units if name.startswith(f"{unit}.")]
    unit = max(units, key=len)
    return unit, name.removeprefix(f"{unit}.")


def _first(
    signals: Path, names: Collection[str] | None, is_wrong: Callable[[str, NDArray[Any]], NDArray[Any]]
) -> Iterator[tuple[str, float, float]]:
    """Yield each column that is wrong somewhere, with the time of the first such value, and the value.

    `names` are those that are looked at, None for all of real numbers.
    """
    import pyarrow as pa  # slow to import
    import pyarrow.parquet as pq

    from handover.cosim.record.columns import column_values

    file = pq.ParquetFile(signals)
    schema = file.schema_arrow
    real = [
        name
        for name, kind in zip(schema.names, schema.types, strict=True)
        if name == "time" or (kind == pa.float64() if names is None else name in names)
    ]
    first: dict[str, tuple[float, float]] = {}
    for batch in file.iter_batches(columns=real, use_threads=False):
        time = column_values(batch.column("time"))
        for name in real:
            if name == "time" or name in first:
                continue
            values = column_values(batch.column(name))
            wrong = is_wrong(name, values)
            if wrong.any():
                row = int(np.argmax(wrong))
                first[name] = float(time[row]), float(values[row])
    yield from ((name, *first[name]) for name in real if name in first)


def _in_words(value: float) -> str:
    if np.isnan(value):
        return "NaN"
    return "infinity" if value > 0 else "-infinity"


def not_finite_lines(outputs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line for each output that was not finite; of many, for the first few, and how many more there are."""
    lines = [_line(output) for output in outputs[:MAX_LINES]]
    more = len(outputs) - MAX_LINES
    if more > 0:
        which = counted(more, "more output is", "more outputs are")
        lines.append(f'{which} not finite: summary.json has them all, by "not_finite"')
    return lines


def out_of_range_lines(outputs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line for each output that left its range; of many, for the first few, and how many more there are."""
    lines = [
        f"unit {o['instance']}: {o['output']}{o['index']} = {o['value']:g} at t = {o['time']:.6g} s, beyond its range, "
        f"{o['range']}"
        for o in outputs[:MAX_LINES]
    ]
    if (more := len(outputs) - MAX_LINES) > 0:
        which = counted(more, "more output goes", "more outputs go")
        lines.append(f'{which} beyond the declared range: summary.json has them all, by "out_of_range"')
    return lines


def _line(output: Mapping[str, Any]) -> str:
    name = f"{output['output']}{output['index']}"
    others = output["entries"] - 1
    and_others = "" if not others else f" ({others} more of its entries too)" if others > 1 else " (another entry too)"
    read = "which feeds a unit, though no step followed" if output["feeds"] else "which no unit reads"
    return f"unit {output['instance']}: {name} = {output['value']} at t = {output['time']:.6g} s{and_others}, {read}"
