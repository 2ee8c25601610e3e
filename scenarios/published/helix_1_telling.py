"""What the claims of `helix-1` are told with."""

from typing import Any

from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.published.claim import Claim
from handover.scenarios.published.helix_1_arm import Helix1Arm
from handover.scenarios.published.verdict_rules import nothing_measured


def published() -> dict[str, Any]:
    """Return the published values by name."""
    return paper_values("helix_handover", "published")


def too_few(told: dict[str, Any], what: str) -> Claim:
    """Return the claim, told but for what came out, as one that so few runs say nothing of."""
    return nothing_measured(**told, reason=f"Too few runs to tell: {what}.")


def missing(arm: Helix1Arm, *alphas: float) -> str:
    """Tell how many runs have no time, as their gripper never began to close; nothing if all have one."""
    number = sum(len(arm.rows[alpha]) - len(arm.times(alpha)) for alpha in alphas)
    return f" Without {number} runs in which the gripper never began to close." if number else ""
