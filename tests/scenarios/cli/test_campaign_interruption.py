"""Ctrl-C amid a finalizer, or as a campaign ends: the table is complete, the workers are ended, it counts."""

import contextlib
import os
import signal
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import pytest
from support.campaigns import short_plan
from support.in_process_pool import InProcessPool

from handover.scenarios.cli.campaign import CampaignInterruption, run_campaign_command
from handover.scenarios.runs.campaign.campaign import run_campaign
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan_check import prepared
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunCounts, RunJob

PLAN = short_plan()
NAMES = [run.name for run in PLAN.runs()]

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows has no SIGINT for one process")


def interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


class SilentPool(InProcessPool):
    """Carries runs out and answers for none, as one that was lost just then."""

    def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
        yield from list(super().run_jobs(jobs))[:0]


class InterruptedEnd:
    """Workers of this process whose end takes long enough to be interrupted."""

    def __init__(self) -> None:
        self.ended = False

    def __str__(self) -> str:
        return "this process"

    def check(self) -> None:
        pass

    @contextlib.contextmanager
    def start(self) -> Generator[InProcessPool, None, None]:
        yield InProcessPool()
        interrupt()
        self.ended = True


class InterruptedFinalized:
    def __del__(self) -> None:
        interrupt()


def finalize(job: RunJob) -> str:
    """Interrupt the first run amid a finalizer, as Dask's futures have some: Python drops the exception."""
    if job.name == NAMES[0]:
        InterruptedFinalized()
    return ""


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_in_a_finalizer(tmp_path: Path):
    folder = CampaignFolder(tmp_path / "c")
    pool = InProcessPool(finalize)
    with CampaignInterruption() as interruption, pytest.raises(KeyboardInterrupt):
        run_campaign(prepared(PLAN), folder, pool, lambda _counts: None, interruption.deferred_signals)
    assert CampaignTable.read(folder.table).column("run").tolist() == NAMES[:1]


def test_as_the_table_is_completed(tmp_path: Path):
    def progress(counts: RunCounts) -> None:
        if counts.ended == len(NAMES):  # reported when runs are found that have ended without a result
            interrupt()

    folder = CampaignFolder(tmp_path / "c")
    with CampaignInterruption() as interruption, pytest.raises(KeyboardInterrupt):
        run_campaign(prepared(PLAN), folder, SilentPool(), progress, interruption.deferred_signals)
    assert CampaignTable.read(folder.table).column("run").tolist() == NAMES


def test_as_the_workers_are_ended(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    workers: Any = InterruptedEnd()
    with pytest.raises(SystemExit) as caught:
        run_campaign_command(PLAN, tmp_path / "c", workers, lambda _outcome: None)
    assert caught.value.code == 1
    assert workers.ended
    reported = f"2 of 2 runs done in {tmp_path / 'c'}; run the same command again to resume"
    assert capsys.readouterr().err.splitlines()[-1] == reported
    assert CampaignTable.read(tmp_path / "c").column("run").tolist() == NAMES
