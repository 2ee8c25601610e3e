"""Two masses, coupled by force and displacement: what each algorithm makes of them."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from two_masses import SIGNALS, Floats, TwoMasses

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.system import System

STIFF, SOFT = TwoMasses(k_c=4000.0, d_c=8.0), TwoMasses(k_c=2.0)
PERIOD = Fraction(1, 10)
LINEAR = Extrapolation.LINEAR
both = pytest.mark.parametrize("algorithm", [Algorithm.FIXED_POINT, Algorithm.NEWTON])


def end(system: System, stop: Fraction, algorithm: Algorithm, **options: Any) -> tuple[Floats, Master]:
    with Master(system, MasterOptions(algorithm=algorithm, **options)) as master:
        master.run(stop)
        return np.array([float(master.signals[name]) for name in SIGNALS]), master


@both
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_iterated_coupling_reaches_the_monolithic_solution_where_others_diverge(algorithm: Algorithm, fmi: int):
    state, _ = end(STIFF.system(PERIOD, fmi), Fraction(2), algorithm)
    assert state == pytest.approx(STIFF.implicit(0.1, 20), abs=1e-6)
    assert np.max(np.abs(state)) < 1.5


def test_jacobi_diverges_there():
    assert np.max(np.abs(end(STIFF.system(PERIOD), Fraction(2), Algorithm.JACOBI)[0])) > 1e6


def test_plain_fixed_point_iteration_would_diverge_there():
    assert STIFF.gain(0.1) < -2.0


def test_newton_needs_fewer_iterations():
    _, slow = end(STIFF.system(PERIOD), Fraction(2), Algorithm.FIXED_POINT)
    _, fast = end(STIFF.system(PERIOD), Fraction(2), Algorithm.NEWTON)
    assert slow.iterations.steps == fast.iterations.steps == 20
    assert fast.iterations.iterations < slow.iterations.iterations
    assert fast.iterations.rollbacks < slow.iterations.rollbacks


@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_each_algorithm_is_of_first_order_with_held_inputs(algorithm: Algorithm):
    errors: list[float] = []
    for n in (100, 200, 400):
        state, _ = end(SOFT.system(Fraction(1, n)), Fraction(1), algorithm)
        errors.append(float(np.linalg.norm(state - SOFT.exact(1.0))))
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.05)


def test_both_solvers_come_to_the_same_the_closer_the_tighter_the_tolerance():
    def apart(tolerance: float) -> float:
        one, _ = end(STIFF.system(PERIOD), Fraction(2), Algorithm.FIXED_POINT, tolerance=tolerance)
        other, _ = end(STIFF.system(PERIOD), Fraction(2), Algorithm.NEWTON, tolerance=tolerance)
        return float(np.linalg.norm(one - other))

    assert apart(1e-12) < 1e-10
    assert apart(1e-12) < apart(1e-3)


def test_inputs_on_lines_to_the_end_of_the_step_make_it_second_order():
    errors: list[float] = []
    for n in (50, 100, 200):
        state, _ = end(SOFT.system(Fraction(1, n), fmi=2), Fraction(1), Algorithm.NEWTON, extrapolation=LINEAR)
        errors.append(float(np.linalg.norm(state - SOFT.exact(1.0))))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)
