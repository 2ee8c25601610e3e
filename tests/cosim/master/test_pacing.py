"""A run keeps to the wall clock by absolute deadlines, and reports those that it missed; the clock here is a number."""

import itertools
import math
import threading
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.native_units import native_fmu
from support.processes import until

from handover.cosim.master.live_control import ControlledPacer, LiveControl
from handover.cosim.master.master import Master
from handover.cosim.master.pacing import Pacer, PaceReport
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System


class Clock:
    """A clock that goes on only when somebody sleeps, or by what work takes; acts happen at their times."""

    def __init__(self, acts: Mapping[float, Callable[[], object]] | None = None) -> None:
        self.now = 0.0
        self.slept: list[float] = []
        self._acts = dict(acts or {})

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.work(seconds * 1.01)  # as real sleeps do, it ends late

    def work(self, seconds: float) -> None:
        self.now += seconds
        for due in [at for at in self._acts if at <= self.now]:
            self._acts.pop(due)()


def paced(work: list[float], pace: float = 1.0) -> tuple[PaceReport, list[float], Clock]:
    """Run points every 0.05 s that take so long to compute; return also when each was let pass."""
    clock = Clock()
    pacer = Pacer(pace, clock, clock.sleep)
    pacer.start(0.0)
    pacer.wait(0.0, lambda: False)
    passed: list[float] = []
    for k, seconds in enumerate(work):
        clock.work(seconds)
        pacer.wait(0.05 * (k + 1), lambda: False)
        passed.append(clock.now)
    return pacer.report, passed, clock


@pytest.mark.parametrize("pace", [1.0, 2.0])
def test_points_pass_at_their_own_times_without_drift_after_one_sleep_each(pace: float):
    report, passed, clock = paced([0.01] * 100, pace)
    assert passed == pytest.approx([0.05 * k / pace for k in range(1, 101)], abs=0.001)
    assert passed[-1] >= 5.0 / pace
    assert (report.deadlines, report.missed, report.largest_lateness, report.latest_at) == (100, 0, 0.0, None)
    assert str(report) == "none of 100"
    assert len(clock.slept) == 100
    assert report.reached == pytest.approx(pace, abs=0.001)


def test_a_missed_deadline_is_counted_and_the_others_stay_where_they_are():
    report, passed, _ = paced([0.01, 0.01, 0.12, 0.01, 0.01, 0.01])
    assert passed[-1] == pytest.approx(0.3, abs=0.001)
    assert (report.deadlines, report.missed) == (6, 2)  # 0.12 s of work at the third take until 0.22 s, then 0.23 s
    assert report.largest_lateness == pytest.approx(0.07, abs=0.001)
    assert report.latest_at == pytest.approx(0.15)
    assert report.share == pytest.approx(1 / 3)
    assert "2 of 6 (33.3%), at most 7" in str(report)
    for work, text in ((0.0604, "at most 10.4 ms late"), (1.11, "at most 1.06 s late"), (2000.0, "1999.95 s late")):
        assert text in str(paced([work])[0])
    assert paced([0.2] * 10)[0].reached == pytest.approx(0.05 / 0.2)
    assert paced([])[0].reached is None


def test_a_wait_ends_when_the_run_is_to_end():
    clock = Clock()
    pacer = Pacer(1e-6, clock, clock.sleep)
    pacer.start(0.0)
    pacer.wait(1.0, lambda: len(clock.slept) == 3)
    assert len(clock.slept) == 3


def test_the_master_lets_each_communication_point_wait_and_asks_for_inputs_when_it_is_due():
    s, clock = System(), Clock()
    mass = s.add("mass", native_fmu("mass", 3), period=Fraction(1, 100))
    seen: list[tuple[float, float]] = []
    asked: list[tuple[float, float]] = []

    class Source:
        def at(self, t: float) -> None:
            asked.append((t, clock.now))

    s.external(mass.u.f, Source())
    with Master(s, MasterOptions(pace=0.5)) as master:
        master.pacer = Pacer(0.5, clock, clock.sleep)
        master.run(Fraction(1, 10), [lambda t, _: seen.append((t, clock.now))])
    for times in (seen, asked):
        assert [wall for _, wall in times] == pytest.approx([2 * t for t, _ in times], abs=0.001)
        assert len(times) == 11
    assert master.pacer.report.deadlines == 10


