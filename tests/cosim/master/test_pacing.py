"""A run keeps to the wall clock by absolute deadlines, and reports those that it missed; the clock here is a list."""

import math
import threading
import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.native_units import native_fmu

from handover.cosim.exceptions import InvalidOptions
from handover.cosim.master.live_control import ControlledPacer, LiveControl
from handover.cosim.master.master import Master
from handover.cosim.master.pacing import Pacer, PaceReport
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System


class Clock:
    """A clock that goes on only when somebody sleeps, or by what work takes."""

    def __init__(self) -> None:
        self.now = 100.0
        self.slept: list[float] = []

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds * 1.01  # as real sleeps do, it ends late


def paced(work: list[float], pace: float = 1.0) -> tuple[PaceReport, list[float], Clock]:
    """Run points every 0.05 s that take so long to compute; return also when each was let pass."""
    clock = Clock()
    pacer = Pacer(pace, clock, clock.sleep)
    pacer.start(0.0)
    pacer.wait(0.0, lambda: False)
    passed: list[float] = []
    for k, seconds in enumerate(work):
        clock.now += seconds
        pacer.wait(0.05 * (k + 1), lambda: False)
        passed.append(clock.now - 100.0)
    return pacer.report, passed, clock


def test_points_pass_at_their_own_times_without_drift():
    report, passed, _ = paced([0.01] * 100)
    assert passed == pytest.approx([0.05 * k for k in range(1, 101)], abs=0.001)
    assert passed[-1] >= 5.0
    assert (report.deadlines, report.missed, report.largest_lateness, report.latest_at) == (100, 0, 0.0, None)
    assert str(report) == "none of 100"


def test_a_pace_of_two_halves_the_wall_time():
    _, passed, _ = paced([0.001] * 10, pace=2.0)
    assert passed == pytest.approx([0.025 * k for k in range(1, 11)], abs=0.001)


def test_a_missed_deadline_is_counted_and_the_others_stay_where_they_are():
    report, passed, _ = paced([0.01, 0.01, 0.12, 0.01, 0.01, 0.01])
    assert passed[-1] == pytest.approx(0.3, abs=0.001)
    assert (report.deadlines, report.missed) == (6, 2)  # 0.12 s of work at the third take until 0.22 s, then 0.23 s
    assert report.largest_lateness == pytest.approx(0.07, abs=0.001)
    assert report.latest_at == pytest.approx(0.15)
    assert report.share == pytest.approx(1 / 3)
    assert "2 of 6 (33.3%), at most 7" in str(report)


@pytest.mark.parametrize(
    ("work", "text"), [(0.0604, "at most 10.4 ms late"), (1.11, "at most 1.06 s late"), (2000.0, "1999.95 s late")]
)
def test_lateness_is_reported_in_a_unit_that_reads_well(work: float, text: str):
    assert text in str(paced([work])[0])


def test_it_says_how_fast_it_went():
    assert paced([0.01] * 100)[0].reached == pytest.approx(1.0, abs=0.001)
    assert paced([0.2] * 10)[0].reached == pytest.approx(0.05 / 0.2)
    assert paced([])[0].reached is None


def test_it_sleeps_until_the_deadline_at_once_and_not_in_a_loop():
    _, _, clock = paced([0.01] * 100)
    assert len(clock.slept) == 100


def test_a_wait_ends_when_the_run_is_to_end():
    clock = Clock()
    pacer = Pacer(1e-6, clock, clock.sleep)
    pacer.start(0.0)
    pacer.wait(1.0, lambda: len(clock.slept) == 3)
    assert len(clock.slept) == 3


def test_the_master_lets_each_communication_point_wait():
    s = System()
    s.add("unit", native_fmu("trivial"), period=Fraction(1, 100))
    clock = Clock()
    seen: list[tuple[float, float]] = []
    with Master(s, MasterOptions(pace=0.5)) as master:
        master.pacer = Pacer(0.5, clock, clock.sleep)
        master.run(Fraction(1, 10), [lambda t, _: seen.append((t, clock.now - 100.0))])
    assert [wall for _, wall in seen] == pytest.approx([2 * t for t, _ in seen], abs=0.001)
    assert master.pacer.report.deadlines == 10


class Paused(Pacer):
    """Notes at each wait, in place of it, how many rows were recorded until then."""

    def __init__(self, recorder: Recorder) -> None:
        super().__init__(1.0)
        self._recorder = recorder
        self.waited: list[tuple[float, int]] = []

    def wait(self, t: float, ended: Callable[[], bool]) -> None:  # noqa: ARG002
        self.waited.append((t, self._recorder.rows))


@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_a_row_is_recorded_before_the_wait_so_that_who_watches_sees_the_first_one(algorithm: Algorithm, tmp_path: Path):
    s = System()
    s.add("unit", native_fmu("trivial"), period=Fraction(1, 100))
    options = MasterOptions(algorithm=algorithm, pace=1.0)
    with Master(s, options) as master, Recorder(tmp_path / "a.parquet") as recorder:
        master.pacer = pacer = Paused(recorder)
        master.run(Fraction(3, 100), [recorder, lambda _t, _s: None])
    assert pacer.waited == [(pytest.approx(0.01 * k), k + 1) for k in range(4)]


def test_inputs_from_outside_are_asked_for_when_their_point_is_due():
    s = System()
    mass = s.add("mass", native_fmu("mass", 3))
    clock = Clock()
    asked: list[float] = []

    class Source:
        def at(self, t: float) -> None:
            asked.append(clock.now - 100.0 - 2.0 * t)

    s.external(mass.u.f, Source())
    with Master(s, MasterOptions(pace=0.5)) as master:
        master.pacer = Pacer(0.5, clock, clock.sleep)
        master.run(Fraction(1, 10), [])
    assert asked == pytest.approx([0.0] * 11, abs=0.001)
    assert master.pacer.report.deadlines == 10


@pytest.mark.parametrize("pace", [0.0, -1.0, float("nan"), float("inf")])
def test_a_pace_that_is_none_is_refused(pace: float):
    with pytest.raises(InvalidOptions, match="above 0 is right"):
        MasterOptions(pace=pace)


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
