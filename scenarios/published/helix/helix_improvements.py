"""What [Vervloet2025] sec. 5.4 suggests to improve, one thing at a time, in runs that are paired by place and seed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np
from scipy import stats

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Mark, strips
from handover.scenarios.published.helix.helix_cases import (
    OFFERED_AT,
    Case,
    reasons_of,
    runs_by_case,
    thesis_settings,
)
from handover.scenarios.published.helix.helix_places import random_places
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Runs
from handover.scenarios.published.tables import of, table_of
from handover.scenarios.published.verdicts import format_p_value
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import LEVEL
from handover.scenarios.runs.campaign.table import CampaignTable

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
        points = [{**place, **case.parameters} for case in cases for place in offered]
        return self.campaign(
            points, seed=_SEED, paired=True, scenes=tuple(OFFERED_AT[0]), units={"arm": "TendonArmFast"}
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge for each change whether the gripper closes nearer to the ball with it."""
        return [_closes_nearer(change, *runs_of) for change, runs_of in self._runs(table).items()]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return success, distance and steps with each change beside those without it."""
        cells = [_row(x, *runs_of) for x, runs_of in self._runs(table).items() if len(runs_of[1])]
        tried = max((len(before) for before, _ in self._runs(table).values()), default=0)
        note = (
            f"Without and with the change, at {counted(tried, 'place')} with the same seeds. Distance is that of "
            "gripper and ball, by ground truth, when the gripper begins to close; steps are control steps until then. "
            "Both are medians over the places at which both did. p is that of Wilcoxon's signed-rank test of the "
            "distances."
        )
        return [table_of("One change at a time", cells, note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the distances of each pair."""
        cases: dict[str, Sequence[Mark]] = {}
        for change, runs_of in self._runs(table).items():
            d = 1e3 * pairs(*runs_of, "closing_distance")
            if len(d):
                beside = (-0.15, 0.15)
                joined = [Mark(row, beside, "-", "0.7", style={"lw": 0.7, "zorder": 1}) for row in d]
                ends = [
                    Mark(d[:, k], np.full(len(d), y), "o", COLOURS[k], label)
                    for k, (y, label) in enumerate(zip(beside, ("without", "with the change"), strict=True))
                ]
                cases[f"{change.settings}: {change.what}"] = [*joined, *ends]
        caption = (
            "Distance of gripper and ball when the gripper begins to close, by ground truth; lines join a place's."
        )
        axes = {"xscale": "log", "xlabel": "distance at closing (mm)"}
        return strips(folder / "improvements", caption, cases, axes, x_ticks={x: f"{x:g}" for x in _TICKS})

    def _runs(self, table: CampaignTable) -> dict[Change, tuple[Runs, Runs]]:
        """Return the runs without and with each change."""
        found = {_key(case): runs for case, runs in runs_by_case(self, table, _CASES).items()}
        return {x: (found[_key(x.without)], found[_key(x.changed)]) for x in CHANGES}


def pairs(before: Runs, after: Runs, metric: str) -> Floats:
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


def _row(change: Change, before: Runs, after: Runs) -> dict[str, str]:
    d, steps = (pairs(before, after, metric) for metric in ("closing_distance", "steps"))
    return {
        "settings": change.settings,
        "change": change.what,
        "sec.": change.section,
        "success": f"{of(before.count)} → {of(after.count)}",
        "closes at, mm": " → ".join(f"{1e3 * x:.1f}" for x in np.median(d, axis=0)) if len(d) else "",
        "p": format_p_value(_p_value(d)) if len(d) else "",
        "control steps": " → ".join(f"{x:.0f}" for x in np.median(steps, axis=0)) if len(steps) else "",
        "failed because": reasons_of(after),
    }


def _closes_nearer(change: Change, before: Runs, after: Runs) -> Claim:
    says = Statement(
        f"With {change.settings}, the gripper closes nearer to the ball: {change.what}",
        f"sec. {change.section}",
        "suggested",
    )
    if not (len(before) and len(after)):
        return says.unknown("It was not tried.")
    d = pairs(before, after, "closing_distance")
    if not len(d):
        return says.unknown("At no place did the gripper close both without and with it.")
    p, least, medians = _p_value(d), 2.0 ** (1 - len(d)), 1e3 * np.median(d, axis=0)
    return says.judged(
        f"{medians[0]:.1f} mm without, {medians[1]:.1f} mm with it; {of(before.count)} and {of(after.count)} succeed",
        p < LEVEL and bool(medians[1] < medians[0]) and after.count[0] >= before.count[0],
        "the median distance is less, Wilcoxon's signed-rank test of the pairs, two-sided, rejects that nothing "
        f"changes (p = {format_p_value(p)}, {counted(len(d), 'pair')}; {format_p_value(least)} at least), and no fewer "
        "handovers succeed",
        enough=least < LEVEL,
    )
