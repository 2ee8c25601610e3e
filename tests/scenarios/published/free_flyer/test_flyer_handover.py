"""Handovers of the free-flyer: the plan, and how claims and tables are judged, on tables that a test makes up."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from support.scenarios.flyer_runs import metric, task_of
from support.scenarios.made_tables import made_table, one, text_of
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

from handover.scenarios.published.free_flyer.flyer_approaches import CASES, FlyerApproaches, places
from handover.scenarios.published.free_flyer.flyer_handover import (
    ARMS,
    AT_PUBLISHED_RATE,
    RATES,
    STRENGTHS,
    UNGATED,
    FlyerHandoverTable,
    HandoverRuns,
    point_of,
)
from handover.scenarios.published.free_flyer.flyer_handover_figures import figure_number
from handover.scenarios.published.free_flyer.handovers import EXCHANGES, GIVING
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.robots.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Propulsion, Task
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.execution.unit_values import split_parameters

NUMBERS = ("strength", "arm_factor", "model_arm_factor", "mass_factor", "inertia_factor", "decision.gate_error")
SIGHT = {"sight_error": 0.002, "depth_error": 0.006}
HAND_OVER = FlyerHandoverTable()


def row_of(run: Any, **measured: Any) -> dict[str, Any]:
    """Return a run's parameters as the campaign's table has them, with the defaults where it sets none."""
    given = dict(run.parameters)
    row: dict[str, Any] = {"status": "done", "run": run.name, "success": True, "saturated_share": 0.1}
    row |= {name: given[name] for name in ("task", "behaviour")} | {"propulsion": given.get("propulsion", "limited")}
    row |= {"strength": 4.0, "gated": given.get("gated") != "false"}
    row |= {n: 1.0 for n in NUMBERS if "factor" in n} | {"decision.gate_error": float("nan")}
    row |= SIGHT | {n: float(given[n]) for n in (*NUMBERS, *SIGHT) if n in given}
    row |= {n: float(text) if n != "person.motion" else text for n, text in given.items() if "." in n}
    row |= {name: given.get(name, "") for name in AT_PUBLISHED_RATE}
    row["p_WG_handover"] = [float(x) for x in given.get("p_WG_handover", "0,-0.07,0").split(",")]
    return row | measured


def test_robots_with_other_arms_are_called_by_how_much_longer_these_are():
    found = {v.label: float(v.parameters["arm_factor"]) for v in ARMS}
    assert found == {"arm -50 %": 0.5, "arm +50 %": 1.5}


@cache
def table_of(
    quick: bool = False,
    *,
    ratio: float = 3.5,
    twice: float = 2.0,
    alone: int = 0,
    gate: int = 1,
    rate: float = 1e-4,
    unfinished: int = 0,
) -> CampaignTable:
    """Return the plan's runs: displacements as published with ideal thrust, and the same with limits.

    Args:
        quick: whether the plan is the quick one.
        ratio: compliant over rigid displacement along z as the robot gives, with ideal thrust.
        twice: that along x as it receives.
        alone: how often a robot acts with nobody there, and
        gate: how often without the gate.
        rate: by how much the rate of control changes displacements, m.
        unfinished: how many runs of each point do not come to their end.
    """
    rows: list[dict[str, Any]] = []
    for run in HAND_OVER.plan(quick).runs():
        compliant = run.parameters["behaviour"] == "compliant"
        z = 0.04 * (ratio if compliant and run.parameters["propulsion"] == "ideal" else 1.0)
        moved = {"displacement": z + (rate if "impedance" in run.parameters else 0.0), "displacement_z": z}
        moved |= {"displacement_x": 0.02 * (twice if compliant else 1.0), "displacement_y": 0.001, "time": 4.0}
        moved |= {"rest_speed": 0.003, "speed": 0.1, "felt_after": 3.0}
        measured = {f"{prefix}_{n}": v for prefix in ("transfer", "return") for n, v in moved.items()}
        measured |= {"phase_move_to_handover": 13.0, "phase_close_gripper": 17.0, "angle_full": 0.78}
        measured |= {"angle_empty": 0.6, "unprovoked": gate if run.parameters.get("gated") == "false" else alone}
        if run.repetition < unfinished:
            measured = {"status": "failed", "success": None, "saturated_share": None}
        rows.append(row_of(run, **measured))
    return made_table(rows)


@cache
def verdicts(table: CampaignTable) -> dict[str, Claim]:
    return {claim.claim: claim for claim in HAND_OVER.claims(table)}


TEN = "As it gives, the compliant robot's error along z is ten times the rigid one's"
USUAL_ROW = ["rigid", "nozzles"]


def test_every_claim_is_judged_both_ways():
    good = verdicts(table_of())
    bad = verdicts(table_of(ratio=1.2, twice=3.0, alone=1, gate=0, rate=0.002))
    judged = {text: c.verdict for text, c in good.items() if c.verdict is not Verdict.NOT_COMPARABLE}
    thresholds = {text for text in judged if text.startswith("By a speed of")}
    succeed = {text for text in judged if "with either behaviour" in text or "asks again" in text}
    assert (len(thresholds), len(succeed)) == (4, 2)
    assert {text for text, v in judged.items() if v is Verdict.NOT_REPRODUCED} == {TEN, *thresholds}
    assert verdicts(table_of(ratio=10.0))[TEN].verdict is Verdict.REPRODUCED
    changed = {text for text in judged if bad[text].verdict is Verdict.NOT_REPRODUCED} - {TEN}
    assert changed == set(judged) - succeed - thresholds - {TEN}


def test_thresholds_are_judged_where_no_gate_keeps_the_robot_from_acting():
    kept, acted = (verdicts(table_of(gate=gate)) for gate in (0, 1))
    for text in (text for text in kept if text.startswith("By a speed of")):
        assert (kept[text].verdict, acted[text].verdict) == (Verdict.REPRODUCED, Verdict.NOT_REPRODUCED)
        assert "9 of 9 as it arrived" in acted[text].measured
        assert "3 of 3 within 20 cm" in acted[text].reason


def test_runs_that_did_not_come_to_their_end_are_failures():
    claims = verdicts(table_of(gate=0, unfinished=1))
    for words in ("with either behaviour", "asks again", "By a speed of"):
        found = [c for text, c in claims.items() if words in text]
        assert found
        assert {c.verdict for c in found} == {Verdict.NOT_REPRODUCED}
        assert all("did not come to an end" in c.reason for c in found)


def test_what_is_chosen_here_is_not_said_to_be_reproduced():
    not_judged = [c.claim for c in verdicts(table_of()).values() if c.verdict is Verdict.NOT_COMPARABLE]
    assert len(not_judged) == 3
    assert all(any(words in text for text in not_judged) for words in ("angle", "13 s", "32 s"))


def test_a_quick_plan_decides_nothing_on_forces_gate_and_rate():
    claims = verdicts(table_of(quick=True))
    assert one(claims.values(), "0.14 m").verdict is claims[TEN].verdict is Verdict.NOT_COMPARABLE
    tables = HAND_OVER.tables(table_of(quick=True))
    assert [table.title for table in tables] == ["Transfers", "Margins of the thresholds"]


def test_a_full_plan_has_all_tables_with_all_rows(wording: Wording):
    tables = {t.title: t for t in HAND_OVER.tables(table_of())}
    assert len(tables) == 5
    assert len(tables["Transfers"].rows) == 6 * len(EXCHANGES)
    assert len(tables["Where the behaviours differ, as the robot gives"].rows) == 3 * (1 + len(STRENGTHS)) + 5
    names = ("Control at the rate that the thesis prints", "Without a gate to the impedance control")
    wording.check(text_of([tables[name] for name in names]))


def test_a_run_is_found_by_what_it_is_for():
    runs = HandoverRuns(table_of())
    for variation in (*STRENGTHS, *UNGATED, *RATES):
        first, *others = runs.of(GIVING.task, Behaviour.RIGID, Propulsion.LIMITED, variation)
        assert len(others) == 2
        assert (first["gated"], first["decision"] != "") == (variation not in UNGATED, variation is RATES[1])
    assert len(runs.of(GIVING.task, Behaviour.RIGID)) == 3
    assert len(runs.usual()) == 72
    assert len(runs.of(Task.COLLABORATIVE, Behaviour.RIGID, variation=STRENGTHS[0])) == 0


@pytest.mark.slow
def test_runs_without_chance_do_not_depend_on_their_seed(tmp_path: Path):
    point = point_of(GIVING.task, Behaviour.RIGID, Propulsion.LIMITED, RATES[0])
    parameters, values = split_parameters(HandoverOfTask, [f"{name}={text}" for name, text in point.items()])
    found: list[list[float]] = []
    for seed in (1, 2):
        task = replace(task_of(HandoverOfTask, tmp_path / f"{seed}", seed=seed), parameters=parameters)
        ended = run_task(replace(task, unit_values=values), lambda _t, _end: None, Interruption())
        assert ended.summary["success"]
        found.append([metric(ended, f"transfer_{n}") for n in ("displacement", "time", "speed", "force")])
    assert found[0] == found[1]


@pytest.mark.slow
def test_without_records_there_are_no_curves(tmp_path: Path, sketches: Sketches):
    HAND_OVER.draw(table_of(), tmp_path, tmp_path)
    sketches.check("margins", "strength")
    numbers = [n for e in EXCHANGES for b in Behaviour if (n := figure_number(e.task, b))]
    assert (numbers[0], numbers[-1], len(numbers)) == ("figs. 4.29, 4.30", "figs. 4.37, 4.38", 5)


@cache
def approaches(alone: int = 0, alone_if_other: int = 0, silent: bool = False, quick: bool = False) -> CampaignTable:
    """Return the approaches' runs, of which the first and, of robots that are otherwise, as many act alone."""
    rows: list[dict[str, Any]] = []
    for run in FlyerApproaches().plan(quick).runs():
        other = any("factor" in n or "noise" in n for n in run.parameters)
        acts = (run.point == 0 and run.repetition < alone) or (other and run.repetition < alone_if_other)
        measured = {"transfer_rest_speed": 0.003, "unprovoked": int(acts), "arrival_error": 0.001}
        measured |= {"simulated_seconds": 36.0, "phase_check_velocity": None if silent and other else 20.0}
        rows.append(row_of(run, **measured))
    return made_table(rows)


