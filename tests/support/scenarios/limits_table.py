"""A made-up table of the experiment `ir-limits`."""

from collections.abc import Callable, Mapping
from typing import Any

import pyarrow as pa

from handover.scenarios.campaign.plan import PlannedRun
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.ir_grasp.ir_limits import IrLimits
from handover.scenarios.published.ir_grasp.limits_axes import PARAMETERS


def limits_table(
    succeeds: Callable[[PlannedRun], bool],
    quick: bool = False,
    pushed: Callable[[PlannedRun], float] = lambda _run: 0.0,
    **metrics: float,
) -> CampaignTable:
    """Return a table of the whole plan, in which runs succeed as given; what a run does not set has no value.

    Args:
        succeeds: whether a run does.
        quick: whether the plan is the quick one.
        pushed: how far its object was pushed before the hand closed, m.
        metrics: others, the same of all runs.
    """

    def row(run: PlannedRun) -> Mapping[str, Any]:
        done = {"run": run.name, "seed": run.seed, "status": "done", "success": succeeds(run)}
        figures = {"displacement": pushed(run), "refinement_time": 2.0, **metrics}
        return {**done, **{name: run.parameters.get(name) for name in PARAMETERS}, **figures}

    return CampaignTable(pa.Table.from_pylist([dict(row(run)) for run in IrLimits().plan(quick).runs()]))
