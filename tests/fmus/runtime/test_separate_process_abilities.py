"""What a unit can do besides steps, with its Python in a process of its own: the same values as in the host's."""

import os
from collections.abc import Callable

import pytest
from support.fmus.ctypes_host import INTEGERS, OK
from support.fmus.saved_states import deserialise, save, serialised
from support.fmus.unit_calls import (
    BALL,
    EVERY_WIDTH,
    SAMPLED,
    TANGENT,
    derivative,
    drive,
    extremes,
    handle,
    port_of,
    tick,
    with_events,
)
from support.fmus.workshop import Workshop

pytestmark = pytest.mark.skipif(os.name == "nt", reason="sets the environment with setenv alone")


def clocked(workshop: Workshop) -> list[object]:
    """Return what is seen of ticks, one of them read before it is settled and saved in between."""
    host = with_events(workshop, SAMPLED)
    tick(host)
    assert host.step(0.0, 1 / 30) == OK
    assert host.call("EnterEventMode") == OK
    assert host.set_clock() == OK
    seen: list[object] = [host.event_needed, host.get("y")]
    state = deserialise(host, serialised(host, save(host)))[1]
    for u in (5.0, 7.0):
        assert host.call("SetFMUState", state) == OK
        host.set("u", [u])
        seen.append(host.get("y"))
        handle(host)
        seen += [host.get("y"), host.get("ticks"), host.get("t_seen")]
    return seen


def eventful(workshop: Workshop) -> list[object]:
    seen = drive(with_events(workshop, BALL, early_return=True), 40)
    return [seen.states, seen.events]


def derived(workshop: Workshop) -> list[object]:
    two, three = (workshop.host(TANGENT, fmi) for fmi in (2, 3))
    assert two.initialise() == three.initialise() == OK
    seed = [0.5, 1.0, -2.0, 3.0, 0.1, 0.2, 0.3]
    return [derivative(two, seed), derivative(three, seed), derivative(three, seed[:4], "GetAdjointDerivative")]


def wide(workshop: Workshop) -> list[object]:
    host = workshop.host(EVERY_WIDTH, 3)
    for width in INTEGERS:
        assert host.put(width, port_of(width), extremes(width)[1]) == OK
    assert host.put("Float32", "x", 0.3) == OK
    assert host.initialise() == OK
    return [host.take(width, f"{port_of(width)}_out") for width in INTEGERS]


def everything(workshop: Workshop) -> list[object]:
    """Return all outputs of some steps, and the state at the end."""
    host, seen = workshop.host("every_kind:EveryKind", 3), list[object]()
    host.set("p0", [0.1, 0.2, 0.3])
    assert host.initialise(1.5) == OK
    for i in range(20):
        assert host.set("v", [i, -i, 1.0 / (i + 1)]) == host.set("a", [0.1 * i]) == OK
        assert host.step(1.5 + i / 64, 1 / 64) == OK, host.log
        seen += [host.get("b"), host.get("p", 3), host.get("N", 9), host.get("c"), host.take("String", "sentence")]
    return [*seen, serialised(host, save(host))]


@pytest.mark.parametrize(
    "seen",
    [
        pytest.param(everything, marks=pytest.mark.machine),
        *(pytest.param(f, marks=pytest.mark.slow) for f in (clocked, derived, eventful, wide)),
    ],
)
def test_a_unit_does_the_same_wherever_its_python_runs(
    workshop: Workshop, monkeypatch: pytest.MonkeyPatch, seen: Callable[[Workshop], list[object]]
):
    monkeypatch.setenv("FMU_PYTHON_PROCESS", "0")
    here = seen(workshop)
    monkeypatch.setenv("FMU_PYTHON_PROCESS", "1")
    assert seen(workshop) == here
    assert len(here) > 1
