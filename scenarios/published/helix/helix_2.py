"""Guidance by a hand, [Vervloet2025] figs. 11, 12 and 22: a person leads the controlled arm to the ball."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy import stats

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Mark, Panel, drawn, records_of
from handover.scenarios.published.helix.helix_1_curves import error_marks, errors_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Runs
from handover.scenarios.published.tables import median_and_range, number, of, table_of
from handover.scenarios.published.verdicts import every_claim, format_p_value
from handover.scenarios.robots.helix.parameters import HandPlace, Tuning
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import LEVEL
from handover.scenarios.runs.campaign.table import CampaignTable

_PATIENCE = 600.0
"""Time by which the gripper must begin to close, s, as in `helix-1`."""

_FIGURES = {0.1: "fig. 12", 0.2: "fig. 22"}
"""Where the thesis compares errors, by step size."""


@dataclass(frozen=True)
class GuidedRuns:
    """Runs that came to their end at one step size, with guidance and without."""

    alpha: float
    guided: Runs
    alone: Runs


class Helix2(PublishedExperiment):
    """Two guided handovers beside eight unguided ones, at two step sizes, all with the thesis's settings.

    The thesis does not say where the hand was in the guided runs; here it is in front. How a person guides is assumed:
    see `Guidance`. The quick plan is a guided and an unguided run at step size 0.1.
    """

    name: ClassVar[str] = "helix-2"
    title: ClassVar[str] = "a person's hand guides the Helix to the ball ([Vervloet2025] figs. 11, 12, 22)"
    scenario: ClassVar[str] = "helix_handover"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return alpha x (unguided at each place, guided in front), each twice; if quick, the first alpha in front."""
        setup, published = paper_values("helix", "experiment"), paper_values("helix", "published")
        periods = dict(zip(setup["alpha"], published["timestep_mean"], strict=True))
        alphas: list[float] = published["guided_alpha"][:1] if quick else published["guided_alpha"]
        unguided = (HandPlace.FRONT,) if quick else tuple(HandPlace)
        ways = [(0.0, place) for place in unguided] + [(setup["guidance"], HandPlace.FRONT)]
        return self.campaign(
            [
                {
                    "alpha": str(alpha),
                    "control_period": str(periods[alpha]),
                    "guidance": str(guidance),
                    "place": place.name.lower(),
                }
                for alpha in alphas
                for guidance, place in ways
            ],
            fixed={
                "tuning": Tuning.THESIS.name.lower(),
                "patience": str(_PATIENCE),
                "help_speed": str(setup["help_speed"]),
            },
            repetitions=1 if quick else int(published["guided_runs"]),
            seed=1,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge that guided handovers succeed, and that they are faster at either step size."""
        runs, (k, n) = self._by_alpha(table), paper_values("helix", "published")["guided_success"]
        first, *others = (of_alpha.guided for of_alpha in runs)
        guided = first.together_with(*others)
        return [
            every_claim("Every guided handover succeeds", "sec. 4.3", (k, n), guided.count),
            *(_faster(of_alpha) for of_alpha in runs),
        ]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return success and times, guided and not."""
        rows = [
            {"α": str(r.alpha), "arm": what, **_cells(runs)}
            for r in self._by_alpha(table)
            for what, runs in (("guided", r.guided), ("alone", r.alone))
            if len(runs)
        ]
        note = (
            "Time until the gripper begins to close; the thesis shows its guided runs in figs. 12 and 22, without "
            "figures. All with the thesis's settings."
        )
        return [table_of("Guidance by a hand", rows, note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the error over time as in figs. 12 and 22, and what the person's hand does."""
        both = [r for r in self._by_alpha(table) if len(r.guided) and len(r.alone)]
        return [*_draw_errors(both, runs, folder), *_draw_hands(both, runs, folder)] if both else []

    def _by_alpha(self, table: CampaignTable) -> list[GuidedRuns]:
        runs = self.runs(table)
        found: list[GuidedRuns] = []
        for alpha in paper_values("helix", "published")["guided_alpha"]:
            of_alpha = runs.matching({"alpha": str(alpha)})
            guided, alone = of_alpha.where(lambda row: row["guidance"] > 0.0), of_alpha.matching({"guidance": "0"})
            found.append(GuidedRuns(alpha, guided, alone))
        return found


def _times(runs: Runs) -> Floats:
    """Return times until the gripper began to close, s; infinity where it never did."""
    return np.array([np.inf if row.get("arm_time") is None else row["arm_time"] for row in runs], dtype=np.float64)


def _faster(runs: GuidedRuns) -> Claim:
    says = Statement(
        f"At step size {runs.alpha} a guided handover is faster",
        f"sec. 4.3, {_FIGURES[runs.alpha]}",
        "significantly faster (no figures)",
    )
    guided, alone = _times(runs.guided), _times(runs.alone)
    if not len(guided) or not len(alone):
        return says.unknown(f"Too few runs: {len(guided)} guided, {len(alone)} not.")
    least, p = _p_value(np.zeros(len(guided)), np.ones(len(alone))), _p_value(guided, alone)
    short = f" With so few runs p cannot be less than {format_p_value(least)}." if least >= LEVEL else ""
    return says.judged(
        f"{_seconds(guided)} against {_seconds(alone)} (medians)",
        p < LEVEL and float(np.median(guided)) < float(np.median(alone)),
        "the guided runs' median is less and the exact test of Mann and Whitney, two-sided, rejects that the times are "
        f"alike: p = {format_p_value(p)}, {counted(len(guided), 'run')} and {len(alone)}",
        f"A run that never closes the gripper counts as longer than any.{short}",
        enough=least < LEVEL,
    )


def _p_value(first: Floats, second: Floats) -> float:
    test: Any = stats.mannwhitneyu(first, second, method="exact")
    return float(test.pvalue)


def _seconds(times: Floats) -> str:
    median = float(np.median(times))
    return f"{median:.1f} s" if np.isfinite(median) else "never"


def _cells(runs: Runs) -> dict[str, str]:
    times = runs.metric("arm_time")
    return {
        "gripper began to close": of((len(times), len(runs))),
        "ball taken": of(runs.count),
        "time, median (range), s": median_and_range(times),
        "control steps, median": number(runs.metric("steps"), ".0f"),
    }


def _draw_errors(drawn_runs: Sequence[GuidedRuns], runs: Path, folder: Path) -> list[Figure]:
    panels: list[Panel] = []
    for of_alpha in drawn_runs:
        marks: list[Mark] = []
        for colour, label, found in ((COLOURS[0], "alone", of_alpha.alone), (COLOURS[1], "guided", of_alpha.guided)):
            if errors := errors_of(found, runs):
                marks += error_marks(errors, found.rows[0]["control_period"], colour, label)
        axes = {"title": f"α = {of_alpha.alpha}", "xlabel": "time (s)", "ylabel": "error (mm)"}
        panels += [Panel(marks, {**axes, "xlim": (0, None), "ylim": (0, None)})] if marks else []
    caption = (
        "Distance to the goal that the controller sees, over wrist and gripper, until the gripper begins to close, "
        "with guidance and without, like figs. 12 and 22. Thick: mean of the runs still under way, up to the median "
        "length, with its standard deviation; thin: the runs."
    )
    return drawn(folder / "errors", caption, panels, size=(8.0, 0.9 + 2.9 * len(panels)))


def _draw_hands(drawn_runs: Sequence[GuidedRuns], runs: Path, folder: Path) -> list[Figure]:
    labels = ("beside the ball (mm)", "above the ball (mm)", "force (N)")
    marks: dict[str, list[Mark]] = {label: [] for label in labels}
    for k, of_alpha in enumerate(drawn_runs):
        for record in records_of(of_alpha.guided.names, runs):
            apart = 1000 * (record["arm.p_WG"] - record["hand.p_WO"])
            force = np.linalg.norm(record["hand.f_G"], axis=1)
            curves = (np.linalg.norm(apart[:, :2], axis=1), apart[:, 2], force)
            for label, values in zip(labels, curves, strict=True):
                marks[label].append(Mark(record.time, values, "-", COLOURS[k], f"α = {of_alpha.alpha}"))
    panels = [Panel(of, {"ylabel": label, "xlabel": "time (s)"}) for label, of in marks.items() if of]
    caption = (
        "The guided runs: where the gripper is by the ball, and the force of the person's hand on it, by ground truth. "
        "Once the gripper has the ball, the force is the ball's weight."
    )
    return drawn(folder / "guidance", caption, panels, size=(8.0, 6.6))
