"""Units that harm their process: `handover run` keeps the run, tells what failed, and leaves nothing behind."""

import contextlib
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import pytest
from support.commands import data_in
from support.failing_systems import failing_chain, failing_ssp, start, wait_until
from support.processes import children, family, lives, recorded_rows, stopped, until

from handover.cosim.record.reader import Record

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc")
slow = pytest.mark.slow

TOGETHER = (
    "change_directory", "close_output", "take_output", "install_handlers", "round_up", "trap_division", "fork_itself",
    "limit_files", "limit_descriptors",
)  # fmt: skip
"""Harms that are put right all at once; `close_descriptors` closes what standard output is put right with."""
GENERAL = ("--algorithm", "fixed-point")


def end_of_chain(folder: Path, units: Sequence[str], *options: str, page: bool = False) -> list[float]:
    """Return what is read of units in a chain by a run that ends as if there were no harm in them."""
    more = () if page else ("--no-report",)
    status, shown, errors = start(folder, failing_chain(folder, units), "--out", "r", *options, *more).wait()
    assert (status, errors) == (0, "drawing figures, writing the report ...\n" if page else ""), shown
    assert "chain.ssp succeeded: ran to 1 s" in shown
    assert shown.count("succeeded") == 1
    assert shown.endswith("report: r/report.html\n" if page else "results: r\n")
    left = {"run.json", "signals.parquet", "summary.json"} | ({"figures", "report.html"} if page else set())
    assert {p.name for p in (folder / "r").iterdir()} == left
    assert data_in(folder / "r")["complete"]
    assert list((folder / "tmp").iterdir()) == []
    return Record(folder / "r" / "signals.parquet")["reader.x"].tolist()


@pytest.fixture(scope="module")
def without_harm(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], list[float]]:
    """Return what is read of a chain of so many units that do no harm."""

    @cache
    def read(length: int) -> list[float]:
        return end_of_chain(tmp_path_factory.mktemp("harmless"), ["stateless"] * length)

    return read


