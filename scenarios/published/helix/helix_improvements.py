"""What [Vervloet2025] sec. 5.4 suggests to improve, one thing at a time, in runs that are paired by place and seed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy import stats

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import LEVEL
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.display_unit import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.published.helix.helix_cases import (
    OFFERED_AT,
    Case,
    rate,
    reasons_of,
    rows_by_case,
    thesis_settings,
)
from handover.scenarios.published.helix.helix_places import random_places
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment, Verdict
from handover.scenarios.published.verdicts import format_p_value, nothing_measured

_RANDOM_PLACES, _SEED = 12, 54
"""Where the ball is offered besides: the thesis's settings miss some, and the paired test needs six pairs."""


@cache
def places() -> list[dict[str, str]]:
    """Return where the ball is offered."""
    return [*OFFERED_AT, *random_places(_RANDOM_PLACES, _SEED)]


_THESIS = {**thesis_settings(0.2), "patience": "300"}
_STEP = ("step size grows with the error", "5.4.4", {"step_rule": "by_error"})
_BOUND = ("estimate's bound by the covariance", "5.4.3", {"bound_rule": "by_covariance"})
_WEIGHTS = ("estimate's weights by the state", "5.4.3", {"weight_rule": "by_state"})
_TOP = ("right camera above", "5.4.1", {"cameras": "top"})
_SIDE = ("right camera at the side", "5.4.1", {"cameras": "side"})
_THREE = ("a third camera above", "5.4.1", {"cameras": "three"})
_FILTERS = ("filters by the measurements' covariances", "5.4.2", {"filters": "own"})


_TICKS = (0.5, 1, 2, 5, 10, 20, 50, 100)  # mm


@dataclass(frozen=True)
class Change:
    """A change of the settings, and the settings that it is compared with, both with a name; where it is suggested."""

    settings: str
    what: str
    section: str
    without: Case
    changed: Case


def _changes(
    settings: str, base: Mapping[str, str], suggested: Sequence[tuple[str, str, dict[str, str]]]
) -> list[Change]:
    without = Case(settings, "", base)
    found: list[Change] = []
    for what, section, parameters in suggested:
        found.append(Change(settings, what, section, without, Case(settings, what, {**base, **parameters})))
    return found


CHANGES = (
    *_changes("the thesis's settings", _THESIS, [_STEP, _FILTERS, _WEIGHTS, _TOP, _SIDE, _THREE]),
    *_changes("the thesis's settings and covariances", {**_THESIS, "filters": "own"}, [_BOUND]),
    *_changes("our settings", {}, [_STEP, _BOUND, _WEIGHTS, _TOP, _SIDE, _THREE]),
)


def _key(case: Case) -> frozenset[tuple[str, str]]:
    return frozenset(case.parameters.items())


_CASES = tuple({_key(c): c for x in CHANGES for c in (x.without, x.changed)}.values())
"""What is run; a case that two changes have is run once."""


class HelixImprovements(PublishedExperiment):
    """Each change beside the same settings without it, at sixteen places with the same seeds, with the fast arm.

    The thesis's settings are at its middle step size, and a person helps: see `HandoverPartner`. The quick plan is a
    change of ours at two places.
    """

    name: ClassVar[str] = "helix-improvements"
    title: ClassVar[str] = "what [Vervloet2025] sec. 5.4 suggests, one thing at a time"
    scenario: ClassVar[str] = "helix_handover"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return every case at every place; if quick, a part of it."""
        quick_cases = [c for c in _CASES if c.parameters in ({}, _SIDE[2])]
        cases, offered = (quick_cases, places()[:2]) if quick else (_CASES, places())
        return CampaignPlan(
            scenario=self.scenario,
            points=[{**place, **case.parameters} for case in cases for place in offered],
            seed=_SEED,
            paired=True,
            scenes=tuple(OFFERED_AT[0]),
            units={"arm": "TendonArmFast"},
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge for each change whether the gripper closes nearer to the ball with it."""
        return [_closes_nearer(change, *runs_of) for change, runs_of in _runs(table).items()]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return success, distance and steps with each change beside those without it."""
        header = ["settings", "change", "sec.", "success", "closes at, mm", "p", "control steps", "failed because"]
        cells = [_row(x, *runs_of) for x, runs_of in _runs(table).items() if runs_of[1]]
        tried = max((len(before) for before, _ in _runs(table).values()), default=0)
        note = (
            f"Without and with the change, at {counted(tried, 'place')} with the same seeds. Distance of gripper and "
            "ball, by ground truth, when the gripper begins to close, and control steps until then: medians over the "
            "places at which both did. p is that of Wilcoxon's signed-rank test of the distances."
        )
        return [ComparisonTable(title="One change at a time", header=header, rows=cells, note=note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the distances of each pair."""
        drawn = [(x, pairs(*runs_of, "closing_distance")) for x, runs_of in _runs(table).items()]
        drawn = [(x, d) for x, d in drawn if len(d)]
        if not drawn:
            return []
        with figure(folder / "improvements", 1, size=(9.0, 1.2 + 0.3 * len(drawn))) as (axes,):
            for y, (_, d) in enumerate(drawn):
                for before, after in 1e3 * d:
                    axes.plot([before, after], [y - 0.15, y + 0.15], "-", lw=0.7, color="0.7", zorder=1)
                axes.plot(1e3 * d[:, 0], np.full(len(d), y - 0.15), "o", ms=4, color=COLOURS[0])
                axes.plot(1e3 * d[:, 1], np.full(len(d), y + 0.15), "o", ms=4, color=COLOURS[1])
            axes.set_yticks(range(len(drawn)), [f"{x.settings}: {x.what}" for x, _ in drawn])
            axes.set(xscale="log", xlabel="distance at closing (mm)", ylim=(len(drawn) - 0.4, -0.6))
            axes.set_xticks(_TICKS, [f"{x:g}" for x in _TICKS])
            axes.minorticks_off()
            axes.plot([], [], "o", ms=4, color=COLOURS[0], label="without")
            axes.plot([], [], "o", ms=4, color=COLOURS[1], label="with the change")
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        caption = (
            "Distance of gripper and ball when the gripper begins to close, by ground truth; lines join a place's."
        )
        return [Figure("improvements", caption)]


