"""Campaigns by the real command, in processes of their own, for tests that disturb them."""

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
Going = subprocess.Popen[str]


@contextlib.contextmanager
def sweeping(*arguments: str | Path) -> Generator[Going, None, None]:
    """Start `handover sweep`; at the end it and what it started are ended."""
    call = [*_ENTRY, "sweep", *map(str, arguments)]
    going = subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield going
    finally:
        end(going)


def ended(going: Going) -> tuple[int, str, str]:
    """Wait for the end of a command; return its status and what it printed."""
    out, errors = going.communicate(timeout=600)
    return going.returncode, out, errors


def end(going: "subprocess.Popen[Any]") -> None:
    """End a process and its descendants."""
    if going.poll() is None:
        family = [psutil.Process(going.pid), *psutil.Process(going.pid).children(recursive=True)]
        for process in family:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
    going.wait()


def workers_of(process: int) -> list[psutil.Process]:
    """Return the workers that a process has started: an embedded cluster, or a nanny."""
    children = psutil.Process(process).children()
    return [p for p in children if any("spawn_main" in text for text in p.cmdline())]


def runs_in(folder: Path) -> dict[str, tuple[int, int]]:
    """Return the runs that are done, and what changes when one is done again."""
    runs = [p for p in (folder / "runs").glob("[!.]*") if p.is_dir()]
    facts = {p.name: (p / "summary.json").stat() for p in runs}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in facts.items()}


def wait_for(condition: Callable[[], Any], going: Going) -> None:
    """Wait until something is so, while a command goes on."""
    deadline = time.monotonic() + 300
    while not condition():
        assert going.poll() is None, going.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)


def without_times(folder: Path) -> list[dict[str, Any]]:
    """Return a campaign's rows without what depends on how fast it went."""
    times = ("wall_", "cpu_", "pace_", "peak_memory")
    return [{k: v for k, v in row.items() if not k.startswith(times)} for row in CampaignTable.read(folder).rows]
