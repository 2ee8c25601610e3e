"""The order of convergence of each algorithm on the two-mass oscillator, against the matrix exponential."""

import math
from collections.abc import Callable
from fractions import Fraction

import pytest
from oscillator import PLAIN

from handover.cosim.stepping.options import Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.system import System

HOLD, LINEAR = Extrapolation.HOLD, Extrapolation.LINEAR


def order(system: Callable[[Fraction], System], options: MasterOptions) -> float:
    coarse, fine = (PLAIN.error_of(system(Fraction(1, n)), options) for n in (200, 400))
    return math.log2(coarse / fine)


@pytest.mark.parametrize("algorithm", list(Algorithm))
@pytest.mark.parametrize(("extrapolation", "expected"), [(HOLD, 1), (LINEAR, 2)])
def test_units_that_have_either_states_or_feedthrough(
    algorithm: Algorithm, extrapolation: Extrapolation, expected: int
):
    options = MasterOptions(algorithm=algorithm, extrapolation=extrapolation)
    assert order(lambda h: PLAIN.three_units(h, 3), options) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL])
@pytest.mark.parametrize(
    ("extrapolation", "fmi", "expected"),
    [(HOLD, 2, 1), (LINEAR, 2, 2), (LINEAR, 3, 1)],
    ids=["held", "interpolating", "one held value for state and feedthrough"],
)
def test_a_unit_with_both_state_and_feedthrough(
    algorithm: Algorithm, extrapolation: Extrapolation, fmi: int, expected: int
):
    options = MasterOptions(algorithm=algorithm, extrapolation=extrapolation)
    assert order(lambda h: PLAIN.two_units(h, fmi), options) == pytest.approx(expected, abs=0.1)
