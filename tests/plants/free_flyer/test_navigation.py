"""The errors of the navigation's estimate against their laws, its delay and rate, and its state."""

import itertools
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.restored_states import assert_continues, flat
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.navigation import (
    Inputs,
    InvalidNavigationParameters,
    Navigation,
    NoOrientation,
    Outputs,
    Params,
)

DT = 0.016
EXACT = Params(position_noise=0.0, attitude_noise=0.0, velocity_noise=0.0, rate_noise=0.0)
WHATS = ("position", "attitude", "velocity", "rate")
P_0, V, W = np.array([0.3, -0.07, 0.1]), np.array([0.2, -0.1, 0.05]), np.array([0.0, 0.6, -0.8])
UNLIKE_EACH_OTHER: dict[str, Any] = {"position": 0.001, "attitude": 0.002, "velocity": 0.003, "rate": 0.004}
DRIFTING = replace(EXACT, drift_time=2.0, **{f"{what}_drift": x for what, x in UNLIKE_EACH_OTHER.items()})


def quaternion_of(turn: Rotation) -> Floats:
    return np.asarray(turn.as_quat(scalar_first=True), dtype=np.float64)


def turned(q: Floats) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


@cache
def truth(t: float) -> Inputs:
    """Return a robot that flies straight and turns evenly; its velocities grow with time, unlike a real one's."""
    return Inputs(p_WB=P_0 + t * V, q_WB=quaternion_of(Rotation.from_rotvec(t * W)), v_WB=V + t * W, w_WB=W + t * V)


def courses(p: Params, steps: int, dt: float = DT) -> list[Outputs]:
    """Return the estimates at the start and after each step."""
    unit = Navigation(p)
    return [unit.outputs(0.0, truth(0.0)), *(unit.step(i * dt, dt, truth((i + 1) * dt)) for i in range(steps))]


def off(y: Outputs, u: Inputs) -> Floats:
    """Return by how much an estimate is off: position, rotation vector in the robot's frame, velocities."""
    turn: Floats = np.asarray((turned(u.q_WB).inv() * turned(y.q_WB_meas)).as_rotvec(), dtype=np.float64)
    return np.concatenate([y.p_WB_meas - u.p_WB, turn, y.v_WB_meas - u.v_WB, y.w_WB_meas - u.w_WB], axis=-1)


def errors(p: Params, steps: int, dt: float = DT) -> Floats:
    """Return by how much the estimates are off, a row a communication point."""
    ys, us = courses(p, steps, dt), [truth(i * dt) for i in range(steps + 1)]
    given = {name: np.array([getattr(y, name) for y in ys]) for name in vars(ys[0])}
    true = {name: np.array([getattr(u, name) for u in us]) for name in vars(us[0])}
    return off(Outputs(**given), Inputs(**true))


def each_axis(what: dict[str, float]) -> Floats:
    return np.repeat([what[name] for name in WHATS], 3)


def test_noise_is_that_of_numpys_generator_by_the_seed():
    rng, ys = np.random.default_rng(7), courses(Params(seed=7), 3)
    for i, y in enumerate(ys):
        n, u = rng.standard_normal(12), truth(i * DT)
        np.testing.assert_array_equal(y.p_WB_meas, u.p_WB + 0.001 * n[:3])
        np.testing.assert_array_equal(y.v_WB_meas, u.v_WB + 0.001 * n[6:9])
        np.testing.assert_array_equal(y.w_WB_meas, u.w_WB + 0.002 * n[9:])
        turn = turned(u.q_WB) * Rotation.from_rotvec(0.002 * n[3:6])
        assert (turn.inv() * turned(y.q_WB_meas)).magnitude() < 1e-8


def test_an_exact_estimate_is_the_truth_to_the_last_bit():
    for i, y in enumerate(courses(EXACT, 20)):
        u = truth(i * DT)
        np.testing.assert_array_equal([y.p_WB_meas, y.v_WB_meas, y.w_WB_meas], [u.p_WB, u.v_WB, u.w_WB])
        np.testing.assert_allclose(y.q_WB_meas, u.q_WB, atol=1e-15)


def test_a_bias_is_constant_in_a_run_and_gaussian_over_the_seeds():
    biased = replace(EXACT, **{f"{what}_bias": x for what, x in UNLIKE_EACH_OTHER.items()})
    one_run = errors(replace(biased, seed=3), 50)
    np.testing.assert_allclose(one_run, np.tile(one_run[0], (51, 1)), atol=1e-15)
    over_seeds = [off(Navigation(replace(biased, seed=n)).outputs(0.0, truth(0.0)), truth(0.0)) for n in range(600)]
    normal = np.array(over_seeds) / each_axis(UNLIKE_EACH_OTHER)
    np.testing.assert_allclose(np.std(normal, axis=0), 1.0, rtol=0.12)
    assert np.all(np.abs(np.mean(normal, axis=0)) < 4.0 / np.sqrt(600))
    assert np.mean(np.abs(normal) < 1.0) == pytest.approx(0.6827, abs=0.025)  # of a normal distribution
    assert np.max(np.abs(np.corrcoef(np.transpose(normal)) - np.eye(12))) < 0.17


