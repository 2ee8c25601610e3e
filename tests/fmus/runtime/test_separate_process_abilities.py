"""What a unit can do besides steps, with its Python in a process of its own: the same values as in the host's."""

import ctypes
import os
from collections.abc import Callable

import pytest
from support.fmus.ctypes_host import DOUBLE, OK, SIZE, CtypesHost
from support.fmus.saved_states import deserialise, save, serialised
from support.fmus.unit_calls import (
    BALL,
    C_TYPES,
    EVERY_WIDTH,
    SAMPLED,
    TANGENT,
    P,
    derivative,
    drive,
    extremes,
    get,
    port_of,
    tick,
    transfer,
)
from support.fmus.workshop import Workshop

pytestmark = pytest.mark.skipif(os.name == "nt", reason="sets the environment with setenv alone")


def clocked(workshop: Workshop) -> list[object]:
    """Return what is seen of ticks, one of them read before it is settled and saved in between."""
    host = workshop.host(SAMPLED, 3, event_mode=True)
    assert host.initialise() == OK
    tick(host)
    assert host.step(0.0, P) == OK
    assert host.event_needed
    assert host.call("EnterEventMode") == OK
    assert host.set_clock() == OK
    seen: list[object] = [host.get("y")]
    state = deserialise(host, serialised(host, save(host)))[1]
    for u in (5.0, 7.0):
        assert host.call("SetFMUState", state) == OK
        host.set("u", [u])
        seen.append(host.get("y"))
        assert host.update() == OK, host.log
        seen += [host.get("y"), host.get("ticks"), host.get("t_seen")]
    return seen


def eventful(workshop: Workshop) -> list[object]:
    seen = drive(workshop.host(BALL, 3, event_mode=True, early_return=True), 40)
    return [seen.states, seen.events]


def derived(workshop: Workshop) -> list[object]:
    seen: list[object] = []
    for fmi in (2, 3):
        host = workshop.host(TANGENT, fmi)
        assert host.initialise() == OK
        status, values = derivative(host, [0.5, 1.0, -2.0, 3.0, 0.1, 0.2, 0.3])
        assert status == OK, host.log
        seen.append(values)
    status, values = derivative(host, [1.0, 0.5, 0.25, 2.0], "GetAdjointDerivative")
    assert status == OK, host.log
    return [*seen, values]


def wide(workshop: Workshop) -> list[object]:
    host = workshop.host(EVERY_WIDTH, 3)
    for width, c_type in C_TYPES.items():
        assert transfer(host, "Set", width, port_of(width), (c_type * 1)(extremes(width)[1])) == OK
    assert transfer(host, "Set", "Float32", "x", (ctypes.c_float * 1)(0.3)) == OK
    assert host.initialise() == OK
    return [get(host, width, f"{port_of(width)}_out") for width in C_TYPES]


def scalar(workshop: Workshop) -> list[object]:
    host = CtypesHost(workshop.scalar_fmu("every_kind:EveryKind"), 3)
    workshop.open.append(host)
    assert host.instantiate(), host.log
    assert host.initialise() == OK
    assert host.step(0.0, 0.25) == OK
    first, values = host.references["p"], (DOUBLE * 3)()
    references = (ctypes.c_uint32 * 3)(first, first + 1, first + 2)
    assert host.call("GetFloat64", references, SIZE(3), values, SIZE(3)) == OK
    return list(values)


@pytest.mark.parametrize(
    "seen", [clocked, derived, *(pytest.param(f, marks=pytest.mark.slow) for f in (eventful, wide, scalar))]
)
def test_a_unit_does_the_same_wherever_its_python_runs(
    workshop: Workshop, monkeypatch: pytest.MonkeyPatch, seen: Callable[[Workshop], list[object]]
):
    monkeypatch.setenv("FMU_PYTHON_PROCESS", "0")
    here = seen(workshop)
    monkeypatch.setenv("FMU_PYTHON_PROCESS", "1")
    assert seen(workshop) == here
    assert len(here) > 1
