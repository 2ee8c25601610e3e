"""Guidance by a hand, [Vervloet2025] figs. 11, 12 and 22: a person leads the controlled arm to the ball."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy import stats

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import LEVEL
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.display_unit import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.helix.parameters import HandPlace, Tuning
from handover.scenarios.published.helix.helix_1_curves import errors_of
from handover.scenarios.published.helix.helix_1_figures import draw_mean_error
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment, Verdict
from handover.scenarios.published.verdicts import every_claim, format_p_value, nothing_measured

_PATIENCE = 600.0
"""Time by which the gripper must begin to close, s, as in `helix-1`."""

_FIGURES = {0.1: "fig. 12", 0.2: "fig. 22"}
"""Where the thesis compares errors, by step size."""


@dataclass(frozen=True)
class GuidedRuns:
    """Rows of a campaign's table of runs that came to their end at one step size, with guidance and without."""

    alpha: float
    guided: Sequence[Mapping[str, Any]]
    alone: Sequence[Mapping[str, Any]]

    @classmethod
    def of(cls, table: CampaignTable, alpha: float) -> "GuidedRuns":
        """Pick the rows of a step size."""
        done = [row for row in table.rows if row["status"] == "done" and row["alpha"] == alpha]
        return cls(alpha, [r for r in done if r["guidance"] > 0.0], [r for r in done if r["guidance"] == 0.0])


class Helix2(PublishedExperiment):
    """Two guided handovers beside eight unguided ones, at two step sizes, all with the thesis's settings.

    The thesis does not say where the hand was in the guided runs; here it is in front. How a person guides is assumed:
    see `Guidance`. The quick plan is a guided and an unguided run at the smaller step size.
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
        return CampaignPlan(
            scenario=self.scenario,
            points=[
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
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge that guided handovers succeed, and that they are faster at either step size."""
        runs, (k, n) = _runs(table), paper_values("helix", "published")["guided_success"]
        guided = [row for of_alpha in runs for row in of_alpha.guided]
        succeeded = sum(bool(row["success"]) for row in guided)
        return [
            every_claim("Every guided handover succeeds", "sec. 4.3", (k, n), (succeeded, len(guided))),
            *(_faster(of_alpha) for of_alpha in runs),
        ]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return success and times, guided and not."""
        rows = [
            [str(r.alpha), what, *_cells(rows)]
            for r in _runs(table)
            for what, rows in (("guided", r.guided), ("alone", r.alone))
            if rows
        ]
        header = [
            "α",
            "arm",
            "gripper began to close",
            "ball taken",
            "time, median (range), s",
            "control steps, median",
        ]
        note = (
            "Time until the gripper begins to close; the thesis shows its guided runs in figs. 12 and 22, without "
            "figures. All with the thesis's settings."
        )
        return [ComparisonTable(title="Guidance by a hand", header=header, rows=rows, note=note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the error over time as in figs. 12 and 22, and what the person's hand does."""
        drawn = [r for r in _runs(table) if r.guided and r.alone]
        return [*_draw_errors(drawn, runs, folder), *_draw_hands(drawn, runs, folder)] if drawn else []


def _runs(table: CampaignTable) -> list[GuidedRuns]:
    return [GuidedRuns.of(table, alpha) for alpha in paper_values("helix", "published")["guided_alpha"]]


def _times(rows: Sequence[Mapping[str, Any]]) -> Floats:
    """Return times until the gripper began to close, s; infinity where it never did."""
    return np.array([np.inf if row.get("arm_time") is None else row["arm_time"] for row in rows], dtype=np.float64)


