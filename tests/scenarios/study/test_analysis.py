"""Results of studies with numbers that are known, written through the session folder."""

from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest
from support.scenarios.sample_study import PLAN, record, rigid_is_better, session, write_study

from handover.scenarios.study.folder.session_folder import SessionFolder
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.order import Round, rounds_of
from handover.scenarios.study.statistics.analysis import FAILURE, StudyAnalysis
from handover.scenarios.study.statistics.exact_tests import SignedRankTest


def test_ratings_of_one_statement_that_differ_are_found(twelve: StudyFolder):
    tests = {(t.statement, t.task): t for t in StudyAnalysis(twelve).rating_tests}
    assert len(tests) == 9
    found = tests["S1", "collaborative"]
    assert found.test is not None
    assert found.p_holm is not None
    assert (found.participants, found.test.estimate, found.test.low, found.test.high) == (12, 2.0, 2.0, 2.0)
    assert found.test.p == pytest.approx(2 / 2**12)
    assert found.p_holm == pytest.approx(9 * 2 / 2**12)
    assert found.first == pytest.approx(6.5)
    assert found.second == pytest.approx(4.5)
    other = tests["S2", "collaborative"]
    assert other.test is not None
    assert (other.test.p, other.p_holm, other.test.zeros) == (1.0, 1.0, 12)


def test_failures_are_compared_within_persons(twelve: StudyFolder):
    analysis = StudyAnalysis(twelve)
    counts = {(c.task, c.behaviour): c for c in analysis.failures}
    assert (counts["human_to_robot", "compliant"].failures, counts["human_to_robot", "compliant"].rounds) == (12, 24)
    assert counts["human_to_robot", "rigid"].failures == counts["collaborative", "compliant"].failures == 0
    assert counts["human_to_robot", "compliant"].low == pytest.approx(0.2912, abs=1e-4)  # Clopper-Pearson of 12 of 24
    test = {t.task: t for t in analysis.failure_tests}["human_to_robot"]
    assert test.p_pairs == pytest.approx(2 / 2**12)  # each of six: two pairs in which compliant alone failed
    assert test.p_holm == pytest.approx(3 * 2 / 2**12)
    assert test.p_participants == pytest.approx(2 / 2**6)
    assert test.difference == pytest.approx(-0.5)


def test_void_rounds_and_rounds_that_nobody_can_judge_do_not_count(tmp_path: Path):
    study = StudyFolder.opened(tmp_path / "out", PLAN)
    folder = study.begin(session(1))
    for planned in folder.rounds[:4]:
        played = replace(record(success=False, void=planned.number == 1))
        folder.record_round(planned.number, replace(played, failed_by_rule=None) if planned.number == 2 else played)
        if planned.number > 1:
            folder.record_answers(planned.number, {"S1": 9, "S2": 9, "S3": 9})
    analysis = StudyAnalysis(study)
    assert sum(c.rounds for c in analysis.failures) == sum(c.failures for c in analysis.failures) == 2
    assert sum(c.unjudged for c in analysis.failures) == 1
    assert sum(c.unsuccessful for c in analysis.failures) == 3
    assert {a["round"] for a in analysis.answers} == {2, 3, 4}


def effects_of(analysis: StudyAnalysis) -> dict[tuple[str, str], SignedRankTest]:
    return {(e.effect, e.measure): e.test for e in analysis.order_effects if e.test is not None}


def test_gains_by_practice_and_what_a_rigid_round_leaves_behind_are_told_apart_and_from_the_comparison(tmp_path: Path):
    def rate(number: int, planned: Round, statement: str) -> int:
        """Rate by practice in S2, and by the behaviour in the round before in S3."""
        before = rounds_of(PLAN, number)[planned.number - 2].condition.behaviour if planned.number > 1 else ""
        learnt = 1 + (planned.number + number % 3) // 2
        return {"S1": 5, "S2": learnt, "S3": 6 if before == "rigid" else 5}[statement]

    analysis = StudyAnalysis(write_study(tmp_path / "out", 12, rate))
    effects = effects_of(analysis)
    assert effects["round", "S2"].estimate == pytest.approx(0.5, abs=0.02)
    assert effects["carry-over", "S3"].estimate == pytest.approx(1.0)
    assert max(effects[of].p for of in (("round", "S2"), ("period", "S2"), ("carry-over", "S3"))) < 0.001
    assert effects["round", "S1"].p == effects["carry-over", FAILURE].p == 1.0
    tests = analysis.rating_tests
    assert all(t.p_holm is not None and t.p_holm > 0.9 for t in tests if t.statement != "S3")


