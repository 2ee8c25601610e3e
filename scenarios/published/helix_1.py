"""Table 1 of [Vervloet2025]: how long the Helix takes to reach a ball by step size, and whether it takes it."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.helix.parameters import Place, Tuning
from handover.scenarios.published.helix_1_claims import own_claims, thesis_claims
from handover.scenarios.published.helix_1_figures import draw_errors, draw_times
from handover.scenarios.published.helix_1_runs import Helix1Arm
from handover.scenarios.published.helix_1_tables import by_place, fig_9, steps, table_1
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment

_PATIENCE = 600.0
"""Time by which the gripper must begin to close, s: as long as the scenario allows; the longest published is 214.9."""

_QUICK_PLACES = (Place.FRONT, Place.LEFT, Place.BACK_LEFT)
"""Where a quick plan offers the ball: as many places as a bootstrap needs values (`MIN_SAMPLES`)."""


class Helix1(PublishedExperiment):
    """Three step sizes, four places, two runs each, with the thesis's settings; and the same with ours beside it.

    The claims are judged on the runs with the thesis's settings. The control period is what the thesis's loop took at
    each step size. The quick plan is a run with the thesis's settings at each of three places: three
    minutes on two cores.
    """

    name: ClassVar[str] = "helix-1"
    title: ClassVar[str] = "the Helix takes a ball at four places with three step sizes ([Vervloet2025] table 1)"
    scenario: ClassVar[str] = "helix_handover"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return alpha x place for the thesis's settings and ours, each twice; if quick, a part of it."""
        setup, published = paper_values("helix", "experiment"), paper_values("helix", "published")
        repetitions = int(published["runs"]) // len(setup["places"])
        points = [
            {
                "tuning": tuning.name.lower(),
                "alpha": str(alpha),
                "control_period": str(period),
                "place": place.name.lower(),
            }
            for tuning in ((Tuning.THESIS,) if quick else (Tuning.THESIS, Tuning.OWN))
            for alpha, period in zip(setup["alpha"], published["timestep_mean"], strict=True)
            for place in (_QUICK_PLACES if quick else Place)
        ]
        return CampaignPlan(
            scenario=self.scenario,
            points=points,
            fixed={"patience": str(_PATIENCE)},
            repetitions=1 if quick else repetitions,
            seed=1,
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge table 1, its discussion and fig. 9 with the thesis's settings; those beyond compare ours with them."""
        thesis, own = (Helix1Arm.of(table, tuning) for tuning in (Tuning.THESIS, Tuning.OWN))
        return [*thesis_claims(thesis), *own_claims(thesis, own)]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return table 1, its steps, its times by place and the lengths of fig. 9, for both settings."""
        arms = [Helix1Arm.of(table, tuning) for tuning in (Tuning.THESIS, Tuning.OWN)]
        return [table_of(arm) for arm in arms if arm.tried for table_of in (table_1, steps, by_place, fig_9)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the times by step size, and the error over time as in fig. 8."""
        arms = [arm for arm in (Helix1Arm.of(table, tuning) for tuning in (Tuning.THESIS, Tuning.OWN)) if arm.tried]
        return [*draw_times(arms, folder), *draw_errors(arms, runs, folder)]
