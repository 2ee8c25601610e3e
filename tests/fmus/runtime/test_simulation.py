"""An FMU against the plain object that it was made from."""

from typing import Any

import numpy as np
import pytest
from support.fmus.ctypes_host import OK
from support.fmus.workshop import Workshop
from support.sample_units.every_kind import EveryKind, Inputs, Mood, Outputs, Params
from support.wording import Wording

from handover.fmus.contents.fmi2_description import NoFmi2Form

BLOCK = "every_kind:EveryKind"
DT, STEPS = 1 / 64, 12
VALUES: dict[str, tuple[str, Any]] = {
    "gain": ("Real", 3.0),
    "n": ("Integer", 7),
    "fast": ("Boolean", True),
    "mood": ("Integer", Mood.WILD),
    "label": ("String", "x%d Größe".encode()),
    "seed": ("Integer", 5),
}
"""Of parameters."""

both = pytest.mark.parametrize("fmi", [2, 3])


def driven(k: int) -> Inputs:
    t = k * DT
    return Inputs(a=t * t, k=k % 5, on=k % 2 == 0, v=np.array([t, -t, 0.5]), M=np.arange(9.0).reshape(3, 3) + t)


@both
def test_a_unit_gives_what_the_plain_object_gives_bit_for_bit(workshop: Workshop, fmi: int):
    host, real = workshop.host(BLOCK, fmi), "Real" if fmi == 2 else "Float64"
    for name, (kind, value) in VALUES.items():
        assert host.put(real if kind == "Real" else kind, name, value) == OK
    block = EveryKind(Params(gain=3.0, n=7, fast=True, mood=Mood.WILD, label="x%d Größe", seed=5))
    for k in range(STEPS + 1):
        u = driven(k)
        for name, kind in (("a", real), ("v", real), ("M", real), ("k", "Integer"), ("on", "Boolean")):
            assert host.put(kind, name, *np.ravel(getattr(u, name)).tolist()) == OK
        if k == 0:
            y: Outputs = block.outputs(0.0, u)
            assert host.initialise() == OK
        else:
            y = block.step((k - 1) * DT, DT, u)
            assert host.step((k - 1) * DT, DT) == OK
        assert (host.get("b"), host.get("c")) == ([y.b], [y.c])
        assert (host.get("p", 3), host.get("N", 9)) == (y.p.tolist(), y.N.ravel().tolist())
        assert host.take("Integer", "total") + host.take("Integer", "mood_out") == [y.total, y.mood_out]
        assert (host.take("Boolean", "off"), host.take("String", "sentence")) == ([y.off], [y.sentence.encode()])


@both
def test_the_start_time_reaches_the_block_and_instances_share_no_values(workshop: Workshop, fmi: int):
    one, two = workshop.host(BLOCK, fmi), workshop.host(BLOCK, fmi)
    one.set("gain", [1.0])
    two.set("gain", [9.0])
    assert one.initialise() == two.initialise(start=5.0) == OK
    assert (one.get("b"), two.get("b")) == ([0.5], [4.5 + 5.0])


@both
def test_asking_for_outputs_while_initialising_does_not_change_what_follows(workshop: Workshop, fmi: int):
    asked, silent = workshop.host(BLOCK, fmi), workshop.host(BLOCK, fmi)
    asked.enter()
    for _ in range(3):
        asked.set("a", [0.5])
        asked.get("p", 3)
    assert asked.set("gain", [4.0]) == silent.set("gain", [4.0]) == OK
    assert asked.get("b") == [2.0]
    asked.call("ExitInitializationMode")
    silent.initialise()
    for i in range(3):
        assert asked.get("p", 3) == silent.get("p", 3)
        asked.step(i * DT, DT)
        silent.step(i * DT, DT)


def test_fmi_2_has_no_pictures(workshop: Workshop, wording: Wording):
    with pytest.raises(NoFmi2Form) as refused:
        workshop.fmu("eye:Eye", 2)
    wording.check(refused.value)
