"""Calls of an instance that several tests make: a tick, derivatives, steps with events, values of every width."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from support.fmus.ctypes_host import DOUBLE, OK, SIZE, CtypesHost
from support.fmus.workshop import Workshop

P = 1 / 30
"""Period of `SAMPLED`, s."""
DT = 0.02
INPUTS, OUTPUTS = {"a": 1, "r": 3, "s": 3}, {"y": 1, "p": 3}
EVERY_WIDTH = "every_width:EveryWidth"
SAMPLED = "sampled:Sampled"
TANGENT = "tangent:Tangent"
BALL = "bouncing_ball:BouncingBall"


def with_events(workshop: Workshop, block: str, *, early_return: bool = False) -> CtypesHost:
    """Return a host in the event mode that follows initialisation."""
    host = workshop.host(block, 3, event_mode=True, early_return=early_return)
    assert host.initialise() == OK
    return host


def tick(host: CtypesHost) -> None:
    assert host.set_clock() == OK, host.log[-1]
    handle(host)


def handle(host: CtypesHost) -> float | None:
    """Update discrete states and leave event mode; return the time of the next event."""
    assert host.update() == OK, host.log[-1]
    assert host.call("EnterStepMode") == OK
    return host.next_event


def references(host: CtypesHost, sizes: dict[str, int]) -> "ctypes.Array[ctypes.c_uint32]":
    found = [host.references[n] + i for n, size in sizes.items() for i in range(size if host.fmi == 2 else 1)]
    return (ctypes.c_uint32 * len(found))(*found)


def derivative(
    host: CtypesHost,
    seed: Sequence[float],
    function: str = "GetDirectionalDerivative",
    knowns: dict[str, int] = INPUTS,
    unknowns: dict[str, int] = OUTPUTS,
) -> tuple[int, list[float]]:
    k, u = references(host, knowns), references(host, unknowns)
    result = (DOUBLE * sum((knowns if "Adjoint" in function else unknowns).values()))()
    values = (DOUBLE * len(seed))(*seed)
    sizes = (SIZE(len(seed)), SIZE(len(result)))
    vectors = (values, result) if host.fmi == 2 else (values, sizes[0], result, sizes[1])
    return host.call(function, u, SIZE(len(u)), k, SIZE(len(k)), *vectors), list(result)


@dataclass
class Seen:
    """States at a host's regular points, and the times of events."""

    states: list[list[float]]
    events: list[float]


def drive(host: CtypesHost, steps: int) -> Seen:
    """Do what a host with event mode does: steps up to regular points, known events and early returns."""
    seen = Seen([], [])
    following = handle(host)
    t, k = 0.0, 0
    for _ in range(2 * steps):
        if k == steps:
            return seen
        regular = (k + 1) * DT
        to = regular if following is None or following >= regular else following
        assert host.step(t, to - t) == OK, host.log[-1]
        t = host.last_time if host.early else to
        if host.event_needed or t == following:
            seen.events.append(t)
            assert host.call("EnterEventMode") == OK
            following = handle(host)
        if t == regular:
            seen.states.append(host.get("h") + host.get("v"))
            k += 1
    raise AssertionError(f"at t = {t} s there is no progress any more")


def port_of(width: str) -> str:
    return width.lower().replace("uint", "u").replace("int", "i")


def extremes(width: str) -> tuple[int, int]:
    limits = np.iinfo(width.lower())
    return int(limits.min), int(limits.max)
