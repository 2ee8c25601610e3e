"""A sampled unit in a host with event mode: the host activates the unit's clock."""

import ctypes
import dataclasses
import xml.etree.ElementTree as ET
from fractions import Fraction

import fmpy
import numpy as np
import pytest
from support.exchange import drive
from support.fmus.ctypes_host import BOOL, DOUBLE, ERROR, OK, SIZE, CtypesHost
from support.fmus.saved_states import deserialise, save, serialised
from support.fmus.unit_calls import SAMPLED, P, tick
from support.fmus.validity import problems_of
from support.fmus.workshop import Workshop
from support.wording import Wording

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.variable import Kind
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS, import_class
from handover.fmus.layout import DuplicateName, Layout


def started(workshop: Workshop, block: str = SAMPLED, *, early_return: bool = False) -> CtypesHost:
    """Return a host in the event mode that follows initialisation."""
    host = workshop.host(block, 3, event_mode=True, early_return=early_return)
    assert host.initialise() == OK
    return host


def clock(host: CtypesHost) -> "ctypes.Array[ctypes.c_uint32]":
    return (ctypes.c_uint32 * 1)(host.references["sample_clock"])


def test_the_model_description_names_the_clock(workshop: Workshop):
    file = workshop.fmu(SAMPLED, 3)
    assert problems_of(file) == []
    host = workshop.host(SAMPLED, 3)
    root = ET.parse(host.folder / "modelDescription.xml").getroot()
    (found,) = root.iter("Clock")
    assert (
        found.attrib.items()
        >= {
            "name": "sample_clock",
            "causality": "input",
            "intervalVariability": "constant",
            "intervalDecimal": repr(1 / 30),
            "supportsFraction": "true",
            "intervalCounter": "1",
            "resolution": "30",
            "shiftCounter": "0",
        }.items()
    )
    interface = root.find("CoSimulation")
    assert interface is not None
    assert interface.attrib["hasEventMode"] == interface.attrib["mightReturnEarlyFromDoStep"] == "true"
    assert not [v for v in root.iter() if "clocks" in v.attrib]


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
    assert host.set_clock() == ERROR
    wording.check(host.log[-1])
    assert host.step(0.0, 3 * P) == OK
    assert host.get("ticks") == [3.0]


def test_the_clock_answers_for_itself(workshop: Workshop):
    host = started(workshop)
    reference, interval, qualifier = clock(host), DOUBLE(), ctypes.c_int(-1)
    counter, resolution = ctypes.c_uint64(9), ctypes.c_uint64(9)
    asked = (reference, SIZE(1))
    assert host.call("GetIntervalDecimal", *asked, ctypes.byref(interval), ctypes.byref(qualifier)) == OK
    assert (interval.value, qualifier.value) == (1 / 30, 1)
    pointers = [ctypes.byref(x) for x in (counter, resolution)]
    assert host.call("GetIntervalFraction", *asked, *pointers, ctypes.byref(qualifier)) == OK
    assert Fraction(counter.value, resolution.value) == Fraction(1, 30)
    assert host.call("GetShiftDecimal", *asked, ctypes.byref(interval)) == OK
    assert interval.value == 0.0
    assert host.call("GetShiftFraction", *asked, *pointers) == OK
    assert (counter.value, resolution.value) == (0, 30)
    active = BOOL(True)
    assert host.call("GetClock", *asked, ctypes.byref(active)) == OK
    assert not active.value
    assert host.set_clock() == OK
    assert host.call("GetClock", *asked, ctypes.byref(active)) == OK
    assert active.value


@pytest.mark.parametrize("what", ["IntervalDecimal", "IntervalFraction", "ShiftDecimal", "ShiftFraction"])
def test_a_constant_clock_is_not_changed(workshop: Workshop, what: str, wording: Wording):
    host = started(workshop)
    values = [ctypes.byref(DOUBLE(1.0)) if "Decimal" in what else ctypes.byref(ctypes.c_uint64(1))] * 2
    assert host.call(f"Set{what}", clock(host), SIZE(1), *values[: 1 + ("Fraction" in what)]) == ERROR
    wording.check(host.log[-1])


def test_a_unit_that_is_not_sampled_has_no_clock(workshop: Workshop, wording: Wording):
    host = workshop.host("scalars:Scalars", 3)
    reference = (ctypes.c_uint32 * 1)(0)
    for function in ("GetClock", "SetClock", "GetShiftDecimal", "SetShiftDecimal"):
        assert host.call(function, reference, SIZE(1), ctypes.byref(DOUBLE())) == ERROR
        wording.check(host.log[-1])


