"""The study with simulated participants: the plan, and how it is judged, on tables that a test makes up."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from support.scenarios.made_tables import made_table
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.scenarios.published.free_flyer.flyer_study import (
    TRAITS,
    FlyerStudy,
    StudyRuns,
    paired,
    participants,
)
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Task
from handover.scenarios.runs.campaign.table import CampaignTable

NAMES = [trait.name for trait in TRAITS]
H2 = "The rigid robot succeeds more often (H2): collaborative"
BESIDE = "Participants and tasks, beside table 5.1"


def by_skill(given: Mapping[str, str], k: int) -> bool:
    """Return whether a trial fails: the more often, the less skill; of the compliant robot twice as often."""
    times = 2 if given["behaviour"] == "compliant" else 1
    return (7 * k + 3) % 20 < 10 * times * (1.0 - float(given["skill"]))


def always(_given: Mapping[str, str], _k: int) -> bool:
    """Return that every trial fails."""
    return True


def one_in_twenty(_given: Mapping[str, str], k: int) -> bool:
    """Return whether it is one of the repetitions, whatever the skill."""
    return k == 7


@cache
def table_of(fails: Callable[[Mapping[str, str], int], bool] = by_skill, quick: bool = False) -> CampaignTable:
    """Return the plan's runs, of which some fail."""
    rows: list[dict[str, Any]] = []
    for run in FlyerStudy().plan(quick).runs():
        given = run.parameters
        failed = fails(given, run.repetition)
        row: dict[str, Any] = {"status": "done", "run": run.name, "seed": run.seed, "success": not failed}
        row |= {"task": given["task"], "behaviour": given["behaviour"], "reason": ""}
        row |= {name: float(given[name]) if name in given else None for name in NAMES}
        rows.append(row | {"decided_by": int(Cause.BUMPED if failed else Cause.NONE)})
    return made_table(rows)


@cache
def verdicts(table: CampaignTable) -> dict[str, Claim]:
    return {claim.claim: claim for claim in FlyerStudy().claims(table)}


def test_both_behaviours_share_the_seeds_of_a_participants_trials_and_nobody_else_does():
    seeds: dict[str, dict[tuple[str, ...], list[int]]] = {"rigid": {}, "compliant": {}}
    for run in FlyerStudy().plan(quick=False).runs():
        who = tuple(run.parameters.get(name, "") for name in ("task", *NAMES))
        seeds[run.parameters["behaviour"]].setdefault(who, []).append(run.seed)
    assert seeds["rigid"] == seeds["compliant"]
    assert len({seed for found in seeds["rigid"].values() for seed in found}) == 3 * 15 * 20
    assert len({tuple(person.values()) for person in participants()}) == 10


def test_a_participants_trials_are_distinguished_from_those_of_a_skill():
    runs = StudyRuns(table_of())
    assert len(runs.of_participants(Task.ROBOT_TO_HUMAN, Behaviour.RIGID)) == 200
    assert len(runs.by_participant(Task.ROBOT_TO_HUMAN, Behaviour.RIGID)[3]) == 20
    assert len(runs.of_skill(0.5, Task.COLLABORATIVE, Behaviour.COMPLIANT)) == 20


@pytest.mark.parametrize(
    ("fails", "begin", "verdict"),
    [
        (by_skill, "Failures grow", Verdict.REPRODUCED),
        (by_skill, H2, Verdict.REPRODUCED),
        (one_in_twenty, "Failures grow", Verdict.NOT_REPRODUCED),
        (one_in_twenty, H2, Verdict.NOT_REPRODUCED),
        (one_in_twenty, "Persons of nominal skill", Verdict.REPRODUCED),
        (always, "Handovers that succeed", Verdict.NOT_REPRODUCED),
    ],
)
def test_whether_failures_grow_with_less_skill_and_the_rigid_robot_does_better_is_noticed(
    fails: Callable[[Mapping[str, str], int], bool], begin: str, verdict: Verdict
):
    found = [c.verdict for name, c in verdicts(table_of(fails)).items() if name.startswith(begin)]
    assert set(found) == {verdict}
    assert len(found) == {"Failures grow": 3, "Handovers that succeed": 6}.get(begin, 1)


def test_of_the_quick_plans_runs_and_of_none_nothing_is_concluded():
    nobody = {"status": "failed", "task": "collaborative", "behaviour": "rigid", "skill": 0.9}
    for table in (table_of(quick=True), made_table([nobody])):
        assert {c.verdict for c in verdicts(table).values()} == {Verdict.NOT_COMPARABLE}


@pytest.mark.parametrize("quick", [pytest.param(False, marks=pytest.mark.slow), True])
def test_figures_are_drawn_of_what_there_is(quick: bool, tmp_path: Path, sketches: Sketches):
    FlyerStudy().draw(table_of(quick=quick), tmp_path, tmp_path)
    sketches.check(*(["skill"] if quick else ["skill", "causes"]))


def test_tables_have_a_row_for_each_participant_beside_the_published():
    quick, tables = ({t.title: t for t in FlyerStudy().tables(table_of(quick=q))} for q in (True, False))
    assert {"The participants", BESIDE} <= tables.keys() - quick.keys()
    assert list(tables)[-1] == list(quick)[-1] == "Failures by skill"
    assert "no person took part" in next(iter(tables.values())).note
    *persons, every, published = tables[BESIDE].rows
    assert len(persons) == 10
    assert all("of 20," in cell for row in persons for cell in row[1:])
    assert all("of 200," in cell for cell in every[1:])
    assert published[1:3] == ["3 of 20, 15 % (3 to 38 %)"] * 2


def test_pairs_go_by_seed_and_not_by_place():
    """The first trial of the rigid robot is missing: all others keep their like."""
    rows = table_of().rows
    gone = next(k for k, row in enumerate(rows) if row["behaviour"] == "rigid" and row["task"] == "collaborative")
    rest = made_table(row for k, row in enumerate(rows) if k != gone)
    claim = verdicts(rest)[H2]
    assert claim.verdict is Verdict.REPRODUCED
    assert "/199 " in claim.measured
    assert "left out: 1." in claim.reason
    rigid, compliant = (StudyRuns(rest).of_participants(Task.COLLABORATIVE, b) for b in Behaviour)
    assert [a for a, _ in paired(rigid, compliant)] == [bool(row["success"]) for row in rigid]


def test_one_participant_alone_does_not_show_that_the_rigid_robot_is_better():
    """All that differs is one person's twenty trials: twenty independent ones would reject."""
    worst = participants()[3]

    def of_one(given: Mapping[str, str], _k: int) -> bool:
        return given["behaviour"] == "compliant" and all(given.get(n) == x for n, x in worst.items())

    claim = verdicts(table_of(of_one))[H2]
    assert claim.verdict is Verdict.NOT_REPRODUCED
    assert "p = 1;" in claim.reason


def test_trials_that_did_not_come_to_their_end_are_failures():
    failed = {"status": "failed", "success": None, "decided_by": None}
    rows = [row | {"success": True} | (failed if k < 20 else {}) for k, row in enumerate(table_of().rows)]
    claim = verdicts(made_table(rows))["Handovers that succeed: robot to human, rigid"]
    assert claim.measured == "180/200 (90 %)"
    assert "20 of 200 runs, which did not come to an end" in claim.reason