def test_a_thousand_approaches_are_counted_with_their_interval():
    never, bears = FlyerApproaches().claims(approaches())
    assert (never.verdict, bears.verdict) == (Verdict.REPRODUCED, Verdict.REPRODUCED)
    assert never.measured.startswith("0 of 1,000 approaches")
    assert never.interval is not None
    assert never.interval[1] == pytest.approx(0.00368, abs=1e-5)
    assert FlyerApproaches().claims(approaches(quick=True))[0].verdict is Verdict.NOT_COMPARABLE
    assert len(set(places(125))) == 125
    assert {point["p_WG_handover"] for point in FlyerApproaches().plan(quick=False).points} == set(places(125))


def test_one_that_acts_alone_is_found_and_so_is_a_robot_that_never_signals():
    never, bears = FlyerApproaches().claims(approaches(alone=1))
    assert (never.verdict, bears.verdict) == (Verdict.NOT_REPRODUCED, Verdict.REPRODUCED)
    bears = FlyerApproaches().claims(approaches(alone_if_other=1, silent=True))[1]
    assert bears.verdict is Verdict.NOT_REPRODUCED
    assert "never signalled" in bears.reason


@pytest.mark.slow
def test_approaches_are_drawn_with_each_kind_of_robot(tmp_path: Path, sketches: Sketches):
    (figure,) = FlyerApproaches().draw(approaches(), tmp_path, tmp_path)
    sketches.check(figure.name)
    (table,) = FlyerApproaches().tables(approaches())
    assert len(table.rows) == 4 * (1 + len(CASES))


