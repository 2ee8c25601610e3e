"""Controllers in the impedance control's place: the plan, and how claims and tables are judged, on made-up tables."""

from functools import cache
from pathlib import Path
from typing import Any

import pyarrow as pa
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.scenarios.campaign.plan_check import checked_plan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.free_flyer.parameters import Behaviour, Propulsion, Task
from handover.scenarios.published.free_flyer.flyer_controllers import (
    CONTROLLERS,
    DISTURBANCES,
    PROPULSIONS,
    ControllerRows,
    FlyerControllers,
)
from handover.scenarios.published.free_flyer.variations import names_of
from handover.scenarios.published.published_experiment import Claim, Verdict

NUMBERS = names_of(DISTURBANCES)
LIMITS = ("impedance.f_max", "impedance.tau_max")


@cache
def table_of(
    quick: bool = False, apart: float = 1.0, late: bool = False, lost: str = "", steady: bool = False
) -> CampaignTable:
    """Return the plan's runs.

    Args:
        quick: whether the plan is the quick one.
        apart: how many times as far the PID lets the gripper go with limits; with ideal thrust it is three times.
        late: whether the rigid impedance control fails with the delay.
        lost: a controller that loses all objects.
        steady: whether a robot without thrust succeeds, too.
    """
    rows: list[dict[str, Any]] = []
    for run in FlyerControllers().plan(quick).runs():
        given = dict(run.parameters)
        row: dict[str, Any] = {name: given[name] for name in ("impedance", "task", "behaviour", "propulsion")}
        row |= {name: float(given[name]) if name in given else None for name in NUMBERS}
        limits = given.get("impedance.f_max")
        row |= dict.fromkeys(LIMITS, None if limits is None else [float(x) for x in limits.split(",")])
        coasts = limits == "0,0,0"
        slow = "delay" in given and given["behaviour"] == "rigid" and given["impedance"] == "ImpedanceController"
        far = 1.0 if given["impedance"] != "PoseController" else 3.0 if given["propulsion"] == "ideal" else apart
        done = not (late and slow)
        row |= {"status": "done" if done else "failed", "success": done and given["impedance"] != lost}
        row["success"] &= not coasts or steady
        row["saturated_share"] = 0.1 if done else None
        row |= {f"transfer_{name}": far if done else None for name in ("displacement", "force", "time")}
        rows.append(row)
    return CampaignTable(pa.Table.from_pylist(rows))


@cache
def verdicts(table: CampaignTable) -> dict[str, Claim]:
    return {claim.claim: claim for claim in FlyerControllers().claims(table)}


def test_the_plan_has_every_controller_in_every_handover_and_under_every_disturbance():
    plan = FlyerControllers().plan(quick=False)
    assert checked_plan(plan).size == 2 * (8 * len(Task) * len(PROPULSIONS) + 6 * len(DISTURBANCES))
    assert FlyerControllers().plan(quick=True).size == 8


def test_every_claim_is_judged_both_ways():
    good, bad = verdicts(table_of()), verdicts(table_of(apart=1.5, late=True, lost="PoseController", steady=True))
    assert [c.verdict for c in good.values()] == [
        *[Verdict.REPRODUCED] * 4,
        *[Verdict.NOT_REPRODUCED] * 2,
        *[Verdict.REPRODUCED] * 3,
    ]
    assert "No task is known to fail without thrust" in bad["With the impedance control every handover succeeds"].reason
    changed = [text for text in good if good[text].verdict is not bad[text].verdict]
    assert changed == [
        "With the PID control every handover succeeds",
        "Without thrust while it yields, the robot ends no handover",
        "With limited thrust the controller hardly matters to how far the person takes the rigid robot",
        "With limited thrust the controller hardly matters to how far the person takes the compliant robot",
        "With a delay of 32 ms, unknown to them, all controllers still hand over",
    ]
    assert all(claim.beyond for claim in good.values())


def test_a_run_that_does_not_end_is_a_failure_and_told_as_such():
    *_, disturbed = FlyerControllers().tables(table_of(late=True))
    late = disturbed.rows[0]
    assert late[:3] == [DISTURBANCES[0].label, "rigid", "did not end"]
    assert late[3].startswith("2/2: 1000 mm")
    reasons = [c.reason for c in verdicts(table_of(late=True)).values()]
    assert sum("did not come to their end" in reason for reason in reasons) == 1


def test_no_controller_of_the_plan_is_told_of_a_delay_that_it_would_reject():
    for point in FlyerControllers().plan(quick=False).points:
        assert ("delay" in point) == (point.get("impedance.delay") == "0")


def test_a_run_is_found_by_what_disturbs_it():
    rows = ControllerRows(table_of())
    case = "AdmittanceController", Task.COLLABORATIVE, Behaviour.RIGID, Propulsion.LIMITED
    for what in DISTURBANCES:
        assert len(rows.of(*case)) == len(rows.of(*case, what)) == 2
        assert rows.of(*case) != rows.of(*case, what)


def test_a_quick_campaign_has_one_table_and_no_figure(tmp_path: Path):
    table = table_of(quick=True)
    assert [t.title for t in FlyerControllers().tables(table)] == ["With limited thrust"]
    assert FlyerControllers().draw(table, tmp_path, tmp_path) == []


def test_the_figure_shows_what_was_run(tmp_path: Path, sketches: Sketches):
    FlyerControllers().draw(table_of(), tmp_path, tmp_path)
    assert len(sketches) == 1
    sketches.check(*sketches)
    assert len(CONTROLLERS) == 3
