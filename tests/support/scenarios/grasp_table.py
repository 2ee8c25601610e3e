"""A made-up table of the experiment `ir-table`."""

from collections.abc import Callable, Mapping
from typing import Any

import pyarrow as pa

from handover.scenarios.campaign.plan import PlannedRun
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.ir_grasp.ir_table import IrTable

DISTANCES = {"final_distance_thumb": 0.011, "final_distance_index": 0.045, "final_distance_ring": 0.012}


def grasp_table(
    succeeds: Callable[[PlannedRun], bool],
    quick: bool = False,
    status: Callable[[PlannedRun], str] = lambda _run: "done",
    **metrics: Callable[[PlannedRun], float],
) -> CampaignTable:
    """Return a table of the whole plan in which runs succeed, fail to run, and have metrics as given."""

    def row(run: PlannedRun) -> Mapping[str, Any]:
        done = status(run) == "done"
        figures = {"displacement": 0.0, "touched": 0.0, "stop": 1.0, "steps": 4.0, "refinement_time": 5.0, **DISTANCES}
        figures.update({name: of(run) for name, of in metrics.items()})
        return {
            "seed": run.seed,
            "status": status(run),
            "success": succeeds(run) if done else None,
            "thing": run.parameters["thing"],
            "perturbed": run.parameters["perturbed"] == "true",
            "strategy": run.parameters["strategy"],
            "forward": float(run.parameters.get("forward", 0.035)),
            **(figures if done else dict.fromkeys(figures)),
        }

    return CampaignTable(pa.Table.from_pylist([dict(row(run)) for run in IrTable().plan(quick).runs()]))
