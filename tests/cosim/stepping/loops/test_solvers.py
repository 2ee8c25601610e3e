import json
from collections.abc import Callable

import numpy as np
import pytest

from handover.cosim.blocks.ports import Floats
from handover.cosim.stepping.interface import Magnitudes
from handover.cosim.stepping.solvers import FixedPoint, InterfaceNewton, InterfaceSolver, Unsolved

Make = Callable[..., InterfaceSolver]


def made(
    kind: type[FixedPoint] | type[InterfaceNewton], n: int, tolerance: float = 1e-9, most: int = 60
) -> InterfaceSolver:
    return kind(Magnitudes(tolerance, np.full(n, 1e-3), np.full(n, 1e-6)), most)


both = pytest.mark.parametrize("kind", [FixedPoint, InterfaceNewton])


@both
@pytest.mark.parametrize("gain", [-30.0, -1.0, 0.9, 4.0])
def test_a_single_signal_settles_whatever_its_gain(kind: type[FixedPoint], gain: float):
    solution = made(kind, 1).solve(lambda x: gain * x + 1.0, np.zeros(1))
    assert solution.x[0] == pytest.approx(1.0 / (1.0 - gain), rel=1e-8)
    assert solution.iterations <= 4


@both
def test_coupled_signals_of_unlike_size_settle(kind: type[FixedPoint]):
    A = np.array([[0.2, 3e-7, 0.0], [1e5, -0.4, 2e3], [0.0, 1e-5, 0.1]])
    b = np.array([1e-3, 1e4, 0.5])
    solution = made(kind, 3).solve(lambda x: A @ x + b, np.zeros(3))
    assert solution.x == pytest.approx(np.linalg.solve(np.eye(3) - A, b), rel=1e-7)


def nonlinear(x: Floats) -> Floats:
    return np.array([np.cos(x[1]) - 0.8 * x[0], 1.5 * np.sin(x[0]) + 0.3 * x[1] ** 2])


def test_newton_needs_fewer_iterations_than_the_fixed_point():
    x = np.array([0.5, 0.5])
    slow, fast = made(FixedPoint, 2).solve(nonlinear, x), made(InterfaceNewton, 2).solve(nonlinear, x)
    assert fast.x == pytest.approx(slow.x, rel=1e-7)
    assert fast.iterations < slow.iterations


def test_a_kept_jacobian_spares_differences():
    calls = 0

    def g(x: Floats) -> Floats:
        nonlocal calls
        calls += 1
        return np.array([[0.0, -3.0], [2.0, 0.5]]) @ x + 1.0

    solver = made(InterfaceNewton, 2, tolerance=1e-6)
    solver.solve(g, np.zeros(2))
    assert calls == 4  # at the guess, two differences, at the solution
    solver.solve(g, np.ones(2))
    assert calls == 6


def test_a_jacobian_that_no_longer_holds_is_taken_anew():
    solver = made(InterfaceNewton, 1)
    solver.solve(lambda x: 0.5 * x + 1.0, np.zeros(1))
    assert solver.solve(lambda x: -50.0 * x + 1.0, np.zeros(1)).x[0] == pytest.approx(1.0 / 51.0, rel=1e-8)


def test_given_derivatives_take_the_place_of_differences():
    calls: list[float] = []

    def g(x: Floats) -> Floats:
        calls.append(float(x[0]))
        return -4.0 * x + 1.0

    made(InterfaceNewton, 1).solve(g, np.zeros(1), lambda: np.array([[-4.0]]))
    assert calls == pytest.approx([0.0, 0.2])


@both
def test_signals_without_a_solution_are_distinguished(kind: type[FixedPoint]):
    with pytest.raises(Unsolved) as caught:
        made(kind, 2).solve(lambda x: np.array([x[0] + 1.0, 0.5 * x[1]]), np.zeros(2))
    assert caught.value.residual[0] == pytest.approx(1.0)
    with pytest.raises(Unsolved, match="diverge beyond all bounds"):
        made(kind, 1).solve(lambda x: x + np.inf, np.zeros(1))


def test_newton_reports_a_gain_of_one_immediately():
    with pytest.raises(Unsolved, match="gain of 1") as caught:
        made(InterfaceNewton, 1).solve(lambda x: x + 1.0, np.zeros(1))
    assert caught.value.iterations == 1


def test_a_signal_at_rest_is_measured_against_its_floor_and_then_against_what_it_was():
    magnitudes = Magnitudes(1e-3, np.array([0.1]), np.array([1e-6]))
    assert not magnitudes.moving(np.zeros(1), np.array([9e-5]))[0]
    assert magnitudes.moving(np.zeros(1), np.array([2e-4]))[0]
    magnitudes.learn(np.array([-5.0]))
    assert not magnitudes.moving(np.zeros(1), np.array([4e-3]))[0]


@both
def test_what_is_learnt_survives_as_json(kind: type[FixedPoint]):
    first, second = made(kind, 2), made(kind, 2)
    first.solve(nonlinear, np.array([0.5, 0.5]))
    second.set_state(json.loads(json.dumps(first.get_state())))
    x = np.array([0.6, 0.4])
    assert first.solve(nonlinear, x).x.tolist() == second.solve(nonlinear, x).x.tolist()
