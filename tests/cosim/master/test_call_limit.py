"""A unit that does not return within the limit fails the run; the others are ended, and it is not called again."""

import os
import threading
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.call_log import CallLog, fed_by
from support.cosim.endless_blocks import GO_ON
from support.cosim.native_units import native_fmu

from handover.cosim.fmu.failures import UnitHung
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.master.master import Master
from handover.cosim.master.watchdog import Watchdog
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import AdaptiveStep, MasterOptions
from handover.cosim.system.system import System
from handover.fmus.build import build_block

PLAN, GENERAL, EVENTS, ADAPTIVE = (
    MasterOptions(call_limit=0.5),
    MasterOptions(call_limit=0.5, compiled=False),
    MasterOptions(call_limit=0.5, repeat_discarded=True),
    MasterOptions(call_limit=0.5, adaptive=AdaptiveStep(absolute=1e9)),
)


class Stuck(CallLog):
    """Holds one call of the unit `bad` until it is let go."""

    def __init__(self, call: str) -> None:
        super().__init__()
        self._stuck = ("bad", call)
        self.let_go = threading.Event()

    def begin(self, code: int, t: float) -> None:
        super().begin(code, t)
        if self.calls[-1] == self._stuck:
            self.let_go.wait(60)


@pytest.fixture
def finish() -> Iterator[Callable[[Callable[[], object]], None]]:
    """Lets go of what is stuck, and waits until no thread is left that was not there before."""
    before = set(threading.enumerate())

    def let_go(act: Callable[[], object] = lambda: None) -> None:
        act()
        for thread in set(threading.enumerate()) - before:
            thread.join(60)
            assert not thread.is_alive()

    yield let_go
    let_go()


@pytest.mark.parametrize(
    ("call", "options"),
    [
        pytest.param("EnterInitializationMode", PLAN, id="initialized"),
        pytest.param("DoStep", GENERAL, id="step"),
        pytest.param("DoStep", EVENTS, id="step, events"),
        pytest.param("DoStep", ADAPTIVE, id="step, adaptive"),
        pytest.param("Terminate", PLAN, id="terminated, plan"),
        pytest.param("Terminate", EVENTS, id="terminated, events"),
        pytest.param("FreeInstance", PLAN, id="freed, plan"),
        pytest.param("FreeInstance", GENERAL, id="freed"),
    ],
)
def test_a_unit_that_hangs_is_left_and_the_others_are_ended(
    call: str, options: MasterOptions, finish: Callable[..., None]
):
    call_log = Stuck(f"fmi3{call}")
    call_log.log("bad", "[Warning] stiff")
    with pytest.raises(UnitHung) as caught, Master(fed_by(native_fmu("gain"), 3), options, call_log) as master:
        master.run(Fraction(1))
    failure = caught.value
    assert (failure.unit, failure.call, failure.limit) == ("bad", f"fmi3{call}", 0.5)
    assert failure.log == ("[Warning] stiff",)
    for unit in ("source", "reader"):
        assert [c for u, c in call_log.calls if u == unit][-1] == "fmi3FreeInstance"
        assert ((unit, "fmi3Terminate") in call_log.calls) == (not call.startswith("Enter"))
    assert call_log.after("bad", f"fmi3{call}", "bad") == []
    number = len(call_log.calls)
    finish(call_log.let_go.set)
    assert call_log.calls[number:] == []  # the thread came back and touched no unit


def test_so_is_one_that_hangs_within_the_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, finish: Callable[..., None]
):
    os.mkfifo(tmp_path / "pipe")
    monkeypatch.setenv(GO_ON, str(tmp_path / "pipe"))
    s, call_log, record = System(), CallLog(), tmp_path / "r.parquet"
    s.add("steady", native_fmu("trivial"), period=Fraction(1, 10))
    s.add("endless", build_block("support.cosim.endless_blocks:HangsInStep", 3, tmp_path, step=Fraction(1, 10)))
    options = MasterOptions(call_limit=3.0)  # s: a unit in Python may take a while to be loaded beside other tests
    with pytest.raises(UnitHung) as caught, Master(s, options, call_log) as master, Recorder(record) as recorder:
        master.run(Fraction(1), [recorder])
    assert str(caught.value) == "endless: fmi3DoStep at t = 0.3 s did not return within 3 s"
    assert caught.value.as_data()["kind"] == "hang"
    assert Record(record).time.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])
    ends = [call for call in call_log.calls if call[1].endswith(("Terminate", "FreeInstance"))]
    assert ends == [("steady", "fmi3Terminate"), ("steady", "fmi3FreeInstance")]
    finish(lambda: (tmp_path / "pipe").write_bytes(b""))
    assert call_log.calls[-1] == ends[-1]


def test_a_failure_counts_more_than_a_hang_that_follows(finish: Callable[..., None]):
    call_log = Stuck("fmi3Terminate")

    def fail(t: float, _y: object) -> None:
        if t > 0.3:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), Master(fed_by(native_fmu("gain"), 3), PLAN, call_log) as master:
        master.run(Fraction(1), [fail])
    assert call_log.after("source", "fmi3Terminate", "bad") != []
    finish(call_log.let_go.set)


@pytest.mark.parametrize(("limit", "thread"), [(60.0, "units"), (None, threading.current_thread().name)])
def test_units_that_return_are_called_from_one_thread_and_nothing_is_left_of_it(
    limit: float | None, thread: str, finish: Callable[..., None]
):
    seen: list[threading.Thread] = []
    with Master(fed_by(native_fmu("gain"), 3), MasterOptions(call_limit=limit)) as master:
        for stop in (Fraction(1, 2), Fraction(1)):
            master.run(stop, [lambda _t, _y: seen.append(threading.current_thread())])
    finish()
    assert [t.name for t in set(seen)] == [thread]


@pytest.mark.parametrize("limit", [None, 60.0])
def test_results_and_errors_come_through(limit: float | None):
    watchdog, error = Watchdog(Heartbeat(), limit), ValueError("wrong")

    def raising() -> None:
        raise error

    assert watchdog.run_job(lambda: 3) == 3
    with pytest.raises(ValueError, match="wrong") as caught:
        watchdog.run_job(raising)
    assert caught.value is error
    watchdog.close()


def test_what_is_no_call_of_a_unit_may_take_its_time():
    watchdog = Watchdog(Heartbeat(), 0.02)
    assert watchdog.run_job(lambda: threading.Event().wait(0.2)) is False  # ten times the limit
    watchdog.close()


def test_an_interrupt_of_the_caller_stops_the_work(monkeypatch: pytest.MonkeyPatch):
    beat = Heartbeat()
    watchdog = Watchdog(beat, 60.0)
    stopped = threading.Event()

    def job() -> None:
        while not beat.stopped:
            pass
        stopped.set()

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Watchdog, "_watch", interrupted)
    with pytest.raises(KeyboardInterrupt):
        watchdog.run_job(job)
    assert stopped.is_set()
    assert beat.abandoned == set()
    watchdog.close()
