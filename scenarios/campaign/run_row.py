"""A row of a campaign's table: how one run went."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from handover.scenarios.campaign.plan import PlannedRun
from handover.scenarios.experiment.experiment import Metric


@dataclass(frozen=True, kw_only=True)
class RunRow:
    """How one run ended.

    Attributes:
        run: the run.
        status: "done", "failed" (a unit failed, or the run crashed) or "lost" (there is no folder of it).
        success: whether its task succeeded; None if it is not done.
        reason: why, in a sentence.
        simulated, wall, cpu: seconds that it took; None where that is not known.
        metrics: its figures; a value of NaN is none.
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
    """Return the row of a run that has left a folder; None if the folder does not say how the run ended."""
    try:
        summary: Any = json.loads((folder / "summary.json").read_bytes())
        if summary["seed"] != run.seed or (summary["failure"] is None and not summary["complete"]):
            return None
        return _row(run, summary)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
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
        metrics={
            name: Metric(
                value=float("nan") if m["value"] is None else float(m["value"]),
                unit=str(m["unit"]),
                description=str(m["description"]),
            )
            for name, m in metrics.items()
        },
    )
