"""Experiment 1 of [Gandarias2020], sec. V-A and fig. 5: arms of soft and of rigid links go by rigid kinematics."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.vsl.vsl_1.claims import claims_of
from handover.scenarios.published.vsl.vsl_1.figures import draw_figures
from handover.scenarios.published.vsl.vsl_1.runs import (
    ALL_LINKS,
    LOADS,
    PATHS,
    REPETITIONS,
    RIGID,
    SOFT,
    Cell,
    Vsl1Runs,
)
from handover.scenarios.published.vsl.vsl_1.tables import tables_of
from handover.scenarios.vsl.path_experiments import VslModelBased

_SEED = 2020
"""Of the campaign; no parameter of the arm was chosen by its runs."""


class Vsl1(PublishedExperiment):
    """Three paths with five loads on links that are rigid or have 0.5 to 2 bar, five times each, by rigid kinematics.

    What differs from repetition to repetition is noise: of the tracker, by which errors are measured, and of the
    encoders, which decide nothing here. The quick plan goes once along each path, with the least and the greatest load
    and pressure and on rigid links.
    """

    name: ClassVar[str] = "vsl-1"
    title: ClassVar[str] = "an arm of soft links follows paths by rigid kinematics ([Gandarias2020] fig. 5)"
    scenario: ClassVar[str] = VslModelBased.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return paths x loads x links, five times each; if quick, the extremes once."""
        loads = (LOADS[0], LOADS[-1]) if quick else LOADS
        kinds = (RIGID, SOFT[0], SOFT[-1]) if quick else ALL_LINKS
        cells = [Cell(path, load, links) for path in PATHS for load in loads for links in kinds]
        return CampaignPlan(
            scenario=self.scenario,
            points=[cell.parameters for cell in cells],
            repetitions=1 if quick else REPETITIONS,
            seed=_SEED,
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge what sec. V-C says of load, pressure, rigid links, reach and servos, in every cell."""
        return claims_of(Vsl1Runs(table))

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return mean errors cell by cell, path by path, and errors near the base and far from it."""
        return tables_of(Vsl1Runs(table))

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the paths like fig. 5, the errors along them, and errors by load."""
        return draw_figures(Vsl1Runs(table), runs, folder)
