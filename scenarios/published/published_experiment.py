"""An experiment of a paper: the campaign that it needs, and what its runs say of the paper's claims."""

import abc
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from handover.scenarios.campaign.campaign_table import CampaignTable
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.published.claim import Claim
from handover.scenarios.published.comparison_table import ComparisonTable


class PublishedExperiment(abc.ABC):
    """A table or figure of a paper. Published values come from its scenario's `paper.toml`."""

    name: ClassVar[str]
    title: ClassVar[str]
    """What was tried, in a line, with its place in the paper."""
    scenario: ClassVar[str]

    @abc.abstractmethod
    def plan(self, quick: bool) -> CampaignPlan:
        """Return the runs that it needs, with its usual seed; if `quick`, a fraction of them."""

    @abc.abstractmethod
    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Return the paper's claims with their verdicts, those beyond the paper last."""

    @abc.abstractmethod
    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return published values beside the campaign's."""

    @abc.abstractmethod
    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the figures into a folder, as PNG and SVG; return them in the order of a page.

        Args:
            table: the campaign's.
            runs: where the folders of its runs are.
            folder: where the figures go.
        """
