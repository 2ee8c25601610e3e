"""Which units iterate: those of a cycle that are due together; the others step once, in the order of the data flow."""

import json
from collections import Counter
from fractions import Fraction

import pytest
from support.cosim.native_units import native_fmu
from support.cosim.oscillator import equal_masses
from support.wording import Wording

from handover.cosim.exceptions import ScheduleError
from handover.cosim.fmu.instance import Instance
from handover.cosim.master.master import Master
from handover.cosim.stepping.iteration import NotConverged
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

both = pytest.mark.parametrize("algorithm", [Algorithm.FIXED_POINT, Algorithm.NEWTON])
PERIOD = Fraction(1, 10)


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Count the steps of each unit."""
    counted: Counter[str] = Counter()
    step = Instance.step

    def counting(self: Instance, t: float, dt: float) -> None:
        counted[self.name] += 1
        step(self, t, dt)

    monkeypatch.setattr(Instance, "step", counting)
    return counted


def test_units_off_the_cycle_step_once(steps: Counter[str]):
    s = System()
    after = s.add("after", native_fmu("gain"), period=PERIOD)
    ramp = s.add("ramp", native_fmu("integrator"), u=1.0, period=PERIOD)
    a = s.add("a", native_fmu("sum"), a2=-3.0, period=PERIOD)
    b = s.add("b", native_fmu("integrator"), period=PERIOD)
    s.connect(ramp.y.x, a.u.u1)
    s.connect(b.y.x, a.u.u2)
    s.connect(a.y.y, b.u.u)
    s.connect(b.y.x, after.u.u)
    with Master(s, MasterOptions(algorithm=Algorithm.NEWTON, cpu_times=True)) as master:
        master.run(Fraction(1, 2))
        x = [float(master.signals[name]) for name in ("b.x", "after.y")]
        count = master.iterations
    assert steps["ramp"] == steps["after"] == 5
    assert steps["a"] == steps["b"] == 5 + count.rollbacks > 5
    assert x[0] == x[1]
    expected = 0.0
    for k in range(1, 6):  # implicit Euler of x' = t - 3 x
        expected = (expected + 0.1 * 0.1 * k) / 1.3
    assert x[0] == pytest.approx(expected, rel=1e-7)
    assert [len(master.cpu[name]) for name in ("a", "b", "ramp")] == [5, 5, 5]


def test_units_that_save_no_state_are_refused_where_they_lie_in_a_cycle(wording: Wording):
    options = MasterOptions(algorithm=Algorithm.NEWTON)
    with pytest.raises(ScheduleError) as caught:
        Master(equal_masses(k_c=1.0).two_units(PERIOD, canGetAndSetFMUState=False), options)
    wording.check(caught.value)
    s = System()
    first, second = (s.add(n, native_fmu("gain", canGetAndSetFMUState=False)) for n in ("first", "second"))
    s.connect(first.y.y, second.u.u)
    with Master(s, options) as master:
        master.run(Fraction(1))
        assert not master.iterates
        assert str(master.iterations) == "no step was iterated"


@both
def test_what_does_not_converge_is_reported_with_signals_time_and_iterations(algorithm: Algorithm):
    system = equal_masses(k_c=4000.0).two_units(PERIOD)
    options = MasterOptions(algorithm=algorithm, tolerance=1e-15, max_iterations=2)
    with pytest.raises(NotConverged) as caught, Master(system, options) as master:
        master.run(Fraction(1))
    e = caught.value
    assert e.t == 0.0
    assert e.iterations == 2
    assert [name for name, _ in e.moving] == ["b.f -> a.f"]
    assert "a, b: iterating at t = 0 s found no solution in 2 iterations" in str(e)
    assert json.loads(json.dumps(e.as_data()))["moving"].keys() == {"b.f -> a.f"}


@both
def test_units_of_several_rates_iterate_with_those_of_their_own(algorithm: Algorithm):
    s = equal_masses(k_c=100.0).two_units(PERIOD)
    slow = s.add("slow", native_fmu("integrator"), period=Fraction(1, 5))
    back = s.add("back", native_fmu("gain"), a=-0.5, b=1.0, period=Fraction(1, 5))
    s.connect(slow.y.x, back.u.u)
    s.connect(back.y.y, slow.u.u)
    with Master(s, MasterOptions(algorithm=algorithm)) as master:
        master.run(Fraction(1))
        assert float(master.signals["slow.x"]) == pytest.approx(2.0 * (1.0 - 1.1**-5))  # implicit Euler of 1 - x/2
        assert master.iterations.steps == 10 + 5


@both
def test_a_cycle_may_hold_signals_that_are_not_real(algorithm: Algorithm):
    s = System()
    a, b = s.add("a", native_fmu("discrete_passer"), count_in=3), s.add("b", native_fmu("discrete_passer"))
    s.connect(a.y.count, b.u.count_in)
    s.connect(b.y.truth, a.u.truth_in)
    with Master(s, MasterOptions(algorithm=algorithm)) as master:
        master.run(Fraction(1, 2))
        assert int(master.signals["b.count"]) == 3
        assert master.iterations.steps == 0