def test_the_host_ticks_the_unit_and_the_outputs_are_new_at_once(workshop: Workshop):
    host, plain = started(workshop), workshop.host(SAMPLED, 3)
    plain.initialise()
    for k in range(100):
        for h in (host, plain):
            h.set("u", [float(k) ** 0.5])
        tick(host)
        assert host.get("ticks") == [k + 1]
        assert host.step(k * P, P) == plain.step(k * P, P) == OK
        assert (host.event_needed, host.early, host.last_time) == (True, False, k * P + P)
        assert [host.get(n) for n in ("y", "t_seen", "dt_seen")] == [plain.get(n) for n in ("y", "t_seen", "dt_seen")]
        assert host.call("EnterEventMode") == OK


def test_a_step_may_be_part_of_the_time_between_ticks(workshop: Workshop):
    host = started(workshop)
    for k in range(30):
        if k % 3 == 0:
            tick(host)
        assert host.step(k * P / 3, P / 3) == OK
        assert host.event_needed == (k % 3 == 2)
        assert host.get("ticks") == [k // 3 + 1]
        if host.event_needed:
            assert host.call("EnterEventMode") == OK


def test_a_step_past_a_tick_returns_early_at_the_tick(workshop: Workshop):
    host = started(workshop, early_return=True)
    tick(host)
    assert host.step(0.0, 0.1) == OK
    assert (host.early, host.event_needed, host.last_time) == (True, True, P)
    assert host.get("ticks") == [1.0]
    assert host.call("EnterEventMode") == OK
    tick(host)
    assert host.step(P, 0.1) == OK
    assert host.last_time == float(Fraction(2, 30))


def test_a_step_past_a_tick_is_refused_where_it_must_not_return_early(workshop: Workshop, wording: Wording):
    host = started(workshop)
    tick(host)
    assert host.step(0.0, 0.05) == ERROR
    wording.check(host.log[-1])
    assert host.step(0.0, P) == OK


def test_a_host_that_has_activated_the_clock_is_reported_of_a_tick_once_and_then_refused(
    workshop: Workshop, wording: Wording
):
    host = started(workshop, early_return=True)
    tick(host)
    assert host.step(0.0, P) == OK
    assert host.step(P, 0.01) == OK
    assert (host.early, host.event_needed, host.last_time) == (True, True, P)
    assert host.step(P, 0.01) == ERROR
    wording.check(host.log[-1])
    assert host.call("EnterEventMode") == OK
    tick(host)
    assert host.step(P, 0.01) == OK


@pytest.mark.parametrize("early_return", [False, True])
def test_for_a_host_that_knows_no_clocks_the_unit_ticks_by_itself_after_a_warning(
    workshop: Workshop, early_return: bool
):
    host = started(workshop, early_return=early_return)
    assert host.call("SetDebugLogging", BOOL(True), SIZE(0), None) == OK
    assert host.update() == OK
    assert host.call("EnterStepMode") == OK
    if early_return:
        assert host.step(0.0, P / 2) == OK
        assert (host.early, host.event_needed, host.last_time) == (True, True, 0.0)
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


def test_fmpys_own_simulation_which_knows_no_clocks_is_the_same_with_event_mode(workshop: Workshop):
    runs = [
        fmpy.simulate_fmu(
            str(workshop.fmu(SAMPLED, 3)), stop_time=1.0, output_interval=P, use_event_mode=mode, output=["y", "ticks"]
        )
        for mode in (False, True)
    ]
    assert runs[0]["ticks"].tolist() == list(range(31))
    assert np.array_equal(runs[0], runs[1])


def test_the_clock_is_refused_at_a_wrong_time_and_what_is_right_is_reported(workshop: Workshop, wording: Wording):
    host = started(workshop)
    tick(host)
    assert host.step(0.0, 0.01) == OK
    assert host.call("EnterEventMode") == OK
    assert host.set_clock() == ERROR
    wording.check(host.log[-1])
    assert host.call("EnterStepMode") == OK


def test_a_tick_is_once_and_has_to_be_settled(workshop: Workshop, wording: Wording):
    host = started(workshop)
    assert host.set_clock() == OK
    assert host.call("EnterStepMode") == ERROR
    wording.check(host.log[-1])
    assert host.set_clock(False) == ERROR
    wording.check(host.log[-1])
    assert host.update() == OK
    assert host.set_clock() == ERROR
    assert host.get("ticks") == [1.0]


def test_a_reference_that_is_not_the_clocks_is_refused(workshop: Workshop, wording: Wording):
    host = started(workshop)
    assert host.call("SetClock", (ctypes.c_uint32 * 1)(1), SIZE(1), ctypes.byref(BOOL(True))) == ERROR
    wording.check(host.log[-1])


def test_outputs_of_an_active_clock_follow_the_inputs_until_the_tick_is_settled(workshop: Workshop):
    host = started(workshop)
    assert host.set_clock() == OK
    for u in (1.0, 20.0, 3.0):
        host.set("u", [u])
        assert host.get("y") == [0.1 * u]
        assert host.get("ticks") == [1.0]
    host.set("u", [4.0])
    assert host.update() == OK
    assert (host.get("y"), host.get("ticks")) == ([0.4], [1.0])
    assert host.call("EnterStepMode") == OK
    assert host.step(0.0, P) == OK
    assert host.call("EnterEventMode") == OK
    tick(host)
    assert (host.get("y"), host.get("ticks")) == ([0.8], [2.0])


@pytest.mark.parametrize("read", [False, True])
def test_a_state_saved_while_the_clock_is_active_continues_there(workshop: Workshop, read: bool):
    host, other = started(workshop), workshop.host(SAMPLED, 3, event_mode=True)
    tick(host)
    assert host.step(0.0, P) == OK
    assert host.call("EnterEventMode") == OK
    assert host.set_clock() == OK
    if read:
        assert host.get("y") == [0.2]
    data = serialised(host, save(host))
    status, state = deserialise(other, data)
    assert status == OK
    assert other.call("SetFMUState", state) == OK
    assert other.get("ticks") == [2.0]
    for h in (host, other):
        h.set("u", [5.0])
        assert h.update() == OK
        assert h.call("EnterStepMode") == OK
        assert (h.get("y"), h.get("ticks"), h.get("t_seen")) == ([0.6], [2.0], [P])
        assert h.step(P, P) == OK


def test_a_state_saved_in_event_mode_is_refused_to_an_instance_that_does_not_use_it(
    workshop: Workshop, wording: Wording
):
    host, other = started(workshop), workshop.host(SAMPLED, 3)
    status, state = deserialise(other, serialised(host, save(host)))
    assert status == OK
    assert other.call("SetFMUState", state) == ERROR
    wording.check(other.log[-1])
    assert other.initialise() == OK


def test_what_is_read_after_the_end_makes_no_tick(workshop: Workshop):
    host = started(workshop)
    assert host.set_clock() == OK
    assert host.call("Terminate") == OK
    assert (host.get("y"), host.get("ticks")) == ([0.0], [0.0])


def test_reset_returns_to_the_start_with_the_clock_at_rest(workshop: Workshop):
    host = started(workshop)
    tick(host)
    host.step(0.0, P)
    host.call("EnterEventMode")
    host.set_clock()
    assert host.get("ticks") == [2.0]
    assert host.call("Reset") == OK
    assert host.initialise(7.0) == OK
    assert host.get("ticks") == [0.0]
    tick(host)
    assert (host.get("ticks"), host.get("t_seen")) == ([1.0], [7.0])


def test_a_failure_in_a_tick_is_a_failure_of_the_instance(workshop: Workshop, wording: Wording):
    host = started(workshop)
    host.set("u", [float("nan")])
    assert host.set_clock() == OK
    assert host.update() == ERROR
    wording.check(host.log[-1])
    host.set("u", [1.0])
    assert host.update() == OK
    assert host.get("ticks") == [1.0]


def test_no_port_of_a_sampled_block_has_the_clocks_name():
    d = describe(import_class("support.sample_units.sampled:Sampled"))
    inputs = (dataclasses.replace(d.inputs[0], name="sample_clock"),)
    with pytest.raises(DuplicateName, match="more than one variable is named sample_clock"):
        Layout(dataclasses.replace(d, inputs=inputs))
    Layout(dataclasses.replace(d, inputs=inputs, period=None))


def simulated(name: str, *, event_mode: bool) -> list[list[float]]:
    """Return the real outputs of a catalogued unit after each of some steps of its period, with inputs that vary."""
    d = describe(import_class(UNITS[name].block))
    period, real = float(d.period or 0), [v.name for v in d.inputs if v.kind is Kind.REAL]
    host = CtypesHost(cached(name, 3), 3)
    assert host.instantiate(event_mode=event_mode)
    for parameter, value in drive.CHOSEN.get(name, {}).items():
        assert host.set(parameter, [value]) == OK
    assert host.initialise() == OK
    seen: list[list[float]] = []
    for k in range(60):
        values = drive.inputs(d, k % drive.STEPS)
        for port in real:
            assert host.set(port, np.ravel(values[port]).tolist()) == OK
        if event_mode:
            assert k == 0 or host.call("EnterEventMode") == OK
            tick(host)
        assert host.step(k * period, period) == OK, host.log[-1]
        seen.append([x for v in d.outputs if v.kind is Kind.REAL for x in host.get(v.name, v.size)])
    host.close()
    return seen


@pytest.mark.parametrize("name", ["ImpedanceController", "TrajectoryPlanner"])
def test_a_catalogued_unit_is_the_same_with_event_mode_and_without_bit_for_bit(name: str):
    by_itself, by_clock = simulated(name, event_mode=False), simulated(name, event_mode=True)
    assert by_clock == by_itself
    assert any(y != by_itself[0] for y in by_itself)
