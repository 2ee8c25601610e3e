"""Inputs that follow values over time: the same under all couplings, at instants, at events, beside connections."""

from fractions import Fraction

import numpy as np
import pytest
from native_units import native_fmu

from handover.cosim.exceptions import NotExportable, WiringError
from handover.cosim.master.master import Master
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, MasterOptions
from handover.cosim.system.system import System
from handover.cosim.system.time_series import TimeSeries

JUMP = TimeSeries([0.0, 0.5, 0.5, 1.0], [[0.0], [1.0], [3.0], [3.0]], linear=True)


@pytest.mark.parametrize(
    ("t", "held", "linear"),
    [(-1.0, 2.0, 2.0), (0.0, 2.0, 2.0), (0.5, 2.0, 3.0), (1.0, 7.0, 7.0), (1.5, 7.0, 6.0), (2.0, 5.0, 5.0), (9, 5, 5)],
)
def test_values_are_held_or_on_lines_and_jump_where_a_time_is_given_twice(t: float, held: float, linear: float):
    times, values = [0.0, 1.0, 1.0, 2.0], [[2.0], [4.0], [7.0], [5.0]]
    assert TimeSeries(times, values, linear=False).at(t).tolist() == [held]
    assert TimeSeries(times, values, linear=True).at(t).tolist() == [linear]


@pytest.mark.parametrize(
    ("times", "values"),
    [([], []), ([0.0, 1.0], [[1.0]]), ([1.0, 0.0], [[1.0], [1.0]]), ([0.0], [[np.nan]]), ([np.inf], [[1.0]])],
)
def test_a_series_that_is_none_is_refused(times: list[float], values: list[list[float]]):
    with pytest.raises(ValueError, match=r"series|row a time|descend|finite"):
        TimeSeries(times, values, linear=True)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_a_mass_gets_the_momentum_of_what_it_follows(algorithm: Algorithm, fmi: int):
    system = System()
    mass = system.add("mass", native_fmu("mass", fmi))
    follower = system.add("follower", native_fmu("gain", fmi), period=mass.period)
    system.connect(mass.y.v, follower.u.u)
    system.follow(mass.u.f, JUMP)
    with Master(system, MasterOptions(algorithm=algorithm)) as master:
        master.run(Fraction(1))
        steps = 2 * np.arange(50) * 0.01  # held over each step of 10 ms
        assert master.signals["mass.v"] == pytest.approx(0.01 * (steps.sum() + 50 * 3.0), abs=1e-12)
        assert master.signals["follower.y"] == pytest.approx(master.signals["mass.v"], abs=0.031)


def test_an_adaptive_step_follows_too():
    system = System()
    mass = system.add("mass", native_fmu("mass", 2))
    system.follow(mass.u.f, TimeSeries([0.0, 1.0], [[0.0], [2.0]], linear=True))
    control = AdaptiveStep(relative=1e-6, largest=Fraction(1, 50))
    with Master(system, MasterOptions(adaptive=control)) as master:
        master.run(Fraction(1))
        assert master.signals["mass.v"] == pytest.approx(1.0, abs=0.02)


def test_a_sampled_unit_acts_on_the_value_of_the_instant():
    system = System()
    unit = system.add("unit", native_fmu("gain", 2), sampled=True)
    system.follow(unit.u.u, TimeSeries([0.0, 1.0], [[0.0], [10.0]], linear=True))
    with Master(system) as master:
        master.run(Fraction(1, 2))
        assert master.signals["unit.y"] == pytest.approx(5.0)


def test_a_discrete_input_that_changes_is_an_event():
    system = System()
    watch = system.add("watch", native_fmu("watch"))
    system.follow(watch.u.count_in, TimeSeries([0.0, 0.3, 0.6], [[0], [4], [5]], linear=False))
    with Master(system) as master:
        master.run(Fraction(1))
        assert master.signals["watch.changed"] == pytest.approx(0.6)
        assert (master.signals["watch.count"], master.signals["watch.changes"]) == (5, 2)


def test_what_cannot_follow_is_refused_with_its_name():
    system = System()
    mass, spring = system.add("mass", native_fmu("mass", 3)), system.add("gain", native_fmu("gain", 3))
    binary = system.add("binary", native_fmu("binary_passer"))
    passer = system.add("passer", native_fmu("discrete_passer", 3))
    system.connect(spring.y.y, mass.u.f)
    for target in (mass.u.f, mass.u.g, mass.u.x, binary.u.u, passer.u.count_in):
        system.follow(target, JUMP)
    system.follow(spring.u.u, TimeSeries([0.0], [[1.0, 2.0]], linear=True))
    with pytest.raises(WiringError) as refused:
        system.check()
    assert refused.value.faults == (
        "mass.f: fed by gain.y, so it cannot follow values over time",
        "mass.g: mass has no input 'g'; valid: f",
        "mass.x: mass.x is an output, not an input",
        "binary.u: a binary cannot follow values over time",
        "passer.count_in: its values are held: it does not vary continuously",
        "gain.u: 2 values a time where 1 is right",
    )


def test_an_ssp_has_no_place_for_it(tmp_path_factory: pytest.TempPathFactory):
    system = System()
    system.follow(system.add("mass", native_fmu("mass", 2)).u.f, JUMP)
    with pytest.raises(NotExportable, match=r"mass\.f follows values over time"):
        write_ssp(system, tmp_path_factory.mktemp("ssp") / "a.ssp", "a")
