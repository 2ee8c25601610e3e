"""Calls that the standards forbid, and failures: they return an error with a log line, and the process survives."""

import ctypes
import math
from collections.abc import Callable

import pytest
from support.fmus.ctypes_host import DISCARD, DOUBLE, ERROR, OK, SIZE, CtypesHost
from support.fmus.workshop import Workshop
from support.wording import Wording

BLOCK = "every_kind:EveryKind"


def started(workshop: Workshop, fmi: int) -> CtypesHost:
    host = workshop.host(BLOCK, fmi)
    assert host.initialise() == OK
    return host


def reference(n: int) -> "ctypes.Array[ctypes.c_uint32]":
    return (ctypes.c_uint32 * 1)(n)


FORBIDDEN: dict[str, Callable[[CtypesHost], int]] = {
    "a step from elsewhere": lambda h: h.step(0.5, 0.1),
    "no step": lambda h: h.step(0.0, 0.0),
    "a step of NaN": lambda h: h.step(0.0, math.nan),
    "a step from NaN": lambda h: h.step(math.nan, 0.1),
    "a parameter": lambda h: h.set("gain", [1.0]),
    "an output": lambda h: h.set("b", [1.0]),
    "another type": lambda h: h.set("k", [1.0]),
    "to enter again": lambda h: h.call("EnterInitializationMode", *[0] * 5),
    "to leave again": lambda h: h.call("ExitInitializationMode"),
    "no place for a state": lambda h: h.call("GetFMUState" if h.fmi == 3 else "GetFMUstate", None),
    "no state": lambda h: h.call("SetFMUState" if h.fmi == 3 else "SetFMUstate", None),
    "model exchange": lambda h: h.call("SetTime", DOUBLE(1.0)),
    "event mode": lambda h: h.call("EnterEventMode"),
}


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("call", FORBIDDEN)
def test_forbidden_calls_are_refused_and_change_nothing(workshop: Workshop, fmi: int, call: str, wording: Wording):
    host = started(workshop, fmi)
    assert FORBIDDEN[call](host) == ERROR
    wording.check(host.log[-1])
    assert host.step(0.0, 0.1) == OK


BAD_ARGUMENTS: dict[str, tuple[object, int, object, int]] = {
    "no variable": (reference(999), 1, (DOUBLE * 1)(), 1),
    "no references": (None, 1, (DOUBLE * 1)(), 1),
    "no values": (reference(0), 1, None, 1),
    "another size": (reference(0), 1, (DOUBLE * 2)(), 2),
}


@pytest.mark.parametrize("case", BAD_ARGUMENTS)
def test_bad_arguments_are_refused(workshop: Workshop, case: str, wording: Wording):
    references, n, values, n_values = BAD_ARGUMENTS[case]
    host = started(workshop, 3)
    assert host.call("GetFloat64", references, SIZE(n), values, SIZE(n_values)) == ERROR
    wording.check(host.log[-1])


@pytest.mark.parametrize("fmi", [2, 3])
def test_no_instance_is_an_error(workshop: Workshop, fmi: int):
    host = workshop.host(BLOCK, fmi)
    host.free()
    assert host.step(0.0, 0.1) == ERROR
    assert host.call("Reset") == ERROR
    host.call("FreeInstance")


@pytest.mark.parametrize("fmi", [2, 3])
def test_outputs_have_no_value_before_initialisation(workshop: Workshop, fmi: int):
    host = workshop.host(BLOCK, fmi)
    with pytest.raises(AssertionError, match="'b' has no value before initialisation"):
        host.get("b")
    assert host.get("gain") == [2.0]


def test_steps_end_with_the_stop_time(workshop: Workshop, wording: Wording):
    host = workshop.host(BLOCK, 2)
    host.call("SetupExperiment", 0, DOUBLE(0.0), DOUBLE(0.0), 1, DOUBLE(1.0))
    host.call("EnterInitializationMode")
    host.call("ExitInitializationMode")
    assert host.step(0.0, 1.5) == ERROR
    wording.check(host.log[-1])
    assert host.step(0.0, 1.0) == OK


