"""Figures 12 and 13 of Luberto et al.: distances of the fingers over the steps of the grasp's refinement."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import success_interval
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.published.ir_grasp.convergence_curves import Descent, descents_of, draw_convergence
from handover.scenarios.published.ir_grasp.grasp_drawings import draw_cases, draw_poses, draw_sequences
from handover.scenarios.published.ir_grasp.ir_table_claims import distance_claims
from handover.scenarios.published.ir_grasp.ir_table_runs import OBJECTS, POSES, REFLEX, IrTableRuns
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.verdicts import (
    FEW,
    format_median,
    format_rate,
    format_share,
    min_trials_for,
    nothing_measured,
    verdict_of,
)

_REPETITIONS = 16
_THINGS = tuple(thing for things in OBJECTS.values() for thing in things)
_FINGERS = ("thumb", "index", "ring")
_FIGURES = {False: "fig. 12", True: "fig. 13"}


class IrConvergence(PublishedExperiment):
    """The table's five things, nominal and perturbed, 16 times each, grasped by the paper's algorithm.

    Figures 12 and 13 show single runs; here all runs are shown, beside the distances of table II, at which the paper's
    ended. The page has drawings after figures 5, 9 and 11, too.
    """

    name: ClassVar[str] = "ir-convergence"
    title: ClassVar[str] = "distances over the steps of infrared grasps: Luberto et al., figs. 5, 9, 11 to 13, table II"
    scenario: ClassVar[str] = IrGrasp.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return 16 runs of each thing and pose; one if quick."""
        return CampaignPlan(
            scenario=self.scenario,
            points=[
                {"thing": thing.name.lower(), "perturbed": perturbed}
                for perturbed in ("false", "true")
                for thing in _THINGS
            ],
            fixed={**REFLEX.parameters, "correction": "paper"},
            repetitions=1 if quick else _REPETITIONS,
            seed=1312,
            paired=True,
            scenes=("thing",),
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Return the claims of table II on the distances at the last step."""
        return distance_claims(IrTableRuns(table))

    def record_claims(self, table: CampaignTable, runs: Path) -> Sequence[Claim]:
        """Judge that the residual's norm falls."""
        return [judge_descents(descents_of(IrTableRuns(table).rows(REFLEX, p), runs), p) for p in POSES]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return steps and distances at the last step beside the published."""
        return [_last_steps(IrTableRuns(table))]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw distances and norm over steps, poses, two grasps in moments, and the recovering actions."""
        found = IrTableRuns(table)
        rows = [row for p in POSES for row in found.rows(REFLEX, p)]
        others = (draw_poses(rows, runs, folder), draw_sequences(rows, runs, folder), draw_cases(folder))
        return [*draw_convergence(found, runs, folder), *(f for f in others if f is not None)]


def judge_descents(descents: Sequence[Descent], perturbed: bool) -> Claim:
    """Judge that the residual's norm falls, by descents in a pose."""
    sentence = f"In {POSES[perturbed]} poses the algorithm reduces the norm of the residual."
    where = f"{_FIGURES[perturbed]}, sec. V-D"
    ends = [d.ends for d in descents if d.ends is not None]
    if not ends:
        return nothing_measured(sentence, where, "it falls")
    rose, n = sum(last >= first for first, last in ends), len(ends)
    first, last = (1e3 * np.median(v) for v in zip(*ends, strict=True))
    interval, least = success_interval(rose, n), min_trials_for(FEW)
    short = f" With {n} runs nothing could have met this rule: it takes at least {least}." if n < least else ""
    return Claim(
        claim=sentence,
        published="it falls",
        measured=f"from {first:.0f} to {last:.0f} mm (medians); it did not fall in {format_rate(rose, n)}",
        interval=(interval.low, interval.high),
        verdict=verdict_of(interval.high < FEW, could_be_either=n >= least),
        reason="The norm is that of thumb's and ring's distances, before the first Gauss-Newton step and after the "
        "last. Reproduced if the interval (Clopper-Pearson) of how often it does not fall lies below "
        f"{format_share(FEW)}, of the runs that made a step and saw the object with both fingers at their end: "
        f"{len(descents) - n} of {len(descents)} runs did not, and are left out.{short}",
        where=where,
    )


def _last_steps(runs: IrTableRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for perturbed, pose in POSES.items():
        for name, things in OBJECTS.items():
            published = runs.published_distances(name, perturbed)
            found = runs.rows(REFLEX, perturbed, things)
            row = [f"{name.replace('_', ' ')}, {pose}", str(len(found))]
            row.append(format_median(runs.metric("steps", REFLEX, perturbed, things), 0))
            for finger in _FINGERS:
                ours = 1e3 * runs.metric(f"final_distance_{finger}", REFLEX, perturbed, things)
                row.append(f"{np.median(ours):.1f}" if 2 * len(ours) > len(found) else "not seen")
                row.append(f"{1e3 * published[finger]:.0f}")
            ends = [(r["final_distance_thumb"], r["final_distance_ring"]) for r in found]
            norms = np.array([math.hypot(*end) for end in ends if None not in end])
            norms = norms[np.isfinite(norms)]
            row.append(f"{1e3 * np.median(norms):.1f}" if 2 * len(norms) > len(found) else "not seen")
            rows.append([*row, f"{1e3 * math.hypot(published['thumb'], published['ring']):.0f}"])
    names = (*_FINGERS, "norm")
    header = ["object and pose", "runs", "steps", *(f"{n}, {who}" for n in names for who in ("ours", "published"))]
    return ComparisonTable(
        title="As the hand closes (mm)",
        header=header,
        rows=rows,
        note="After the last step, or after the recoveries that may follow it, or at the best pose of all: curves may "
        "end elsewhere. Medians of the runs in which the finger sees the object; not seen: by half of the runs or "
        "more. Both poses of an object are taken together, as table II does. The norm is that of thumb and ring.",
    )