def _faster(runs: GuidedRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": f"At step size {runs.alpha} a guided handover is faster",
        "published": "significantly faster (no figures)",
        "where": f"sec. 4.3, {_FIGURES[runs.alpha]}",
    }
    guided, alone = _times(runs.guided), _times(runs.alone)
    if not len(guided) or not len(alone):
        return nothing_measured(**facts, reason=f"Too few runs: {len(guided)} guided, {len(alone)} not.")
    least, p = _p_value(np.zeros(len(guided)), np.ones(len(alone))), _p_value(guided, alone)
    holds = p < LEVEL and float(np.median(guided)) < float(np.median(alone))
    short = f" With so few runs p cannot be less than {format_p_value(least)}." if least >= LEVEL else ""
    verdict = Verdict.REPRODUCED if holds else Verdict.NOT_REPRODUCED
    return Claim(
        **facts,
        measured=f"{_seconds(guided)} against {_seconds(alone)} (medians)",
        verdict=Verdict.NOT_COMPARABLE if least >= LEVEL else verdict,
        reason="Reproduced if the guided runs' median is less and the exact test of Mann and Whitney, two-sided, "
        f"rejects that the times are alike: p = {format_p_value(p)}, {counted(len(guided), 'run')} and {len(alone)}. "
        f"A run that never closes the gripper counts as longer than any.{short}",
    )


def _p_value(first: Floats, second: Floats) -> float:
    test: Any = stats.mannwhitneyu(first, second, method="exact")
    return float(test.pvalue)


def _seconds(times: Floats) -> str:
    median = float(np.median(times))
    return f"{median:.1f} s" if np.isfinite(median) else "never"


def _cells(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    closed = [row for row in rows if row.get("arm_time") is not None]
    times = _times(closed)
    shown = f"{np.median(times):.1f} ({times.min():.1f} to {times.max():.1f})" if closed else ""
    steps = f"{np.median([row['steps'] for row in closed]):.0f}" if closed else ""
    taken = sum(bool(row["success"]) for row in rows)
    return [f"{len(closed)} of {len(rows)}", f"{taken} of {len(rows)}", shown, steps]


def _draw_errors(drawn: Sequence[GuidedRuns], runs: Path, folder: Path) -> list[Figure]:
    if not any(errors_of([*of_alpha.guided, *of_alpha.alone], runs) for of_alpha in drawn):
        return []
    with figure(folder / "errors", len(drawn), size=(8.0, 0.7 + 2.9 * len(drawn))) as axes:
        for axis, of_alpha in zip(axes, drawn, strict=True):
            for colour, label, rows in ((COLOURS[0], "alone", of_alpha.alone), (COLOURS[1], "guided", of_alpha.guided)):
                if errors := errors_of(rows, runs):
                    draw_mean_error(axis, errors, rows[0]["control_period"], (colour, label))
            axis.set(ylabel="error (mm)", ylim=(0, None), xlim=(0, None), title=f"α = {of_alpha.alpha}")
            axis.legend(loc="upper right")
        axes[-1].set_xlabel("time (s)")
    caption = (
        "Distance to the goal that the controller sees, over wrist and gripper, until the gripper begins to close, "
        "with guidance and without, like figs. 12 and 22. Thick: mean of the runs still under way, up to the median "
        "length, with its standard deviation; thin: the runs."
    )
    return [Figure("errors", caption)]


def _draw_hands(drawn: Sequence[GuidedRuns], runs: Path, folder: Path) -> list[Figure]:
    records = [
        (of_alpha.alpha, Record(path))
        for of_alpha in drawn
        for row in of_alpha.guided
        if (path := runs / row["run"] / "signals.parquet").exists()
    ]
    if not records:
        return []
    with figure(folder / "guidance", 3, size=(8.0, 6.6)) as axes:
        for alpha, record in records:
            colour = COLOURS[[of_alpha.alpha for of_alpha in drawn].index(alpha)]
            apart = 1000 * (record["arm.p_WG"] - record["hand.p_WO"])
            curves = (
                np.linalg.norm(apart[:, :2], axis=1),
                apart[:, 2],
                np.linalg.norm(record["hand.f_G"], axis=1),
            )
            for axis, values in zip(axes, curves, strict=True):
                axis.plot(record.time, values, color=colour, lw=1.2)
        axes[0].set_ylabel("beside the ball (mm)")
        axes[1].set_ylabel("above the ball (mm)")
        axes[2].set(ylabel="force (N)", xlabel="time (s)")
        for k, of_alpha in enumerate(drawn):
            axes[0].plot([], [], color=COLOURS[k], label=f"α = {of_alpha.alpha}")
        axes[0].legend(loc="upper right")
    caption = (
        "The guided runs: where the gripper is by the ball, and the force of the person's hand on it, by ground truth. "
        "Once the gripper has the ball, the force is the ball's weight."
    )
    return [Figure("guidance", caption)]
