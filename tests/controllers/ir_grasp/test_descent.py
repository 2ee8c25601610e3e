from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from handover.controllers.ir_grasp.descent import (
    Descent,
    Verdict,
    bounded_step,
    broyden_update,
    minimum_norm_step,
    printed_step,
    step_scaling,
)
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


RNG = np.random.default_rng(0)
JACOBIAN: NDArray[np.float64] = RNG.normal(0.0, 0.5, (2, 4))
R = np.array([0.03, -0.02])
SCALE = np.array([0.02, 0.02, 0.1, 0.1])
WIDE = (np.full(4, -10.0), np.full(4, 10.0))


def test_without_damping_a_step_brings_the_linear_residual_to_zero_and_is_the_shortest_in_the_declared_scale():
    dx = minimum_norm_step(JACOBIAN, R, SCALE, 1e-9)
    assert np.allclose(R + JACOBIAN @ dx, 0.0, atol=1e-9)
    _, _, null = np.linalg.svd(JACOBIAN * SCALE)
    for direction in null[2:]:
        assert abs(direction @ (dx / SCALE)) < 1e-9


def test_a_damped_step_minimises_the_linear_cost_plus_the_damping():
    damping = 0.01
    dx = minimum_norm_step(JACOBIAN, R, SCALE, damping)
    Jz: NDArray[np.float64] = JACOBIAN * SCALE
    transposed = np.transpose(Jz)
    assert np.allclose(dx, -SCALE * np.linalg.solve(transposed @ Jz + damping**2 * np.eye(4), transposed @ R))
    assert np.linalg.norm(dx / SCALE) < np.linalg.norm(minimum_norm_step(JACOBIAN, R, SCALE, 1e-9) / SCALE)


def test_a_step_from_a_jacobian_of_no_rank_stays_finite():
    assert np.array_equal(minimum_norm_step(np.zeros((2, 4)), R, SCALE, 0.004), np.zeros(4))
    assert np.all(np.isfinite(minimum_norm_step(np.ones((2, 4)), R, SCALE, 0.004)))


def test_the_printed_step_is_the_left_pseudo_inverse_and_where_there_is_none_the_moore_penrose_one():
    tall: NDArray[np.float64] = RNG.normal(0.0, 1.0, (6, 4))
    transposed, r = np.transpose(tall), RNG.normal(0.0, 0.01, 6)
    assert np.allclose(printed_step(tall, r, np.ones(4)), -np.linalg.inv(transposed @ tall) @ transposed @ r)
    assert np.allclose(printed_step(JACOBIAN, R, np.ones(4)), -np.linalg.pinv(JACOBIAN) @ R)
    assert printed_step(JACOBIAN, R, np.array([1.0, 1.0, 0.0, 1.0]))[2] == 0.0


def test_broydens_update_explains_the_move_and_changes_nothing_across_it():
    dx, dr = np.array([0.003, -0.002, 0.02, 0.01]), np.array([0.004, -0.001])
    updated = broyden_update(JACOBIAN, dx, dr, SCALE)
    assert np.allclose(updated @ dx, dr)
    _, _, across = np.linalg.svd((dx / SCALE)[None, :])
    for z in across[1:]:
        assert np.allclose(updated @ (SCALE * z), JACOBIAN @ (SCALE * z))
    assert np.array_equal(broyden_update(JACOBIAN, np.zeros(4), dr, SCALE), JACOBIAN)


def test_alpha_is_cut_so_that_no_input_exceeds_its_largest_step():
    most = np.array([0.01, 0.01, 0.1, 0.1])
    assert step_scaling(np.array([0.005, 0.0, 0.0, 0.0]), 0.8, most) == 0.8
    assert step_scaling(np.array([0.005, -0.04, 0.0, 0.0]), 0.8, most) == pytest.approx(0.25)
    assert step_scaling(np.zeros(4), 0.8, most) == 0.8


def test_an_input_at_its_limit_stays_and_the_others_take_over():
    JACOBIAN, r = np.array([[-1.0, -1.0, 0.0, 0.0]]), np.array([0.004])
    limits = (WIDE[0], np.array([0.001, 10.0, 10.0, 10.0]))

    def step(scale: NDArray[np.float64] | None, limits: Any, alpha: float = 1.0) -> NDArray[np.float64]:
        given: dict[str, Any] = {"damping": 1e-9, "max_step": np.ones(4), "alpha": alpha}
        return bounded_step(JACOBIAN, r, np.zeros(4), scale=scale, limits=limits, **given)

    assert np.allclose(step(np.ones(4), WIDE), [0.002, 0.002, 0.0, 0.0])
    assert np.allclose(step(np.ones(4), WIDE, alpha=0.5), [0.001, 0.001, 0.0, 0.0])
    assert np.allclose(step(np.ones(4), limits), [0.0, 0.004, 0.0, 0.0])
    assert np.allclose(step(None, limits), [0.0, 0.004, 0.0, 0.0])  # as printed
