"""Runs a campaign: checks all of it, keeps what is done, gives the rest to a worker pool, writes the table."""

import contextlib
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from handover.cosim.exceptions import RecordNotWritten
from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.campaign.plan import CampaignPlan, PlannedRun
from handover.scenarios.campaign.plan_check import PreparedPlan
from handover.scenarios.campaign.table import CampaignTable, RunRow, row_of
from handover.scenarios.campaign.table_writer import TableWriter
from handover.scenarios.campaign.worker_pool import JobResult, OnRunCounts, RunCounts, RunJob, WorkerPool
from handover.scenarios.results.run_folder import disk_errors_reported


def run_campaign(
    ready: PreparedPlan,
    folder: CampaignFolder,
    pool: WorkerPool,
    progress: OnRunCounts,
    settling: Callable[[], contextlib.AbstractContextManager[None]] = contextlib.nullcontext,
) -> CampaignTable:
    """Carry out the runs of a campaign that are not done yet, and return the table of all.

    Whatever ends it, what was done stays; run the same command again to resume: a run is done when it has left its
    folder, also if a unit failed in it. Lost runs are tried again by the next call. The table is completed in a block
    of `settling`, which can keep an interruption from it.

    Raises:
        InvalidRunFolder, PoolError: before anything was written.
        RecordNotWritten: there is no room.
        ClusterLost: there are no workers any more.
        KeyboardInterrupt: it was interrupted; runs under way are dropped, and the table is written.
    """
    check = _nothing if folder.has_all(ready.plan) else pool.check
    with folder.opened(ready.plan, ready.fmus, check) as fmus:
        work = _Work(ready.plan, folder, progress)
        try:
            work.give_to(pool, fmus)
        finally:
            with settling():
                work.end()
    return CampaignTable.read(folder.table)


def _nothing(_folder: Path) -> None:
    """Check no crew, as none is needed unless a run turns out to be damaged."""


class _Work:
    """A campaign under way."""

    def __init__(self, plan: CampaignPlan, folder: CampaignFolder, progress: OnRunCounts) -> None:
        self.plan, self.folder, self.progress = plan, folder, progress
        self.table = TableWriter(plan, folder.table)
        self.runs = {run.name: run for run in plan.runs()}
        self._count = Counter[str]()
        self._kept = self._keep(self.runs.values())
        progress(self.counts)

    def give_to(self, pool: WorkerPool, fmus: Mapping[str, Path]) -> None:
        """Have the runs carried out that are not done."""
        jobs = [self._job(run, fmus) for run in self._to_do()]
        if not jobs:
            return
        with contextlib.closing(pool.run_jobs(jobs)) as results:
            for result in results:
                self._take(result)

    def end(self) -> None:
        """Write the table, also of runs that have ended but whose answers have not come, as after an interruption."""
        known = {row.run.name for row in self.table.rows if row.status != "lost"}
        if self._keep([run for run in self.runs.values() if run.name not in known]):
            self.progress(self.counts)
        self.table.complete()

    @property
    def counts(self) -> RunCounts:
        """How far it has come."""
        n = self._count
        ended = n["done"] + n["failed"]
        return RunCounts(total=len(self.runs), kept=self._kept, ended=ended, failed=n["failed"], lost=n["lost"])

    def _keep(self, runs: Iterable[PlannedRun]) -> int:
        """Take the rows of those runs that are done, and remove what cannot be read of a run; return how many."""
        kept: list[RunRow] = []
        for run in runs:
            left = self.folder.runs / run.name
            row = row_of(run, left) if self.folder.is_done(run) else None
            if row is not None:
                kept.append(row)
            elif left.exists():
                with disk_errors_reported(self.folder.runs):
                    shutil.rmtree(left)
        self.table.keep(kept)
        self._count = Counter(row.status for row in self.table.rows)
        return len(kept)

    def _to_do(self) -> Sequence[PlannedRun]:
        """Return the runs that are not done, repetition by repetition, so that a part tells of all points."""
        left = [run for run in self.runs.values() if not self.folder.is_done(run)]
        return sorted(left, key=lambda run: run.repetition)

    def _job(self, run: PlannedRun, fmus: Mapping[str, Path]) -> RunJob:
        return RunJob(
            name=run.name,
            scenario=self.plan.scenario,
            parameters=tuple(f"{name}={value}" for name, value in run.parameters.items()),
            seed=run.seed,
            fmus={unit: str(path) for unit, path in fmus.items()},
            runs=str(self.folder.runs.absolute()),
            options=self.plan.options,
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
