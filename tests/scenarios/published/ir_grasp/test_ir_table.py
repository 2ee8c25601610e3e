"""The experiment `ir-table`: what it runs, and what it makes of made-up results."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import cache
from math import nan
from pathlib import Path
from typing import Any

import pytest
from support.scenarios.made_tables import made_table, one, text_of
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.published.ir_grasp.ir_table import BLIND, FORWARD_35, REFLEX, IrTable, IrTableRuns
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.runs.campaign.plan import PlannedRun
from handover.scenarios.runs.campaign.table import CampaignTable

TUNED = range(1000, 1008)
"""Seeds with which the scenario was tuned."""

TOUCH = "The IR-guided hand does not touch"
BEST = "The IR-guided hand holds 11 of 15"


@cache
def planned(quick: bool) -> Sequence[PlannedRun]:
    return IrTable().plan(quick).runs()


def grasp_table(
    succeeds: Callable[[PlannedRun], bool],
    quick: bool = False,
    status: Callable[[PlannedRun], str] = lambda _run: "done",
    **metrics: Callable[[PlannedRun], float],
) -> CampaignTable:
    """Return a table of the whole plan in which runs succeed, fail to run, and have metrics as given."""
    usual = {"displacement": 0.0, "touched": 0.0, "stop": 1.0, "steps": 4.0, "refinement_time": 5.0}
    usual |= {"final_distance_thumb": 0.011, "final_distance_index": 0.045, "final_distance_ring": 0.012}

    def row(run: PlannedRun) -> dict[str, Any]:
        done, p = status(run) == "done", run.parameters
        figures = {**usual, **{name: of(run) for name, of in metrics.items()}}
        return {
            "seed": run.seed,
            "status": status(run),
            "success": succeeds(run) if done else None,
            "thing": p["thing"],
            "perturbed": p["perturbed"] == "true",
            "strategy": p["strategy"],
            "forward": float(p.get("forward", 0.035)),
            **(figures if done else dict.fromkeys(figures)),
        }

    return made_table(row(run) for run in planned(quick))


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


def test_all_ways_of_a_thing_share_their_scenes_and_things_do_not_and_none_was_tuned_with():
    seeds: dict[str, set[tuple[int, ...]]] = defaultdict(set)
    plan = IrTable().plan(quick=False)
    runs = plan.runs()
    for point, parameters in enumerate(plan.points):
        seeds[parameters["thing"]].add(tuple(run.seed for run in runs if run.point == point))
    assert all(len(of_thing) == 1 for of_thing in seeds.values())
    drawn = {seed for of_thing in seeds.values() for runs in of_thing for seed in runs}
    assert len(drawn) == 5 * plan.repetitions
    assert not drawn & set(TUNED)


def test_published_counts_and_distances_are_those_of_tables_1_and_2(table: CampaignTable):
    runs = IrTableRuns(table)
    assert runs.published(REFLEX, False, Thing.CYLINDER) == (2, 3)
    assert runs.published(BLIND, False, Thing.PAPER_BOX_B) == (1, 3)
    counts = [runs.published(arm, p) for p in (False, True) for arm in (REFLEX, BLIND)]
    assert counts == [(11, 15), (2, 15), (8, 15), (0, 15)]
    assert runs.published(FORWARD_35, False) is None
    assert runs.published_distances("baby_cup", True) == {"thumb": 0.018, "index": 0.048, "ring": 0.019}


@pytest.mark.parametrize(
    ("begin", "verdict"),
    [
        (BEST, Verdict.NOT_REPRODUCED),
        ("The IR-guided hand succeeds less often in perturbed poses than in nominal ones.", Verdict.NOT_REPRODUCED),
        ("In nominal poses the IR-guided hand succeeds more often than the blind one", Verdict.NOT_COMPARABLE),
        ("In perturbed poses the IR-guided hand succeeds more often than the blind one", Verdict.NOT_COMPARABLE),
        ("Thumb and ring are well centred", Verdict.NOT_COMPARABLE),
        ("The blind hand holds 0 of 15", Verdict.NOT_COMPARABLE),
        ("In nominal poses thumb and ring end 9 to 12 mm", Verdict.NOT_COMPARABLE),
        ("In perturbed poses thumb and ring end 13 to 19 mm", Verdict.NOT_REPRODUCED),
        (TOUCH, Verdict.REPRODUCED),
    ],
)
def test_claims_follow_their_rules_and_what_was_made_or_chosen_so_is_no_evidence(
    claims: Sequence[Claim], begin: str, verdict: Verdict, wording: Wording
):
    claim = one(claims, begin)
    assert claim.verdict is verdict
    wording.check(f"{claim.measured} | {claim.reason}")


def test_the_control_arm_is_reported_beyond_the_paper(claims: Sequence[Claim]):
    beyond = [claim for claim in claims if claim.beyond]
    assert [claim.verdict for claim in beyond] == [Verdict.REPRODUCED] * 4
    assert "80/80 (100 %) against 0/80 (0 %)" in beyond[-1].measured


def test_other_rates_distances_and_touches_have_other_verdicts():
    def spread(run: PlannedRun) -> float:
        return 0.010 + 0.001 * run.repetition

    claims = IrTable().claims(
        grasp_table(
            lambda run: succeeds(run) and run.repetition % 4 != 0,
            final_distance_thumb=spread,
            final_distance_ring=spread,
            touched=lambda run: float(run.repetition < 3),
            displacement=lambda run: 0.002 if run.repetition < 2 else 0.0,
        )
    )
    best = one(claims, BEST)
    assert (best.measured, best.verdict) == ("60/80 (75 %)", Verdict.REPRODUCED)
    begin = "In perturbed poses thumb and ring end 13 to 19 mm"
    assert one(claims, begin).verdict is Verdict.REPRODUCED
    assert one(claims, TOUCH).verdict is Verdict.NOT_REPRODUCED
    fewer = one(IrTable().claims(grasp_table(lambda run: run.repetition < 4)), BEST)
    assert "easier task" not in fewer.reason


def test_tables_put_ours_beside_the_published_and_star_what_differs(table: CampaignTable, wording: Wording):
    wording.check(text_of(IrTable().tables(table)))


def test_a_distance_beyond_the_range_is_reported_as_not_seen_and_runs_that_did_not_come_to_their_end_do_not_count():
    def seen(run: PlannedRun) -> float:
        return nan if run.parameters["thing"] != "cylinder" or run.repetition < 6 else 0.04

    made = grasp_table(
        succeeds, status=lambda run: "failed" if run.repetition == 0 else "done", final_distance_index=seen
    )
    assert IrTableRuns(made).count(REFLEX, False) == (75, 75)
    first, *others = IrTable().tables(made)
    assert "40 runs that did not come to an end" in first.note
    table = next(t for t in others if t.title.startswith("Table II, nominal"))
    reported = {dict(zip(table.header, row, strict=True))["index, ours"] for row in table.rows}
    assert reported == {"40.0 (40.0 to 40.0); not seen in 5", "not seen in 30"}


def test_without_any_run_that_ended_there_are_no_verdicts_and_no_failure(tmp_path: Path, sketches: Sketches):
    table = grasp_table(succeeds, quick=True, status=lambda _run: "lost")
    assert {claim.verdict for claim in IrTable().claims(table)} == {Verdict.NOT_COMPARABLE}
    assert IrTable().tables(table)
    assert IrTable().draw(table, tmp_path, tmp_path)
    assert list(sketches) == ["success_rates", "final_distances"]
