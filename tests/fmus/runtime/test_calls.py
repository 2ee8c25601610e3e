"""Calls that the standards forbid, and failures: they return an error with a log line, and the process survives.

A rejected call leaves an instance as it is, to the last byte of its state.
"""

import ctypes
import math
from collections.abc import Callable

import pytest
from support.fmus.ctypes_host import DISCARD, DOUBLE, ERROR, OK, SIZE, CtypesHost
from support.fmus.saved_states import called, save, serialised
from support.fmus.workshop import Workshop, expect_error
from support.wording import Wording

BLOCK = "every_kind:EveryKind"

both = pytest.mark.parametrize("fmi", [2, 3])


def started(workshop: Workshop, fmi: int) -> CtypesHost:
    host = workshop.host(BLOCK, fmi)
    assert host.initialise() == OK
    return host


def state_of(host: CtypesHost) -> bytes:
    return serialised(host, save(host))


def reference(n: int) -> "ctypes.Array[ctypes.c_uint32]":
    return (ctypes.c_uint32 * 1)(n)


def set_strings(host: CtypesHost, names: tuple[str, ...], values: tuple[bytes | None, ...]) -> int:
    n = len(names)
    references = (ctypes.c_uint32 * n)(*(host.references[name] for name in names))
    return host.call("SetString", references, SIZE(n), (ctypes.c_char_p * n)(*values), *[SIZE(n)] * (host.fmi == 3))


def unknown_item(host: CtypesHost) -> int:
    assert host.put("Integer", "mood_in", 99) == OK
    return host.step(0.0, 0.1)


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
    "no place for a state": lambda h: h.call(called(h, "GetFMUstate"), None),
    "no state": lambda h: h.call(called(h, "SetFMUstate"), None),
    "model exchange": lambda h: h.call("SetTime", DOUBLE(1.0)),
    "event mode": lambda h: h.call("EnterEventMode"),
    **{
        f"a string of {bad}": lambda h, bad=bad: set_strings(h, ("word", "word"), (b"fine", bad))
        for bad in (
            None, b"\xff", b"\xc3", b"\xc0\x80", b"\xe0\x80\xaf", b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"a\x80"
        )
    },
}  # fmt: skip


@both
def test_forbidden_calls_are_refused_and_change_nothing(workshop: Workshop, fmi: int, wording: Wording):
    host = started(workshop, fmi)
    before = state_of(host)
    for call in FORBIDDEN.values():
        expect_error(wording, host, call(host))
        assert state_of(host) == before
    assert set_strings(host, (), ()) == OK
    assert host.set("a", []) == (OK if fmi == 2 else ERROR)
    assert state_of(host) == before
    for name, values in (("v", (0.0, math.nan, 0.0)), ("v", (0.0, 0.0, math.inf))):
        assert host.set(name, values) == OK
        expect_error(wording, host, host.step(0.0, 0.1))
    assert host.set("v", [0.0, 0.0, 0.0]) == OK
    expect_error(wording, host, unknown_item(host))
    after = state_of(host)
    assert host.step(0.0, 0.1) == ERROR
    assert state_of(host) == after
    assert host.put("Integer", "mood_in", 1) == OK
    every_length = "a \x7f\x80\u07ff\u0800\ud7ff\ue000\uffff\U00010000\U0010ffff"
    assert set_strings(host, ("word",), (every_length.encode(),)) == OK
    assert host.step(0.0, 0.1) == OK
    host.free()
    assert host.step(0.0, 0.1) == host.call("Reset") == ERROR
    host.call("FreeInstance")


def test_bad_arguments_are_refused(workshop: Workshop, wording: Wording):
    host, value = started(workshop, 3), (DOUBLE * 1)()
    for references, n, values, n_values in (
        (reference(999), 1, value, 1),
        (None, 1, value, 1),
        (reference(0), 1, None, 1),
        (reference(0), 1, (DOUBLE * 2)(), 2),
    ):
        expect_error(wording, host, host.call("GetFloat64", references, SIZE(n), values, SIZE(n_values)))


def test_bytes_without_sizes_do_not_make_a_block(workshop: Workshop):
    host = workshop.host("eye:Eye", 3)
    assert host.enter() == OK
    before = state_of(host)
    note, picture = reference(host.references["note_back"]), reference(host.references["picture"])
    value = ctypes.byref(ctypes.c_void_p())
    assert host.call("GetBinary", note, SIZE(1), None, value, SIZE(1)) == ERROR
    assert host.call("SetBinary", picture, SIZE(1), (SIZE * 1)(7), (ctypes.c_char_p * 1)(b"7"), SIZE(1)) == ERROR
    assert state_of(host) == before