@pytest.mark.parametrize("coupling", [pytest.param((), id="plan"), pytest.param(GENERAL, id="general", marks=slow)])
def test_a_run_ends_as_if_its_units_had_done_no_harm_in_a_step(
    coupling: tuple[str, ...], without_harm: Callable[[int], list[float]], tmp_path: Path
):
    x = end_of_chain(tmp_path, [f"{harm}_in_step" for harm in TOGETHER], *coupling)
    # what follows the unit that rounds up, at that one point, rounds up
    assert x == pytest.approx(without_harm(len(TOGETHER)), rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("when", ["instantiate", "load"])
def test_so_it_does_where_they_do_it_before_it_begins(
    when: str, without_harm: Callable[[int], list[float]], tmp_path: Path
):
    x = end_of_chain(tmp_path, [f"{harm}_in_{when}" for harm in TOGETHER])
    assert x == without_harm(len(TOGETHER))


def test_figures_and_page_are_drawn_where_a_unit_rounds_up(tmp_path: Path):
    end_of_chain(tmp_path, ["round_up_in_load"], page=True)


@slow
@pytest.mark.parametrize("when", ["step", "step of the general loop", "instantiate", "load"])
def test_so_it_does_where_a_unit_closes_all_descriptors(
    when: str, without_harm: Callable[[int], list[float]], tmp_path: Path
):
    when, _, general = when.partition(" of ")
    options = GENERAL if general else ()
    assert end_of_chain(tmp_path, [f"close_descriptors_in_{when}"], *options) == without_harm(1)


@pytest.mark.parametrize(
    ("bad", "text"),
    [
        ("hang_in_load", "bad: loading of its library at t = 0 s did not return within 0.5 s"),
        pytest.param("hang_in_unload", "bad: unloading of its library at t = 1 s did not return", marks=slow),
        pytest.param("hang_in_terminate", "bad: fmi3Terminate at t = 1 s did not return within 0.5 s", marks=slow),
        ("error_in_terminate", "bad: fmi3Terminate at t = 1 s answered Error"),
        pytest.param("crash_in_load", "unit bad crashed in loading of its library at t = 0 s: segm", marks=slow),
        pytest.param("crash_in_free", "unit bad crashed in fmi3FreeInstance at t = 1 s: segm", marks=slow),
        ("crash_in_unload", "unit bad crashed in unloading of its library at t = 1 s"),
    ],
)
def test_what_fails_as_units_are_loaded_or_ended_is_reported_with_call_and_time(bad: str, text: str, tmp_path: Path):
    going = start(tmp_path, failing_ssp(tmp_path, bad), "--out", "r", "--call-limit", "0.5", "--no-report")
    status, _, errors = going.wait()
    assert status == 3, errors
    assert text in errors, errors
    assert list((tmp_path / "tmp").iterdir()) == []
    begun = not bad.endswith(("load", "instantiate")) or bad.endswith("unload")
    assert (tmp_path / "r").exists() == begun
    if begun:
        assert Record(tmp_path / "r" / "signals.parquet").time[-1] == 1.0
        failure = data_in(tmp_path / "r")["failure"]
        assert (failure["instance"], failure["time"]) == ("bad", 1.0)
        assert not (tmp_path / "r" / "report.html").exists()


def test_a_thread_of_a_unit_that_crashes_is_reported_with_the_unit(tmp_path: Path):
    file = failing_ssp(tmp_path, "start_crashing_thread_in_step")
    status, _, errors = start(tmp_path, file, "--out", "r", "--pace", "1", "--no-report").wait()
    assert status == 3, errors
    assert errors.startswith("unit bad crashed in a thread of its own at t = 0."), errors
    assert errors.endswith(": segmentation fault\n")
    failure = data_in(tmp_path / "r")["failure"]
    assert (failure["kind"], failure["instance"]) == ("crash", "bad")


def test_what_a_unit_has_forked_does_not_outlive_the_run(tmp_path: Path):
    file = failing_ssp(tmp_path, "fork_and_hang_in_step")
    going = start(tmp_path, file, "--out", "r", "--call-limit", "2", "--no-report")
    processes: list[int] = []

    def forked() -> bool:
        processes[:] = family(going.pid)
        return len(processes) > 1

    wait_until(forked, going)
    status, _, errors = going.wait()
    assert (status, errors) == (3, "bad: fmi3DoStep at t = 0.2 s did not return within 2 s\n")
    until(lambda: not any(map(lives, processes)))


@pytest.mark.parametrize(
    ("bad", "isolate"),
    [
        pytest.param("sleep_in_group", ("--isolate", "all"), marks=slow),
        ("sleep_in_daemon", ()),
        pytest.param("sleep_in_daemon", ("--isolate", "all"), marks=slow),
    ],
)
def test_what_a_unit_has_forked_and_left_ends_with_the_command(bad: str, isolate: tuple[str, ...], tmp_path: Path):
    file = failing_ssp(tmp_path, f"{bad}_in_step")
    going = start(tmp_path, file, "--out", "r", "--pace", "1", "--no-report", *isolate)
    seen: set[int] = set()
    while going.poll() is None:
        seen.update(family(going.pid))
        time.sleep(0.02)
    status, _, errors = going.wait()
    left = [process for process in seen if lives(process)]
    for process in left:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
    assert (status, errors, left) == (0, "", [])
    assert len(seen) > 1 + 3 * bool(isolate), "nothing was forked"


def waits_of(process: int) -> int:
    """Return how often a process has waited for something."""
    status = Path(f"/proc/{process}/status").read_text()
    return int(re.findall(r"^voluntary_ctxt_switches:\s*(\d+)", status, re.MULTILINE)[0])


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=slow)])
def test_a_run_that_a_unit_has_stopped_can_be_aborted(number: signal.Signals, tmp_path: Path):
    lines = [
        "the run is stopped (SIGSTOP) and ends once it continues; the same signal again aborts it",
        "Aborted! The run was stopped (SIGSTOP).",
    ]
    going = start(tmp_path, failing_ssp(tmp_path, "stop_itself_in_step"), "--out", "r", "--call-limit", "0")
    wait_until(lambda: any(map(stopped, family(going.pid))), going)
    looked = waits_of(going.pid) + 3
    wait_until(lambda: waits_of(going.pid) >= looked, going)  # its parent has seen it
    going.send_signal(number)
    wait_until(lambda: lines[0] in going.errors_file.read_text(), going)
    going.send_signal(number)
    status, _, errors = going.wait()
    assert status == 130
    assert errors.splitlines() == lines
    assert list((tmp_path / "tmp").iterdir()) == []
    assert (tmp_path / "r" / "signals.tail").exists(), "what was recorded is left"


@pytest.mark.parametrize("bad", ["ignore_signals_and_hang", pytest.param("fork_and_hang", marks=slow)])
def test_a_run_dies_with_its_parent_whatever_the_unit_does(bad: str, tmp_path: Path):
    going = start(tmp_path, failing_ssp(tmp_path, f"{bad}_in_step"), "--out", "r", "--call-limit", "0")
    wait_until(lambda: recorded_rows(tmp_path / "r") > 2, going)
    processes = children(going.pid)
    assert len(processes) == 1
    going.send_signal(signal.SIGKILL)
    assert going.wait().status == -signal.SIGKILL
    until(lambda: not any(map(lives, processes)))
    with contextlib.suppress(ProcessLookupError):
        os.killpg(processes[0], signal.SIGKILL)  # the copy of it, in which the unit hangs too