@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_a_row_is_recorded_before_the_wait_so_that_who_watches_sees_the_first_one(
    algorithm: Algorithm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    s = System()
    s.add("unit", native_fmu("trivial"), period=Fraction(1, 100))
    waited: list[tuple[float, int]] = []
    options = MasterOptions(algorithm=algorithm, pace=1.0)
    with Master(s, options) as master, Recorder(tmp_path / "a.parquet") as recorder:

        def wait(self: Pacer, t: float, ended: object) -> None:  # noqa: ARG001
            waited.append((t, recorder.rows))

        monkeypatch.setattr(Pacer, "wait", wait)
        master.run(Fraction(3, 100), [recorder, lambda _t, _s: None])
    assert waited == [(pytest.approx(0.01 * k), k + 1) for k in range(4)]


MANY = 100


@pytest.mark.parametrize(
    ("pace", "acts", "counts"),
    [
        pytest.param(math.inf, {0.0: "pause"}, {0.0: 0}, id="ends in a pause"),
        pytest.param(
            math.inf,
            {0.0: "pause", 0.3: "step", 0.31: "step", 0.6: "step", 0.8: "go"},
            {0.0: 0, 0.3: 2, 0.6: 1, 0.8: MANY},
            id="as many steps as it is asked",
        ),
        pytest.param(
            math.inf, {0.3: "step and go", 0.5: "pause"}, {0.0: MANY, 0.3: MANY, 0.5: 0}, id="no step is kept"
        ),
        pytest.param(
            0.001,
            {0.1: "pause", 0.5: "fast", 0.6: "go"},
            {0.0: 0, 0.1: 0, 0.5: 0, 0.6: MANY},
            id="not passed by a pause",
        ),
        pytest.param(
            0.1, {0.25: "pause", 0.5: "go"}, {0.0: 2, 0.25: 0, 0.5: 1, 0.59: 4}, id="and from the end of a pause"
        ),
        pytest.param(
            math.inf, {0.2: "slow", 0.75: "fast"}, {0.0: MANY, 0.21: 5, 0.76: MANY}, id="a pace counts from its setting"
        ),
    ],
)
def test_controls_act_from_when_they_are_set(pace: float, acts: dict[float, str], counts: dict[float, int]):
    """Points every 10 ms, of which one takes 1 ms to compute, for 1 s; slow is a point in 0.1 s of wall time."""
    control = LiveControl.in_memory(pace)

    def act(name: str) -> None:
        if "step" in name:
            control.ask_for_step()
        if name in ("slow", "fast"):
            control.pace = 0.1 if name == "slow" else math.inf
        elif name != "step":
            control.paused = name == "pause"

    clock = Clock({at: lambda name=name: act(name) for at, name in acts.items()})
    pacer = ControlledPacer(control, clock, clock.sleep)
    passed: list[float] = []
    pacer.start(0.0)
    clock.work(0.0)
    while clock.now < 1.0:
        pacer.wait(0.01 * (len(passed) + 1), lambda: clock.now >= 1.0)
        passed.append(clock.now)
        clock.work(0.001)
    for begin, end in itertools.pairwise((*counts, 1.0)):
        found = sum(begin <= t < end for t in passed)
        assert found == counts[begin] or found > counts[begin] == MANY, (begin, found)


def test_no_step_is_lost_or_taken_twice_while_others_are_asked_for(tmp_path: Path):
    control = LiveControl.create(tmp_path / "control", math.inf, paused=True)
    passed, ended = list[float](), threading.Event()

    def go() -> None:
        pacer = ControlledPacer(control)
        while not ended.is_set():
            pacer.wait(0.01 * (len(passed) + 1), ended.is_set)
            passed.append(0.0)

    thread = threading.Thread(target=go)
    thread.start()
    for _ in range(2000):
        control.ask_for_step()
    until(lambda: len(passed) == 2000)
    ended.set()
    thread.join()
    assert len(passed) == 2001  # the wait that was ended
    assert not control.take_step()


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
    assert (here.pace, here.paused) == (math.inf, True)  # closed, it says what it said, and keeps what it is given
    here.pace = 4.0
    assert (here.pace, there.pace) == (4.0, math.inf)
    there.close()


@pytest.mark.parametrize("pace", [0.0, -1.0, math.nan])
def test_a_pace_that_is_none_is_refused_and_the_one_before_holds(tmp_path: Path, pace: float):
    with pytest.raises(ValueError, match="the pace must be positive"):
        LiveControl.create(tmp_path / "none", pace, paused=False)
    assert not (tmp_path / "none").exists()
    control = LiveControl.in_memory(2.0)
    with pytest.raises(ValueError, match="the pace must be positive"):
        control.pace = pace
    assert (control.pace, control.paused) == (2.0, False)


def test_the_report_of_a_pace_that_was_changed_says_so_and_what_it_was_at_first():
    control, clock = LiveControl.in_memory(1.0), Clock()
    pacer = ControlledPacer(control, clock, clock.sleep)
    pacer.start(0.0)
    control.pace = 50.0  # before the run begins: no change on the way
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
