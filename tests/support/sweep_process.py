"""Campaigns by the command `handover sweep` in processes of their own, for tests that interrupt or kill them."""

import contextlib
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import psutil

from handover.scenarios.runs.campaign.table import CampaignTable
from support.commands import Command, Ended

SweepProcess = Command


@contextlib.contextmanager
def sweeping(*arguments: str | Path) -> Generator[Command, None, None]:
    """Start `handover sweep`; at the end it and what it started are ended."""
    sweep = Command("sweep", *arguments)
    try:
        yield sweep
    finally:
        if sweep.poll() is None:
            for process in (psutil.Process(sweep.pid), *psutil.Process(sweep.pid).children(recursive=True)):
                with contextlib.suppress(psutil.NoSuchProcess):
                    process.kill()


def ended(sweep: SweepProcess) -> Ended:
    """Wait for the end of a command; return its status and what it printed."""
    return sweep.wait(600.0)


def runs_in(folder: Path) -> dict[str, tuple[int, int]]:
    """Return the runs that are done, with the inode and time of their summaries, which change if a run is repeated."""
    runs = [p for p in (folder / "runs").glob("[!.]*") if p.is_dir()]
    stats = {p.name: (p / "summary.json").stat() for p in runs}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in stats.items()}


def wait_for(condition: Callable[[], Any], sweep: Command) -> None:
    """Wait until a condition is true, while a command runs."""
    deadline = time.monotonic() + 300
    while not condition():
        assert sweep.poll() is None, sweep.wait()
        assert time.monotonic() < deadline, sweep.errors_file.read_text()
        time.sleep(0.05)


def without_times(folder: Path) -> list[dict[str, Any]]:
    """Return a campaign's rows without what depends on how fast it went."""
    times = ("wall_", "cpu_", "pace_", "peak_memory")
    return [{k: v for k, v in row.items() if not k.startswith(times)} for row in CampaignTable.read(folder).rows]
