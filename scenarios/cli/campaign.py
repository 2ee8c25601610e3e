"""Runs a campaign as a command does: with its progress, Ctrl-C, and exit statuses. `sweep` and `paper` call it.

Progress is a bar on a terminal, elsewhere a line now and then, as in a batch system's log. The first Ctrl-C ends a
campaign in order, the second at once.
"""

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType, TracebackType
from typing import NoReturn, TextIO

from rich.progress import BarColumn, TextColumn

from handover.cosim.exceptions import RecordNotWritten, counted
from handover.scenarios.runs.campaign.campaign import run_campaign
from handover.scenarios.runs.campaign.folder import CampaignFolder, default_folder
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.plan_check import PreparedPlan, prepared
from handover.scenarios.runs.campaign.pools import LazyPool, PoolConfig
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.campaign.worker_pool import RunCounts, WorkerPool
from handover.scenarios.runs.execution.errors import (
    ClusterLost,
    RunNotWritten,
    UsageError,
    WorkersLost,
    one_line_errors,
)
from handover.scenarios.runs.execution.exit_status import ABORTED, INTERRUPTED, UNIT_FAILED
from handover.scenarios.runs.execution.progress import say, terminal_progress
from handover.scenarios.runs.execution.supervisor import leave

_PAUSE = 30.0
"""Seconds from one line to the next where there is no terminal."""

_STARTING = "starting workers"


class CampaignProgress:
    """Shows the counts of a campaign's runs while it is used as a context manager; calling it updates them.

    Args:
        stream: what it is written to; a bar if it is a terminal.
        clock: returns monotonic time, s.
    """

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self.counts: RunCounts | None = None
        """The last counts."""
        self._stream = stream
        self._clock = clock
        self._began = self._printed_at = clock()
        columns = (TextColumn("{task.description}"), BarColumn(bar_width=30), TextColumn("{task.fields[left]}"))
        self._bar = terminal_progress(stream, *columns)
        self._task = self._bar.add_task(_STARTING, total=None, left="")
        self._printing, self._ended = threading.Lock(), threading.Event()
        self._printer = threading.Thread(target=self._print_periodically, daemon=True)

    def __call__(self, counts: RunCounts) -> None:
        """Take the present counts."""
        if self.counts is None:
            self._began = self._clock()
        self.counts = counts
        ended = counts.ended + counts.lost
        left = format_time_left(counts, self._clock() - self._began)
        self._bar.update(
            self._task, description=format_progress(counts), total=counts.total, completed=ended, left=left
        )
        self.tell()

    def tell(self) -> None:
        """Write a line if one is due."""
        with self._printing:
            if not self._bar.disable or self._due() > 0:
                return
            self._printed_at = self._clock()
            counts = self.counts
            left = format_time_left(counts, self._printed_at - self._began) if counts else ""
            self._stream.write(f"{format_progress(counts) if counts else _STARTING}{', ' if left else ''}{left}\n")
            self._stream.flush()

    def __enter__(self) -> "CampaignProgress":
        self._printed_at = self._clock()
        self._bar.start()
        if self._bar.disable:
            self._printer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        self._ended.set()
        if self._bar.disable:
            self._printer.join()

    def _due(self) -> float:
        """Return in how many seconds the next line is due."""
        return self._printed_at + _PAUSE - self._clock()

    def _print_periodically(self) -> None:
        while not self._ended.wait(max(self._due(), 0.0)):
            self.tell()


def format_progress(counts: RunCounts) -> str:
    """Return a text such as "12 of 60 runs done, 1 failed, 2 lost"."""
    parts = [f"{counts.ended} of {counts.total} runs done"]
    parts += [f"{counts.failed} failed"] if counts.failed else []
    parts += [f"{counts.lost} lost"] if counts.lost else []
    return ", ".join(parts)


def format_time_left(counts: RunCounts, elapsed: float) -> str:
    """Return a text such as "3 min left", estimated from the runs of this command; "" where nothing can be said."""
    ended_here = counts.ended + counts.lost - counts.kept
    if ended_here == 0 or counts.left == 0:
        return ""
    seconds = elapsed / ended_here * counts.left
    if seconds < 60:
        return f"{max(1, round(seconds))} s left"
    if seconds < 3600:
        return f"{round(seconds / 60)} min left"
    return f"{seconds / 3600:.1f} h left"


