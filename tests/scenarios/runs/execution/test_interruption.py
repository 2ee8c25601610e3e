"""Ctrl-C and other signals: the first ends a run after its step, or what has not begun at once; the second aborts."""

import contextlib
import os
import signal
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
from support.commands import Command
from support.failing_systems import wait_until

from handover.fmus.build import build_block
from handover.scenarios.runs.execution.interruption import Interruption

BLOCKS = ["HangsInPython", "HangsInNativeCode"][: 2 if sys.platform.startswith("linux") else 1]


def interrupt(interruption: Interruption, times: int = 1) -> bool:
    for _ in range(times):
        os.kill(os.getpid(), signal.SIGINT)
    return interruption.asked


def swallow(interruption: Interruption) -> None:
    with contextlib.suppress(KeyboardInterrupt):
        interrupt(interruption)
    interruption.begin()


def twice_during_a_run(interruption: Interruption) -> None:
    interruption.begin()
    interrupt(interruption, 2)


@pytest.mark.parametrize("act", [interrupt, swallow, twice_during_a_run])
def test_an_interrupt_before_a_run_aborts_also_where_it_was_taken_for_a_failure_and_the_second_during_it(
    act: Callable[[Interruption], object], capfd: pytest.CaptureFixture[str]
):
    with pytest.raises(SystemExit) as caught, Interruption() as interruption:
        act(interruption)
    assert caught.value.code == 130
    assert capfd.readouterr().err.endswith("Aborted!\n")


def test_during_a_run_the_first_interrupt_asks_and_without_one_nothing_changes():
    before = signal.getsignal(signal.SIGINT)
    for times in (0, 1):
        with Interruption() as interruption:
            interruption.begin()
            assert interrupt(interruption, times) is bool(times)
        assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has no such signal")
@pytest.mark.parametrize(("handler", "asked"), [(signal.SIG_DFL, True), (signal.SIG_IGN, False)])
def test_a_terminal_that_is_closed_ends_a_run_unless_that_is_ignored(handler: signal.Handlers, asked: bool):
    """As under nohup, which ignores it for what it starts."""
    before = signal.signal(signal.SIGHUP, handler)
    try:
        with Interruption() as interruption:
            interruption.begin()
            os.kill(os.getpid(), signal.SIGHUP)
            assert interruption.asked is asked
        assert signal.getsignal(signal.SIGHUP) is handler
    finally:
        signal.signal(signal.SIGHUP, before)


def test_ctrl_c_while_units_are_built_leaves_nothing(tmp_path: Path):
    cache, out = tmp_path / "cache", tmp_path / "r"
    going = Command("run", "ir_grasp", "--out", out, env={"HANDOVER_CACHE": str(cache)})
    wait_until(cache.exists, going)
    going.send_signal(signal.SIGINT)
    status, _, errors = going.wait()
    assert status == 130
    assert "Traceback" not in errors
    assert not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize("block", BLOCKS)
def test_a_second_ctrl_c_ends_a_run_whose_unit_hangs(block: str, tmp_path: Path):
    unit = build_block(f"support.scenarios.hanging_blocks:{block}", 3, tmp_path, step=Fraction(1, 10))
    hangs = tmp_path / "hangs"
    going = Command("run", unit, "--stop", "1", "--out", tmp_path / "r", env={"HANGING_BLOCK_TELLS": str(hangs)})
    wait_until(hangs.exists, going)
    going.send_signal(signal.SIGINT)
    wait_until(lambda: "Ctrl-C again to abort" in going.errors_file.read_text(), going)
    going.send_signal(signal.SIGINT)
    status, _, errors = going.wait()
    assert status == 130
    assert "Aborted!" in errors
    assert "Traceback" not in errors