def _runs(table: CampaignTable) -> dict[Change, tuple[Sequence[Mapping[str, Any]], Sequence[Mapping[str, Any]]]]:
    """Return the runs without and with each change."""
    found = {_key(case): rows for case, rows in rows_by_case(table, _CASES).items()}
    return {x: (found[_key(x.without)], found[_key(x.changed)]) for x in CHANGES}


def pairs(before: Sequence[Mapping[str, Any]], after: Sequence[Mapping[str, Any]], metric: str) -> Floats:
    """Return a metric's values without and with a change, shape (n, 2), of the places at which both have it."""
    place = tuple(OFFERED_AT[0])
    changed = {tuple(row[name] for name in place): row for row in after}
    found: list[tuple[float, float]] = []
    for row in before:
        other = changed.get(tuple(row[name] for name in place))
        if other is not None and row.get(metric) is not None and other.get(metric) is not None:
            found.append((float(row[metric]), float(other[metric])))
    return np.array(found, dtype=np.float64).reshape(-1, 2)


def _p_value(d: Floats) -> float:
    """Return that of Wilcoxon's signed-rank test, two-sided; 1 where nothing differs or there is nothing."""
    difference = d[:, 1] - d[:, 0]
    return float(stats.wilcoxon(difference).pvalue) if np.any(difference) else 1.0


def _row(change: Change, before: Sequence[Mapping[str, Any]], after: Sequence[Mapping[str, Any]]) -> list[str]:
    d, steps = (pairs(before, after, metric) for metric in ("closing_distance", "steps"))
    return [
        change.settings,
        change.what,
        change.section,
        f"{rate(before)} → {rate(after)}",
        " → ".join(f"{1e3 * x:.1f}" for x in np.median(d, axis=0)) if len(d) else "",
        format_p_value(_p_value(d)) if len(d) else "",
        " → ".join(f"{x:.0f}" for x in np.median(steps, axis=0)) if len(steps) else "",
        reasons_of(after),
    ]


def _closes_nearer(change: Change, before: Sequence[Mapping[str, Any]], after: Sequence[Mapping[str, Any]]) -> Claim:
    facts: dict[str, Any] = {
        "claim": f"With {change.settings}, the gripper closes nearer to the ball: {change.what}",
        "published": "suggested",
        "where": f"sec. {change.section}",
    }
    if not (before and after):
        return nothing_measured(**facts, reason="It was not tried.")
    d = pairs(before, after, "closing_distance")
    if not len(d):
        return nothing_measured(**facts, reason="At no place did the gripper close both without and with it.")
    p, least = _p_value(d), 2.0 ** (1 - len(d))
    successes = [sum(bool(row["success"]) for row in rows) for rows in (before, after)]
    medians = 1e3 * np.median(d, axis=0)
    holds = p < LEVEL and medians[1] < medians[0] and successes[1] >= successes[0]
    verdict = Verdict.REPRODUCED if holds else Verdict.NOT_REPRODUCED
    return Claim(
        **facts,
        measured=f"{medians[0]:.1f} mm without, {medians[1]:.1f} mm with it; "
        f"{successes[0]} of {len(before)} and {successes[1]} of {len(after)} succeed",
        verdict=Verdict.NOT_COMPARABLE if least >= LEVEL else verdict,
        reason="Reproduced if the median distance is less, Wilcoxon's signed-rank test of the pairs, two-sided, "
        f"rejects that nothing changes (p = {format_p_value(p)}, {counted(len(d), 'pair')}; "
        f"{format_p_value(least)} at least), and no fewer handovers succeed.",
    )
