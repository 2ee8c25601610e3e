"""Work is done in another thread; a call that does not return is left there, and when it returns it learns of that."""

import threading
from collections.abc import Callable

import pytest

from handover.cosim.fmu.failures import UnitHung
from handover.cosim.fmu.heartbeat import Abandoned, Heartbeat
from handover.cosim.master.watchdog import Watchdog


class Unit:
    """A unit whose calls last until an event, as `Instance` makes them."""

    def __init__(self, beat: Heartbeat) -> None:
        self.beat, self.go_on = beat, threading.Event()
        self.came_back: list[str] = []

    def call(self) -> None:
        self.beat.begin(self.beat.code("arm", "fmi3DoStep"), 0.4)
        self.go_on.wait(60)
        self.beat.end()
        self.came_back.append(threading.current_thread().name)
        if "arm" in self.beat.abandoned:
            raise Abandoned


def raising(error: BaseException) -> Callable[[], None]:
    def job() -> None:
        raise error

    return job


@pytest.mark.parametrize("limit", [None, 60.0])
def test_results_and_errors_come_through(limit: float | None):
    watchdog = Watchdog(Heartbeat(), limit)
    assert watchdog.run_job(lambda: 3) == 3
    error = ValueError("wrong")
    with pytest.raises(ValueError, match="wrong") as caught:
        watchdog.run_job(raising(error))
    assert caught.value is error
    watchdog.close()


def test_a_call_that_does_not_return_is_named_and_left_and_work_goes_on():
    beat = Heartbeat()
    watchdog, unit = Watchdog(beat, 0.1), Unit(beat)
    beat.log("arm", "[Warning] stiff")
    with pytest.raises(UnitHung) as caught:
        watchdog.run_job(unit.call)
    assert (caught.value.unit, caught.value.call, caught.value.t, caught.value.limit) == ("arm", "fmi3DoStep", 0.4, 0.1)
    assert caught.value.log == ("[Warning] stiff",)
    assert (beat.abandoned, beat.stopped) == ({"arm"}, True)
    assert watchdog.run_job(lambda: "freed") == "freed"
    unit.go_on.set()
    watchdog.close()


def test_what_is_no_call_of_a_unit_may_take_its_time():
    beat = Heartbeat()
    watchdog, looks = Watchdog(beat, 0.02), threading.Event()

    def job() -> str:
        looks.wait(0.2)  # ten times the limit
        return "done"

    assert watchdog.run_job(job) == "done"
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
