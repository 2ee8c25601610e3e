"""A child process that is stopped, hangs at its end, closes its pipes or loses its parent is dealt with."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import NoReturn

import pytest
from support.processes import lives, until

from handover.cosim.fmu.heartbeat import Heartbeat, StallTimer
from handover.scenarios.runs.execution import child_process
from handover.scenarios.runs.execution.child_process import ChildEnd, ForkedChild

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are looked at as on Linux")


@pytest.fixture
def beat(monkeypatch: pytest.MonkeyPatch) -> Heartbeat:
    """Of a child whose calls may take 0.3 s, and whose parent waits 0.3 s longer."""
    monkeypatch.setattr(child_process, "_GRACE", 0.3)
    beat = Heartbeat()
    beat.limit = 0.3
    return beat


def forked(beat: Heartbeat, work: Callable[[], object]) -> ForkedChild:
    def command() -> NoReturn:
        work()
        beat.status = 0
        os._exit(0)

    return ForkedChild(command, beat)


def ended(child: ForkedChild, **options: float) -> ChildEnd:
    end = child.wait(**options)  # type: ignore
    assert end is not None
    return end


def begin_call(beat: Heartbeat) -> None:
    beat.begin(beat.code("bad", "fmi3DoStep"), 0.1)


def hang_in_call(beat: Heartbeat) -> None:
    begin_call(beat)
    time.sleep(60)


def say_status(beat: Heartbeat) -> None:
    beat.status = 3
    time.sleep(60)


def close_descriptors(beat: Heartbeat) -> None:
    os.closerange(3, 1024)
    hang_in_call(beat)


@pytest.mark.parametrize(
    ("work", "hung", "status"), [(hang_in_call, True, None), (say_status, False, 3), (close_descriptors, True, None)]
)
def test_a_child_that_does_not_end_is_ended(
    work: Callable[[Heartbeat], None], hung: bool, status: int | None, beat: Heartbeat
):
    end = ended(forked(beat, lambda: work(beat)))
    assert (end.signal, end.hung, end.stopped, beat.status) == (signal.SIGKILL, hung, False, status)


def test_a_child_that_is_stopped_in_a_call_does_not_hang(beat: Heartbeat):
    child = forked(beat, lambda: (begin_call(beat), time.sleep(0.2), beat.end()))
    os.kill(child.pid, signal.SIGSTOP)
    subprocess.Popen(["sh", "-c", f"sleep 1; kill -CONT {child.pid}"]).poll()
    end = ended(child)
    assert (end.signal, end.status, end.hung, end.stopped) == (None, 0, False, False)


def test_a_child_that_stays_stopped_is_given_up_but_did_not_hang(beat: Heartbeat):
    child = forked(beat, lambda: hang_in_call(beat))
    os.kill(child.pid, signal.SIGSTOP)
    end = ended(child, stop_limit=1.0)
    assert (end.signal, end.hung, end.stopped) == (signal.SIGKILL, False, True)


def test_memory_that_is_read_back_from_the_disk_does_not_count_as_hanging():
    beat, now, reads = Heartbeat(), [0.0], [0]
    stall_timer = StallTimer(beat, 0.5, lambda: now[0], lambda: reads[0])
    begin_call(beat)

    def after(seconds: float, read: int) -> float:
        now[0] += seconds
        reads[0] += read
        return stall_timer.poll()

    assert [after(0.2, 0), after(0.2, 0), after(0.2, 7), after(0.2, 0)] == pytest.approx([0.0, 0.2, 0.2, 0.4])


_PARENT = """
import ctypes, os, signal
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.scenarios.runs.execution.child_process import ForkedChild

def hang():
    os.closerange(3, 1024)
    for number in range(1, 32):
        if number not in (signal.SIGKILL, signal.SIGSTOP):
            signal.signal(number, signal.SIG_IGN)
    print(os.getpid(), flush=True)
    ctypes.PyDLL(None).sleep(600)  # with Python's lock, so that none of its threads runs

ForkedChild(hang, Heartbeat()).wait()
"""


def test_a_child_that_can_do_nothing_dies_with_its_parent():
    parent = subprocess.Popen([sys.executable, "-c", _PARENT], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    assert lives(child)
    parent.kill()
    parent.wait()
    parent.stdout.close()
    until(lambda: not lives(child))