_SIGNALS = [n for n in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", None)) if n is not None]


class CampaignInterruption:
    """Handles SIGINT, SIGTERM and SIGHUP. Use it as a context manager in the main thread.

    The first of them raises KeyboardInterrupt, on which a campaign drops the runs under way and writes its table. The
    second ends this process at once with status 130, whereupon its workers end by themselves. A signal that is ignored,
    as under nohup, stays so.
    """

    def __init__(self) -> None:
        self._asked = self._defers = False
        self._undo: list[Callable[[], object]] = []

    def __enter__(self) -> "CampaignInterruption":
        for number in _SIGNALS:
            before = signal.getsignal(number)
            if before is not signal.SIG_IGN:
                signal.signal(number, self._take)
                self._undo.append(partial(signal.signal, number, before))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for undo in self._undo:
            undo()

    @contextlib.contextmanager
    def at_once(self) -> Generator[None, None, None]:
        """Let the first signal end this process like the second, while there is nothing to clean up."""
        before, self._asked = self._asked, True
        try:
            yield
        finally:
            self._asked = before

    @contextlib.contextmanager
    def deferred_signals(self) -> Generator[None, None, None]:
        """Defer the first signal to the end of the block, as half-started workers cannot be cleaned up.

        Raises:
            KeyboardInterrupt: at the end, if there has been one.
        """
        self._defers = True
        try:
            yield
        finally:
            self._defers = False
        if self._asked:
            raise KeyboardInterrupt

    def _take(self, _number: int, _frame: FrameType | None) -> None:
        if self._asked:
            os.write(2, b"\nAborted!\n" if os.isatty(2) else b"Aborted!\n")
            leave(ABORTED)
        self._asked = True
        if not self._defers:
            raise KeyboardInterrupt


@dataclass(frozen=True)
class CampaignOutcome:
    """A complete campaign: the plan as it was checked, its folder, its runs, and their counts."""

    plan: CampaignPlan
    folder: CampaignFolder
    table: CampaignTable
    counts: RunCounts

    @property
    def status(self) -> int:
        """The command's exit status: whether all runs have ended, whether or not their tasks succeeded."""
        return UNIT_FAILED if self.counts.failed or self.counts.lost else 0


Finish = Callable[[CampaignOutcome], None]
"""Prints the results of a complete campaign, and writes what is made of it, such as its report."""


def pool_config(workers: int | None, scheduler: str | None) -> PoolConfig:
    """Return workers of this machine, or those of a scheduler.

    Raises:
        UsageError: both are given.
    """
    if workers is not None and scheduler is not None:
        raise UsageError("--workers and --scheduler: a scheduler has workers of its own; give one of them")
    return PoolConfig(workers, scheduler)


def run_campaign_command(plan: CampaignPlan, out: Path | None, workers: PoolConfig, finish: Finish) -> CampaignOutcome:
    """Run a campaign in a folder, or in one of its own in `campaigns/`, and finish it.

    If it is interrupted, the command exits here with the status for that.

    Raises:
        UsageError, RunNotWritten, WorkersLost: with one line that says what was wrong.
    """
    progress = CampaignProgress(sys.stderr)
    folder = None
    try:
        with CampaignInterruption() as interruption, one_line_errors(), contextlib.ExitStack() as opened:
            named = CampaignFolder(out) if out else None
            ready = prepared(plan, lambda checked: _check_without_units(checked, named, workers, interruption))
            folder = named or default_folder(ready.plan, ready.fmus, opened)
            folder.check(ready.plan, ready.fmus)  # before anything is printed
            table = _run(ready, folder, workers, interruption, progress)
            assert progress.counts is not None
            outcome = CampaignOutcome(ready.plan, folder, table, progress.counts)
            if outcome.counts.kept == outcome.counts.total:
                say(f"{folder.path} has all of its runs; nothing was run")
            finish(outcome)
    except KeyboardInterrupt:
        _end_interrupted(folder, progress)
    return outcome


def _check_without_units(
    plan: CampaignPlan, folder: CampaignFolder | None, workers: PoolConfig, interruption: CampaignInterruption
) -> None:
    """Check what needs no units, which may have to be built."""
    if folder is not None:
        folder.check_free()
    if folder is None or not folder.has_all(plan):
        with interruption.at_once():  # asyncio cannot end while a server does not answer
            workers.check()


def _run(
    ready: PreparedPlan,
    folder: CampaignFolder,
    workers: PoolConfig,
    interruption: CampaignInterruption,
    progress: CampaignProgress,
) -> CampaignTable:
    plan = ready.plan
    if not folder.has_all(plan):
        done = sum(map(folder.is_done, plan.runs()))
        text = f"{counted(plan.size, 'run')} of {plan.scenario} on {workers} into {folder.path}"
        say(f"{text}{f'; {done} are done' if done else ''}")
    try:
        with contextlib.ExitStack() as opened, progress:
            start = partial(_started, workers, interruption)
            return run_campaign(ready, folder, LazyPool(start, opened), progress, interruption.deferred_signals)
    except (RecordNotWritten, ClusterLost) as e:
        if progress.counts is None:
            raise
        stopped = WorkersLost if isinstance(e, ClusterLost) else RunNotWritten
        raise stopped(f"{e}; {format_progress(progress.counts)}; run the same command again to resume") from e


@contextlib.contextmanager
def _started(workers: PoolConfig, interruption: CampaignInterruption) -> Generator[WorkerPool, None, None]:
    """Give workers; neither their start nor their end is interrupted."""
    opened = contextlib.ExitStack()
    try:
        with interruption.deferred_signals():
            pool = opened.enter_context(workers.start())
        yield pool
    finally:
        with interruption.deferred_signals():
            opened.close()


def _end_interrupted(folder: CampaignFolder | None, progress: CampaignProgress) -> NoReturn:
    if folder is None or progress.counts is None:
        kept = folder is not None and folder.is_there
        say(f"Aborted! Run the same command again to resume {folder.path}" if folder and kept else "Aborted!")
        sys.exit(ABORTED)
    say(f"{format_progress(progress.counts)} in {folder.path}; run the same command again to resume")
    sys.exit(INTERRUPTED)
