"""An FMU against the plain object that it was made from."""

import ctypes
from collections.abc import Callable
from typing import Any

import fmpy
import numpy as np
import pytest
from support.fmus.validity import problems_of
from support.fmus.workshop import Workshop
from support.sample_units.every_kind import EveryKind, Inputs, Mood, Outputs, Params

from handover.fmus.contents.fmi2_description import NoFmi2Form

DT, STEPS = 1 / 64, 12


PARAMS = Params(gain=3.0, n=7, fast=True, mood=Mood.WILD, label="x%d", seed=5)
START: dict[str, Any] = {"gain": 3.0, "n": 7, "fast": True, "mood": 5, "label": "x%d", "seed": 5}


def drive(u: Inputs, t: float) -> None:
    u.a = t * t
    u.k = round(64 * t) % 5
    u.on = round(64 * t) % 2 == 0


def plain(params: Params, drive: Callable[[Inputs, float], None]) -> list[Outputs]:
    block, u = EveryKind(params), Inputs()
    drive(u, 0.0)
    outputs = [block.outputs(0.0, u)]
    for i in range(STEPS):
        drive(u, i * DT)
        outputs.append(block.step(i * DT, DT, u))
    return outputs


def signals() -> "np.ndarray[Any, Any]":
    made = np.zeros(STEPS + 1, dtype=[("time", float), ("a", float), ("k", int), ("on", bool)])
    for i in range(STEPS + 1):
        u = Inputs()
        drive(u, i * DT)
        made[i] = (i * DT, u.a, u.k, u.on)
    return made


@pytest.mark.parametrize("fmi", [2, 3])
def test_fmpy_gives_what_the_plain_object_gives_bit_for_bit(workshop: Workshop, fmi: int):
    result = fmpy.simulate_fmu(
        str(workshop.fmu("every_kind:EveryKind", fmi)),
        start_values=dict(START),
        stop_time=STEPS * DT,
        output_interval=DT,
        input=signals(),
    )
    assert len(result) == STEPS + 1
    for row, y in zip(result, plain(PARAMS, drive), strict=True):
        p = [row[f"p[{i}]"] for i in (1, 2, 3)] if fmi == 2 else row["p"].tolist()
        assert (row["b"], p, row["c"]) == (y.b, y.p.tolist(), y.c)
        assert (row["total"], row["off"], row["mood_out"]) == (y.total, y.off, y.mood_out)
        N = [[row[f"N[{i},{j}]"] for j in (1, 2, 3)] for i in (1, 2, 3)] if fmi == 2 else row["N"].tolist()
        assert y.N.tolist() == N


@pytest.mark.parametrize("fmi", [2, 3])
def test_arrays_go_in_and_out_row_by_row(workshop: Workshop, fmi: int):
    def drive_arrays(u: Inputs, t: float) -> None:
        u.v = np.array([t, -t, 0.5])
        u.M = np.arange(9.0).reshape(3, 3) + t

    host = workshop.host("every_kind:EveryKind", fmi)
    u = Inputs()
    for i, y in enumerate(plain(Params(), drive_arrays)):
        drive_arrays(u, max(i - 1, 0) * DT)
        host.set("v", u.v.tolist())
        host.set("M", u.M.ravel().tolist())
        assert (host.initialise() if i == 0 else host.step((i - 1) * DT, DT)) == 0
        assert (host.get("p", 3), host.get("N", 9)) == (y.p.tolist(), y.N.ravel().tolist())


@pytest.mark.parametrize(("block", "fmi"), [("every_kind:EveryKind", 2), ("every_kind:EveryKind", 3), ("eye:Eye", 3)])
def test_the_model_description_is_valid(workshop: Workshop, block: str, fmi: int):
    assert problems_of(workshop.fmu(block, fmi)) == []


def test_the_model_description_says_what_the_declarations_say(workshop: Workshop):
    description = fmpy.read_model_description(str(workshop.fmu("every_kind:EveryKind", 3)))
    v = {v.name: v for v in description.modelVariables}
    assert (v["gain"].min, v["gain"].max, v["gain"].start, v["gain"].variability) == ("0.0", "10.0", "2.0", "fixed")
    assert (v["v"].unit, v["v"].start, v["v"].description) == ("m/s", "0.1 -0.2 0.3", "velocity")
    assert v["M"].shape == (3, 3)
    mood: Any = v["mood"].declaredType
    assert [(i.name, i.value) for i in mood.items] == [("CALM", "0"), ("KEEN", "1"), ("WILD", "5")]
    outputs: list[Any] = list(description.outputs)
    dependencies = {u.variable.name: [d.name for d in u.dependencies] for u in outputs}
    assert (dependencies["b"], dependencies["p"]) == (["a"], [])
    assert v["label"].start == 'a<b&"c" 100% #1'


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_start_time_reaches_the_block(workshop: Workshop, fmi: int):
    host = workshop.host("every_kind:EveryKind", fmi)
    assert host.initialise(start=5.0) == 0
    assert host.get("b") == [2.0 * 0.5 + 5.0]


@pytest.mark.parametrize("fmi", [2, 3])
def test_asking_for_outputs_while_initialising_does_not_change_what_follows(workshop: Workshop, fmi: int):
    asked, silent = workshop.host("every_kind:EveryKind", fmi), workshop.host("every_kind:EveryKind", fmi)
    asked.enter()
    for _ in range(3):
        asked.set("a", [0.5])
        asked.get("p", 3)
    asked.call("ExitInitializationMode")
    silent.initialise()
    for i in range(3):
        assert asked.get("p", 3) == silent.get("p", 3)
        asked.step(i * DT, DT)
        silent.step(i * DT, DT)


def test_a_parameter_set_after_the_first_outputs_counts(workshop: Workshop):
    host = workshop.host("every_kind:EveryKind", 3)
    host.enter()
    assert host.get("b") == [1.0]
    assert host.set("gain", [4.0]) == 0
    assert host.get("b") == [2.0]


def test_strings_arrive_and_come_back(workshop: Workshop):
    host = workshop.host("every_kind:EveryKind", 3)
    label, sentence = (ctypes.byref(ctypes.c_uint32(host.references[n])) for n in ("label", "sentence"))
    one = ctypes.c_size_t(1)
    assert host.call("SetString", label, one, (ctypes.c_char_p * 1)("Größe".encode()), one) == 0
    host.initialise()
    value = (ctypes.c_char_p * 1)()
    assert host.call("GetString", sentence, one, value, one) == 0
    assert value[0] == "Größe hello".encode()


def test_two_instances_of_one_unit_do_not_share_values(workshop: Workshop):
    one, two = workshop.host("every_kind:EveryKind", 3), workshop.host("every_kind:EveryKind", 3)
    one.set("gain", [1.0])
    two.set("gain", [9.0])
    one.initialise()
    two.initialise()
    assert (one.get("b"), two.get("b")) == ([0.5], [4.5])


def test_fmi_2_has_no_pictures(workshop: Workshop):
    with pytest.raises(NoFmi2Form, match="picture"):
        workshop.fmu("eye:Eye", 2)
