"""A run keeps to the wall clock by absolute deadlines, and reports those that it missed; the clock here is a list."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
from native_units import native_fmu

from handover.cosim.exceptions import InvalidOptions
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
