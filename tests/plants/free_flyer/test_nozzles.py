"""Twelve nozzles: what they can give, that it comes out as commanded, and how flappers and impellers delay it."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog
from support.restored_states import assert_continues
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.nozzles import (
    AXIS_OF_NOZZLE,
    DIRECTIONS,
    LARGEST_ANGLE,
    P_BN,
    WRENCH_OF_THRUST,
    Nozzles,
    lost_directions,
)
from handover.plants.free_flyer.robot.thrusters import (
    Inputs,
    InvalidThrusterParameters,
    Outputs,
    Params,
    Propulsion,
    Thrusters,
)

DT = 0.016
AT_ONCE = {"flapper_lag": 0.0, "flapper_rate": 1e9}
LIMITS = np.array([0.55, 0.39, 0.45, 0.064, 0.040, 0.075])
DEFAULT = Params()
NOZZLES = Nozzles(np.asarray(DEFAULT.thrust_factor), DEFAULT.impeller_speed)
SPEEDS = np.full((1, 2), DEFAULT.impeller_speed)


def thrusters(**changes: Any) -> Thrusters:
    return Thrusters(Params(propulsion=Propulsion.NOZZLES, **changes))


def command(wrench: Floats) -> Inputs:
    return Inputs(f_pose=wrench[:3], tau_pose=wrench[3:])


def wrench_of(y: Outputs) -> Floats:
    return np.concatenate([y.f_B, y.tau_B])


def walk(unit: Thrusters, wrench: Floats, steps: int, dt: float = DT) -> Floats:
    return np.array([wrench_of(unit.step(i * dt, dt, command(wrench))) for i in range(steps)])


def random_wrenches(count: int, size: float) -> Floats:
    """In all directions, of a length, where each axis is measured by its limit."""
    directions = np.random.default_rng(0).normal(size=(count, 6))
    return size * directions / np.linalg.norm(directions, axis=1, keepdims=True) * LIMITS


def test_modules_are_each_other_turned_about_z_blow_outwards_and_all_nozzles_of_an_axis_push_nowhere():
    turn = np.diag([-1.0, -1.0, 1.0])
    np.testing.assert_array_equal(P_BN[6:], P_BN[:6] @ turn)
    np.testing.assert_array_equal(DIRECTIONS[6:], DIRECTIONS[:6] @ turn)
    assert np.all(np.sum(P_BN * DIRECTIONS, axis=1) > 0.15)
    for axis in range(3):
        np.testing.assert_allclose(WRENCH_OF_THRUST @ (np.array(AXIS_OF_NOZZLE) == axis), 0.0, atol=1e-15)


def test_what_is_allocated_comes_out_again():
    scaled = 0
    for wrench in random_wrenches(300, 0.45):
        thrusts, less = NOZZLES.allocate(wrench)
        assert np.all(thrusts >= 0.0)
        scaled += less
        if not less:
            angles = NOZZLES.angles(thrusts)
            assert np.all((angles >= 0.0) & (angles <= LARGEST_ANGLE))
            np.testing.assert_allclose(NOZZLES.wrench(angles[None], SPEEDS)[0], wrench, atol=1e-12)
    assert scaled < 150


@pytest.mark.parametrize("size", [0.9, 40.0])
def test_what_there_is_not_is_scaled_down_in_its_direction_until_a_nozzle_or_a_plenum_is_at_its_end(size: float):
    for wrench in random_wrenches(25, size):
        thrusts, less = NOZZLES.allocate(wrench)
        assert less
        angles = NOZZLES.angles(thrusts)
        given = NOZZLES.wrench(angles[None], SPEEDS)[0]
        factor = float(given @ wrench / (wrench @ wrench))
        assert 0.0 < factor < 1.0
        np.testing.assert_allclose(given, factor * wrench, atol=1e-9)
        assert NOZZLES.allocate(0.999 * given)[1] is False
        assert NOZZLES.allocate(1.001 * given)[1] is True


def test_each_axis_alone_has_about_what_is_published_of_it_both_ways():
    factors = DEFAULT.thrust_factor
    most = np.array(
        [[NOZZLES.wrench(_angles(sign * 9.0 * e)[None], SPEEDS)[0] @ e for e in np.eye(6)] for sign in (1, -1)]
    )
    np.testing.assert_allclose(most[0], -most[1], rtol=1e-9)
    np.testing.assert_allclose(most[0, :3], LIMITS[:3], rtol=1e-3)  # fitted
    np.testing.assert_allclose(most[0, 3:] / LIMITS[3:], [0.898, 0.766, 0.875], atol=0.001)  # follows
    assert np.all((factors > 1.1) & (factors < 1.4))  # the published simulation has 1.25 for all


def _angles(wrench: Floats) -> Floats:
    return NOZZLES.angles(NOZZLES.allocate(wrench)[0])


def test_least_norm_allocation_needs_no_less_thrust_than_the_best_one_and_not_much_more():
    for wrench in random_wrenches(10, 0.3):
        own = float(np.sum(NOZZLES.allocate(wrench)[0]))
        found: Any = linprog(np.ones(12), A_eq=WRENCH_OF_THRUST, b_eq=wrench)
        best = float(found.fun)
        assert best <= own * (1 + 1e-9)
        assert own < 1.8 * best


def test_the_mean_over_a_step_is_the_command_where_flappers_turn_at_once():
    for wrench in random_wrenches(20, 0.25):
        y = walk(thrusters(**AT_ONCE), wrench, 2)
        np.testing.assert_allclose(y, np.tile(wrench, (2, 1)), atol=1e-12)


def test_a_step_command_lags_by_about_the_flappers_lag():
    for axis in range(6):
        wrench = (0.01, 0.75)[axis % 2] * LIMITS * np.eye(6)[axis]
        lag = np.sum(1.0 - walk(thrusters(), wrench, 60, 0.005)[:, axis] / wrench[axis]) * 0.005
        assert DEFAULT.flapper_lag * 0.8 < lag < DEFAULT.flapper_lag * 1.2


def test_flappers_turn_no_faster_than_their_rate():
    unit, rate, u = thrusters(flapper_rate=2.0), 2.0, command(np.array([0.5, 0.0, 0.2, 0.0, 0.01, 0.0]))
    angles = np.array([np.zeros(12)] + [unit.step(i * DT, DT, u).flapper_angles for i in range(60)])
    turned = np.abs(np.diff(angles, axis=0))
    assert np.max(turned) == pytest.approx(rate * DT, rel=1e-12)
    np.testing.assert_allclose(angles[-1], _angles(np.array([0.5, 0.0, 0.2, 0.0, 0.01, 0.0])), atol=1e-4)


@pytest.mark.parametrize("changes", [{"flapper_rate": 3.0}, {"impeller_speed_0": 50.0, "delay": 0.024}])
def test_the_whole_impulse_does_not_depend_on_the_step(changes: dict[str, float]):
    wrench = np.array([0.2, -0.1, 0.05, 0.01, -0.005, 0.01])
    fine, coarse = (
        dt * np.sum(walk(thrusters(**changes), wrench, round(0.8 / dt), dt), axis=0) for dt in (0.002, 0.016)
    )
    np.testing.assert_allclose(coarse, fine, atol=1e-5)


def test_thrust_grows_with_the_square_of_the_impellers_speed_as_they_start():
    unit, wrench = thrusters(impeller_speed_0=0.0, impeller_lag=1.0, **AT_ONCE), np.array([0.3, 0, 0, 0, 0, 0.0])
    walk(unit, wrench, 100, 0.005)
    y = unit.step(0.5, 1e-6, command(wrench))
    share = 1.0 - np.exp(-0.5)
    np.testing.assert_allclose(y.impeller_speeds, DEFAULT.impeller_speed * share, rtol=1e-5)
    np.testing.assert_allclose(wrench_of(y), share**2 * wrench, rtol=1e-5, atol=1e-12)


def test_axes_are_clipped_before_the_rest_is_scaled():
    y = walk(thrusters(**AT_ONCE), np.array([0.3, 0.0, 0.0, 0.0, 0.0, 3.0]), 1)[0]
    assert y[0] / y[5] == pytest.approx(0.3 / 0.075)
    assert y[0] > 0.1
    assert thrusters().step(0.0, DT, command(np.array([0.3, 0.0, 0.0, 0.0, 0.0, 3.0]))).saturated
    assert not thrusters().step(0.0, DT, command(np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0]))).saturated


def test_a_stuck_nozzle_is_missing_and_the_others_of_its_plenum_blow_harder():
    share = np.ones(12)
    share[0] = 0.0  # one of the two that push along -x, at +y
    wrench = np.array([-0.3, 0, 0, 0, 0, 0.0])
    y = walk(thrusters(flapper_range=share, **AT_ONCE), wrench, 1)[0]
    assert y[0] == pytest.approx(-0.15, abs=1e-9)
    assert y[5] == pytest.approx(-0.15 * 4.01 * 0.0254, abs=1e-9)
    both = np.array([-0.1, -0.1, 0, 0, 0, 0.0])  # nozzles 3 and 4 of the same plenum push along -y
    assert -0.125 < walk(thrusters(flapper_range=share, **AT_ONCE), both, 1)[0][1] < -0.105


def test_nozzles_whose_loss_takes_a_direction_away_are_refused_with_that_direction(wording: Wording):
    assert all(lost_directions([i]) == [] for i in range(12))
    share = np.ones(12)
    share[[0, 7]] = 0.0
    for closed in (share, np.zeros(12)):
        with pytest.raises(InvalidThrusterParameters) as refused:
            thrusters(flapper_range=closed)
        wording.check(refused.value)
    assert Thrusters(Params(flapper_range=share))


def test_goes_on_bit_for_bit_after_a_state_is_restored():
    there, back = command(np.array([0.3, 0, 0, 0.01, 0, 0.0])), command(np.array([-0.4, 0.1, 0, 0, 0.02, 0.0]))
    make = partial(thrusters, delay=0.025, impeller_speed_0=100.0)
    assert_continues(make, lambda n: there if n < 5 else back, [3, 5], 8)
