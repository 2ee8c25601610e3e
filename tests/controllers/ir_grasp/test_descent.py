from typing import Any

import numpy as np
import pytest

from handover.controllers.ir_grasp.descent import Descent, Verdict
from handover.controllers.ir_grasp.parameters import Params

X = (-0.2, 0.0, 0.0, 0.0)
J = np.array([[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])


def descent(**params: Any) -> Descent:
    d = Descent(Params(**params))
    d.measure(X, np.array([0.02, 0.02]), X)
    d.probed(J)
    return d


def test_a_linear_scene_is_solved_in_few_steps():
    d, x = descent(alpha=1.0), X
    verdict, steps = Verdict.STEP, 0
    while verdict is Verdict.STEP:
        x = d.next_command(x)
        r = np.array([0.02, 0.02]) + J @ (np.array(x) - X)
        verdict, steps = d.judge(x, r, x), steps + 1
    assert verdict is Verdict.REACHED
    assert steps == d.steps <= 3


def test_a_step_that_raises_the_cost_leads_back_and_halves_alpha():
    d = descent(max_step=np.ones(4))
    first = np.array(d.next_command(X)) - X
    assert d.judge(X, np.array([0.021, 0.02]), (0.0,) * 4) is Verdict.BACK
    assert d.best == X
    d.measure(X, np.array([0.02, 0.02]), X)
    d.probed(J)
    assert np.allclose(np.array(d.next_command(X)) - X, 0.5 * first)


@pytest.mark.parametrize(
    ("params", "distances", "verdicts"),
    [
        ({"stalled_steps": 3}, (0.01998, 0.01996, 0.01994), (Verdict.STEP, Verdict.STEP, Verdict.STALLED)),
        ({"max_steps": 2}, (0.018, 0.015), (Verdict.STEP, Verdict.USED_UP)),
        ({"probe_every": 2}, (0.018, 0.015), (Verdict.STEP, Verdict.PROBE)),
        ({"literal": True}, (0.018, 0.012), (Verdict.PROBE, Verdict.REACHED)),
    ],
)
def test_verdicts_on_steps(params: dict[str, Any], distances: tuple[float, ...], verdicts: tuple[Verdict, ...]):
    """What ends a descent, and when its Jacobian is probed anew: as printed, at every step."""
    d = descent(**params)
    assert tuple(d.judge(X, np.full(2, r), X) for r in distances) == verdicts


def test_commands_stay_within_reach():
    low = Descent(Params()).within_reach((-9.0, -9.0, -9.0, -9.0))
    assert np.allclose(low, [-0.3, -0.1, -0.6, 0.0])
    assert Descent(Params()).within_reach((9.0, 9.0, 9.0, 9.0))[3] == Params().sigma_limit


@pytest.mark.parametrize(("ahead", "held"), [(0.0, False), (0.0999, True)])
def test_a_step_that_would_leave_the_reach_is_held_back(ahead: float, held: bool):
    d, p = Descent(Params()), Params()
    x = (float(p.p_WH_pregrasp[0]) + ahead, float(p.p_WH_pregrasp[1]), p.yaw_pregrasp, p.sigma_pregrasp)
    d.measure(x, np.array([0.04, 0.04]), x)
    d.probed(np.array([[-1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0]]))  # both distances fall as the hand goes ahead
    assert d.next_command(x)[0] <= p.p_WH_pregrasp[0] + p.reach[0]
    assert d.is_held is held
