"""A heartbeat reports the call in progress, also to another process, and for how long it has been observed."""

import os
import sys

import pytest

from handover.cosim.fmu.heartbeat import Heartbeat, PolledClock, StallTimer


def test_a_call_is_reported_by_names_and_time_while_it_is_under_way():
    beat = Heartbeat()
    assert beat.under_way is None
    beat.begin(beat.code("arm", "fmi3DoStep"), 0.4)
    assert beat.under_way == ("arm", "fmi3DoStep", 0.4)
    beat.begin(beat.code("hand", "fmi3GetFloat64"), 0.5)
    assert beat.under_way == ("hand", "fmi3GetFloat64", 0.5)
    beat.end()
    assert (beat.under_way, beat.beat, beat.time) == (None, None, 0.5)


def test_two_calls_of_the_same_kind_differ():
    beat, seen = Heartbeat(), set[object]()
    code = beat.code("arm", "fmi3DoStep")
    for _ in range(3):
        beat.begin(code, 0.0)
        seen.add(beat.beat)
    assert len(seen) == 3


def test_thousands_of_units_and_strange_names_keep_their_names():
    beat = Heartbeat()
    names = [f"unit {i} äöü" for i in range(3000)]
    codes = [beat.code(n, f"fmi3Call{i % 200}") for i, n in enumerate(names)]
    assert len(set(codes)) == 3000
    beat.begin(codes[2777], 1.0)
    assert beat.under_way == (names[2777], f"fmi3Call{2777 % 200}", 1.0)


def test_a_log_without_end_keeps_its_last_lines():
    beat = Heartbeat()
    for i in range(50_000):
        beat.log("arm", f"line {i}")
    beat.log("hand", "another\nand one more")
    assert beat.log_of("arm")[-1] == "line 49999"
    assert beat.log_of("hand") == ("another", "and one more")


@pytest.mark.skipif(sys.platform == "win32", reason="processes cannot be forked")
def test_what_a_process_reported_is_known_when_it_is_gone():
    beat = Heartbeat()
    child = os.fork()
    if child == 0:
        beat.record_facts(folder="runs/x")
        beat.record_scratch_folder("a")
        beat.record_scratch_folder("b")
        beat.log("arm", "[Warning] hot")
        beat.begin(beat.code("arm", "fmi2DoStep"), 0.4)
        os._exit(9)
    os.waitpid(child, 0)
    assert beat.under_way == ("arm", "fmi2DoStep", 0.4)
    assert beat.log_of("arm") == ("[Warning] hot",)
    assert beat.facts == {"folder": "runs/x", "scratch": ["a", "b"]}
    assert beat.status is None


def test_only_the_time_of_one_call_adds_up():
    beat, now = Heartbeat(), [0.0]
    stall_timer = StallTimer(beat, 0.5, lambda: now[0])
    code = beat.code("arm", "fmi3DoStep")

    def after(seconds: float) -> float:
        now[0] += seconds
        return stall_timer.poll()

    assert after(0.2) == 0.0  # no call is under way
    beat.begin(code, 0.0)
    assert [after(0.2), after(0.2), after(0.2)] == pytest.approx([0.0, 0.2, 0.4])
    beat.begin(code, 0.0)  # the same unit in its next call
    assert [after(0.2), after(0.2)] == pytest.approx([0.0, 0.2])
    assert after(3600.0) == pytest.approx(0.7)  # the machine slept
    beat.end()
    assert after(0.2) == 0.0


def test_a_polled_clock_counts_at_most_so_much_between_two_polls():
    now = [0.0]
    clock = PolledClock(0.5, lambda: now[0])

    def after(seconds: float, *, counts: bool = True) -> float:
        now[0] += seconds
        return clock.poll(counts=counts)

    assert [after(0.2), after(0.4), after(3600.0)] == pytest.approx([0.2, 0.6, 1.1])
    assert [after(0.3, counts=False), after(0.3)] == pytest.approx([1.1, 1.4])
    clock.restart()
    assert after(0.1) == pytest.approx(0.1)
