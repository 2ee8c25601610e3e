"""A unit that does not return within the limit fails the run; the others are ended, and it is not called again."""

import threading
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.call_log import CallLog, fed_by
from support.cosim.endless_blocks import GO_ON
from support.cosim.native_units import native_fmu

from handover.cosim.fmu.failures import UnitHung
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import AdaptiveStep, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus.build import build_block

LIMIT = 3.0  # s: a unit in Python may take a while to be loaded beside other tests


@pytest.fixture
def endless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """Lets endless blocks go on, and waits until the threads that were left in them have ended."""
    before = set(threading.enumerate())
    file = tmp_path / "go on"
    monkeypatch.setenv(GO_ON, str(file))

    def go_on() -> None:
        file.touch()
        for thread in set(threading.enumerate()) - before:
            thread.join(60)
            assert not thread.is_alive()

    yield go_on
    go_on()


def block(name: str, folder: Path) -> Path:
    return build_block(f"support.cosim.endless_blocks:{name}", 3, folder, step=Fraction(1, 10))


@pytest.mark.parametrize("compiled", [False, True], ids=["general", "compiled"])
def test_a_unit_that_hangs_in_a_step_is_left_and_the_others_are_ended(
    compiled: bool, endless: Callable[[], None], tmp_path: Path
):
    s, call_log, record = System(), CallLog(), tmp_path / "r.parquet"
    s.add("steady", native_fmu("trivial"), period=Fraction(1, 10))
    s.add("endless", block("HangsInStep", tmp_path))
    s.add("later", native_fmu("trivial"), period=Fraction(1, 10))
    options = MasterOptions(call_limit=LIMIT, compiled=compiled)
    with pytest.raises(UnitHung) as caught, Master(s, options, call_log) as master, Recorder(record) as recorder:
        master.run(Fraction(1), [recorder])
    assert str(caught.value) == "endless: fmi3DoStep at t = 0.3 s did not return within 3 s"
    assert caught.value.as_data()["kind"] == "hang"
    assert Record(record).time.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])
    ends = [call for call in call_log.calls if call[1].endswith(("Terminate", "FreeInstance"))]
    assert sorted(ends) == sorted((u, f"fmi3{c}") for u in ("later", "steady") for c in ("FreeInstance", "Terminate"))
    number = len(call_log.calls)
    endless()
    assert call_log.calls[number:] == []  # the thread came back and touched no unit


@pytest.mark.parametrize(
    "options",
    [
        MasterOptions(call_limit=LIMIT, repeat_discarded=True),
        MasterOptions(call_limit=LIMIT, adaptive=AdaptiveStep(absolute=1e9)),
    ],
    ids=["events", "adaptive"],
)
def test_saved_states_of_a_unit_that_hangs_are_left_too(
    options: MasterOptions, endless: Callable[[], None], tmp_path: Path
):
    s, call_log = System(), CallLog()
    s.add("steady", native_fmu("integrator"), period=Fraction(1, 10))
    s.add("endless", block("HangsInStep", tmp_path))
    with pytest.raises(UnitHung) as caught, Master(s, options, call_log) as master:
        master.run(Fraction(1))
    assert caught.value.unit == "endless"
    assert call_log.after("endless", "fmi3DoStep", "endless") == []
    assert call_log.after("steady", "fmi3DoStep", "endless")[-1] == "fmi3FreeInstance"
    number = len(call_log.calls)
    endless()
    assert call_log.calls[number:] == []


def test_a_unit_that_hangs_as_it_is_initialised(endless: Callable[[], None], tmp_path: Path):
    s, call_log = System(), CallLog()
    s.add("first", native_fmu("trivial"))
    s.add("endless", block("HangsAtOnce", tmp_path))
    hangs = pytest.raises(UnitHung, match=r"endless: fmi3\w+ at t = 0 s did not return")
    with hangs, Master(s, MasterOptions(call_limit=LIMIT), call_log):
        pass
    assert ("first", "fmi3FreeInstance") in call_log.calls
    assert ("endless", "fmi3FreeInstance") not in call_log.calls
    endless()


def test_units_that_return_are_called_from_one_thread_and_nothing_is_left_of_it():
    before = set(threading.enumerate())
    seen: list[threading.Thread] = []

    def observe(_t: float, _signals: Signals) -> None:
        seen.append(threading.current_thread())

    with Master(fed_by(native_fmu("gain"), 3), MasterOptions(call_limit=60.0)) as master:
        master.run(Fraction(1, 2), [observe])
        master.run(Fraction(1), [observe])
    for thread in set(threading.enumerate()) - before:
        thread.join(60)
    assert {t.name for t in seen} == {"units"}
    assert len(set(seen)) == 1
    assert set(threading.enumerate()) <= before


def test_without_a_limit_there_is_no_other_thread():
    seen: list[threading.Thread] = []

    def observe(_t: float, _signals: Signals) -> None:
        seen.append(threading.current_thread())

    with Master(fed_by(native_fmu("gain"), 3)) as master:
        master.run(Fraction(1), [observe])
    assert set(seen) == {threading.current_thread()}


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf")])
def test_a_limit_that_is_none_is_refused(limit: float):
    with pytest.raises(ValueError, match="above 0 is right"):
        MasterOptions(call_limit=limit)


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
def threads() -> Iterator[list[Stuck]]:
    """Lets go of what is in the list, and waits until no thread is left."""
    before, stuck = set(threading.enumerate()), list[Stuck]()
    yield stuck
    for each in stuck:
        each.let_go.set()
    for thread in set(threading.enumerate()) - before:
        thread.join(60)
        assert not thread.is_alive()


@pytest.mark.parametrize(
    "options",
    [
        MasterOptions(call_limit=0.5),
        MasterOptions(call_limit=0.5, compiled=False),
        MasterOptions(call_limit=0.5, repeat_discarded=True),
    ],
    ids=["plan", "grid", "events"],
)
@pytest.mark.parametrize("call", ["Terminate", "FreeInstance"])
def test_others_are_ended(call: str, options: MasterOptions, threads: list[Stuck]):
    call_log = Stuck(f"fmi3{call}")
    threads.append(call_log)
    master = Master(fed_by(native_fmu("gain"), 3), options, call_log)
    with pytest.raises(UnitHung, match=f"bad: fmi3{call} at t = "), master:
        master.run(Fraction(1))
    for unit in ("source", "reader"):
        assert [c for u, c in call_log.calls if u == unit][-1] == "fmi3FreeInstance"
        assert (unit, "fmi3Terminate") in call_log.calls
    assert call_log.after("bad", f"fmi3{call}", "bad") == []


def test_a_failure_counts_more_than_a_hang_that_follows(threads: list[Stuck]):
    call_log = Stuck("fmi3Terminate")
    threads.append(call_log)

    def fail(t: float, _y: object) -> None:
        if t > 0.3:
            raise ZeroDivisionError

    with (
        pytest.raises(ZeroDivisionError),
        Master(fed_by(native_fmu("gain"), 3), MasterOptions(call_limit=0.5), call_log) as master,
    ):
        master.run(Fraction(1), [fail])
    assert call_log.after("source", "fmi3Terminate", "bad") != []
