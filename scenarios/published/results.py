"""What a published experiment leaves in its campaign's folder."""

import json
from collections.abc import Sequence
from pathlib import Path

from handover.scenarios.campaign.campaign_folder import CampaignFolder
from handover.scenarios.campaign.campaign_table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.published.claim import Claim
from handover.scenarios.published.published_experiment import PublishedExperiment
from handover.scenarios.results.run_folder import told_if_not_written, write_whole


def write_claims(claims: Sequence[Claim], folder: CampaignFolder) -> None:
    """Write `claims.json`, a list of claims.

    Raises:
        RecordNotWritten: it cannot be written.
    """
    told = [claim.as_data() for claim in claims]
    write_whole(folder.path / "claims.json", json.dumps(told, indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def draw_figures(experiment: PublishedExperiment, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
    """Draw the figures into a folder, of runs whose folders are in `runs`; return them in the order of a page.

    Raises:
        RecordNotWritten: there is no room.
    """
    with told_if_not_written(folder):
        folder.mkdir(exist_ok=True)
        return experiment.draw(table, runs, folder)
