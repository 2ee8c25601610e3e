"""What a published experiment leaves in its campaign's folder."""

import json

from scenarios.campaign.campaign_folder import CampaignFolder
from scenarios.campaign.campaign_table import CampaignTable
from scenarios.published.published_experiment import PublishedExperiment
from scenarios.run_folder import told_if_not_written, write_whole


def write_results(experiment: PublishedExperiment, table: CampaignTable, folder: CampaignFolder) -> None:
    """Write `claims.json`, a list of claims, and the figures.

    Raises:
        RecordNotWritten: they cannot be written.
    """
    claims = [claim.as_data() for claim in experiment.claims(table)]
    with told_if_not_written(folder.figures):
        folder.figures.mkdir(exist_ok=True)
        experiment.draw(table, folder.figures)
    write_whole(folder.path / "claims.json", json.dumps(claims, indent=2, allow_nan=False, ensure_ascii=False) + "\n")
