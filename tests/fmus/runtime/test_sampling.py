"""A sampled unit in a host without event mode: it ticks by itself at start + k periods, whatever the host's step."""

import ctypes
import math
from fractions import Fraction

import pytest
from support.fmus.ctypes_host import OK, CtypesHost
from support.fmus.saved_states import called, deserialise, save, serialised
from support.fmus.unit_calls import SAMPLED, P
from support.fmus.workshop import Workshop, expect_error
from support.wording import Wording

both = pytest.mark.parametrize("fmi", [2, 3])


def started(workshop: Workshop, fmi: int, start: float = 0.0) -> CtypesHost:
    host = workshop.host(SAMPLED, fmi)
    assert host.initialise(start) == OK
    return host


@pytest.mark.parametrize("summed", [False, True], ids=["products", "sums"])
@pytest.mark.parametrize(
    "dt", [P, 2 * P, 7 * P, P / 2, P / 3, P / 10, 0.02, 0.05, 0.0123, 0.0333333333, 0.0333333334, 0.03333335, 0.0333333]
)
def test_each_tick_is_once_and_at_its_exact_time_with_the_exact_period(workshop: Workshop, dt: float, summed: bool):
    """Hosts multiply or sum steps, and write a period as a decimal that misses it by a little."""
    host, t, exact = started(workshop, 3 if summed else 2), 0.0, Fraction(dt).limit_denominator(10**4)
    for k in range(600):
        assert host.step(t, dt) == OK, host.log[-1]
        ticks = math.ceil(exact * (k + 1) * 30)
        assert [host.get(name) for name in ("ticks", "t_seen", "dt_seen")] == [[ticks], [(ticks - 1) / 30], [P]]
        t = t + dt if summed else (k + 1) * dt


@both
def test_ticks_are_counted_from_the_start_of_the_run(workshop: Workshop, fmi: int):
    start = 0.0125
    host = started(workshop, fmi, start)
    for k in range(6):
        assert host.step(start + k * P / 2, P / 2) == OK
        assert host.get("t_seen") == pytest.approx([start + k // 2 * P])
    assert host.call("Reset") == OK
    assert host.initialise(100.0) == OK
    for k in range(2):
        assert host.step(100.0 + k * P, P) == OK
        assert host.get("t_seen") == [100.0 + k * P]


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
    for k in range(31):
        assert one.step(k * dt, dt) == OK
    assert other.call(called(other, "SetFMUstate"), deserialise(other, serialised(one, save(one)))[1]) == OK
    for k in range(31, 70):
        assert one.step(k * dt, dt) == other.step(k * dt, dt) == OK
        assert one.get("t_seen") == other.get("t_seen")
        assert one.get("ticks") == other.get("ticks") == [k // 3 + 1]


@both
def test_a_step_of_no_end_of_ticks_and_clock_functions_are_refused_and_nothing_has_changed(
    workshop: Workshop, fmi: int, wording: Wording
):
    host = started(workshop, fmi)
    assert host.step(0.0, P) == OK
    for dt in (1e12, 1e300, 1.7e308):
        expect_error(wording, host, host.step(P, dt))
    if fmi == 3:
        expect_error(wording, host, host.set_clock())
        expect_error(wording, host, host.call("EnterEventMode"))
        u = ctypes.byref(ctypes.c_uint32(host.references["u"]))
        expect_error(wording, host, host.call("SetIntervalDecimal", u, ctypes.c_size_t(1), None))
    assert host.step(P, P) == OK
    assert host.get("ticks") == [2.0]
