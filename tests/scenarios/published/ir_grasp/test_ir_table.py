"""The experiment `ir-table`: what it runs, and what it makes of made-up results."""

from collections import defaultdict
from collections.abc import Sequence
from importlib import resources
from math import nan
from pathlib import Path

import pytest
import tomli
from support.scenarios.grasp_table import grasp_table

from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.campaign.plan import PlannedRun
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.ir_grasp.ir_table import IrTable
from handover.scenarios.published.ir_grasp.ir_table_claims import closing_claims, distance_claims, rate_claims
from handover.scenarios.published.ir_grasp.ir_table_runs import BLIND, FORWARD_35, REFLEX, IrTableRuns
from handover.scenarios.published.published_experiment import Claim, Verdict

TUNED = range(1000, 1008)
"""Seeds with which the scenario was tuned."""


def succeeds(run: PlannedRun) -> bool:
    """All hold but the blind hand, and the one that goes 35 mm forward to moved objects."""
    short = run.parameters.get("forward") == "0.035" and run.parameters["perturbed"] == "true"
    return run.parameters["strategy"] != "blind" and not short


@pytest.fixture(scope="module")
def table() -> CampaignTable:
    return grasp_table(succeeds)


@pytest.fixture(scope="module")
def claims(table: CampaignTable) -> Sequence[Claim]:
    return IrTable().claims(table)


def one(claims: Sequence[Claim], begin: str) -> Claim:
    (found,) = (claim for claim in claims if claim.claim.startswith(begin))
    return found


def test_all_ways_of_a_thing_share_their_scenes_and_things_do_not():
    seeds: dict[str, set[tuple[int, ...]]] = defaultdict(set)
    plan = IrTable().plan(quick=False)
    runs = plan.runs()
    for point, parameters in enumerate(plan.points):
        seeds[parameters["thing"]].add(tuple(run.seed for run in runs if run.point == point))
    assert all(len(of_thing) == 1 for of_thing in seeds.values())
    assert len({seed for of_thing in seeds.values() for runs in of_thing for seed in runs}) == 5 * plan.repetitions


def test_no_scene_is_one_that_the_scenario_was_tuned_with():
    assert not {run.seed for run in IrTable().plan(quick=False).runs()} & set(TUNED)


def test_a_quick_one_has_as_many_runs_of_a_cell_as_the_paper():
    plan = IrTable().plan(quick=True)
    assert (len(plan.points), plan.repetitions) == (5 * 2 * 4, 3)


def test_every_published_value_has_its_origin():
    text = resources.files("handover.scenarios.ir_grasp").joinpath("paper.toml").read_text(encoding="utf-8")
    for name, entry in tomli.loads(text)["published"].items():
        assert set(entry) == {"value", "unit", "where", "status"}, name
        assert entry["where"], name
        assert entry["status"] in ("stated", "derived", "read off figure"), name


def test_published_counts_are_those_of_table_1(table: CampaignTable):
    runs = IrTableRuns(table)
    assert runs.published(REFLEX, False, Thing.CYLINDER) == (2, 3)
    assert runs.published(BLIND, False, Thing.PAPER_BOX_B) == (1, 3)
    assert [runs.published(arm, p) for p in (False, True) for arm in (REFLEX, BLIND)] == [
        (11, 15),
        (2, 15),
        (8, 15),
        (0, 15),
    ]
    assert runs.published(FORWARD_35, False) is None


def test_published_distances_are_those_of_table_2_by_finger(table: CampaignTable):
    assert IrTableRuns(table).published_distances("baby_cup", True) == {"thumb": 0.018, "index": 0.048, "ring": 0.019}


def test_claims_on_rates_and_orders_follow_their_rules(claims: Sequence[Claim]):
    found = {claim.claim: claim.verdict for claim in claims}
    assert found["The IR-guided hand holds 11 of 15 objects in nominal poses."] is Verdict.NOT_REPRODUCED
    fewer = "The {} hand succeeds less often in perturbed poses than in nominal ones."
    assert found[fewer.format("IR-guided")] is Verdict.NOT_REPRODUCED


@pytest.mark.parametrize("pose", ["nominal", "perturbed"])
def test_better_than_a_hand_that_was_made_to_fail_is_no_evidence(claims: Sequence[Claim], pose: str):
    claim = one(claims, f"In {pose} poses the IR-guided hand succeeds more often than the blind one.")
    assert claim.verdict is Verdict.NOT_COMPARABLE
    assert claim.reason.startswith("The blind hand fails by choice")
    assert "McNemar" in claim.reason


def test_alike_distances_of_fingers_with_one_target_are_no_evidence(claims: Sequence[Claim]):
    claim = one(claims, "Thumb and ring are well centred")
    assert (claim.verdict, claim.measured) == (Verdict.NOT_COMPARABLE, "1.0 mm apart (median)")
    assert claim.reason.startswith("Both fingers have one target distance by construction")


