"""Campaigns by the command `handover sweep` in processes of their own, for tests that interrupt or kill them."""

import contextlib
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import psutil

from handover.scenarios.campaign.table import CampaignTable

_ENTRY = [sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()"]
SweepProcess = subprocess.Popen[str]


@contextlib.contextmanager
def sweeping(*arguments: str | Path) -> Generator[SweepProcess, None, None]:
    """Start `handover sweep`; at the end it and what it started are ended."""
    call = [*_ENTRY, "sweep", *map(str, arguments)]
    sweep = subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield sweep
    finally:
        end(sweep)


def ended(sweep: SweepProcess) -> tuple[int, str, str]:
    """Wait for the end of a command; return its status and what it printed."""
    out, errors = sweep.communicate(timeout=600)
    return sweep.returncode, out, errors


def end(sweep: "subprocess.Popen[Any]") -> None:
    """End a process and its descendants."""
    if sweep.poll() is None:
        family = [psutil.Process(sweep.pid), *psutil.Process(sweep.pid).children(recursive=True)]
        for process in family:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
    sweep.wait()


def workers_of(process: int) -> list[psutil.Process]:
    """Return the workers that a process has started: an embedded cluster, or a nanny."""
    children = psutil.Process(process).children()
    return [p for p in children if any("spawn_main" in text for text in p.cmdline())]


def runs_in(folder: Path) -> dict[str, tuple[int, int]]:
    """Return the runs that are done, with the inode and time of their summaries, which change if a run is repeated."""
    runs = [p for p in (folder / "runs").glob("[!.]*") if p.is_dir()]
    stats = {p.name: (p / "summary.json").stat() for p in runs}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in stats.items()}


def wait_for(condition: Callable[[], Any], sweep: SweepProcess) -> None:
    """Wait until a condition is true, while a command runs."""
    deadline = time.monotonic() + 300
    while not condition():
        assert sweep.poll() is None, sweep.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)


def without_times(folder: Path) -> list[dict[str, Any]]:
    """Return a campaign's rows without what depends on how fast it went."""
    times = ("wall_", "cpu_", "pace_", "peak_memory")
    return [{k: v for k, v in row.items() if not k.startswith(times)} for row in CampaignTable.read(folder).rows]
