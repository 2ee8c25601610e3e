"""A unit with events of its own, in hosts with and without event mode and early return."""

import math
from fractions import Fraction
from typing import Any

import fmpy
import numpy as np
import pytest
from support.fmus.ctypes_host import ERROR, OK
from support.fmus.saved_states import deserialise, save, serialised
from support.fmus.unit_calls import BALL, DT, drive, handle, with_events
from support.fmus.validity import problems_of
from support.fmus.workshop import Workshop, expect_error
from support.sample_units.bouncing_ball import BouncingBall, Inputs, Outputs, Params
from support.sample_units.scalars import Scalars
from support.wording import Wording

from handover.cosim.blocks.block import InvalidAdvance, TooManyEvents, step_through_events
from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.blocks.description import describe
from handover.cosim.master.master import Master
from handover.cosim.system.system import System

G, E, HEIGHT, RELEASE = 9.81, 0.7, 1.0, 0.25
IMPACTS = math.ceil(math.log(0.05 / math.sqrt(2 * G * HEIGHT), E))
"""Of the last one, the rebound is slower than 0.05 m/s and the ball stays."""


def impact_times(n: int) -> list[float]:
    """Return the first impacts: a fall of sqrt(2 h / g), then flights of 2 e^k v / g."""
    fall = math.sqrt(2 * HEIGHT / G)
    times = [RELEASE + fall]
    for k in range(1, n):
        times.append(times[-1] + 2 * E**k * fall)
    return times


def test_impacts_are_where_the_closed_form_has_them_and_the_course_is_that_without_event_mode(workshop: Workshop):
    seen, quiet = (drive(with_events(workshop, BALL, early_return=early), 250) for early in (True, False))
    assert seen.events == pytest.approx([RELEASE, *impact_times(IMPACTS)], abs=1e-12)
    assert quiet.events == [RELEASE]
    assert seen.states[-1] == [0.0, 0.0]
    plain = workshop.host(BALL, 3)
    assert plain.initialise() == OK
    for k, states in enumerate(zip(seen.states, quiet.states, strict=True)):
        assert plain.step(k * DT, DT) == OK
        assert (plain.early, plain.event_needed) == (False, False)
        assert np.abs(np.subtract(states, plain.get("h") + plain.get("v"))).max() < 1e-12


def test_an_early_return_says_where_the_step_ended_and_that_an_event_waits(workshop: Workshop, wording: Wording):
    host = with_events(workshop, BALL, early_return=True)
    for _ in range(3):  # without an event, nothing changes
        assert host.update() == OK
        assert host.next_event == RELEASE
    assert host.call("EnterStepMode") == OK
    assert host.step(0.0, 0.1) == OK
    assert (host.early, host.event_needed) == (False, False)
    assert host.call("EnterEventMode") == OK
    assert handle(host) == RELEASE
    assert host.step(0.1, 5.0) == OK
    assert (host.early, host.event_needed, host.last_time, host.terminate) == (True, True, RELEASE, False)
    assert host.get("time") == [RELEASE]
    expect_error(wording, host, host.step(RELEASE, 0.1))
    assert host.call("EnterEventMode") == OK
    expect_error(wording, host, host.call("EnterStepMode"))
    assert handle(host) is None
    assert host.step(RELEASE, 5.0) == OK
    assert host.last_time == pytest.approx(impact_times(1)[0], abs=1e-12)
    assert host.get("h") == [0.0]
    before = host.get("v")[0]
    assert host.call("EnterEventMode") == OK
    assert host.update() == OK
    assert host.get("v") == [-E * before]


def test_a_known_event_at_a_steps_end_is_reported_without_early_return(workshop: Workshop):
    host = with_events(workshop, BALL)
    handle(host)
    assert host.step(0.0, RELEASE) == OK
    assert (host.early, host.event_needed) == (False, True)
    assert host.get("h") == [HEIGHT]


def test_a_state_with_a_waiting_event_continues_in_another_instance(workshop: Workshop):
    host, other = (
        with_events(workshop, BALL, early_return=True),
        workshop.host(BALL, 3, event_mode=True, early_return=True),
    )
    handle(host)
    assert host.step(0.0, 5.0) == OK
    host.call("EnterEventMode")
    handle(host)
    assert host.step(RELEASE, 5.0) == OK
    assert other.call("SetFMUState", deserialise(other, serialised(host, save(host)))[1]) == OK
    t = host.last_time
    assert other.step(t, 1.0) == ERROR
    assert "is not handled yet" in other.log[-1]
    for h in (host, other):
        assert h.call("EnterEventMode") == OK
        assert h.update() == OK
    assert other.call("SetFMUState", deserialise(other, serialised(host, save(host)))[1]) == OK
    for h in (host, other):
        assert h.call("EnterStepMode") == OK
        assert h.step(t, 5.0) == OK
    assert (host.last_time, host.get("v")) == (other.last_time, other.get("v"))
    assert host.last_time == pytest.approx(impact_times(2)[1], abs=1e-12)


@pytest.mark.parametrize("fmi", [2, 3])
def test_other_masters_follow_the_events(workshop: Workshop, fmi: int):
    """FMPy without event mode (FMI 2) or with it, and our own."""
    fmu, impacts = workshop.fmu(BALL, fmi), [t for t in impact_times(20) if t < 2.0]
    assert problems_of(fmu) == []
    seen: Any = fmpy.simulate_fmu(
        str(fmu), stop_time=2.0, output_interval=DT, use_event_mode=fmi == 3, early_return_allowed=fmi == 3
    )
    assert len(seen) == 101 + (2 * (1 + len(impacts)) if fmi == 3 else 0)
    s, rows = System(), dict[float, float]()
    s.add("ball", fmu, period=Fraction(1, 10))
    with Master(s) as master:
        master.run(Fraction(2), [lambda t, y: rows.__setitem__(t, float(y["ball.h"]))])
    off_grid = [t for t in rows if t not in {k / 10 for k in range(21)}]
    assert off_grid == (pytest.approx([RELEASE, *impacts], abs=1e-9) if fmi == 3 else [])
    for t, h in rows.items():
        at = np.flatnonzero(np.isclose(seen["time"], t, rtol=0, atol=1e-9))
        assert not len(at) or seen["h"][at[-1]] == pytest.approx(h, abs=1e-9)


class Half(Scalars):
    def advance(self, t: float, dt: float, u: Any) -> tuple[float, Any]:
        return dt, self.step(t, dt, u)


class Sampled(BouncingBall):
    period = Fraction(1, 10)


class Stuck(BouncingBall):
    def advance(self, t: float, dt: float, u: Inputs) -> tuple[float, Outputs]:  # noqa: ARG002
        return 0.0, self.outputs(t, u)


class Hasty(BouncingBall):
    def advance(self, t: float, dt: float, u: Inputs) -> tuple[float, Outputs]:
        return 2.0 * dt, self.outputs(t, u)


def test_what_a_block_with_events_must_not_declare_or_do_is_refused(wording: Wording):
    assert describe(BouncingBall).has_events
    for declared in (Half, Sampled):
        with pytest.raises(DeclarationError) as refused:
            describe(declared)
        wording.check(refused.value)
    for block, kind in ((Stuck, TooManyEvents), (Hasty, InvalidAdvance)):
        with pytest.raises(kind) as failed:
            step_through_events(block(Params()), 1.0, 0.1, Inputs())
        wording.check(failed.value)
