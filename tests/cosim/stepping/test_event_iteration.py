"""Units in event mode change each other's inputs until none changes any more, at one instant."""

from fractions import Fraction

import pytest
from native_units import native_fmu
from observed_rows import grid, observed_rows

from handover.cosim.fmu.failures import UnsettledEvents
from handover.cosim.master.master import Master
from handover.cosim.stepping.event_iteration import MAX_ITERATIONS
from handover.cosim.system.system import System


def followers(most: int) -> System:
    """Two units in a ring, each of which gives one more than it gets, up to a limit."""
    s = System()
    a, b = s.add("a", native_fmu("follower"), most=most), s.add("b", native_fmu("follower"), most=most)
    s.connect(a.y.count, b.u.count_in)
    s.connect(b.y.count, a.u.count_in)
    return s


@pytest.mark.parametrize("most", [1, 7, 50])
def test_an_iteration_between_two_units_settles_at_one_instant(most: int):
    rows = observed_rows(followers(most), Fraction(1, 2), "a.count", "b.count")
    assert list(rows) == grid(10)[:6]
    assert set(rows.values()) == {(most, most)}


def test_units_that_never_settle_are_named():
    with pytest.raises(UnsettledEvents) as failure:
        observed_rows(followers(10**6), Fraction(1), "a.count")
    assert set(failure.value.units) <= {"a", "b"}
    assert failure.value.t == 0.0
    assert f"no end of events after {MAX_ITERATIONS} iterations; these do not settle: a, b" in str(failure.value)


def test_a_unit_that_wants_ever_more_iterations_is_named():
    s = System()
    s.add("quiet", native_fmu("watch"))
    s.add("asker", native_fmu("asker"))
    with pytest.raises(
        UnsettledEvents, match=r"asker: fmi3UpdateDiscreteStates at t = 0.1 s answered no end"
    ) as failure:
        observed_rows(s, Fraction(1), "asker.count")
    assert failure.value.units == ("asker",)


@pytest.mark.parametrize(("stalls", "points"), [(0, 6), (3, 6)])
def test_a_unit_may_return_at_once_some_times(stalls: int, points: int):
    s = System()
    s.add("staller", native_fmu("staller"), most=stalls)
    s.add("other", native_fmu("integrator"), u=1.0)
    rows = observed_rows(s, Fraction(1, 2), "staller.count", "other.x")
    assert list(rows) == grid(10)[:points]
    assert rows[0.5] == (stalls, pytest.approx(0.5))


def test_a_unit_that_does_not_get_on_is_named():
    s = System()
    s.add("staller", native_fmu("staller"), most=10**6)
    with pytest.raises(UnsettledEvents, match=r"staller: fmi3DoStep at t = 0.2 s answered no end of events after"):
        observed_rows(s, Fraction(1, 2), "staller.count")


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_may_end_the_simulation(fmi: int):
    s = System()
    s.add("quitter", native_fmu("quitter", fmi))
    times: list[float] = []
    with Master(s) as master:
        master.run(Fraction(1), [lambda t, _: times.append(t)])
        assert master.ended is not None
        told = str(master.ended)
    assert told == f"quitter: fmi{fmi}DoStep at t = 0.2 s asked to end the simulation"
    assert times == [0.0, 0.1, 0.2, pytest.approx(0.3)]
