import numpy as np
import pytest
from numpy.typing import NDArray

from handover.controllers.ir_grasp.moves import Move, Probing

SIZES = (0.004, 0.004, 0.04, 0.03)


def residuals(x: tuple[float, ...]) -> NDArray[np.float64]:
    """Return two distances of an analytic scene, in m."""
    p_x, p_y, yaw, sigma = x
    return np.array(
        [
            0.05 - p_x + 0.3 * p_y**2 + 0.08 * np.sin(yaw) - 0.1 * sigma,
            0.04 + p_y - 0.05 * yaw - 0.12 * sigma**2 + p_x * p_y,
        ]
    )


def jacobian(x: tuple[float, ...]) -> NDArray[np.float64]:
    p_x, p_y, yaw, sigma = x
    return np.array([[-1.0, 0.6 * p_y, 0.08 * np.cos(yaw), -0.1], [p_y, 1.0 + p_x, -0.05, -0.24 * sigma]])


@pytest.mark.parametrize("reached", [1.0, 0.8])
def test_probing_gives_the_jacobian_of_an_analytic_scene_in_four_moves_and_one_back(reached: float):
    """By the measured move, not by the commanded one."""
    x = (0.02, -0.01, 0.2, 0.15)
    probing, moves = Probing(SIZES), 0
    probing.begin(x, x, residuals(x))
    while not probing.done:
        there = tuple(a + reached * (b - a) for a, b in zip(x, probing.command, strict=True))
        probing.take(there, residuals(there), [True, True])
        moves += 1
    assert moves == 4
    assert probing.command == x
    assert np.allclose(probing.jacobian, jacobian(x), atol=0.005)


def test_a_finger_that_loses_the_object_is_asked_by_the_opposite_move():
    x = (0.0, 0.0, 0.0, 0.2)
    probing = Probing(SIZES)
    probing.begin(x, x, residuals(x))
    commands: list[tuple[float, ...]] = []
    while not probing.done:
        commands.append(probing.command)
        lost = probing.command[0] > x[0]
        r = residuals(probing.command)
        probing.take(probing.command, np.array([0.055, r[1]]) if lost else r, [not lost, True])
    assert [c[0] for c in commands[:2]] == [0.004, -0.004]
    assert len(commands) == 5
    assert np.allclose(probing.jacobian, jacobian(x), atol=0.005)


def test_what_stays_unseen_both_ways_counts_as_independent():
    x = (0.0, 0.0, 0.0, 0.2)
    probing = Probing(SIZES)
    probing.begin(x, x, residuals(x))
    while not probing.done:
        probing.take(probing.command, residuals(probing.command), [False, True])
    assert np.array_equal(probing.jacobian[0], np.zeros(4))
    assert np.allclose(probing.jacobian[1], jacobian(x)[1], atol=0.005)


def test_an_open_hand_is_not_commanded_to_open_further():
    x = (0.0, 0.0, 0.0, 0.0)
    probing, closures = Probing(SIZES), list[float]()
    probing.begin(x, x, residuals(x))
    while not probing.done:
        closures.append(probing.command[3])
        probing.take(probing.command, residuals(probing.command), [probing.command[3] == 0.0, True])
    assert closures == [0.0, 0.0, 0.0, 0.03, 0.0]
    assert np.array_equal(probing.jacobian[:, 3] == 0.0, [True, False])


def test_a_move_waits_for_the_encoders_rests_and_averages_scans():
    move, goal = Move((1e-3,) * 4, calm=2), (0.1, 0.0, 0.0, 0.0)
    move.start(goal, 3, 100)
    for x in (0.0, 0.05):
        assert move.advance((x, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0)) is None
    readings = [move.advance((0.1, 0.0, 0.0, 0.0), (float(k), 10.0, 20.0)) for k in range(5)]
    assert readings[:4] == [None] * 4
    last = readings[4]
    assert last is not None
    assert last.x == pytest.approx(goal)
    assert last.ticks == pytest.approx((3.0, 10.0, 20.0))  # mean of 2, 3 and 4


def test_a_move_that_does_not_arrive_is_over_when_its_time_is_up():
    move = Move((1e-3,) * 4, calm=1)
    move.start((0.1, 0.0, 0.0, 1.0), 0, 10)
    taken = [move.advance((0.0,) * 4, (0.0,) * 3) for _ in range(11)]
    assert taken[:10] == [None] * 10
    assert taken[10] is not None
