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


@pytest.mark.parametrize(
    ("algorithm", "extrapolation", "expected"),
    [
        (Algorithm.JACOBI, HOLD, 1),
        (Algorithm.NEWTON, HOLD, 1),
        (Algorithm.GAUSS_SEIDEL, LINEAR, 2),
        (Algorithm.FIXED_POINT, LINEAR, 2),
    ],
)
def test_units_that_have_either_states_or_feedthrough(
    algorithm: Algorithm, extrapolation: Extrapolation, expected: int
):
    options = MasterOptions(algorithm=algorithm, extrapolation=extrapolation)
    assert order(lambda h: PLAIN.three_units(h, 3), options) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize(
    ("extrapolation", "fmi", "expected", "algorithm"),
    [
        (HOLD, 2, 1, Algorithm.FIXED_POINT),
        *((LINEAR, 2, 2, algorithm) for algorithm in (Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL, Algorithm.NEWTON)),
        (LINEAR, 3, 1, Algorithm.GAUSS_SEIDEL),  # one held value
    ],
)
def test_a_unit_with_both_state_and_feedthrough(
    algorithm: Algorithm, extrapolation: Extrapolation, fmi: int, expected: int
):
    options = MasterOptions(algorithm=algorithm, extrapolation=extrapolation)
    assert order(lambda h: PLAIN.two_units(h, fmi), options) == pytest.approx(expected, abs=0.1)


STRONGLY = equal_masses(k_c=4000.0, d_c=8.0)


def end(algorithm: Algorithm, **options: Any) -> tuple[Floats, Master]:
    with Master(STRONGLY.two_units(Fraction(1, 10), 3), MasterOptions(algorithm=algorithm, **options)) as master:
        master.run(Fraction(2))
        return np.array([float(master.signals[name]) for name in STATES]), master


def test_the_iterated_coupling_reaches_the_monolithic_solution_where_others_diverge():
    (slow, one), (fast, other) = end(Algorithm.FIXED_POINT), end(Algorithm.NEWTON)
    for state in (slow, fast):
        assert state == pytest.approx(STRONGLY.implicit(0.1, 20), abs=1e-6)
    assert np.max(np.abs(slow)) < 1.5
    assert one.iterations.steps == other.iterations.steps == 20
    assert other.iterations.iterations < one.iterations.iterations
    assert other.iterations.rollbacks < one.iterations.rollbacks
    assert np.max(np.abs(end(Algorithm.JACOBI)[0])) > 1e6
    assert STRONGLY.gain(0.1) < -2.0  # plain fixed-point iteration would diverge, too


def test_both_solvers_come_to_the_same_the_closer_the_tighter_the_tolerance():
    def apart(tolerance: float) -> float:
        ends = (end(a, tolerance=tolerance)[0] for a in (Algorithm.FIXED_POINT, Algorithm.NEWTON))
        return float(np.linalg.norm(next(ends) - next(ends)))

    assert apart(1e-12) < min(1e-10, apart(1e-3))
