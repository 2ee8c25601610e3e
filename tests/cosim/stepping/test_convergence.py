"""Each algorithm on the two-mass oscillator: its order of convergence, and what it makes of a strong coupling."""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from support.cosim.oscillator import PLAIN, STATES, Floats, equal_masses

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.system import System

HOLD, LINEAR = Extrapolation.HOLD, Extrapolation.LINEAR


def order(system: Callable[[Fraction], System], options: MasterOptions) -> float:
    n = 50 if options.algorithm.iterates else 200  # steps that are iterated are dear, and in the limit with fewer
    coarse, fine = (PLAIN.error_of(system(Fraction(1, k)), options) for k in (n, 2 * n))
    return math.log2(coarse / fine)


@pytest.mark.parametrize("algorithm", list(Algorithm))
@pytest.mark.parametrize(("extrapolation", "expected"), [(HOLD, 1), (LINEAR, 2)])
def test_units_that_have_either_states_or_feedthrough(
    algorithm: Algorithm, extrapolation: Extrapolation, expected: int
):
    options = MasterOptions(algorithm=algorithm, extrapolation=extrapolation)
    assert order(lambda h: PLAIN.three_units(h, 3), options) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize(
    ("extrapolation", "fmi", "expected", "algorithm"),
    [
        *((HOLD, 2, 1, algorithm) for algorithm in Algorithm),
        *((LINEAR, 2, 2, algorithm) for algorithm in (Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL, Algorithm.NEWTON)),
        *((LINEAR, 3, 1, algorithm) for algorithm in (Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL)),  # one held value
    ],
)
def test_a_unit_with_both_state_and_feedthrough(
    algorithm: Algorithm, extrapolation: Extrapolation, fmi: int, expected: int
):
    options = MasterOptions(algorithm=algorithm, extrapolation=extrapolation)
    assert order(lambda h: PLAIN.two_units(h, fmi), options) == pytest.approx(expected, abs=0.1)


STRONGLY = equal_masses(k_c=4000.0, d_c=8.0)
PERIOD = Fraction(1, 10)
both = pytest.mark.parametrize("algorithm", [Algorithm.FIXED_POINT, Algorithm.NEWTON])


def end(system: System, stop: Fraction, algorithm: Algorithm, **options: Any) -> tuple[Floats, Master]:
    with Master(system, MasterOptions(algorithm=algorithm, **options)) as master:
        master.run(stop)
        return np.array([float(master.signals[name]) for name in STATES]), master


@both
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_iterated_coupling_reaches_the_monolithic_solution_where_others_diverge(algorithm: Algorithm, fmi: int):
    state, _ = end(STRONGLY.two_units(PERIOD, fmi), Fraction(2), algorithm)
    assert state == pytest.approx(STRONGLY.implicit(0.1, 20), abs=1e-6)
    assert np.max(np.abs(state)) < 1.5


def test_jacobi_diverges_there():
    assert np.max(np.abs(end(STRONGLY.two_units(PERIOD), Fraction(2), Algorithm.JACOBI)[0])) > 1e6


def test_plain_fixed_point_iteration_would_diverge_there():
    assert STRONGLY.gain(0.1) < -2.0


def test_newton_needs_fewer_iterations():
    _, slow = end(STRONGLY.two_units(PERIOD), Fraction(2), Algorithm.FIXED_POINT)
    _, fast = end(STRONGLY.two_units(PERIOD), Fraction(2), Algorithm.NEWTON)
    assert slow.iterations.steps == fast.iterations.steps == 20
    assert fast.iterations.iterations < slow.iterations.iterations
    assert fast.iterations.rollbacks < slow.iterations.rollbacks


def test_both_solvers_come_to_the_same_the_closer_the_tighter_the_tolerance():
    def apart(tolerance: float) -> float:
        one, _ = end(STRONGLY.two_units(PERIOD), Fraction(2), Algorithm.FIXED_POINT, tolerance=tolerance)
        other, _ = end(STRONGLY.two_units(PERIOD), Fraction(2), Algorithm.NEWTON, tolerance=tolerance)
        return float(np.linalg.norm(one - other))

    assert apart(1e-12) < 1e-10
    assert apart(1e-12) < apart(1e-3)
