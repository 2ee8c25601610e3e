"""A sampled unit in a host with event mode: the host activates the unit's clock."""

import ctypes
import dataclasses
import xml.etree.ElementTree as ET
from fractions import Fraction

import pytest
from support.fmus.ctypes_host import BOOL, DOUBLE, ERROR, OK, SIZE, CtypesHost
from support.fmus.saved_states import deserialise, save, serialised
from support.fmus.unit_calls import SAMPLED, P, handle, tick, with_events
from support.fmus.validity import problems_of
from support.fmus.workshop import Workshop, expect_error
from support.wording import Wording

from handover.cosim.blocks.description import describe
from handover.cosim.master.master import Master
from handover.cosim.system.system import System
from handover.fmus.catalog import import_class
from handover.fmus.layout import DuplicateName, Layout

NAMES = ("y", "ticks", "t_seen")


def clock(host: CtypesHost) -> "ctypes.Array[ctypes.c_uint32]":
    return (ctypes.c_uint32 * 1)(host.references["sample_clock"])


def answer(host: CtypesHost) -> tuple[bool, bool, float]:
    """Return what the last step answered."""
    return host.early, host.event_needed, host.last_time


def test_the_clock_is_described_and_answers_for_itself(workshop: Workshop):
    assert problems_of(workshop.fmu(SAMPLED, 3)) == []
    host = with_events(workshop, SAMPLED)
    root = ET.parse(host.folder / "modelDescription.xml").getroot()
    (found,) = root.iter("Clock")
    counted = {"intervalCounter": "1", "resolution": "30", "shiftCounter": "0", "supportsFraction": "true"}
    wanted = {"causality": "input", "intervalVariability": "constant", "intervalDecimal": repr(P), **counted}
    assert found.attrib.items() >= {"name": "sample_clock", **wanted}.items()
    interface = root.find("CoSimulation")
    assert interface is not None
    assert interface.attrib["hasEventMode"] == interface.attrib["mightReturnEarlyFromDoStep"] == "true"
    assert not [v for v in root.iter() if "clocks" in v.attrib]

    interval, qualifier, active = DOUBLE(), ctypes.c_int(-1), BOOL(True)
    counter, resolution = ctypes.c_uint64(9), ctypes.c_uint64(9)
    asked, pointers = (clock(host), SIZE(1)), (ctypes.byref(counter), ctypes.byref(resolution))
    assert host.call("GetIntervalDecimal", *asked, ctypes.byref(interval), ctypes.byref(qualifier)) == OK
    assert (interval.value, qualifier.value) == (P, 1)
    assert host.call("GetIntervalFraction", *asked, *pointers, ctypes.byref(qualifier)) == OK
    assert Fraction(counter.value, resolution.value) == Fraction(1, 30)
    assert host.call("GetShiftDecimal", *asked, ctypes.byref(interval)) == OK
    assert interval.value == 0.0
    assert host.call("GetShiftFraction", *asked, *pointers) == OK
    assert (counter.value, resolution.value) == (0, 30)
    for is_active in (False, True):
        assert host.call("GetClock", *asked, ctypes.byref(active)) == OK
        assert active.value is is_active
        assert host.set_clock() == OK


def test_the_scalar_form_has_no_clock_and_ticks_by_itself(workshop: Workshop, wording: Wording):
    file = workshop.scalar_fmu(SAMPLED)
    assert problems_of(file) == []
    host = CtypesHost(file, 3)
    workshop.open.append(host)
    assert not host.instantiate(event_mode=True)
    wording.check(host.log[-1])
    assert "sample_clock" not in host.references
    assert host.instantiate()
    assert host.initialise() == OK
    host.references["sample_clock"] = 7
    expect_error(wording, host, host.set_clock())
    assert host.step(0.0, 3 * P) == OK
    assert host.get("ticks") == [3.0]


