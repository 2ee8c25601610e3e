"""The study with simulated participants: the plan, and how it is judged, on tables that a test makes up."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.scenarios.campaign.plan_check import checked_plan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.free_flyer.parameters import Behaviour, Task
from handover.scenarios.published.free_flyer.flyer_study import FlyerStudy
from handover.scenarios.published.free_flyer.study_runs import (
    TRAITS,
    StudyRuns,
    paired,
    participants,
)
from handover.scenarios.published.published_experiment import Claim, Verdict

NAMES = [trait.name for trait in TRAITS]


def by_skill(given: Mapping[str, str], k: int) -> bool:
    """Return whether a trial fails: the more often, the less skill; of the compliant robot twice as often."""
    times = 2 if given["behaviour"] == "compliant" else 1
    return (7 * k + 3) % 20 < 10 * times * (1.0 - float(given["skill"]))


def always(given: Mapping[str, str], k: int) -> bool:  # noqa: ARG001
    """Return that every trial fails."""
    return True


def one_in_twenty(_given: Mapping[str, str], k: int) -> bool:
    """Return whether it is one of the repetitions, whatever the skill."""
    return k == 7


def never(_given: Mapping[str, str], _k: int) -> bool:
    """Return that no trial fails."""
    return False


@cache
def table_of(fails: Callable[[Mapping[str, str], int], bool] = by_skill, quick: bool = False) -> CampaignTable:
    """Return the plan's runs, of which some fail."""
    rows: list[dict[str, Any]] = []
    for run in FlyerStudy().plan(quick).runs():
        given = run.parameters
        failed = fails(given, run.repetition)
        row: dict[str, Any] = {"status": "done", "run": run.name, "seed": run.seed, "success": not failed}
        row |= {"task": given["task"], "behaviour": given["behaviour"]}
        row |= {name: float(given[name]) if name in given else None for name in NAMES}
        rows.append(row | {"decided_by": int(Cause.BUMPED if failed else Cause.NONE), "reason": ""})
    return CampaignTable(pa.Table.from_pylist(rows))


@cache
def verdicts(table: CampaignTable) -> dict[str, Claim]:
    return {claim.claim: claim for claim in FlyerStudy().claims(table)}


def test_the_plans_are_sound_and_have_the_thesis_tasks_for_ten_participants():
    plan = checked_plan(FlyerStudy().plan(quick=False))
    assert checked_plan(FlyerStudy().plan(quick=True)).size < 100
    assert plan.size == 3 * 2 * (10 + 5) * 20
    assert len({tuple(person.values()) for person in participants()}) == 10


def test_both_behaviours_share_the_seeds_of_a_participants_trials_and_nobody_else_does():
    seeds: dict[tuple[str, ...], list[int]] = {}
    for run in FlyerStudy().plan(quick=False).runs():
        who = tuple(run.parameters.get(name, "") for name in ("task", *NAMES))
        seeds.setdefault((run.parameters["behaviour"], *who), []).append(run.seed)
    rigid = {who[1:]: found for who, found in seeds.items() if who[0] == "rigid"}
    assert all(seeds[("compliant", *who)] == found for who, found in rigid.items())
    assert len({seed for found in rigid.values() for seed in found}) == 3 * 15 * 20


def test_a_participants_trials_are_told_from_those_of_a_skill():
    runs = StudyRuns(table_of())
    assert len(runs.of_participants(Task.ROBOT_TO_HUMAN, Behaviour.RIGID)) == 200
    assert len(runs.of_participants(Task.ROBOT_TO_HUMAN, Behaviour.RIGID, 3)) == 20
    assert len(runs.of_skill(0.5, Task.COLLABORATIVE, Behaviour.COMPLIANT)) == 20


def test_failures_that_grow_with_less_skill_are_noticed():
    claims = verdicts(table_of())
    grow = [c for name, c in claims.items() if name.startswith("Failures grow")]
    assert [c.verdict for c in grow] == [Verdict.REPRODUCED] * 3
    assert claims["The rigid robot succeeds more often (H2): collaborative"].verdict is Verdict.REPRODUCED