def test_drift_is_stationary_from_the_start_and_forgets_in_its_correlation_time():
    steps, lag = 25, 12  # 2 s, and some half of the correlation time
    runs = np.array([errors(replace(DRIFTING, seed=n), steps, 5 * DT) for n in range(100)])
    runs /= each_axis(UNLIKE_EACH_OTHER)
    for row in (0, lag, steps):
        assert np.std(runs[:, row]) == pytest.approx(1.0, rel=0.08)
    assert np.mean(runs[:, : steps - lag] * runs[:, lag:steps]) == pytest.approx(np.exp(-lag * 5 * DT / 2.0), abs=0.06)
    assert np.std(np.diff(runs, axis=1)) == pytest.approx(np.sqrt(2.0 * (1.0 - np.exp(-5 * DT / 2.0))), rel=0.04)


def test_bias_and_drift_do_not_change_the_noise():
    noise = errors(Params(seed=2), 30)
    slow = replace(DRIFTING, rate_bias=0.01, position_bias=0.02, seed=2)
    together = errors(replace(slow, **{f"{w}_noise": getattr(Params(), f"{w}_noise") for w in WHATS}), 30)
    np.testing.assert_allclose(together, noise + errors(slow, 30), atol=1e-7)  # small turns do not quite commute
    assert np.std(together - noise) > 0.001


@pytest.mark.parametrize(("delay", "dt"), [(0.016, 0.016), (0.05, 0.016), (0.0037, 0.016), (0.0037, 0.002)])
def test_a_delay_is_exact_on_a_ramp(delay: float, dt: float):
    for i, y in enumerate(courses(replace(EXACT, delay=delay), 60, dt)):
        np.testing.assert_allclose(off(y, truth(max(i * dt - delay, 0.0))), 0.0, atol=3e-8)


def test_a_delayed_estimate_keeps_the_quaternions_sign():
    ys = courses(replace(EXACT, delay=0.05), 900)
    assert all(a.q_WB_meas @ b.q_WB_meas > 0.99 for a, b in itertools.pairwise(ys))
    assert min(y.q_WB_meas[0] for y in ys) < -0.99


@pytest.mark.parametrize(("rate", "delay"), [(5.0, 0.13), (62.5, 0.0), (40.0, 0.05), (1000.0, 0.0)])
def test_an_estimate_is_held_between_updates(rate: float, delay: float):
    for i, y in enumerate(courses(replace(EXACT, update_rate=rate, delay=delay), 100)):
        updated = np.floor(i * DT * rate + 1e-6) / rate
        np.testing.assert_allclose(off(y, truth(max(updated - delay, 0.0))), 0.0, atol=3e-8)


def test_a_held_estimate_has_one_noise():
    ys = np.array([flat(y) for y in courses(Params(update_rate=5.0), 125)])
    assert len(np.unique(ys, axis=0)) == 11  # one at the start, and ten in two seconds


def test_goes_on_bit_for_bit_after_a_state_is_restored_and_asking_for_outputs_changes_nothing():
    p = replace(DRIFTING, seed=3, position_bias=0.01, attitude_noise=0.002, update_rate=13.0, delay=0.1)
    assert_continues(lambda: Navigation(p), lambda i: truth((i + 1) * DT), [5, 20], 40)
    asked, other = Navigation(p), Navigation(p)
    other.outputs(0.0, truth(0.0))
    for i in range(20):
        now, after = truth(i * DT), truth((i + 1) * DT)
        np.testing.assert_array_equal(flat(asked.outputs(i * DT, now)), flat(asked.outputs(i * DT, now)))
        np.testing.assert_array_equal(flat(asked.step(i * DT, DT, after)), flat(other.step(i * DT, DT, after)))


@pytest.mark.parametrize(
    "changes",
    [
        {"delay": -0.1, "update_rate": -1.0, "attitude_bias": 3.0},
        {"delay": float("nan")},
        {"position_drift": 0.01},
        *({f"{what}_{name}": -0.001 for what in WHATS} for name in ("noise", "bias", "drift")),
    ],
    ids=["range", "nan", "drift", "negative noise", "negative bias", "negative drift"],
)
def test_what_no_navigation_has_is_refused_all_at_once(changes: dict[str, Any], wording: Wording):
    with pytest.raises(InvalidNavigationParameters) as refused:
        Navigation(replace(EXACT, **changes))
    assert len(refused.value.faults) == len(changes)
    wording.check(refused.value)


@pytest.mark.parametrize("changes", [{}, {"delay": 0.1, "update_rate": 13.0}])
def test_an_orientation_that_is_none_is_refused_by_name(changes: dict[str, Any], wording: Wording):
    unit, none = Navigation(replace(EXACT, **changes)), replace(truth(0.0), q_WB=np.zeros(4))
    with pytest.raises(NoOrientation) as refused:
        unit.outputs(0.0, none)
    wording.check(refused.value)
    unit.outputs(0.0, truth(0.0))
    with pytest.raises(NoOrientation) as refused:
        unit.step(0.0, DT, none)
    wording.check(refused.value)