def test_what_no_clock_or_no_constant_one_allows_is_refused(workshop: Workshop, wording: Wording):
    host = with_events(workshop, SAMPLED)
    for what in ("IntervalDecimal", "IntervalFraction", "ShiftDecimal", "ShiftFraction"):
        values = [ctypes.byref(DOUBLE(1.0)) if "Decimal" in what else ctypes.byref(ctypes.c_uint64(1))] * 2
        given = values[: 1 + ("Fraction" in what)]
        expect_error(wording, host, host.call(f"Set{what}", clock(host), SIZE(1), *given))
    other = (ctypes.c_uint32 * 1)(1)
    expect_error(wording, host, host.call("SetClock", other, SIZE(1), ctypes.byref(BOOL(True))))
    unsampled = workshop.host("scalars:Scalars", 3)
    for function in ("GetClock", "SetClock", "GetShiftDecimal", "SetShiftDecimal"):
        expect_error(wording, unsampled, unsampled.call(function, other, SIZE(1), ctypes.byref(DOUBLE())))


def test_the_host_ticks_the_unit_and_the_outputs_are_new_at_once(workshop: Workshop):
    host, plain = with_events(workshop, SAMPLED), workshop.host(SAMPLED, 3)
    plain.initialise()
    for k in range(100):
        for h in (host, plain):
            h.set("u", [float(k) ** 0.5])
        tick(host)
        assert host.get("ticks") == [k + 1]
        assert host.step(k * P, P) == plain.step(k * P, P) == OK
        assert answer(host) == (False, True, k * P + P)
        assert [host.get(n) for n in ("y", "t_seen", "dt_seen")] == [plain.get(n) for n in ("y", "t_seen", "dt_seen")]
        assert host.call("EnterEventMode") == OK