def test_more_successes_than_published_are_told_as_an_easier_task(claims: Sequence[Claim]):
    assert "easier task" in one(claims, "The IR-guided hand holds 11 of 15").reason
    fewer = grasp_table(lambda run: run.repetition < 4)
    assert "easier task" not in one(rate_claims(IrTableRuns(fewer)), "The IR-guided hand holds 11 of 15").reason


@pytest.mark.slow
def test_a_distance_beyond_the_range_is_told_as_not_seen():
    index = grasp_table(succeeds, final_distance_index=lambda run: nan if run.repetition < 5 else 0.04)
    table = next(t for t in IrTable().tables(index) if t.title.startswith("Table II, nominal"))
    cell = dict(zip(table.header, table.rows[0], strict=True))["index, ours"]
    assert cell == "40.0 (40.0 to 40.0); not seen in 5"
    none = grasp_table(succeeds, final_distance_index=lambda _run: nan)
    table = next(t for t in IrTable().tables(none) if t.title.startswith("Table II, nominal"))
    assert dict(zip(table.header, table.rows[0], strict=True))["index, ours"] == "not seen in 16"


def test_what_was_chosen_to_fit_the_table_is_not_comparable(claims: Sequence[Claim]):
    assert one(claims, "The blind hand holds 0 of 15").verdict is Verdict.NOT_COMPARABLE
    assert one(claims, "In nominal poses thumb and ring end 9 to 12 mm").verdict is Verdict.NOT_COMPARABLE


def test_a_hand_that_fails_as_often_as_theirs_reproduces_their_rate():
    table = grasp_table(lambda run: succeeds(run) and run.repetition % 4 != 0)
    claim = one(rate_claims(IrTableRuns(table)), "The IR-guided hand holds 11 of 15")
    assert (claim.measured, claim.verdict) == ("60/80 (75 %)", Verdict.REPRODUCED)


def test_the_control_arm_is_reported_beyond_the_paper(claims: Sequence[Claim]):
    beyond = [claim for claim in claims if claim.beyond]
    assert len(beyond) == 4
    assert {claim.verdict for claim in beyond} == {Verdict.REPRODUCED}
    assert "80/80 (100 %) against 0/80 (0 %)" in beyond[-1].measured


def test_distances_that_no_run_of_ours_has_are_not_reproduced(claims: Sequence[Claim]):
    begin = "In perturbed poses thumb and ring end 13 to 19 mm"
    assert one(claims, begin).verdict is Verdict.NOT_REPRODUCED

    def spread(run: PlannedRun) -> float:
        return 0.010 + 0.001 * run.repetition

    spread_out = grasp_table(succeeds, final_distance_thumb=spread, final_distance_ring=spread)
    assert one(distance_claims(IrTableRuns(spread_out)), begin).verdict is Verdict.REPRODUCED


def test_objects_pushed_before_closing_refute_that_there_is_no_premature_contact(claims: Sequence[Claim]):
    begin = "The IR-guided hand does not touch"
    assert one(claims, begin).verdict is Verdict.REPRODUCED
    pushed = grasp_table(
        succeeds,
        touched=lambda run: float(run.repetition < 3),
        displacement=lambda run: 0.002 if run.repetition < 2 else 0.0,
    )
    assert one(closing_claims(IrTableRuns(pushed)), begin).verdict is Verdict.NOT_REPRODUCED


def test_table_1_puts_counts_beside_the_published_and_stars_those_that_differ(table: CampaignTable):
    nominal = IrTable().tables(table)[0]
    assert [f"{way}, {whose}" for way in ("IR-guided", "blind") for whose in ("published", "ours")] == nominal.header[
        1:5
    ]
    rows = {row[0]: row[1:5] for row in nominal.rows}
    assert rows["cylinder"] == ["2/3", "16/16", "0/3", "0/16"]
    assert rows["baby cup, pose (a)"] == ["1/3", "16/16 *", "0/3", "0/16"]
    assert rows["total"] == ["11/15 (45 to 92 %)", "80/80 (95 to 100 %) *", "2/15 (2 to 40 %)", "0/80 (0 to 5 %) *"]


def test_runs_that_did_not_come_to_their_end_do_not_count():
    table = grasp_table(succeeds, status=lambda run: "failed" if run.repetition == 0 else "done")
    assert IrTableRuns(table).count(REFLEX, False) == (75, 75)
    assert "40 runs did not come to their end" in IrTable().tables(table)[0].note


@pytest.mark.slow
def test_without_any_run_that_ended_there_are_no_verdicts_and_no_failure(tmp_path: Path):
    table = grasp_table(succeeds, quick=True, status=lambda _run: "lost")
    assert {claim.verdict for claim in IrTable().claims(table)} == {Verdict.NOT_COMPARABLE}
    assert IrTable().tables(table)
    assert IrTable().draw(table, tmp_path, tmp_path)


@pytest.mark.slow
def test_figures_are_left_as_png_and_svg(table: CampaignTable, tmp_path: Path):
    names = {figure.name for figure in IrTable().draw(table, tmp_path, tmp_path)}
    assert names == {"success_rates", "final_distances"}
    assert {p.name for p in tmp_path.iterdir()} == {f"{n}.{s}" for n in names for s in ("png", "svg")}
