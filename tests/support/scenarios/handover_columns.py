"""What a campaign's table of handovers has of their parameters."""

from typing import Any

from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.robots.helix.helix_handover import HelixHandover
from handover.scenarios.runs.campaign.plan import CampaignPlan


def columns(plan: CampaignPlan) -> list[dict[str, Any]]:
    """Return the values of all parameters that the plan sets anywhere, by its points."""
    kinds = {v.name: v for v in HelixHandover.parameters()}
    names = {name for point in plan.points for name in point}
    rows: list[dict[str, Any]] = []
    for point in plan.points:
        p = parse_parameters(HelixHandover, [f"{name}={value}" for name, value in point.items()])
        values = {name: getattr(p, name) for name in names}
        rows.append({n: v.name.lower() if kinds[n].enumeration is not None else v for n, v in values.items()})
    return rows
