"""Reals of 32 bits and integers of every width, where a block asks for them."""

import ctypes
import math
from typing import Any

import numpy as np
import pytest
from support.fmus.ctypes_host import ERROR, OK, SIZE, CtypesHost
from support.fmus.unit_calls import C_TYPES, EVERY_WIDTH, extremes, get, port_of, transfer
from support.fmus.workshop import Workshop
from support.wording import Wording

from handover.fmus.contents.fmi2_description import NoFmi2Form


@pytest.mark.parametrize("width", C_TYPES)
def test_an_integer_of_every_width_passes_with_its_extremes(workshop: Workshop, width: str):
    host = workshop.host(EVERY_WIDTH, 3)
    assert host.initialise() == OK
    for k, value in enumerate(extremes(width)):
        assert transfer(host, "Set", width, port_of(width), (C_TYPES[width] * 1)(value)) == OK
        assert host.step(k * 0.5, 0.5) == OK, host.log[-1]
        assert get(host, width, f"{port_of(width)}_out") == value


def test_a_single_is_widened_on_its_way_in_and_rounded_on_its_way_out(workshop: Workshop):
    host = workshop.host(EVERY_WIDTH, 3)
    stretch, x = np.float32(0.7), np.float32(0.3)
    assert transfer(host, "Set", "Float32", "stretch", (ctypes.c_float * 1)(stretch)) == OK
    assert transfer(host, "Set", "Float32", "x", (ctypes.c_float * 1)(x)) == OK
    assert transfer(host, "Set", "Float32", "v", (ctypes.c_float * 3)(0.1, 0.2, math.pi)) == OK
    assert host.initialise() == OK
    one, three = (ctypes.c_float * 1)(), (ctypes.c_float * 3)()
    assert transfer(host, "Get", "Float32", "x_out", one) == OK
    assert transfer(host, "Get", "Float32", "v_out", three) == OK
    assert one[0] == np.float32(float(stretch) * float(x))
    assert list(three) == [2.0 * float(np.float32(entry)) for entry in (0.1, 0.2, math.pi)]


def set_real(host: CtypesHost, name: str, *values: float) -> int:
    if host.fmi == 2:
        return host.set(name, values)
    return transfer(host, "Set", "Float32", name, (ctypes.c_float * len(values))(*values))


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("name", "values"), [("x", (1e38,)), ("x", (-1e38,)), ("v", (0.0, 0.0, 3e38))])
def test_a_step_whose_output_no_single_holds_is_an_error(
    workshop: Workshop, fmi: int, name: str, values: tuple[float, ...], wording: Wording
):
    host = workshop.host(EVERY_WIDTH, fmi)
    assert set_real(host, "stretch", 5e37) == OK
    assert host.initialise() == OK
    assert host.step(0.0, 0.5) == OK
    assert set_real(host, name, *values) == OK
    for _ in range(2):  # the second time since it has failed
        assert host.step(0.5, 0.5) == ERROR
        wording.check(host.log[-1])


@pytest.mark.parametrize(
    ("width", "name"),
    [("Float64", "x"), ("Float32", "time"), ("Int64", "i16"), ("UInt16", "i16"), ("Int32", "x"), ("Float32", "told"),
     ("Boolean", "u8")],
)  # fmt: skip
def test_a_call_of_another_type_is_reported_the_variables_own(
    workshop: Workshop, width: str, name: str, wording: Wording
):
    host = workshop.host(EVERY_WIDTH, 3)
    host.initialise()
    for verb in ("Get", "Set"):
        assert transfer(host, verb, width, name, (ctypes.c_double * 1)()) == ERROR
        wording.check(host.log[-1])


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_output_outside_its_width_is_an_error_that_says_the_range(workshop: Workshop, fmi: int, wording: Wording):
    host = workshop.host(EVERY_WIDTH, fmi)
    width = "Integer" if fmi == 2 else "Int16"
    shift = (ctypes.c_int * 1)(-1) if fmi == 2 else (ctypes.c_int16 * 1)(-1)
    assert set_integer(host, width, "shift", shift) == OK
    assert host.initialise() == ERROR
    wording.check(host.log[-1].splitlines()[-1])


def get_integer(host: CtypesHost, name: str) -> int:
    values = (ctypes.c_int * 1)()
    assert host.call("GetInteger", ctypes.byref(ctypes.c_uint32(host.references[name])), SIZE(1), values) == OK
    return values[0]


def set_integer(host: CtypesHost, function: str, name: str, values: Any) -> int:
    if host.fmi == 3:
        return transfer(host, "Set", function, name, values)
    return host.call("SetInteger", ctypes.byref(ctypes.c_uint32(host.references[name])), SIZE(1), values)


@pytest.mark.parametrize(
    ("name", "value"), [("i8", 128), ("u8", -1), ("i16", -40000), ("u16", 65536), ("u32", -1), ("u64", -1)]
)
def test_fmi_2_refuses_what_is_outside_an_inputs_width(workshop: Workshop, name: str, value: int, wording: Wording):
    host = workshop.host(EVERY_WIDTH, 2)
    assert host.initialise() == OK
    before = get_integer(host, name)
    assert set_integer(host, "Integer", name, (ctypes.c_int * 1)(value)) == ERROR
    wording.check(host.log[-1])
    assert get_integer(host, name) == before


def test_fmi_2_takes_every_integer_that_fits_and_reals_with_all_their_digits(workshop: Workshop):
    host = workshop.host(EVERY_WIDTH, 2)
    assert host.set("x", [0.3]) == OK
    assert host.set("v", [0.1, 0.2, math.pi]) == OK
    values = {"i8": -128, "u8": 255, "i16": 2**15 - 1, "u16": 2**16 - 1, "i32": -(2**31), "u32": 2**31 - 1, "u64": 5}
    for name, value in values.items():
        assert set_integer(host, "Integer", name, (ctypes.c_int * 1)(value)) == OK, host.log[-1]
    assert host.initialise() == OK
    assert {name: get_integer(host, f"{name}_out") for name in values} == values
    assert host.get("v_out", 3) == [0.2, 0.4, 2.0 * math.pi]
    assert host.get("x_out") == [0.3 * float(np.float32(0.1))]


def test_fmi_2_refuses_integers_whose_start_has_no_place_in_32_bits(workshop: Workshop):
    with pytest.raises(NoFmi2Form, match=r"integers have 32 bits, too few for start values \(most\); use FMI 3"):
        workshop.fmu("every_width:Long", 2)
    host = workshop.host("every_width:Long", 3)
    assert host.initialise() == OK
    assert get(host, "UInt64", "most_out") == get(host, "UInt64", "most") == 2**64 - 1
