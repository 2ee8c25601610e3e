"""Units that harm their process: `handover run` keeps the run, tells what failed, and leaves nothing behind."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from failing_systems import failing_ssp, start, wait_until
from processes import children, family, lives, until

from handover.cosim.record.reader import Record

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc")
slow = pytest.mark.slow

WHEN = ("step", "instantiate", "load")
HARMLESS_IN_THE_END = (
    "change_directory", "close_descriptors", "close_output", "take_output", "install_handlers", "round_up",
    "trap_division", "fork_itself", "limit_files", "limit_descriptors",
)  # fmt: skip
FIRST = {
    ("round_up", "step"),
    ("fork_itself", "step"),
}


def finish(going: "subprocess.Popen[str]") -> tuple[int, str, str]:
    shown, errors = going.communicate(timeout=180)
    return going.returncode, shown, errors


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> list[float]:
    """What the reader's output is where nothing does harm."""
    folder = tmp_path_factory.mktemp("expected")
    status, _, errors = finish(start(folder, failing_ssp(folder, "stateless"), "--out", "r", "--no-report"))
    assert (status, errors) == (0, "")
    return Record(folder / "r" / "signals.parquet")["reader.x"].tolist()


@pytest.mark.parametrize(
    ("harm", "when"),
    [
        pytest.param(harm, when, marks=() if (harm, when) in FIRST else (slow,))
        for harm in HARMLESS_IN_THE_END
        for when in WHEN
    ],
)
@pytest.mark.parametrize("way", ["plan", pytest.param("general", marks=slow)])
def test_a_run_ends_as_if_the_unit_had_done_no_harm(
    harm: str, when: str, way: str, expected: list[float], tmp_path: Path
):
    coupling = () if way == "plan" else ("--algorithm", "fixed-point")
    status, shown, errors = finish(start(tmp_path, failing_ssp(tmp_path, f"{harm}_in_{when}"), "--out", "r", *coupling))
    assert (status, errors) == (0, "drawing figures, writing the report ...\n"), shown
    assert f"{harm}_in_{when}.ssp succeeded: ran to 1 s" in shown
    assert shown.count("succeeded") == 1
    assert shown.endswith("report: r/report.html\n")
    out = tmp_path / "r"
    assert {p.name for p in out.iterdir()} == {
        "figures", "report.html", "run.json", "signals.parquet", "summary.json"
    }  # fmt: skip
    assert json.loads((out / "summary.json").read_text())["complete"]
    assert list((tmp_path / "tmp").iterdir()) == []
    x = Record(out / "signals.parquet")["reader.x"].tolist()
    if (harm, when) == ("round_up", "step"):  # what follows the unit at that one point rounds up
        assert x == pytest.approx(expected, rel=1e-14, abs=1e-15)
    else:
        assert x == expected


@pytest.mark.parametrize(
    ("bad", "text"),
    [
        pytest.param("hang_in_load", "bad: loading of its library at t = 0 s did not return within 0.5 s", marks=slow),
        ("hang_in_unload", "bad: unloading of its library at t = 1 s did not return within 0.5 s"),
        pytest.param("hang_in_instantiate", "bad: fmi3InstantiateCoSimulation at t = 0 s did not", marks=slow),
        pytest.param("hang_in_terminate", "bad: fmi3Terminate at t = 1 s did not return within 0.5 s", marks=slow),
        pytest.param("hang_in_free", "bad: fmi3FreeInstance at t = 1 s did not return within 0.5 s", marks=slow),
        ("error_in_terminate", "bad: fmi3Terminate at t = 1 s answered Error"),
        pytest.param("crash_in_load", "unit bad crashed in loading of its library at t = 0 s: segm", marks=slow),
        pytest.param("crash_in_terminate", "unit bad crashed in fmi3Terminate at t = 1 s: segmentation", marks=slow),
        ("crash_in_free", "unit bad crashed in fmi3FreeInstance at t = 1 s: segmentation fault"),
        pytest.param("crash_in_unload", "unit bad crashed in unloading of its library at t = 1 s", marks=slow),
    ],
)
def test_what_fails_as_units_are_loaded_or_ended_is_told_with_call_and_time(bad: str, text: str, tmp_path: Path):
    going = start(tmp_path, failing_ssp(tmp_path, bad), "--out", "r", "--call-limit", "0.5", "--no-report")
    status, _, errors = finish(going)
    assert status == 3, errors
    assert text in errors, errors
    assert list((tmp_path / "tmp").iterdir()) == []
    begun = not bad.endswith(("load", "instantiate")) or bad.endswith("unload")
    assert (tmp_path / "r").exists() == begun
    if begun:
        assert Record(tmp_path / "r" / "signals.parquet").time[-1] == 1.0
        failure = json.loads((tmp_path / "r" / "summary.json").read_text())["failure"]
        assert (failure["instance"], failure["time"]) == ("bad", 1.0)
        assert not (tmp_path / "r" / "report.html").exists()


