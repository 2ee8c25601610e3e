"""A unit with events of its own, in hosts with and without event mode and early return."""

import math
from fractions import Fraction
from typing import Any

import fmpy
import numpy as np
import pytest
from support.fmus.ctypes_host import ERROR, OK
from support.fmus.saved_states import deserialise, save, serialised
from support.fmus.unit_calls import BALL, DT, drive, handle
from support.fmus.validity import problems_of
from support.fmus.workshop import Workshop
from support.sample_units.bouncing_ball import BouncingBall, Inputs, Outputs, Params
from support.sample_units.scalars import Scalars
from support.wording import Wording

from handover.cosim.blocks.block import InvalidAdvance, TooManyEvents, step_through_events
from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.blocks.description import describe

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


def without_events(workshop: Workshop, steps: int) -> list[list[float]]:
    host = workshop.host(BALL, 3)
    assert host.initialise() == OK
    states: list[list[float]] = []
    for k in range(steps):
        assert host.step(k * DT, DT) == OK
        assert (host.early, host.event_needed) == (False, False)
        states.append(host.get("h") + host.get("v"))
    return states


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_unit_is_valid(workshop: Workshop, fmi: int):
    assert problems_of(workshop.fmu(BALL, fmi)) == []


def test_impacts_are_where_the_closed_form_has_them(workshop: Workshop):
    seen = drive(workshop.host(BALL, 3, event_mode=True, early_return=True), 200)
    assert seen.events == pytest.approx([RELEASE, *impact_times(IMPACTS)], abs=1e-12)


def test_the_course_is_the_same_with_event_mode_and_without(workshop: Workshop):
    plain = without_events(workshop, 200)
    seen = drive(workshop.host(BALL, 3, event_mode=True, early_return=True), 200)
    assert np.abs(np.subtract(seen.states, plain)).max() < 1e-12
    quiet = drive(workshop.host(BALL, 3, event_mode=True, early_return=False), 200)
    assert np.abs(np.subtract(quiet.states, plain)).max() < 1e-12
    assert quiet.events == [RELEASE]


def test_the_ball_comes_to_rest_and_its_events_end(workshop: Workshop):
    host = workshop.host(BALL, 3, event_mode=True, early_return=True)
    seen = drive(host, 250)
    assert seen.states[-1] == [0.0, 0.0]
    assert seen.events[-1] < 3.5
    assert len(seen.events) == 1 + IMPACTS
    assert not host.event_needed


def test_an_early_return_says_where_the_step_ended_and_that_an_event_waits(workshop: Workshop, wording: Wording):
    host = workshop.host(BALL, 3, event_mode=True, early_return=True)
    host.initialise()
    assert handle(host) == RELEASE
    assert host.step(0.0, 5.0) == OK
    assert (host.early, host.event_needed, host.last_time, host.terminate) == (True, True, RELEASE, False)
    assert host.get("time") == [RELEASE]
    assert host.step(RELEASE, 0.1) == ERROR
    wording.check(host.log[-1])
    assert host.call("EnterEventMode") == OK
    assert host.call("EnterStepMode") == ERROR
    wording.check(host.log[-1])
    assert handle(host) is None
    assert host.step(RELEASE, 5.0) == OK
    assert host.last_time == pytest.approx(impact_times(1)[0], abs=1e-12)
    assert host.get("h") == [0.0]
    before = host.get("v")[0]
    assert host.call("EnterEventMode") == OK
    assert host.update() == OK
    assert host.get("v") == [-E * before]


def test_a_known_event_at_a_steps_end_is_reported_without_early_return(workshop: Workshop):
    host = workshop.host(BALL, 3, event_mode=True)
    host.initialise()
    handle(host)
    assert host.step(0.0, RELEASE) == OK
    assert (host.early, host.event_needed) == (False, True)
    assert host.get("h") == [HEIGHT]


def test_event_mode_without_an_event_changes_nothing(workshop: Workshop):
    host = workshop.host(BALL, 3, event_mode=True, early_return=True)
    host.initialise()
    for _ in range(3):
        assert host.update() == OK
        assert host.next_event == RELEASE
    assert host.call("EnterStepMode") == OK
    assert host.step(0.0, 0.1) == OK
    assert (host.early, host.event_needed) == (False, False)
    assert host.call("EnterEventMode") == OK
    assert handle(host) == RELEASE


def test_a_state_with_a_waiting_event_continues_in_another_instance(workshop: Workshop):
    host, other = (workshop.host(BALL, 3, event_mode=True, early_return=True) for _ in range(2))
    host.initialise()
    handle(host)
    for t in (0.0, RELEASE):
        assert host.step(t, 5.0) == OK
        if t == 0.0:
            host.call("EnterEventMode")
            handle(host)
    status, state = deserialise(other, serialised(host, save(host)))
    assert status == OK
    assert other.call("SetFMUState", state) == OK
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


def test_fmpys_own_simulation_follows_the_events(workshop: Workshop):
    runs: list[Any] = [
        fmpy.simulate_fmu(
            str(workshop.fmu(BALL, 3)),
            stop_time=2.0,
            output_interval=DT,
            output=["h", "v"],
            use_event_mode=mode,
            early_return_allowed=mode,
        )
        for mode in (False, True)
    ]
    plain, seen = runs
    impacts = [t for t in impact_times(20) if t < 2.0]
    assert len(seen) == len(plain) + 2 * (1 + len(impacts))
    for t, h in zip(plain["time"], plain["h"], strict=True):
        at = np.flatnonzero(np.isclose(seen["time"], t, rtol=0, atol=1e-12))
        assert np.abs(seen["h"][at[-1]] - h) < 1e-12


def test_a_block_has_all_of_the_event_methods_or_none():
    assert describe(BouncingBall).has_events

    with pytest.raises(DeclarationError, match=r"Half.handle_event: a block with advance needs this method too"):
        describe(Half)

    class Sampled(BouncingBall):
        period = Fraction(1, 10)

    with pytest.raises(DeclarationError, match=r"a block with events is not sampled"):
        describe(Sampled)


class Half(Scalars):
    def advance(self, t: float, dt: float, u: Any) -> tuple[float, Any]:
        return dt, self.step(t, dt, u)


class Stuck(BouncingBall):
    def advance(self, t: float, dt: float, u: Inputs) -> tuple[float, Outputs]:  # noqa: ARG002
        return 0.0, self.outputs(t, u)


class Hasty(BouncingBall):
    def advance(self, t: float, dt: float, u: Inputs) -> tuple[float, Outputs]:
        return 2.0 * dt, self.outputs(t, u)


def test_events_without_end_and_impossible_progress_are_errors():
    with pytest.raises(TooManyEvents, match=r"Stuck has had 1000 events at t = 1\.0 s"):
        step_through_events(Stuck(Params()), 1.0, 0.1, Inputs())
    with pytest.raises(InvalidAdvance, match=r"Hasty.advance came 0\.2 s far; it was to advance by at most 0\.1 s"):
        step_through_events(Hasty(Params()), 1.0, 0.1, Inputs())
