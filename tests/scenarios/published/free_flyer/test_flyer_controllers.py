"""Controllers in the impedance control's place: the plan, and how claims and tables are judged, on made-up tables."""

from functools import cache
from pathlib import Path
from typing import Any

import pytest
from support.scenarios.made_tables import made_table
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

from handover.scenarios.published.free_flyer.flyer_controllers import (
    DISTURBANCES,
    FlyerControllers,
)
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.runs.campaign.table import CampaignTable

NUMBERS = {name for what in DISTURBANCES for name in what.parameters}
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
        slow = "delay" in given and given["behaviour"] == "rigid" and given["impedance"] == "ImpedanceController"
        far = 1.0 if given["impedance"] != "PoseController" else 3.0 if given["propulsion"] == "ideal" else apart
        done = not (late and slow)
        row["success"] = done and given["impedance"] != lost and (steady or limits != "0,0,0")
        row |= {"status": "done" if done else "failed", "saturated_share": 0.1 if done else None}
        rows.append(row | {f"transfer_{n}": far if done else None for n in ("displacement", "force", "time")})
    return made_table(rows)


@cache
def verdicts(table: CampaignTable) -> dict[str, Claim]:
    return {claim.claim: claim for claim in FlyerControllers().claims(table)}


def test_every_claim_is_judged_both_ways(wording: Wording):
    good, bad = verdicts(table_of()), verdicts(table_of(apart=1.5, late=True, lost="PoseController", steady=True))
    not_good = [4, 5]
    assert [k for k, c in enumerate(good.values()) if c.verdict is not Verdict.REPRODUCED] == not_good
    assert "No task is known to fail without thrust" in bad["With the impedance control every handover succeeds"].reason
    wording.check("\n".join(text for text in good if good[text].verdict is not bad[text].verdict))
    assert all(claim.beyond for claim in good.values())
    late = table_of(late=True)
    *_, disturbed = FlyerControllers().tables(late)
    assert disturbed.rows[0][:3] == [DISTURBANCES[0].label, "rigid", "did not end"]
    assert disturbed.rows[0][3].startswith("2/2: 1000 mm")
    assert sum("did not come to an end" in c.reason for c in verdicts(late).values()) == 1


def test_no_controller_of_the_plan_is_given_a_delay_that_it_would_reject():
    for point in FlyerControllers().plan(quick=False).points:
        assert ("delay" in point) == (point.get("impedance.delay") == "0")


def test_a_quick_campaign_has_one_table_and_no_figure(tmp_path: Path):
    table = table_of(quick=True)
    assert [t.title for t in FlyerControllers().tables(table)] == ["With limited thrust"]
    assert FlyerControllers().draw(table, tmp_path, tmp_path) == []


@pytest.mark.slow
def test_the_figure_shows_what_was_run(tmp_path: Path, sketches: Sketches):
    (figure,) = FlyerControllers().draw(table_of(), tmp_path, tmp_path)
    sketches.check(figure.name)
