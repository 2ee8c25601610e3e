"""Tables I and II of Luberto et al.: grasps by infrared reflex, blind, and by going forward without sensing."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from handover.plants.ir_grasp.objects import SOLIDS
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.published.ir_grasp.ir_table_claims import (
    closing_claims,
    distance_claims,
    further_claims,
    order_claims,
    rate_claims,
)
from handover.scenarios.published.ir_grasp.ir_table_figures import draw_table
from handover.scenarios.published.ir_grasp.ir_table_runs import ARMS, IrTableRuns
from handover.scenarios.published.ir_grasp.ir_table_tables import tables_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment

_REPETITIONS, _QUICK = 16, 3
"""Runs of a cell: with 80 of a pose and an arm an interval is at most 23 points wide; the paper has three."""

_SEED = 2016
"""Of the campaign; the runs' seeds follow from it, apart from 1000 to 1007, with which the scenario was tuned."""


class IrTable(PublishedExperiment):
    """Five things in nominal and perturbed poses, grasped in four ways in the same scenes.

    Besides the paper's two ways, IR-guided (`reflex`) and blind, a control arm goes forward from the pre-grasp pose
    without sensing, and closes: by 35 mm, about as far as the reflex goes in nominal poses, and by 55 mm, with which
    it did as well as the reflex in the scenes that the scenario was tuned in. Grasps in which it succeeds
    need no sensing.

    The ways share their scenes, so that they are compared run by run; things and repetitions do not, so that they are
    counted together.
    """

    name: ClassVar[str] = "ir-table"
    title: ClassVar[str] = "grasps by infrared reflex and blind: Luberto et al., tables I and II"
    scenario: ClassVar[str] = IrGrasp.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return 16 runs of a cell, three as in the paper if `quick`."""
        points = [
            {"thing": thing.name.lower(), "perturbed": perturbed, **arm.parameters}
            for perturbed in ("false", "true")
            for thing in SOLIDS
            for arm in ARMS
        ]
        return CampaignPlan(
            scenario=self.scenario,
            points=points,
            repetitions=_QUICK if quick else _REPETITIONS,
            seed=_SEED,
            paired=True,
            scenes=("thing",),
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Return the claims of tables I and II and of sec. V-D, and those of the control arm beyond the paper."""
        runs = IrTableRuns(table)
        groups = (rate_claims, order_claims, closing_claims, distance_claims, further_claims)
        return [claim for claims in groups for claim in claims(runs)]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return successes, exact tests, how refinements ended, and distances."""
        return tables_of(IrTableRuns(table))

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002 (its figures need the table alone)
        """Draw rates of success and distances."""
        return draw_table(IrTableRuns(table), folder)
