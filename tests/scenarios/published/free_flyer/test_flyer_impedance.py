"""Pushes on the free-flyer: the plan, and how claims and tables are judged, on tables that a test makes up."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.scenarios.campaign.plan_check import checked_plan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.free_flyer.parameters import Axis, Behaviour, ImpedanceParameters, Wrench
from handover.scenarios.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.published.free_flyer import flyer_impedance_figures
from handover.scenarios.published.free_flyer.flyer_impedance import FlyerImpedanceTable
from handover.scenarios.published.free_flyer.push_runs import (
    DURATIONS,
    PUSHES,
    Push,
    PushRuns,
    predicted_errors,
    predicted_greatest,
)
from handover.scenarios.published.free_flyer.variations import EXACT
from handover.scenarios.published.published_experiment import Claim, Verdict

NUMBERS = ("duration", "mass_factor", "inertia_factor", "arm_factor", *EXACT)


@cache
def table_of(quick: bool = False, longest: float = 10.0, off: float = 0.004, back: bool = True) -> CampaignTable:
    """Return the plan's runs: errors as python-control has them, but for the ratio of the longest pushes.

    Args:
        quick: whether the plan is the quick one.
        longest: that ratio.
        off: difference to eq. (4.4), m, with noise; a tenth without, ten times with a robot that is another.
        back: whether the robot comes back to rest where its thrust has limits.
    """
    rows: list[dict[str, Any]] = []
    for run in FlyerImpedanceTable().plan(quick).runs():
        given = dict(run.parameters)
        row: dict[str, Any] = {name: given[name] for name in ("kind", "axis", "behaviour")} | {"status": "done"}
        row |= {"propulsion": given["propulsion"]} | {n: float(given[n]) if n in given else None for n in NUMBERS}
        push = Push(Wrench[given["kind"].upper()], Axis[given["axis"].upper()])
        behaviour, duration = Behaviour[given["behaviour"].upper()], float(given.get("duration", "0.5"))
        size = predicted_greatest(push, behaviour, min(duration, 2.0))
        if duration > 2.0:
            size = 0.01 * (longest if behaviour is Behaviour.COMPLIANT else 1.0)
        other = any("factor" in name for name in given)
        apart = off * (10.0 if other else 0.1 if "navigation.position_noise" in given else 1.0)
        row |= {"greatest_position_error": size, "greatest_orientation_error": size, "success": True}
        row |= {"disagreement_position": apart, "disagreement_orientation": apart, "run": run.name}
        row["settling_time"] = 3.0 if given["propulsion"] == "ideal" or back else None
        rows.append(row)
    return CampaignTable(pa.Table.from_pylist(rows))


@cache
def verdicts(table: CampaignTable) -> dict[str, Claim]:
    return {claim.claim: claim for claim in FlyerImpedanceTable().claims(table)}


def test_the_plan_has_the_thesiss_twelve_pushes_and_what_is_beyond_them():
    plan = FlyerImpedanceTable().plan(quick=False)
    assert checked_plan(plan).size == 12 + 12 + 12 + 6 * (len(DURATIONS) - 1) + 12 * 6
    assert FlyerImpedanceTable().plan(quick=True).size == 12


@pytest.mark.parametrize("quick", [False, True])
def test_the_scenario_takes_every_point(quick: bool):
    for point in FlyerImpedanceTable().plan(quick).points:
        own = {name: value for name, value in point.items() if "." not in name}
        assert parse_parameters(FlyerImpedance, [f"{k}={v}" for k, v in own.items()])


def test_every_claim_is_judged_both_ways():
    good, bad = verdicts(table_of()), verdicts(table_of(longest=7.0, off=0.03, back=False))
    assert [claim.verdict for claim in good.values()] == [Verdict.REPRODUCED] * 8
    changed = {text for text, claim in bad.items() if claim.verdict is Verdict.NOT_REPRODUCED}
    assert changed == {
        "A force takes the compliant robot ten times as far as the rigid one",
        "The motion is the impedance model's",
        "Without noise of the navigation the motion is the impedance model's",
        "With Astrobee's limits of thrust the robot comes back from the same pushes",
    }


def test_runs_that_were_lost_decide_nothing():
    rows = [{**row, "status": "lost"} for row in table_of().rows]
    claims = FlyerImpedanceTable().claims(CampaignTable(pa.Table.from_pylist(rows)))
    assert {claim.verdict for claim in claims} == {Verdict.NOT_COMPARABLE}
    assert {claim.measured for claim in claims} == {""}


def test_of_some_changes_alone_nothing_is_decided():
    rows = [row for row in table_of().rows if row["behaviour"] == "rigid"]
    told = verdicts(CampaignTable(pa.Table.from_pylist(rows)))
    of_changes = next(claim for text, claim in told.items() if text.startswith("A mass or an inertia"))
    assert (of_changes.verdict, of_changes.measured) == (Verdict.NOT_COMPARABLE, "in 4 of 4 cases")


def test_a_quick_plan_decides_nothing_on_durations_and_has_no_table_of_them():
    claims, tables = verdicts(table_of(quick=True)), FlyerImpedanceTable().tables(table_of(quick=True))
    ratio = claims["A force takes the compliant robot ten times as far as the rigid one"]
    assert ratio.verdict is Verdict.NOT_COMPARABLE
    assert ratio.measured == "3.3 to 3.3 after 0.5 s"
    assert [table.title for table in tables] == ["Pushes of 0.5 s"]


def test_the_figures_are_numbered_as_in_the_thesis():
    numbers = [push.figure_number(behaviour) for behaviour in Behaviour for push in PUSHES]
    assert numbers == [f"fig. 4.{n}" for n in range(5, 17)]


def test_a_run_is_found_by_what_it_is_for():
    runs = PushRuns(table_of())
    push = PUSHES[1]
    usual, exact = runs.of(push, Behaviour.RIGID), runs.of(push, Behaviour.RIGID, exact=True)
    assert usual is not None
    assert exact is not None
    assert usual["navigation.position_noise"] is None
    assert exact["navigation.position_noise"] == 0.0
    assert runs.of(push, Behaviour.RIGID, duration=7.0) is None
    assert len(runs.all_of()) == 12


@pytest.mark.parametrize("behaviour", Behaviour)
def test_python_control_and_a_long_push_end_at_the_springs_stretch(behaviour: Behaviour):
    t = np.arange(0.0, 90.0, 0.016)
    p, R = predicted_errors(Push(Wrench.FORCE, Axis.Y), behaviour, 120.0, t)
    stiffness = (7.0 if behaviour is Behaviour.RIGID else 0.7) * ImpedanceParameters().model.mass
    assert p[-1] == pytest.approx([0.0, -5.0 / stiffness, 0.0], abs=1e-4)
    assert np.abs(R[-1]) == pytest.approx(np.zeros(3), abs=1e-3)
    assert not p[t < 1.0].any()


def test_without_records_there_are_no_curves(tmp_path: Path, sketches: Sketches, monkeypatch: pytest.MonkeyPatch):
    def predicted(_push: Push, behaviour: Behaviour, _duration: float) -> float:
        return 1.0 + behaviour

    monkeypatch.setattr(flyer_impedance_figures, "predicted_greatest", predicted)
    FlyerImpedanceTable().draw(table_of(), tmp_path, tmp_path)
    sketches.check("ratio")