def test_what_a_transfer_reached_is_shown_where_the_handover_failed():
    rows = table_of(quick=True).rows
    for row in (row for row in rows if row["task"] == "collaborative"):
        row |= {"success": False, "return_time": None, "return_speed": None, "return_felt_after": None}
    (table,) = [t for t in HAND_OVER.tables(made_table(rows)) if t.title == "Transfers"]
    by_name = {row[1]: dict(zip(table.header, row, strict=True)) for row in table.rows if row[2:4] == USUAL_ROW}
    names = ("received", "succeeded", "along z, mm", "taken after, s")
    assert [by_name["collaborative, giving"][n] for n in names] == ["1 of 1", "0 of 1", "(40)", "(4.0)"]
    back = by_name["collaborative, receiving"]
    assert (back["received"], back["succeeded"], back["taken after, s"]) == ("0 of 1", "0 of 1", "")
    assert by_name["robot to human"]["along z, mm"] == "40"


def test_runs_that_failed_tell_no_displacement():
    rows = [row | {"success": list(row["p_WG_handover"]) != [0.0, -0.07, 0.3]} for row in table_of().rows]
    (table,) = [t for t in HAND_OVER.tables(made_table(rows)) if "differ" in t.title]
    cells = {row[0]: dict(zip(table.header, row, strict=True)) for row in table.rows}
    reported = ("rigid felt it", "rigid succeeded", "rigid along z, mm", "compliant over rigid")
    assert [cells["at (0, -0.07, 0.3) m"][name] for name in reported] == ["3 of 3", "0 of 3", "", ""]
    assert [cells["at (0, -0.3, 0) m"][name] for name in reported] == ["3 of 3", "3 of 3", "40", "1.0"]
