"""Table 1 of [Vervloet2025]: how long the Helix takes to reach a ball by step size, and whether it takes it.

Besides its figs. 7 to 10 and 16 to 21: error, model of the command and estimated state over time.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.helix.parameters import HandPlace, Tuning
from handover.scenarios.published.helix.helix_1_claims import fitted_claims, on_fitted_arm, own_claims, thesis_claims
from handover.scenarios.published.helix.helix_1_curve_claims import error_claims, model_claims
from handover.scenarios.published.helix.helix_1_curves import RunCurves, curves_of
from handover.scenarios.published.helix.helix_1_figures import draw_errors, draw_single_errors, draw_times
from handover.scenarios.published.helix.helix_1_model_figures import draw_estimate, draw_model
from handover.scenarios.published.helix.helix_1_runs import Helix1Runs
from handover.scenarios.published.helix.helix_1_spread import (
    draw_spread,
    fitted_rows,
    spread_claims,
    spread_points,
    spread_table,
    undisturbed,
)
from handover.scenarios.published.helix.helix_1_tables import by_place, fig_9, steps, table_1
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment

_PATIENCE = 600.0
"""Time by which the gripper must begin to close, s: as long as the scenario allows; the longest published is 214.9."""

_QUICK_PLACES = (HandPlace.FRONT, HandPlace.LEFT, HandPlace.BACK_LEFT)
"""Where a quick plan offers the ball: as many places as a bootstrap needs values (`MIN_SAMPLES`)."""


class Helix1(PublishedExperiment):
    """Three step sizes, four places, two runs each, with the thesis's settings; and the same with ours beside it.

    The claims are judged on the runs with the thesis's settings. The control period is what the thesis's loop took at
    each step size. Besides, at the smallest step size, whose times the thesis has widely spread, one thing is wrong at
    a time; and on an arm that is fitted to fig. 9 all step sizes are tried again. The quick plan is a run with the
    thesis's settings at each of three places: three minutes on two cores.
    """

    name: ClassVar[str] = "helix-1"
    title: ClassVar[str] = "the Helix takes a ball at four places with three step sizes ([Vervloet2025] table 1)"
    scenario: ClassVar[str] = "helix_handover"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return alpha x place for the thesis's settings and ours, and what may spread the times; if quick, a part."""
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
            for place in (_QUICK_PLACES if quick else HandPlace)
        ]
        if not quick:
            points += spread_points(dict(zip(setup["alpha"], published["timestep_mean"], strict=True)))
        return CampaignPlan(
            scenario=self.scenario,
            points=points,
            fixed={"patience": str(_PATIENCE), "help_speed": str(setup["help_speed"])},
            repetitions=1 if quick else repetitions,
            seed=1,
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge table 1, its discussion and fig. 9 with the thesis's settings; those beyond are on other arms."""
        thesis, fitted, own = _arms(table)
        return [*thesis_claims(thesis), *fitted_claims(fitted), *own_claims(thesis, own), *spread_claims(table)]

    def record_claims(self, table: CampaignTable, runs: Path) -> Sequence[Claim]:
        """Judge what secs. 4.2, 5.1 and 5.2 say of the curves of figs. 8 to 10, with the thesis's settings."""
        thesis, fitted, _ = _arms(table)
        claims = _curve_claims(thesis, runs)
        return [*claims, *on_fitted_arm(_curve_claims(fitted, runs))] if fitted.tried else claims

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return table 1, its steps, its times by place and the lengths of fig. 9; and what spreads the times."""
        arms = [arm for arm in _arms(table) if arm.tried]
        of_arms = [table_of(arm) for arm in arms for table_of in (table_1, steps, by_place, fig_9)]
        return [*of_arms, *spread_table(table)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the times by step size, and figs. 7 to 10 and 16 to 21: errors, model and estimate over time."""
        arms = [arm for arm in _arms(table) if arm.tried]
        figures = [*draw_times(arms, folder), *draw_errors(arms, runs, folder)]
        for arm in arms:
            if arm.tuning is Tuning.THESIS:
                curves = _curves(arm, runs)
                figures += draw_single_errors(arm, runs, folder)
                figures += draw_model(arm, curves, folder)
                figures += draw_estimate(arm, curves, folder)
        return [*figures, *draw_spread(table, folder)]


def _arms(table: CampaignTable) -> tuple[Helix1Runs, Helix1Runs, Helix1Runs]:
    """Return the runs with the thesis's settings, the same on the arm fitted to fig. 9, and those with ours."""
    plain = undisturbed(table)
    fitted = Helix1Runs.of(fitted_rows(table), Tuning.THESIS, fitted=True)
    return Helix1Runs.of(plain, Tuning.THESIS), fitted, Helix1Runs.of(plain, Tuning.OWN)


def _curves(arm: Helix1Runs, runs: Path) -> dict[float, list[RunCurves]]:
    return {alpha: curves_of(arm.rows[alpha], runs) for alpha in arm.alphas}


def _curve_claims(arm: Helix1Runs, runs: Path) -> list[Claim]:
    curves = _curves(arm, runs)
    return [*error_claims(curves), *model_claims(curves)]