def test_a_step_may_be_part_of_the_time_between_ticks(workshop: Workshop):
    host = with_events(workshop, SAMPLED)
    for k in range(30):
        if k % 3 == 0:
            tick(host)
        assert host.step(k * P / 3, P / 3) == OK
        assert host.event_needed == (k % 3 == 2)
        assert host.get("ticks") == [k // 3 + 1]
        if host.event_needed:
            assert host.call("EnterEventMode") == OK


def test_a_step_past_a_tick_returns_early_or_is_refused(workshop: Workshop, wording: Wording):
    host = with_events(workshop, SAMPLED, early_return=True)
    tick(host)
    assert host.step(0.0, 0.1) == OK
    assert answer(host) == (True, True, P)
    assert host.get("ticks") == [1.0]
    assert host.call("EnterEventMode") == OK
    tick(host)
    assert host.step(P, 0.1) == OK
    assert host.last_time == float(Fraction(2, 30))
    whole = with_events(workshop, SAMPLED)
    tick(whole)
    expect_error(wording, whole, whole.step(0.0, 0.05))
    assert whole.step(0.0, P) == OK


def test_a_host_that_has_activated_the_clock_is_notified_of_a_tick_once_and_then_refused(
    workshop: Workshop, wording: Wording
):
    host = with_events(workshop, SAMPLED, early_return=True)
    tick(host)
    assert host.step(0.0, P) == OK
    assert host.step(P, 0.01) == OK
    assert answer(host) == (True, True, P)
    expect_error(wording, host, host.step(P, 0.01))
    assert host.call("EnterEventMode") == OK
    tick(host)
    assert host.step(P, 0.01) == OK


@pytest.mark.parametrize("early_return", [False, True])
def test_for_a_host_that_knows_no_clocks_the_unit_ticks_by_itself_after_a_warning(
    workshop: Workshop, early_return: bool
):
    host = with_events(workshop, SAMPLED, early_return=early_return)
    assert host.call("SetDebugLogging", BOOL(True), SIZE(0), None) == OK
    handle(host)
    if early_return:
        assert host.step(0.0, P / 2) == OK
        assert answer(host) == (True, True, 0.0)
    for k in range(20):
        assert host.step(k * P / 2, P / 2) == OK
        assert (host.early, host.event_needed) == (False, False)
        assert host.get("ticks") == [k // 2 + 1]
    warnings = [line for line in host.log if "the unit ticks by itself, until the clock is activated" in line]
    assert len(warnings) == 1
    assert host.call("EnterEventMode") == OK
    tick(host)
    assert host.get("ticks") == [11.0]
    assert not early_return or (host.step(10 * P, 2 * P) == OK and host.early)
    assert early_return or host.step(10 * P, 2 * P) == ERROR


def test_a_tick_is_at_its_time_and_once_and_has_to_be_settled(workshop: Workshop, wording: Wording):
    host = with_events(workshop, SAMPLED)
    assert host.set_clock() == OK
    expect_error(wording, host, host.call("EnterStepMode"))
    expect_error(wording, host, host.set_clock(False))
    assert host.update() == OK
    assert host.set_clock() == ERROR
    assert host.get("ticks") == [1.0]
    assert host.call("EnterStepMode") == OK
    assert host.step(0.0, 0.01) == OK
    assert host.call("EnterEventMode") == OK
    expect_error(wording, host, host.set_clock())
    assert host.call("EnterStepMode") == OK


def test_outputs_of_an_active_clock_follow_the_inputs_until_the_tick_is_settled(workshop: Workshop):
    host = with_events(workshop, SAMPLED)
    assert host.set_clock() == OK
    for u in (1.0, 20.0, 3.0):
        host.set("u", [u])
        assert (host.get("y"), host.get("ticks")) == ([0.1 * u], [1.0])
    host.set("u", [4.0])
    handle(host)
    assert (host.get("y"), host.get("ticks")) == ([0.4], [1.0])
    assert host.step(0.0, P) == OK
    assert host.call("EnterEventMode") == OK
    tick(host)
    assert (host.get("y"), host.get("ticks")) == ([0.8], [2.0])


@pytest.mark.parametrize("read", [False, True])
def test_a_state_saved_while_the_clock_is_active_continues_there(workshop: Workshop, read: bool, wording: Wording):
    host, other = with_events(workshop, SAMPLED), workshop.host(SAMPLED, 3, event_mode=True)
    tick(host)
    assert host.step(0.0, P) == OK
    assert host.call("EnterEventMode") == OK
    assert host.set_clock() == OK
    if read:
        assert host.get("y") == [0.2]
    data = serialised(host, save(host))
    assert other.call("SetFMUState", deserialise(other, data)[1]) == OK
    assert other.get("ticks") == [2.0]
    for h in (host, other):
        h.set("u", [5.0])
        handle(h)
        assert (h.get("y"), h.get("ticks"), h.get("t_seen")) == ([0.6], [2.0], [P])
        assert h.step(P, P) == OK
    without = workshop.host(SAMPLED, 3)
    expect_error(wording, without, without.call("SetFMUState", deserialise(without, data)[1]))
    assert without.initialise() == OK


def test_the_clock_is_at_rest_after_the_end_a_reset_and_a_failure(workshop: Workshop, wording: Wording):
    host = with_events(workshop, SAMPLED)
    host.set("u", [float("nan")])
    assert host.set_clock() == OK
    expect_error(wording, host, host.update())
    host.set("u", [1.0])
    handle(host)
    host.step(0.0, P)
    host.call("EnterEventMode")
    host.set_clock()
    assert host.get("ticks") == [2.0]
    assert host.call("Reset") == OK
    assert host.initialise(7.0) == OK
    assert host.get("ticks") == [0.0]
    tick(host)
    assert (host.get("ticks"), host.get("t_seen")) == ([1.0], [7.0])
    ended = with_events(workshop, SAMPLED)
    assert ended.set_clock() == OK
    assert ended.call("Terminate") == OK
    assert (ended.get("y"), ended.get("ticks")) == ([0.0], [0.0])


def test_no_port_of_a_sampled_block_has_the_clocks_name():
    d = describe(import_class("support.sample_units.sampled:Sampled"))
    inputs = (dataclasses.replace(d.inputs[0], name="sample_clock"),)
    with pytest.raises(DuplicateName, match="sample_clock"):
        Layout(dataclasses.replace(d, inputs=inputs))
    Layout(dataclasses.replace(d, inputs=inputs, period=None))


def test_our_own_master_ticks_a_unit_as_it_would_by_itself(workshop: Workshop):
    """It ticks by itself where it is placed as sampled, and by the master's hand where it is not."""
    rows: dict[bool, list[list[float]]] = {True: [], False: []}
    for sampled, seen in rows.items():
        s = System()
        fmu = workshop.fmu(SAMPLED, 3)
        source, unit = (s.add(n, fmu, period=Fraction(1, 30), sampled=sampled) for n in ("source", "unit"))
        s.connect(source.y.y, unit.u.u)
        with Master(s) as master:
            master.run(Fraction(2), [lambda t, y: seen.append([t, *(float(y[f"unit.{n}"]) for n in NAMES)])])  # noqa: B023
    assert rows[True] == rows[False]
    assert rows[True][-1][2] == 61
