"""A unit that does not return as it is terminated or freed is reported, and the others are ended."""

import threading
from collections.abc import Iterator
from fractions import Fraction

import pytest
from call_log import CallLog, fed_by
from native_units import native_fmu

from handover.cosim.fmu.failures import UnitHung
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions


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
