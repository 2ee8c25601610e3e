"""Writes the table of a campaign while its runs end, and rebuilds it from the runs' folders.

A campaign that was killed may have runs whose rows are missing: `rebuild_table` adds them.
"""

import contextlib
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from handover.cosim.blocks.units import ONE
from handover.cosim.blocks.variable import Causality, Kind, Variable
from handover.cosim.exceptions import CosimError
from handover.cosim.record.reader import InvalidRecord, read_parquet
from handover.scenarios.catalog import scenario_of
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.experiment.parameters import InvalidParameter, parse_value
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan import CampaignPlan, is_number
from handover.scenarios.runs.campaign.plan_check import checked_plan
from handover.scenarios.runs.campaign.table import CampaignTable, RunRow, row_of
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.file_experiment import settable_of
from handover.scenarios.runs.execution.request import is_file
from handover.scenarios.runs.results.run_folder import (
    InvalidRunFolder,
    check_place,
    disk_errors_reported,
    replacing,
    versions,
)

_MAX_SHARE = 0.005
"""Share of the time that may go into writing tables while runs end."""

_PAUSE = 1.0
"""Seconds that pass at least from one table to the next."""

_RUN_COLUMNS = (
    ("run", pa.string(), "", "name of the run's folder in runs/"),
    ("point", pa.int64(), "1", "number of the point, from 0"),
    ("repetition", pa.int64(), "1", "number of the point's repetition, from 0"),
    ("seed", pa.int64(), "1", "seed of all random numbers"),
    ("status", pa.string(), "", "done; failed: a unit failed, or the run crashed; lost: no worker came back with it"),
    ("success", pa.bool_(), "", "whether the task succeeded; null where the run is not done"),
    ("reason", pa.string(), "", "how it ended"),
)
_COST_COLUMNS = (
    ("simulated_seconds", "simulated time"),
    ("wall_seconds", "time that the run took"),
    ("cpu_seconds", "time of the processor that the run took"),
)
_TYPES: Mapping[Kind, pa.DataType] = {
    Kind.REAL: pa.float64(),
    Kind.INTEGER: pa.int64(),
    Kind.BOOLEAN: pa.bool_(),
    Kind.ENUMERATION: pa.string(),
    Kind.STRING: pa.string(),
}


class TableWriter:
    """Keeps `runs.parquet`, the table that `CampaignTable` reads: complete at any time, and written seldom.

    Rows are in the order of the plan. A metric with the name of another column gets the suffix `_metric`.
    """

    def __init__(self, plan: CampaignPlan, path: Path) -> None:
        self._plan = plan
        self._path = path
        self._rank = {run.name: number for number, run in enumerate(plan.runs())}
        self._rows: dict[str, RunRow] = {}
        self._next = 0.0

    def add(self, row: RunRow) -> None:
        """Take a row, in place of one of the same run.

        Raises:
            RecordNotWritten: the table cannot be written.
        """
        self._rows[row.run.name] = row
        if time.monotonic() >= self._next:
            self.write()

    def keep(self, rows: Iterable[RunRow]) -> None:
        """Take rows without writing."""
        self._rows.update({row.run.name: row for row in rows})

    @property
    def rows(self) -> list[RunRow]:
        """The rows."""
        return sorted(self._rows.values(), key=lambda row: self._rank[row.run.name])

    def complete(self) -> None:
        """Write the table unless the file is the same already: a report that was made of it then stays up to date.

        Raises:
            RecordNotWritten: it cannot be written.
        """
        with contextlib.suppress(OSError, InvalidRecord):
            if read_parquet(self._path).equals(table_of(self._plan, self.rows), check_metadata=True):
                return
        self.write()

    def write(self) -> None:
        """Write the table, whole or not at all.

        Raises:
            RecordNotWritten: it cannot be written.
        """
        began = time.monotonic()
        with disk_errors_reported(self._path), replacing(self._path) as unfinished:
            pq.write_table(table_of(self._plan, self.rows), unfinished)
        took = time.monotonic() - began
        self._next = began + took + max(_PAUSE, took / _MAX_SHARE)


def table_of(plan: CampaignPlan, rows: Sequence[RunRow]) -> pa.Table:
    """Return rows as a table; the plan is a checked one."""
    columns: list[pa.Field[Any]] = []
    values: list[list[Any]] = []

    def add(name: str, kind: pa.DataType, role: str, unit: str, description: str, column: list[Any]) -> None:
        columns.append(pa.field(name, kind, metadata={"role": role, "unit": unit, "description": description}))
        values.append(column)

    for name, kind, unit, description in _RUN_COLUMNS:
        add(name, kind, "run", unit, description, [_of_run(row, name) for row in rows])
    for variable in _set_parameters(plan):
        kind = _type_of(variable)
        unit = variable.unit.symbol if variable.kind in (Kind.REAL, Kind.INTEGER) else ""
        at = [_plain(variable, _text(plan, point, variable.name)) for point in range(len(plan.points))]
        add(variable.name, kind, "parameter", unit, variable.description, [at[row.run.point] for row in rows])
    for name, description in _COST_COLUMNS:
        add(name, pa.float64(), "run", "s", description, [getattr(row, name.partition("_")[0]) for row in rows])
    taken = {column.name for column in columns}
    for name, metric in _metrics(rows).items():
        column = [_finite(row.metrics[name].value) if name in row.metrics else None for row in rows]
        unique = f"{name}_metric" if name in taken else name
        add(unique, pa.float64(), "metric", metric.unit, metric.description, column)
    arrays: list[Any] = [pa.array(v, type=c.type) for v, c in zip(values, columns, strict=True)]
    return pa.Table.from_arrays(arrays, schema=pa.schema(columns))


