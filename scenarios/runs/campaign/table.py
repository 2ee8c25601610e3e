"""Reads the table of a campaign, a row for each run that has ended, and the row of one run from its folder."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from handover.cosim.exceptions import nearest, one_line
from handover.cosim.record.columns import column_values
from handover.cosim.record.reader import InvalidRecord, read_parquet
from handover.cosim.typed_data import InvalidData, read_typed
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.runs.campaign.plan import PlannedRun, safe_name
from handover.scenarios.runs.results.folder_data import Summary
from handover.scenarios.runs.results.run_folder import InvalidRunFolder
from handover.scenarios.runs.results.summary import metric_of

_LONGEST_NAME = 255
"""Characters of a folder's name."""
_REMEDY = "run the campaign's command again to rewrite it"


class CampaignTable:
    """Reads `runs.parquet`.

    Its columns are `run`, `point`, `repetition`, `seed`, `status` ("done"; "failed": a unit failed or the run crashed;
    "lost": no worker came back with it), `success` (null where the run is not done), `reason`, the parameters that are
    varied or set, `simulated_seconds`, `wall_seconds`, `cpu_seconds` and the metrics. A column's metadata hold its
    `role` (run, parameter or metric), `unit` and `description`.
    """

    def __init__(self, table: pa.Table) -> None:
        self.table = table

    @classmethod
    def read(cls, path: Path) -> "CampaignTable":
        """Read a campaign's table, given by its file or by the campaign's folder.

        Raises:
            InvalidRunFolder: there is none, or it is damaged.
        """
        file = path / "runs.parquet" if path.is_dir() else path
        try:
            table = cls(read_parquet(file))
        except FileNotFoundError as e:
            raise InvalidRunFolder(file.parent, f"it has no {file.name}; {_REMEDY}") from e
        except (OSError, InvalidRecord) as e:
            fault = e.fault if isinstance(e, InvalidRecord) else one_line(e)
            raise InvalidRunFolder(file.parent, f"its {file.name} is damaged: {fault}; {_REMEDY}") from e
        for name in table.column("run") if "run" in table.table.column_names else ():
            is_name = isinstance(name, str) and not name.startswith(".") and safe_name(name) == name
            if not is_name or len(name) > _LONGEST_NAME:  # not in the folder
                raise InvalidRunFolder(file.parent, f"its {file.name} is damaged: {name!r:.60} is not a run's name")
        return table

    def __len__(self) -> int:
        """Return the number of rows."""
        return self.table.num_rows

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows, each a mapping of columns to values; None is null."""
        return self.table.to_pylist()

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that were varied or set."""
        return self._of_role("parameter")

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics' columns."""
        return self._of_role("metric")

    def column(self, name: str) -> NDArray[Any]:
        """Return a column: numbers as floats, NaN where null, or as integers; all else as objects, None where null.

        Raises:
            KeyError: there is none of that name.
        """
        column, kind = self.table.column(self._checked(name)), self._kind(name)
        if pa.types.is_floating(kind):
            return np.asarray(column_values(column), dtype=np.float64)
        if pa.types.is_integer(kind) and column.null_count == 0:
            return np.asarray(column_values(column), dtype=np.int64)
        values = np.empty(len(column), dtype=object)
        values[:] = column.to_pylist()
        return values

    def holds(self, name: str, kind: str) -> bool:
        """Return whether a column holds `texts`, `numbers`, `whole numbers`, all of them given, or `true and false`."""
        is_whole = pa.types.is_integer(self._kind(name)) and self.table.column(name).null_count == 0
        fits = {
            "texts": pa.types.is_string(self._kind(name)),
            "numbers": is_whole or pa.types.is_floating(self._kind(name)),
            "whole numbers": is_whole,
            "true and false": pa.types.is_boolean(self._kind(name)),
        }
        return (
            fits[kind] or (pa.types.is_null(self._kind(name)) and kind in ("texts", "true and false")) or not len(self)
        )

    def unit(self, name: str) -> str:
        """Return the unit of a column, "1" where it has none.

        Raises:
            KeyError: there is no such column.
        """
        return self._metadata(name, "unit") or "1"

    def description(self, name: str) -> str:
        """Return what a column is, in words; "" where nothing is said.

        Raises:
            KeyError: there is no such column.
        """
        return self._metadata(name, "description")

    def _kind(self, name: str) -> pa.DataType:
        return cast(Any, self.table.schema.field(self._checked(name))).type

    def _of_role(self, role: str) -> tuple[str, ...]:
        return tuple(name for name in self.table.column_names if self._metadata(name, "role") == role)

    def _metadata(self, name: str, key: str) -> str:
        metadata: Mapping[bytes, bytes] = self.table.schema.field(self._checked(name)).metadata or {}
        return metadata.get(key.encode(), b"").decode(errors="replace")

    def _checked(self, name: str) -> str:
        if name not in self.table.column_names:
            raise KeyError(f"no column {name!r}: {nearest(name, self.table.column_names)}")
        return name


@dataclass(frozen=True, kw_only=True)
class RunRow:
    """How one run ended.

    Attributes:
        run: the run.
        status: "done", "failed" (a unit failed, or the run crashed) or "lost" (there is no folder of it).
        success: whether its task succeeded; None if it is not done.
        reason: why, in a sentence.
        simulated, wall, cpu: seconds that it took; None where that is not known.
        metrics: by name; NaN stands for no value.
    """

    run: PlannedRun
    status: str
    success: bool | None
    reason: str
    simulated: float | None = None
    wall: float | None = None
    cpu: float | None = None
    metrics: Mapping[str, Metric] = field(default_factory=dict[str, Metric])


def row_of(run: PlannedRun, folder: Path) -> RunRow | None:
    """Return the row of a run by its folder; None if the folder does not say how the run ended.

    A summary has no seed where the scenario draws no random numbers.
    """
    try:
        summary: dict[str, Any] = {**read_typed(folder / "summary.json", Summary)}
        if summary["seed"] not in (run.seed, None) or (summary["failure"] is None and not summary["complete"]):
            return None
        return _row(run, summary)
    except (OSError, InvalidData, KeyError):
        return None


def _row(run: PlannedRun, summary: Mapping[str, Any]) -> RunRow:
    done = summary["failure"] is None
    metrics = cast(Mapping[str, Mapping[str, Any]], summary["metrics"])
    return RunRow(
        run=run,
        status="done" if done else "failed",
        success=bool(summary["success"]) if done else None,
        reason=str(summary["reason"]),
        simulated=float(summary["simulated_seconds"]),
        wall=float(summary["wall_seconds"]),
        cpu=float(summary["cpu_seconds"]),
        metrics={name: metric_of(data) for name, data in metrics.items()},
    )
