"""Inputs on lines through their sources' last two points."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import native_fmu
from support.cosim.observed_rows import observed_rows

from handover.cosim.stepping.extrapolation import SampleHistory
from handover.cosim.stepping.options import Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import System

LINEAR = MasterOptions(extrapolation=Extrapolation.LINEAR)
LINEAR_JACOBI = MasterOptions(extrapolation=Extrapolation.LINEAR, algorithm=Algorithm.JACOBI)


def integrated_ramp(slow: Fraction, fast: Fraction, **placing: Any) -> System:
    """Return a system in which a fast unit integrates what a slow one says: y = t."""
    s = System()
    ramp = s.add("ramp", native_fmu("ramp"), period=slow, **placing)
    integrator = s.add("integrator", native_fmu("integrator"), period=fast)
    s.connect(ramp.y.y, integrator.u.u)
    return s


def course(system: System, signal: str, stop: Fraction, options: MasterOptions = LINEAR) -> dict[float, float]:
    return {t: y for t, (y,) in observed_rows(system, stop, signal, options=options).items()}


@pytest.mark.parametrize("fast", [Fraction(1, 10), Fraction(1, 7)])
def test_a_fast_unit_gets_a_slow_ones_values_at_its_own_times(fast: Fraction):
    seen = course(integrated_ramp(Fraction(1), fast), "integrator.x", Fraction(3))
    assert len(seen) == 3 / fast + 1
    assert list(seen.values()) == pytest.approx([t * t / 2 for t in seen], rel=1e-12, abs=1e-12)


def test_a_line_begins_level_and_is_drawn_on():
    seen = course(integrated_ramp(Fraction(1), Fraction(1, 4)), "integrator.x", Fraction(3), LINEAR_JACOBI)
    assert [seen[t] for t in (0.5, 1.0, 1.5, 2.5, 3.0)] == [0.0, 0.0, 0.625, 2.625, 4.0]


def test_what_acts_at_instants_is_held():
    seen = course(integrated_ramp(Fraction(1), Fraction(1, 4), sampled=True), "integrator.x", Fraction(3))
    assert seen[3.0] == 1 + 2 + 3


@pytest.mark.parametrize(("interpolates", "error"), [(True, 0.0), (False, 2 * (1 / 4) ** 2 / 12)])
def test_input_derivatives_are_used_where_a_unit_of_fmi2_interpolates(interpolates: bool, error: float):
    """x'' = 2 t + 1; a force that is held at its value in the middle of steps of h makes x lead by 2 h^2 t / 12."""
    s = System()
    ramp = s.add("ramp", native_fmu("ramp", 2), period=Fraction(1, 4))
    mass = s.add("mass", native_fmu("mass", 2, canInterpolateInputs=interpolates), period=Fraction(1, 4))
    s.connect(ramp.y.y, mass.u.f, LinearTransformation(2.0, 1.0))
    x = course(s, "mass.x", Fraction(1))[1.0]
    assert x == pytest.approx(1 / 3 + 1 / 2 + error, abs=1e-9)


def test_places_on_a_line_do_not_depend_on_how_late_it_is():
    def line_from(first: int) -> SampleHistory:
        values = np.array([1.0, 2.0])
        history = SampleHistory(values)
        history.record(first)
        values[...] = (1.3, -0.4)
        history.record(first + 3)
        return history

    early, late = 21, 21 * 10**13
    for half_ticks in range(-6, 20):
        a, b = (line_from(first).at(2 * first + half_ticks) for first in (early, late))
        assert a.tolist() == b.tolist() == pytest.approx([1 + 0.05 * half_ticks, 2 - 0.4 * half_ticks])
    assert line_from(late).rate(0.1).tolist() == pytest.approx([1.0, -8.0])
