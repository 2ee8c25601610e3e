"""Runs a campaign: checks all of it, keeps runs that are done, gives the others to a worker pool, writes the table."""

import contextlib
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from handover.cosim.exceptions import RecordNotWritten
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan import CampaignPlan, PlannedRun
from handover.scenarios.runs.campaign.plan_check import PreparedPlan
from handover.scenarios.runs.campaign.table import CampaignTable, RunRow, row_of
from handover.scenarios.runs.campaign.table_writer import TableWriter
from handover.scenarios.runs.campaign.worker_pool import JobResult, OnRunCounts, RunCounts, RunJob, WorkerPool
from handover.scenarios.runs.results.run_folder import disk_errors_reported

SignalsDeferred = Callable[[], contextlib.AbstractContextManager[None]]


def run_campaign(
    ready: PreparedPlan,
    folder: CampaignFolder,
    pool: WorkerPool,
    progress: OnRunCounts,
    signals_deferred: SignalsDeferred = contextlib.nullcontext,
) -> CampaignTable:
    """Run those runs of a campaign that are not done yet, and return the table of all.

    However it ends, runs that are done are kept, and running the same command again resumes the campaign. A run is done
    when its folder is complete, also if a unit failed in it; lost runs are tried again. Each result is taken, and the
    table completed, in a block of `signals_deferred`, which can defer signals meanwhile.

    Raises:
        InvalidRunFolder, PoolError: before anything was written.
        RecordNotWritten: the disk is full.
        ClusterLost: all workers were lost.
        KeyboardInterrupt: it was interrupted; runs under way are dropped, and the table is written.
    """
    check = _no_check if folder.has_all(ready.plan) else pool.check
    with folder.opened(ready.plan, ready.fmus, check) as fmus:
        state = _CampaignState(ready.plan, folder, progress)
        try:
            state.run_on(pool, fmus, signals_deferred)
        finally:
            with signals_deferred():
                state.end()
    return CampaignTable.read(folder.table)


def _no_check(_folder: Path) -> None:
    """Check no worker pool, as none is needed unless a run turns out to be damaged."""


class _CampaignState:
    """A campaign under way: its table, and how many of its runs are done."""

    def __init__(self, plan: CampaignPlan, folder: CampaignFolder, progress: OnRunCounts) -> None:
        self.plan, self.folder, self.progress = plan, folder, progress
        self.table = TableWriter(plan, folder.table)
        self._source = plan.source
        self.runs = {run.name: run for run in plan.runs()}
        self._count = Counter[str]()
        self._kept = self._keep(self.runs.values())
        progress(self.counts)

    def run_on(self, pool: WorkerPool, fmus: Mapping[str, Path], signals_deferred: SignalsDeferred) -> None:
        """Let a worker pool run the runs that are not done."""
        jobs = [self._job(run, fmus) for run in self._to_do()]
        if not jobs:
            return
        with contextlib.closing(pool.run_jobs(jobs)) as results:
            for result in results:
                with signals_deferred():  # also tells of a signal whose exception was lost, as in a finalizer
                    self._take(result)

    def end(self) -> None:
        """Write the table, also with runs that have ended but whose results have not come, as after an interruption."""
        known = {row.run.name for row in self.table.rows if row.status != "lost"}
        if self._keep([run for run in self.runs.values() if run.name not in known]):
            self.progress(self.counts)
        self.table.complete()

    @property
    def counts(self) -> RunCounts:
        """Counts of its runs so far."""
        n = self._count
        ended = n["done"] + n["failed"]
        return RunCounts(total=len(self.runs), kept=self._kept, ended=ended, failed=n["failed"], lost=n["lost"])

    def _keep(self, runs: Iterable[PlannedRun]) -> int:
        """Take the rows of runs that are done, and remove folders that cannot be read; return how many are done."""
        kept: list[RunRow] = []
        for run in runs:
            run_folder = self.folder.runs / run.name
            row = row_of(run, run_folder) if self.folder.is_done(run) else None
            if row is not None:
                kept.append(row)
            elif run_folder.exists():
                with disk_errors_reported(self.folder.runs):
                    shutil.rmtree(run_folder)
        self.table.keep(kept)
        self._count = Counter(row.status for row in self.table.rows)
        return len(kept)

    def _to_do(self) -> Sequence[PlannedRun]:
        """Return the runs that are not done, repetition by repetition, so that a part of them covers all points."""
        missing = [run for run in self.runs.values() if not self.folder.is_done(run)]
        return sorted(missing, key=lambda run: run.repetition)

    def _job(self, run: PlannedRun, fmus: Mapping[str, Path]) -> RunJob:
        file, inputs, units = self.plan.file, self.plan.inputs, self.plan.fmus(run.point, fmus)
        return RunJob(
            name=run.name,
            scenario=self.plan.scenario if file is None else str(units.pop(file.stem)),
            parameters=tuple(self.plan.texts(run.point)),
            seed=run.seed,
            fmus={unit: str(path) for unit, path in units.items()},
            runs=str(self.folder.runs.absolute()),
            options=self.plan.options,
            start=self.plan.start,
            stop=self.plan.stop,
            step=self.plan.step,
            recorded=tuple(self.plan.recorded),
            inputs="" if inputs is None else str(self.folder.fmus.absolute() / inputs.name),
            log_level=self.plan.log_level,
            modules="" if self._source is None else self._source.folder,
        )

    def _take(self, result: JobResult) -> None:
        run = self.runs[result.name]
        row = None if result.lost else row_of(run, self.folder.runs / run.name)
        if row is None:
            if result.no_room:
                raise RecordNotWritten(self.folder.runs / run.name, result.no_room)
            reason = result.lost or "its folder does not say how it ended"
            row = RunRow(run=run, status="lost", success=None, reason=reason)
        self._count[row.status] += 1
        self.progress(self.counts)
        self.table.add(row)