def test_practice_is_not_taken_for_carry_over_where_rounds_are_void_and_orders_unbalanced(tmp_path: Path):
    study = StudyFolder.opened(tmp_path / "out", PLAN)
    with patch.object(SessionFolder, "write_tables"):
        for number in range(1, 8):
            folder = study.begin(session(number))
            for planned in folder.rounds:
                is_void = (planned.number + number) % 5 == 0
                folder.record_round(planned.number, record(void=is_void))
                if not is_void:  # the second period is rated higher by 4, whatever came before
                    ratings = {"S1": 1 + 4 * (planned.period - 1), "S2": min(9, planned.number), "S3": 5}
                    folder.record_answers(planned.number, ratings)
            folder.record_questionnaire({"age_group": "21-30", "background": "engineering", "comments": ""})
    analysis = StudyAnalysis(study)
    assert len(analysis.complete_sessions) == 7
    effects = effects_of(analysis)
    period = effects["period", "S1"]
    assert (period.estimate, period.low, period.high) == pytest.approx((4.0, 4.0, 4.0))
    assert effects["carry-over", "S1"].p > 0.05


@pytest.mark.slow
def test_the_model_has_the_behaviours_effect_in_each_task(tmp_path: Path):
    def rates(number: int, planned: Round, statement: str) -> int:
        noise = (7 * number + 3 * planned.number + 5 * int(statement[1])) % 5 - 2
        above = 2 if planned.condition.behaviour == "rigid" and planned.condition.task == "collaborative" else 0
        return min(9, max(1, 4 + number % 3 + noise // 2 + above))

    analysis = StudyAnalysis(write_study(tmp_path / "out", 12, rates))
    found = analysis.models[0]
    assert found.model is not None, found.reason
    effects = dict(zip(found.names, found.model.effects, strict=True))
    assert list(effects)[:3] == [f"behaviour, {t}" for t in PLAN.tasks]
    assert list(effects)[-1] == "period"
    assert effects["behaviour, collaborative"].low > 0.0
    assert effects["behaviour, robot_to_human"].low < 0.0 < effects["behaviour, robot_to_human"].high


def test_comparisons_take_complete_pairs_and_order_effects_complete_sessions(tmp_path: Path):
    study = write_study(tmp_path / "out", 6, rigid_is_better)
    folder = study.begin(session(7))
    played = folder.rounds[:4]
    void = next(r for r in played if r.condition.task == played[0].condition.task)
    for planned in played:
        folder.record_round(planned.number, record(void=planned is void))
        if planned is not void:
            folder.record_answers(planned.number, dict.fromkeys(PLAN.statements, 5))
    counted = [r.condition for r in played if r is not void]
    both = {t for t in PLAN.tasks if {c.behaviour for c in counted if c.task == t} == set(PLAN.behaviours)}
    analysis = StudyAnalysis(study)
    assert {t.task: t.participants for t in analysis.rating_tests} == {t: 6 + (t in both) for t in PLAN.tasks}
    assert {t.task: t.participants for t in analysis.failure_tests} == {t: 6 + (t in both) for t in PLAN.tasks}
    assert {e.participants for e in analysis.order_effects} == {6}
    assert sum(c.rounds for c in analysis.failures) == 6 * 12 + 3


def test_a_void_round_takes_its_pair_out_of_the_comparison_and_no_more(tmp_path: Path):
    study = StudyFolder.opened(tmp_path / "out", PLAN)
    folder = study.begin(session(1))
    task = PLAN.tasks[0]
    void = next(r for r in folder.rounds if (r.condition.task, r.condition.behaviour) == (task, "rigid"))
    for planned in folder.rounds:
        folder.record_round(planned.number, record(void=planned is void))
        if planned is not void:  # the second period is rated higher by 4, whatever the behaviour
            folder.record_answers(planned.number, dict.fromkeys(PLAN.statements, 1 + 4 * (planned.period - 1)))
    means = {(m.task, m.statement): (m.first, m.second) for m in StudyAnalysis(study).means}
    other = 3 - void.period
    assert means[task, "S1"] == (1.0 + 4 * (other - 1),) * 2
    assert means[PLAN.tasks[1], "S1"] == (3.0, 3.0)


def test_who_has_withdrawn_is_in_no_result(tmp_path: Path):
    study = write_study(tmp_path / "out", 7, rigid_is_better)
    study.withdraw(3, "2026-11-24T15:00:00", delete=False)
    analysis = StudyAnalysis(study)
    assert {t.participants for t in analysis.rating_tests} == {6}
    assert {m.participant for m in analysis.means} == {"P01", "P02", "P04", "P05", "P06", "P07"}
    assert all(row["participant"] != "P03" for row in [*analysis.rounds, *analysis.answers])
    assert {e.participants for e in analysis.order_effects} == {6}


def test_a_session_of_void_rounds_enters_no_effect_of_the_order(tmp_path: Path):
    study = StudyFolder.opened(tmp_path / "out", PLAN)
    folder = study.begin(session(1))
    for planned in folder.rounds:
        folder.record_round(planned.number, record(void=True))
    folder.record_questionnaire({})
    assert folder.is_complete
    assert {effect.participants for effect in StudyAnalysis(study).order_effects} == {0}
