"""Where a campaign's folder is if the call does not say."""

import time
from collections.abc import Mapping
from pathlib import Path

from handover.scenarios.campaign.campaign_folder import CampaignFolder
from handover.scenarios.campaign.campaign_identity import identity_of
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.results.run_folder import BadRunFolder

PLACE = Path("campaigns")


def place_of(plan: CampaignPlan, fmus: Mapping[str, Path]) -> CampaignFolder:
    """Return the newest folder of this very campaign in `campaigns/` that lacks runs, else a new one.

    So a call that was interrupted goes on where it stopped, and one that came to its end begins anew. The plan is a
    checked one.
    """
    wanted = identity_of(plan, fmus)
    for path in sorted(PLACE.glob(f"*_{_stem(plan)}*/"), reverse=True):
        folder = CampaignFolder(path)
        try:
            there = folder.read()
        except BadRunFolder:
            continue
        if all(there.get(key) == value for key, value in wanted.items()):
            return _new(plan) if folder.has_all(plan) else folder
    return _new(plan)


def _stem(plan: CampaignPlan) -> str:
    return plan.experiment or plan.scenario


def _new(plan: CampaignPlan) -> CampaignFolder:
    name = time.strftime(f"%Y-%m-%d_%H%M%S_{_stem(plan)}")
    path, number = PLACE / name, 1
    while path.exists():
        number += 1
        path = PLACE / f"{name}_{number}"
    return CampaignFolder(path)
