"""Processes that are alive, by /proc, how far a run has come, waiting for a condition, and programs among the tests."""

import contextlib
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

SUPPORT = Path(__file__).parent


def program(name: str, *arguments: object) -> list[str]:
    """Return the command of a program in this folder, which may need `with_path`."""
    return [sys.executable, str(SUPPORT / name), *map(str, arguments)]


def with_path() -> dict[str, str]:
    """Return an environment in which Python imports what it does here."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}


def lives(process: int) -> bool:
    """Return whether a process exists and is not a zombie."""
    with contextlib.suppress(ProcessLookupError, FileNotFoundError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def children(process: int) -> list[int]:
    """Return the processes that a process has started and that exist."""
    processes: list[int] = []
    with contextlib.suppress(ProcessLookupError, FileNotFoundError):
        for thread in Path(f"/proc/{process}/task").iterdir():
            processes += map(int, (thread / "children").read_text().split())
    return processes


def family(process: int) -> list[int]:
    """Return a process's children, their children, and so on."""
    return [below for child in children(process) for below in (child, *family(child))]


def with_argument(process: int, argument: str) -> list[int]:
    """Return the processes below a process that were called with an argument; of a zombie none is known."""

    def has(process: int) -> bool:
        with contextlib.suppress(ProcessLookupError, FileNotFoundError):
            return argument.encode() in Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
        return False

    return [below for below in family(process) if has(below)]


def servers(process: int) -> list[int]:
    """Return the run servers below a process; the runs that they have forked have the same command line."""

    def named(process: int) -> bool:
        with contextlib.suppress(ProcessLookupError, FileNotFoundError):
            return b"handover.scenarios.runs.campaign.run_server" in Path(f"/proc/{process}/cmdline").read_bytes()
        return False

    return [child for above in (process, *family(process)) if not named(above) for child in children(above)
            if named(child)]  # fmt: skip


def parent(process: int) -> int:
    """Return the process that has started a process."""
    return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])


def stopped(process: int) -> bool:
    """Return whether a process is stopped, as by SIGSTOP."""
    with contextlib.suppress(ProcessLookupError, FileNotFoundError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "T"
    return False


def recorded_rows(folder: Path) -> int:
    """Return how many rows a run that goes on has recorded so far, but for those in whole blocks."""
    tail = folder / "signals.tail"
    return int.from_bytes(tail.read_bytes()[16:24], "little") if tail.exists() else 0


def until(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait until a condition is true, for at most some seconds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"the condition did not become true: {condition}"
        time.sleep(0.02)