def test_a_thread_of_a_unit_that_crashes_is_told_with_the_unit(tmp_path: Path):
    file = failing_ssp(tmp_path, "start_crashing_thread_in_step")
    status, _, errors = finish(start(tmp_path, file, "--out", "r", "--pace", "1", "--no-report"))
    assert status == 3, errors
    assert errors.startswith("unit bad crashed in a thread of its own at t = 0."), errors
    assert errors.endswith(": segmentation fault\n")
    failure = json.loads((tmp_path / "r" / "summary.json").read_text())["failure"]
    assert (failure["kind"], failure["instance"]) == ("crash", "bad")


@slow
def test_what_a_unit_has_forked_does_not_outlive_the_run(tmp_path: Path):
    going = start(
        tmp_path, failing_ssp(tmp_path, "fork_and_hang_in_step"), "--out", "r", "--call-limit", "2", "--no-report"
    )
    processes: list[int] = []

    def forked() -> bool:
        processes[:] = family(going.pid)
        return len(processes) > 1

    wait_until(forked, going)
    status, _, errors = finish(going)
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
    going = start(
        tmp_path, failing_ssp(tmp_path, f"{bad}_in_step"), "--out", "r", "--pace", "1", "--no-report", *isolate
    )
    seen: set[int] = set()
    while going.poll() is None:
        seen.update(family(going.pid))
        time.sleep(0.02)
    left = [process for process in seen if lives(process)]
    for process in left:
        os.kill(process, signal.SIGKILL)
    status, _, errors = finish(going)
    assert (status, errors, left) == (0, "", [])
    assert len(seen) > 1 + 3 * bool(isolate), "nothing was forked"


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=slow)])
def test_a_run_that_a_unit_has_stopped_can_be_aborted(number: signal.Signals, tmp_path: Path):
    going = start(tmp_path, failing_ssp(tmp_path, "stop_itself_in_step"), "--out", "r", "--call-limit", "0")

    def stopped() -> bool:
        for pid in family(going.pid):
            with contextlib.suppress(FileNotFoundError, ProcessLookupError):
                if ") T " in Path(f"/proc/{pid}/stat").read_text():
                    return True
        return False

    wait_until(stopped, going)
    time.sleep(1)  # until its parent has looked
    for _ in range(2):
        going.send_signal(number)
        time.sleep(1)
    status, _, errors = finish(going)
    assert status == 130
    assert errors.splitlines() == [
        "the run is stopped (SIGSTOP) and ends once it continues; the same signal again aborts it",
        "Aborted! The run was stopped (SIGSTOP).",
    ]
    assert list((tmp_path / "tmp").iterdir()) == []
    assert (tmp_path / "r" / "signals.tail").exists(), "what was recorded is left"


@pytest.mark.parametrize("bad", ["ignore_signals_and_hang", pytest.param("fork_and_hang", marks=slow)])
def test_a_run_dies_with_its_parent_whatever_the_unit_does(bad: str, tmp_path: Path):
    going = start(tmp_path, failing_ssp(tmp_path, f"{bad}_in_step"), "--out", "r", "--call-limit", "0")
    tail = tmp_path / "r" / "signals.tail"
    wait_until(lambda: tail.exists() and tail.read_bytes()[16:17] >= b"\x03", going)
    processes = children(going.pid)
    assert len(processes) == 1
    os.kill(going.pid, signal.SIGKILL)
    going.wait(60)
    until(lambda: not any(map(lives, processes)))
    assert going.stdout is not None
    assert going.stderr is not None
    going.stdout.close()
    going.stderr.close()
    with contextlib.suppress(ProcessLookupError):
        os.killpg(processes[0], signal.SIGKILL)  # the copy of it, in which the unit hangs too