def test_a_wrong_token_is_refused(workshop: Workshop):
    host = workshop.host(BLOCK, 3)
    host.free()
    assert not host.instantiate(token="{00000000-0000-0000-0000-000000000000}")
    assert "token {00000000" in host.log[-1]


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_exception_is_an_error_with_its_traceback_and_the_instance_can_be_reset(
    workshop: Workshop, fmi: int, wording: Wording
):
    host = started(workshop, fmi)
    assert host.step(0.0, 0.1) == OK
    before = host.get("p", 3)
    host.set("a", [666.0])
    assert host.step(0.1, 0.1) == ERROR
    trace = host.log[-1]
    if fmi == 2:
        trace = trace.replace("%%", "%").replace("##", "#")
    assert "Traceback" in trace
    assert 'raise Misfortune("the number of the beast # 100%")' in trace
    assert host.step(0.1, 0.1) == ERROR
    wording.check(host.log[-1])
    assert host.call("Reset") == OK
    assert host.initialise() == OK
    assert host.step(0.0, 0.1) == OK
    assert host.get("p", 3) == before


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_parameter_out_of_range_is_refused_with_name_value_range_and_unit(
    workshop: Workshop, fmi: int, wording: Wording
):
    host = workshop.host(BLOCK, fmi)
    host.set("gain", [11.0])
    assert host.initialise() == ERROR
    wording.check(host.log[-1])
    assert "Traceback" not in host.log[-1]


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_an_input_that_is_not_finite_is_refused_by_name(workshop: Workshop, fmi: int, value: float):
    host = started(workshop, fmi)
    host.set("v", [0.0, value, 0.0])
    assert host.step(0.0, 0.1) == ERROR
    assert ("'v[2]' is" if fmi == 2 else "'v' is") in host.log[-1]
    host.set("v", [0.0, 0.0, 0.0])
    assert host.step(0.0, 0.1) == OK


def test_a_number_that_is_no_item_of_an_enumeration_is_refused(workshop: Workshop, wording: Wording):
    host = workshop.host(BLOCK, 3)
    value = (ctypes.c_int64 * 1)(3)
    assert host.call("SetInt64", reference(host.references["mood_in"]), SIZE(1), value, SIZE(1)) == OK
    assert host.initialise() == ERROR
    wording.check(host.log[-1])


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_output_that_is_not_finite_is_a_failure_that_names_it(workshop: Workshop, fmi: int, wording: Wording):
    host = workshop.host(BLOCK, fmi)
    host.set("gain", [10.0])
    assert host.initialise() == OK
    host.set("a", [1e308])
    assert host.step(0.0, 0.1) == ERROR
    wording.check(host.log[-1])
    assert host.step(0.1, 0.1) == ERROR
    wording.check(host.log[-1])


def test_outputs_at_the_start_that_are_not_finite_are_a_failure(workshop: Workshop, wording: Wording):
    host = workshop.host(BLOCK, 3)
    host.set("gain", [10.0])
    host.set("a", [1e308])
    assert host.initialise() == ERROR
    wording.check(host.log[-1])


def test_an_output_of_the_wrong_shape_is_an_error_that_names_it(workshop: Workshop, wording: Wording):
    host = workshop.host("careless:Careless", 3)
    assert host.initialise() == ERROR
    wording.check(host.log[-1].splitlines()[-1])


def test_event_mode_is_refused_to_a_unit_that_has_none(workshop: Workshop, wording: Wording):
    host = workshop.host(BLOCK, 3)
    host.free()
    assert not host.instantiate(event_mode=True)
    wording.check(host.log[-1])


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_string_that_one_call_asks_for_twice_is_the_same_string(workshop: Workshop, fmi: int):
    host = workshop.host(BLOCK, fmi)
    references = (ctypes.c_uint32 * 2)(*[host.references["word"]] * 2)
    pointers = (ctypes.c_void_p * 2)()
    assert host.call("GetString", references, SIZE(2), pointers, *[SIZE(2)] * (fmi == 3)) == OK
    assert pointers[0] == pointers[1]
    assert ctypes.string_at(pointers[0]) == b"hello"


def test_a_status_that_there_is_not_is_discarded(workshop: Workshop, wording: Wording):
    host = workshop.host(BLOCK, 2)
    assert host.initialise() == OK
    time, kinds = DOUBLE(), {"LastSuccessfulTime": 2, "Terminated": 3}
    assert host.call("GetRealStatus", kinds["LastSuccessfulTime"], ctypes.byref(time)) == OK
    assert host.call("GetRealStatus", kinds["Terminated"], ctypes.byref(time)) == DISCARD
    for name in ("Status", "IntegerStatus", "StringStatus"):
        assert host.call(f"Get{name}", 0, ctypes.byref(time)) == DISCARD
        wording.check(host.log[-1])
