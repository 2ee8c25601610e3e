"""What a campaign's runs say of the paper that it is of."""

from collections.abc import Sequence
from dataclasses import dataclass

from handover.scenarios.campaign.campaign_table import CampaignTable
from handover.scenarios.published.claim import Claim
from handover.scenarios.published.comparison_table import ComparisonTable
from handover.scenarios.published.published_experiment import PublishedExperiment


@dataclass(frozen=True, kw_only=True)
class PaperResults:
    """The claims with their verdicts, and published values beside the campaign's."""

    claims: Sequence[Claim]
    tables: Sequence[ComparisonTable]

    @classmethod
    def of(cls, experiment: PublishedExperiment, table: CampaignTable) -> "PaperResults":
        """Judge the claims and fill in the tables.

        Raises:
            KeyError: the table is of another version of the experiment, and lacks a column.
        """
        return cls(claims=experiment.claims(table), tables=experiment.tables(table))