@both
def test_outputs_have_no_value_before_initialisation(workshop: Workshop, fmi: int, wording: Wording):
    host = workshop.host(BLOCK, fmi)
    expect_error(wording, host, host.transfer("GetReal" if fmi == 2 else "GetFloat64", "b", (DOUBLE * 1)()))
    assert host.get("gain") == [2.0]


def test_steps_end_with_the_stop_time(workshop: Workshop, wording: Wording):
    host = workshop.host(BLOCK, 2)
    host.call("SetupExperiment", 0, DOUBLE(0.0), DOUBLE(0.0), 1, DOUBLE(1.0))
    host.call("EnterInitializationMode")
    host.call("ExitInitializationMode")
    expect_error(wording, host, host.step(0.0, 1.5))
    assert host.step(0.0, 1.0) == OK


def test_instances_of_another_token_kind_or_mode_are_refused(workshop: Workshop, wording: Wording):
    host = workshop.host(BLOCK, 3)
    host.free()
    assert not host.instantiate(token="{00000000-0000-0000-0000-000000000000}")
    assert not host.instantiate(event_mode=True)
    assert not host.library.fmi3InstantiateModelExchange(b"me", b"", b"", False, False, None, host.logger3)
    assert len(host.log) == 3
    for message in host.log[1:]:
        wording.check(message)
    for part in ("token {00000000", "of two different builds. Cure: unpack the FMU again"):
        assert part in host.log[0]


@both
def test_an_exception_is_an_error_with_its_traceback_and_the_instance_can_be_reset(
    workshop: Workshop, fmi: int, wording: Wording
):
    host = started(workshop, fmi)
    assert host.step(0.0, 0.1) == OK
    before = host.get("p", 3)
    host.set("a", [666.0])
    assert host.step(0.1, 0.1) == ERROR
    trace = host.log[-1].replace("%%", "%").replace("##", "#") if fmi == 2 else host.log[-1]
    assert "Traceback" in trace
    assert 'raise Misfortune("the number of the beast # 100%")' in trace
    assert "\nsupport.sample_units.every_kind.Misfortune: " in trace
    assert "_fmu_" not in trace
    expect_error(wording, host, host.step(0.1, 0.1))
    assert host.call("Reset") == OK
    assert host.initialise() == OK
    assert host.step(0.0, 0.1) == OK
    assert host.get("p", 3) == before


@both
def test_values_that_a_unit_cannot_start_from_are_refused_by_name(workshop: Workshop, fmi: int, wording: Wording):
    real = "Real" if fmi == 2 else "Float64"
    for kind, name, value in ((real, "gain", 11.0), ("Integer", "mood_in", 3), (real, "a", 1e308)):
        host = workshop.host(BLOCK, fmi)
        host.set("gain", [10.0])
        assert host.put(kind, name, value) == OK
        expect_error(wording, host, host.initialise())
        assert "Traceback" not in host.log[-1]


@both
def test_an_output_that_is_not_finite_is_a_failure_that_names_it(workshop: Workshop, fmi: int, wording: Wording):
    host = workshop.host(BLOCK, fmi)
    host.set("gain", [10.0])
    assert host.initialise() == OK
    host.set("a", [1e308])
    expect_error(wording, host, host.step(0.0, 0.1))
    expect_error(wording, host, host.step(0.1, 0.1))


def test_an_output_of_the_wrong_shape_is_an_error_that_names_it(workshop: Workshop, wording: Wording):
    host = workshop.host("careless:Careless", 3)
    assert host.initialise() == ERROR
    wording.check(host.log[-1].splitlines()[-1])


@both
def test_a_string_that_one_call_asks_for_twice_is_the_same_string(workshop: Workshop, fmi: int):
    host = workshop.host(BLOCK, fmi)
    references = (ctypes.c_uint32 * 2)(*[host.references["word"]] * 2)
    pointers = (ctypes.c_void_p * 2)()
    assert host.call("GetString", references, SIZE(2), pointers, *[SIZE(2)] * (fmi == 3)) == OK
    assert pointers[0] == pointers[1]
    assert ctypes.string_at(pointers[0]) == b"hello"


def test_a_status_that_there_is_not_is_discarded(workshop: Workshop, wording: Wording):
    host = started(workshop, 2)
    time, kinds = DOUBLE(), {"LastSuccessfulTime": 2, "Terminated": 3}
    assert host.call("GetRealStatus", kinds["LastSuccessfulTime"], ctypes.byref(time)) == OK
    assert host.call("GetRealStatus", kinds["Terminated"], ctypes.byref(time)) == DISCARD
    for name in ("Status", "IntegerStatus", "StringStatus"):
        assert host.call(f"Get{name}", 0, ctypes.byref(time)) == DISCARD
        wording.check(host.log[-1])
