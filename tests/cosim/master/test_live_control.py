"""A run is paused, stepped, slowed and let go by its controls, from another process or thread."""

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from handover.cosim.master.live_control import ControlledPacer, LiveControl


class Points:
    """Communication points every 10 ms of simulated time that a pacer lets pass, in a thread."""

    def __init__(self, control: LiveControl) -> None:
        self.passed, self.ended = 0, False
        self._pacer = ControlledPacer(control)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        self._pacer.start(0.0)
        while not self.ended:
            self._pacer.wait(0.01 * (self.passed + 1), lambda: self.ended)
            if not self.ended:
                self.passed += 1

    def close(self) -> None:
        self.ended = True
        self._thread.join()


def until(condition: Callable[[], bool]) -> None:
    late = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < late, "it never came true"
        time.sleep(0.005)


def test_what_is_set_by_one_is_read_by_the_other(tmp_path: Path):
    here = LiveControl.create(tmp_path / "control", 2.0, paused=True)
    there = LiveControl(tmp_path / "control")
    assert (there.pace, there.paused, there.stop) == (2.0, True, False)
    there.pace, there.paused, there.stop = math.inf, False, True
    assert (here.pace, here.paused, here.stop) == (math.inf, False, True)
    assert not here.take_step()
    there.ask_for_step()
    assert here.paused
    assert here.take_step()
    assert not here.take_step()
    here.close()
    there.close()


def test_a_paused_run_takes_as_many_steps_as_it_is_told(tmp_path: Path):
    control = LiveControl.create(tmp_path / "control", math.inf, paused=True)
    points = Points(control)
    try:
        time.sleep(0.1)
        assert points.passed == 0
        for _ in range(3):
            control.ask_for_step()
        until(lambda: points.passed == 3)
        time.sleep(0.1)
        assert points.passed == 3
        control.paused = False
        until(lambda: points.passed > 1000)
    finally:
        points.close()


def test_no_step_is_lost_or_taken_twice_while_others_are_asked_for(tmp_path: Path):
    control = LiveControl.create(tmp_path / "control", math.inf, paused=True)
    points = Points(control)
    try:
        for _ in range(2000):
            control.ask_for_step()
        until(lambda: points.passed == 2000)
        time.sleep(0.05)
        assert points.passed == 2000
    finally:
        points.close()


def test_a_step_that_was_asked_for_while_the_run_went_on_is_not_taken_at_the_next_pause(tmp_path: Path):
    control = LiveControl.create(tmp_path / "control", math.inf, paused=False)
    points = Points(control)
    try:
        control.ask_for_step()
        control.paused = False
        before = points.passed
        until(lambda: points.passed > before + 100)
        control.paused = True
        time.sleep(0.1)
        before = points.passed
        time.sleep(0.1)
        assert points.passed == before
    finally:
        points.close()


def test_a_point_is_not_passed_early_by_a_pause_while_it_was_waited_for(tmp_path: Path):
    control = LiveControl.create(tmp_path / "control", 0.001, paused=False)  # a point in 10 s
    points = Points(control)
    try:
        time.sleep(0.1)
        control.paused = True
        time.sleep(0.3)
        assert points.passed == 0
        control.pace = math.inf
        control.paused = False
        until(lambda: points.passed > 100)
    finally:
        points.close()


def test_a_pace_counts_from_when_it_was_set(tmp_path: Path):
    control = LiveControl.create(tmp_path / "control", math.inf, paused=False)
    points = Points(control)
    try:
        until(lambda: points.passed > 1000)
        control.pace = 0.1  # a point in 0.1 s
        time.sleep(0.15)
        before = points.passed
        time.sleep(0.3)
        assert points.passed - before <= 6
        control.pace = math.inf
        until(lambda: points.passed > before + 1000)
    finally:
        points.close()


@pytest.mark.parametrize("pace", [0.001, math.inf])
def test_a_paused_run_ends_when_it_is_told_to(tmp_path: Path, pace: float):
    points = Points(LiveControl.create(tmp_path / "control", pace, paused=True))
    time.sleep(0.05)
    points.close()
    assert points.passed == 0


@pytest.mark.parametrize("pace", [0.0, -1.0, math.nan])
def test_a_pace_that_is_none_is_refused_and_the_one_before_holds(tmp_path: Path, pace: float):
    with pytest.raises(ValueError, match="the pace must be positive"):
        LiveControl.create(tmp_path / "none", pace, paused=False)
    assert not (tmp_path / "none").exists()
    control = LiveControl.create(tmp_path / "control", 2.0, paused=False)
    with pytest.raises(ValueError, match="the pace must be positive"):
        control.pace = pace
    assert control.pace == 2.0


def test_closed_controls_say_what_they_said_and_take_what_they_are_told(tmp_path: Path):
    control, other = LiveControl.create(tmp_path / "control", 3.0, paused=True), LiveControl(tmp_path / "control")
    control.close()
    assert (control.pace, control.paused) == (3.0, True)
    control.pace = 4.0
    assert (control.pace, other.pace) == (4.0, 3.0)
    other.close()


def test_controls_in_memory_are_not_paused():
    control = LiveControl.in_memory(2.0)
    control.ask_for_step()
    assert (control.pace, control.paused, control.stop, control.take_step()) == (2.0, True, False, True)


def test_the_report_of_a_pace_that_was_changed_says_so_and_what_it_was_at_first():
    control = LiveControl.in_memory(50.0)
    pacer = ControlledPacer(control)
    pacer.start(0.0)
    pacer.wait(0.01, lambda: False)
    unchanged = pacer.report.as_data()
    assert (unchanged["pace"], unchanged["deadlines"]) == (50.0, 1)
    assert not {"changed", "first"} & unchanged.keys(), "what summaries of such runs always held"
    control.pace = math.inf
    pacer.wait(0.02, lambda: False)
    fast = pacer.report.as_data()
    assert (fast["changed"], fast["first"], fast["pace"], fast["deadlines"]) == (True, 50.0, None, 0)
    control.pace = 100.0
    pacer.wait(0.03, lambda: False)
    assert (pacer.report.first, pacer.report.pace, pacer.report.deadlines) == (50.0, 100.0, 1)


def test_a_pace_that_is_set_before_the_run_begins_is_no_change_on_the_way():
    control = LiveControl.in_memory(1.0)
    pacer = ControlledPacer(control)
    pacer.start(0.0)
    control.pace = 50.0
    pacer.wait(0.01, lambda: False)
    assert (pacer.report.pace, pacer.report.deadlines, pacer.report.changed) == (50.0, 1, False)
    control.pace = 100.0
    pacer.wait(0.02, lambda: False)
    assert (pacer.report.first, pacer.report.pace, pacer.report.changed) == (50.0, 100.0, True)
