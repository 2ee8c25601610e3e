"""Pushes on the free-flyer: the plan, and how claims and tables are judged, on tables that a test makes up."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.made_tables import made_table, one
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.scenarios.published.free_flyer import flyer_impedance
from handover.scenarios.published.free_flyer.flyer_impedance import FlyerImpedanceTable
from handover.scenarios.published.free_flyer.handovers import EXACT
from handover.scenarios.published.free_flyer.linear_model import PUSHES, Push, predicted_errors, predicted_greatest
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.robots.free_flyer.parameters import Axis, Behaviour, ImpedanceParameters, Wrench
from handover.scenarios.runs.campaign.table import CampaignTable

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
        row: dict[str, Any] = {name: given[name] for name in ("kind", "axis", "behaviour", "propulsion")}
        row |= {n: float(given[n]) if n in given else None for n in NUMBERS}
        push = Push(Wrench[given["kind"].upper()], Axis[given["axis"].upper()])
        behaviour, duration = Behaviour[given["behaviour"].upper()], float(given.get("duration", "0.5"))
        size = predicted_greatest(push, behaviour, min(duration, 2.0))
        if duration > 2.0:
            size = 0.01 * (longest if behaviour is Behaviour.COMPLIANT else 1.0)
        other = any("factor" in name for name in given)
        apart = off * (10.0 if other else 0.1 if "navigation.position_noise" in given else 1.0)
        row |= {f"greatest_{of}_error": size for of in ("position", "orientation")}
        row |= {f"disagreement_{of}": apart for of in ("position", "orientation")}
        row["settling_time"] = 3.0 if given["propulsion"] == "ideal" or back else None
        rows.append(row | {"success": True, "status": "done", "run": run.name})
    return made_table(rows)


@cache
def verdicts(table: CampaignTable) -> dict[str, Claim]:
    return {claim.claim: claim for claim in FlyerImpedanceTable().claims(table)}


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


def test_runs_that_were_lost_and_some_changes_alone_decide_nothing():
    lost = made_table({**row, "status": "lost"} for row in table_of().rows)
    assert {(c.verdict, c.measured) for c in verdicts(lost).values()} == {(Verdict.NOT_COMPARABLE, "")}
    reported = verdicts(made_table(row for row in table_of().rows if row["behaviour"] == "rigid"))
    of_changes = one(reported.values(), "A mass or an inertia")
    assert (of_changes.verdict, of_changes.measured) == (Verdict.NOT_COMPARABLE, "in 4 of 4 cases")


def test_a_quick_plan_decides_nothing_on_durations_and_has_no_table_of_them():
    ratio = verdicts(table_of(quick=True))["A force takes the compliant robot ten times as far as the rigid one"]
    assert (ratio.verdict, ratio.measured) == (Verdict.NOT_COMPARABLE, "3.3 to 3.3 after 0.5 s")
    assert [t.title for t in FlyerImpedanceTable().tables(table_of(quick=True))] == ["Pushes of 0.5 s"]


def test_the_figures_are_numbered_as_in_the_thesis():
    numbers = [push.figure_number(behaviour) for behaviour in Behaviour for push in PUSHES]
    assert numbers == [f"fig. 4.{n}" for n in range(5, 17)]


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

    monkeypatch.setattr(flyer_impedance, "predicted_greatest", predicted)
    FlyerImpedanceTable().draw(table_of(), tmp_path, tmp_path)
    sketches.check("ratio")
