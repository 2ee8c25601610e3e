"""Reals of 32 bits and integers of every width, where a block asks for them."""

import math
from typing import Any

import numpy as np
import pytest
from support.fmus.ctypes_host import DOUBLE, ERROR, INTEGERS, OK
from support.fmus.unit_calls import EVERY_WIDTH, extremes, port_of
from support.fmus.workshop import Workshop, expect_error
from support.wording import Wording

from handover.fmus.contents.fmi2_description import NoFmi2Form

both = pytest.mark.parametrize("fmi", [2, 3])


def test_fmi_3_passes_integers_with_their_extremes_and_rounds_singles(workshop: Workshop):
    host = workshop.host(EVERY_WIDTH, 3)
    stretch, x, v = np.float32(0.7), np.float32(0.3), (0.1, 0.2, math.pi)
    for name, values in (("stretch", [stretch]), ("x", [x]), ("v", v)):
        assert host.put("Float32", name, *values) == OK
    assert host.initialise() == OK
    assert host.take("Float32", "x_out") == [np.float32(float(stretch) * float(x))]
    assert host.take("Float32", "v_out", 3) == [2.0 * float(np.float32(entry)) for entry in v]
    for k in range(2):
        for width in INTEGERS:
            assert host.put(width, port_of(width), extremes(width)[k]) == OK
        assert host.step(k * 0.5, 0.5) == OK, host.log[-1]
        for width in INTEGERS:
            assert host.take(width, f"{port_of(width)}_out") == [extremes(width)[k]]


@both
@pytest.mark.parametrize(("name", "values"), [("x", (1e38,)), ("x", (-1e38,)), ("v", (0.0, 0.0, 3e38))])
def test_a_step_whose_output_no_single_holds_is_an_error(
    workshop: Workshop, fmi: int, name: str, values: tuple[float, ...], wording: Wording
):
    host, single = workshop.host(EVERY_WIDTH, fmi), "Real" if fmi == 2 else "Float32"
    assert host.put(single, "stretch", 5e37) == OK
    assert host.initialise() == OK
    assert host.step(0.0, 0.5) == OK
    assert host.put(single, name, *values) == OK
    for _ in range(2):  # the second time since it has failed
        expect_error(wording, host, host.step(0.5, 0.5))


@both
def test_an_output_outside_its_width_is_an_error_that_says_the_range(workshop: Workshop, fmi: int, wording: Wording):
    host = workshop.host(EVERY_WIDTH, fmi)
    assert host.put("Integer" if fmi == 2 else "Int16", "shift", -1) == OK
    assert host.initialise() == ERROR
    wording.check(host.log[-1].splitlines()[-1])


def test_a_call_of_another_type_is_refused_with_the_variables_own(workshop: Workshop, wording: Wording):
    host = workshop.host(EVERY_WIDTH, 3)
    host.initialise()
    wrong = "Float64 x, Float32 time, Int64 i16, UInt16 i16, Int32 x, Float32 reported, Boolean u8"
    for kind, name in map(str.split, wrong.split(", ")):
        for verb in ("Get", "Set"):
            expect_error(wording, host, host.transfer(f"{verb}{kind}", name, (DOUBLE * 1)()))


def test_fmi_2_takes_what_fits_and_refuses_the_rest(workshop: Workshop, wording: Wording):
    host = workshop.host(EVERY_WIDTH, 2)
    assert host.set("x", [0.3]) == OK
    assert host.set("v", [0.1, 0.2, math.pi]) == OK
    values = {"i8": -128, "u8": 255, "i16": 2**15 - 1, "u16": 2**16 - 1, "i32": -(2**31), "u32": 2**31 - 1, "u64": 5}
    for name, value in values.items():
        assert host.put("Integer", name, value) == OK, host.log[-1]
    assert host.initialise() == OK
    for name, value in {"i8": 128, "u8": -1, "i16": -40000, "u16": 65536, "u32": -1, "u64": -1}.items():
        expect_error(wording, host, host.put("Integer", name, value))
        assert host.take("Integer", name) == [values[name]]
    found: dict[str, Any] = {name: host.take("Integer", f"{name}_out")[0] for name in values}
    assert found == values
    assert host.get("v_out", 3) == [0.2, 0.4, 2.0 * math.pi]
    assert host.get("x_out") == [0.3 * float(np.float32(0.1))]


def test_fmi_2_refuses_integers_whose_start_has_no_place_in_32_bits(workshop: Workshop, wording: Wording):
    with pytest.raises(NoFmi2Form) as refused:
        workshop.fmu("every_width:Long", 2)
    wording.check(refused.value)
    host = workshop.host("every_width:Long", 3)
    assert host.initialise() == OK
    assert host.take("UInt64", "most_out") == host.take("UInt64", "most") == [2**64 - 1]