def _of_run(row: RunRow, name: str) -> Any:
    run = row.run
    known = {"run": run.name, "point": run.point, "repetition": run.repetition, "seed": run.seed}
    return known[name] if name in known else getattr(row, name)


def _set_parameters(plan: CampaignPlan) -> list[Variable]:
    """Return the parameters that the plan sets at any point, those that are varied first."""
    known = {v.name: v for v in plan.kind.parameters()}
    names = dict.fromkeys([*(name for point in plan.points for name in point), *plan.fixed])
    return [known[name] if name in known else _of_unit(plan, name) for name in names]


def _of_unit(plan: CampaignPlan, name: str) -> Variable:
    """Return a unit's parameter: a real if all of its values are numbers, else a text."""
    if name in plan.varied_units:
        described = "FMU or block in the unit's place"
        return Variable(name=name, kind=Kind.STRING, causality=Causality.PARAMETER, description=described, start="")
    texts = [text for point in range(len(plan.points)) if (text := _text(plan, point, name)) is not None]
    kind, start = (Kind.REAL, math.nan) if all(map(is_number, texts)) else (Kind.STRING, "")
    settable = settable_of(plan.kind)
    port = None if settable is None else settable.port(name)
    described = port.description if port is not None and port.description else "value of the unit's parameter"
    unit = ONE if port is None else port.unit
    return Variable(name=name, kind=kind, causality=Causality.PARAMETER, description=described, unit=unit, start=start)


def _text(plan: CampaignPlan, point: int, name: str) -> str | None:
    return plan.points[point].get(name, plan.fixed.get(name))


def _plain(variable: Variable, text: str | None) -> Any:
    """Return a parameter's value as a column has it; where a point does not set it, the parameter's default."""
    value = variable.start if text is None else parse_value(variable, text)[0]
    if variable.enumeration is not None:
        return str(value.name).lower()
    return np.asarray(value).reshape(-1).tolist() if variable.shape else value


def _type_of(variable: Variable) -> pa.DataType:
    kind = _TYPES[variable.kind]
    return pa.list_(kind) if variable.shape else kind


def _metrics(rows: Sequence[RunRow]) -> dict[str, Metric]:
    """Return the metrics by name, each as the first run with a value of it describes it."""
    metrics: dict[str, Metric] = {}
    for row in rows:
        for name, metric in row.metrics.items():
            if not math.isfinite(metrics.setdefault(name, metric).value):
                metrics[name] = metric
    return metrics


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


_PLAN_KEYS = ("scenario", "points", "fixed", "repetitions", "seed", "paired", "scenes", "experiment")
"""Keys of `campaign.json` on which the table depends."""


def rebuild_table(folder: CampaignFolder) -> None:
    """Give the table of a campaign a row for each run that is done; a damaged table is replaced.

    It stays as it is if a command runs the campaign at this time, if another version wrote it, if the folder cannot be
    written to, or if the plan in `campaign.json` is damaged.

    Raises:
        InvalidRunFolder: there is no `campaign.json`, or it cannot be read.
        RecordNotWritten: the disk is full.
    """
    plan = _plan_of(folder)
    if plan is None:
        return
    with contextlib.ExitStack() as held:
        try:
            check_place(folder.path)
            held.enter_context(folder.held())
        except InvalidRunFolder:  # the command that has locked it writes the table itself
            return
        _complete(folder, plan)


def _plan_of(folder: CampaignFolder) -> CampaignPlan | None:
    """Return the plan that `campaign.json` describes; None if it is another version's or damaged."""
    metadata = folder.read()
    if metadata.get("versions") != versions():
        return None
    try:
        name, source = metadata["scenario"], metadata.get("source", {})
        known: dict[str, Any] = {key: metadata[key] for key in _PLAN_KEYS}
        times: dict[str, Any] = {
            key: Fraction(metadata[key]) for key in ("start", "stop", "step") if metadata.get(key) is not None
        }
        if is_file(name):
            known["scenario"] = str(folder.fmus / name)
        elif source.get("scenario", name) != name or scenario_of(name, source) is None:
            return None
        return checked_plan(CampaignPlan(**known, **times, varied_units=metadata.get("varied_units", ())))
    except (UsageError, CosimError, InvalidParameter, LookupError, TypeError, ValueError, AttributeError):
        return None  # the page reports it


def _complete(folder: CampaignFolder, plan: CampaignPlan) -> None:
    try:
        known = {row.get("run"): row for row in CampaignTable.read(folder.table).rows}
    except InvalidRunFolder:
        known = {}
    writer = TableWriter(plan, folder.table)
    for run in plan.runs():
        old_row = known.get(run.name, {})
        row = row_of(run, folder.runs / run.name)
        if row is None and old_row.get("status") == "lost":
            row = RunRow(run=run, status="lost", success=None, reason=str(old_row.get("reason")))
        writer.keep([] if row is None else [row])
    if {row.run.name: row.status for row in writer.rows} != {name: row.get("status") for name, row in known.items()}:
        writer.write()
