"""A sampled unit in a host without event mode: it ticks by itself at start + k periods, whatever the host's step."""

import ctypes
import math
from fractions import Fraction

import pytest
from support.fmus.ctypes_host import ERROR, OK, CtypesHost
from support.fmus.saved_states import deserialise, save, serialised
from support.fmus.workshop import Workshop
from support.wording import Wording

SAMPLED = "sampled:Sampled"
P = 1 / 30

both = pytest.mark.parametrize("fmi", [2, 3])


def started(workshop: Workshop, fmi: int, start: float = 0.0) -> CtypesHost:
    host = workshop.host(SAMPLED, fmi)
    assert host.initialise(start) == OK
    return host


def run(host: CtypesHost, dt: float, steps: int, start: float = 0.0) -> list[tuple[float, float]]:
    """Return time and step of the last tick after each step; the host multiplies, as most do."""
    seen: list[tuple[float, float]] = []
    for k in range(steps):
        t = start + k * dt
        assert host.step(t, dt) == OK, host.log[-1]
        seen.append((host.get("t_seen")[0], host.get("dt_seen")[0]))
    return seen


@both
def test_a_step_of_one_period_is_one_tick_at_its_exact_time(workshop: Workshop, fmi: int):
    assert run(started(workshop, fmi), P, 300) == [(k / 30, P) for k in range(300)]


@both
@pytest.mark.parametrize("periods", [2, 7])
def test_a_step_of_several_periods_is_as_many_ticks_at_their_exact_times(workshop: Workshop, fmi: int, periods: int):
    host = started(workshop, fmi)
    seen = run(host, periods * P, 20)
    assert host.get("ticks") == [20 * periods]
    assert seen == [((periods * k + periods - 1) / 30, P) for k in range(20)]


@both
@pytest.mark.parametrize("parts", [2, 3, 10])
def test_steps_of_a_fraction_of_the_period_tick_once_a_period_and_hold_between(
    workshop: Workshop, fmi: int, parts: int
):
    host = started(workshop, fmi)
    seen = run(host, P / parts, 40 * parts)
    assert host.get("ticks") == [40.0]
    assert seen == [(i // parts / 30, P) for i in range(40 * parts)]


@both
@pytest.mark.parametrize("dt", [0.02, 0.05, 0.0123])
def test_a_step_that_has_nothing_to_do_with_the_period_ticks_when_ticks_are_due(
    workshop: Workshop, fmi: int, dt: float
):
    host = started(workshop, fmi)
    for k in range(200):
        assert host.step(k * dt, dt) == OK
        assert host.get("ticks")[0] == math.ceil(Fraction(dt) * (k + 1) * 30 - Fraction(1, 10**4))


@pytest.mark.parametrize("dt", [0.0333333333, 0.0333333334, 0.03333335, 0.0333333])
def test_a_period_written_as_a_decimal_ticks_once_in_each_step(workshop: Workshop, dt: float):
    host = started(workshop, 3)
    t = 0.0
    for k in range(600):
        assert host.step(t, dt) == OK
        assert host.get("ticks") == [k + 1.0]
        assert host.get("t_seen") == [k / 30]
        t += dt


@both
def test_ticks_are_counted_from_the_start_of_the_run(workshop: Workshop, fmi: int):
    start = 0.0125
    host = started(workshop, fmi, start)
    assert [t for t, _ in run(host, P / 2, 6, start)] == pytest.approx([start + k // 2 * P for k in range(6)])
    assert host.call("Reset") == OK
    assert host.initialise(100.0) == OK
    assert run(host, P, 2, 100.0) == [(100.0, P), (100.0 + P, P)]


@both
def test_the_inputs_of_the_step_in_which_a_tick_falls_are_what_counts(workshop: Workshop, fmi: int):
    host = started(workshop, fmi)
    for k, (u, y) in enumerate([(2.0, 0.2), (3.0, 0.2), (5.0, 0.2), (7.0, 0.9)]):
        host.set("u", [u])
        assert host.step(k * P / 3, P / 3) == OK
        assert host.get("y") == pytest.approx([y])


@both
def test_a_state_between_ticks_continues_with_its_count_in_another_instance(workshop: Workshop, fmi: int):
    dt = P / 3
    one, other = started(workshop, fmi), started(workshop, fmi, 5.0)
    run(one, dt, 31)
    status, state = deserialise(other, serialised(one, save(one)))
    assert status == OK
    assert other.call("SetFMUState" if fmi == 3 else "SetFMUstate", state) == OK
    for k in range(31, 70):
        assert one.step(k * dt, dt) == other.step(k * dt, dt) == OK
        assert one.get("t_seen") == other.get("t_seen")
        assert one.get("ticks") == other.get("ticks") == [k // 3 + 1]


def test_clock_functions_are_refused_outside_event_mode(workshop: Workshop, wording: Wording):
    host = started(workshop, 3)
    assert host.set_clock() == ERROR
    wording.check(host.log[-1])
    assert host.call("EnterEventMode") == ERROR
    wording.check(host.log[-1])
    reference = ctypes.c_uint32(host.references["u"])
    assert host.call("SetIntervalDecimal", ctypes.byref(reference), ctypes.c_size_t(1), None) == ERROR
    wording.check(host.log[-1])


@both
@pytest.mark.parametrize("dt", [1e12, 1e300, 1.7e308])
def test_a_step_of_no_end_of_ticks_is_refused_and_nothing_has_changed(
    workshop: Workshop, fmi: int, dt: float, wording: Wording
):
    host = started(workshop, fmi)
    assert host.step(0.0, P) == OK
    assert host.step(P, dt) == ERROR
    wording.check(host.log[-1])
    assert host.step(P, P) == OK
    assert host.get("ticks") == [2.0]