def test_failures_that_do_not_are_noticed_too():
    claims = verdicts(table_of(one_in_twenty))
    grow = [c for name, c in claims.items() if name.startswith("Failures grow")]
    assert [c.verdict for c in grow] == [Verdict.NOT_REPRODUCED] * 3
    assert claims["The rigid robot succeeds more often (H2): collaborative"].verdict is Verdict.NOT_REPRODUCED
    nominal = next(c for name, c in claims.items() if name.startswith("Persons of nominal skill"))
    assert nominal.verdict is Verdict.REPRODUCED


def test_rates_far_from_the_published_are_not_reproduced():
    claims = verdicts(table_of(always))
    rates = [c for name, c in claims.items() if name.startswith("Handovers that succeed")]
    assert [c.verdict for c in rates] == [Verdict.NOT_REPRODUCED] * 6


def test_of_the_quick_plans_runs_and_of_none_nothing_is_concluded():
    assert {c.verdict for c in verdicts(table_of(quick=True)).values()} == {Verdict.NOT_COMPARABLE}
    nothing = CampaignTable(pa.Table.from_pylist([{"status": "failed"}]))
    assert {c.verdict for c in verdicts(nothing).values()} == {Verdict.NOT_COMPARABLE}


@pytest.mark.parametrize("quick", [False, True])
def test_tables_and_figures_are_made_of_what_there_is(quick: bool, tmp_path: Path, sketches: Sketches):
    table = table_of(quick=quick)
    tables = FlyerStudy().tables(table)
    assert tables[-1].title == "Failures by skill"
    FlyerStudy().draw(table, tmp_path, tmp_path)
    sketches.check(*(["skill"] if quick else ["skill", "causes"]))
    by_title = {t.title: t for t in tables}
    assert ("The participants" in by_title) is not quick
    of_participants = by_title.get("Participants and tasks, beside table 5.1")
    assert (of_participants is None) is quick
    if of_participants is not None:
        assert "no person took part" in tables[0].note
        *persons, every, published = of_participants.rows
        assert len(persons) == 10
        assert all("of 20," in cell for row in persons for cell in row[1:])
        assert all("of 200," in cell for cell in every[1:])
        assert published[1:3] == ["3 of 20, 15 % (3 to 38 %)"] * 2


def test_pairs_go_by_seed_and_not_by_place():
    """The first trial of the rigid robot is missing: all others keep their like."""
    rows = table_of().rows
    gone = next(k for k, row in enumerate(rows) if row["behaviour"] == "rigid" and row["task"] == "collaborative")
    rest = CampaignTable(pa.Table.from_pylist([row for k, row in enumerate(rows) if k != gone]))
    text = "The rigid robot succeeds more often (H2): collaborative"
    whole, claim = verdicts(table_of())[text], verdicts(rest)[text]
    assert claim.verdict is whole.verdict is Verdict.REPRODUCED
    assert "/199 " in claim.measured
    assert "left out: 1." in claim.reason
    runs = StudyRuns(rest)
    rigid, compliant = (runs.of_participants(Task.COLLABORATIVE, b) for b in Behaviour)
    assert [a for a, _ in paired(rigid, compliant)] == [bool(row["success"]) for row in rigid]


def test_one_participant_alone_does_not_show_that_the_rigid_robot_is_better():
    """All that differs is one person's twenty trials: twenty independent ones would reject."""
    worst = participants()[3]

    def of_one(given: Mapping[str, str], k: int) -> bool:  # noqa: ARG001
        return given["behaviour"] == "compliant" and all(given.get(n) == x for n, x in worst.items())

    claim = verdicts(table_of(of_one))["The rigid robot succeeds more often (H2): collaborative"]
    assert claim.verdict is Verdict.NOT_REPRODUCED
    assert "p = 1;" in claim.reason


def test_trials_that_did_not_come_to_their_end_are_failures():
    rows = table_of(never).rows
    for row in rows[:20]:
        row |= {"status": "failed", "success": None, "decided_by": None}
    claims = verdicts(CampaignTable(pa.Table.from_pylist(rows)))
    claim = claims["Handovers that succeed: robot to human, rigid"]
    assert claim.measured == "180/200 (90 %)"
    assert "20 of 200 runs did not come to their end" in claim.reason
