"""A campaign as a command carries it out: with its progress, ended in order by Ctrl-C, its end told in a line."""

import contextlib
import sys
from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NoReturn

import click

from handover.cosim.exceptions import RecordNotWritten
from handover.scenarios.campaign.campaign import carry_out_campaign
from handover.scenarios.campaign.campaign_interruption import CampaignInterruption
from handover.scenarios.campaign.campaign_progress import CampaignProgress, told_done
from handover.scenarios.campaign.folder import CampaignFolder, place_of
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.plan_check import PreparedPlan, prepared
from handover.scenarios.campaign.pool_config import LateCrew, Workforce
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.campaign.worker_pool import Crew, Tally
from handover.scenarios.execution.errors import BadCall, CrewLost, RunNotWritten, WorkersLost, told_in_one_line
from handover.scenarios.execution.exit_status import ABORTED, INTERRUPTED, UNIT_FAILED

Finish = Callable[[CampaignFolder, CampaignTable], None]
"""Writes what is made of a campaign that has come to its end."""


@dataclass(frozen=True)
class CampaignCall:
    """A campaign that has come to its end: the plan as it was checked, where it is, its runs, and how many failed."""

    plan: CampaignPlan
    folder: CampaignFolder
    table: CampaignTable
    tally: Tally

    @property
    def status(self) -> int:
        """The command's exit status: whether all runs have ended, whether or not their tasks succeeded."""
        return UNIT_FAILED if self.tally.failed or self.tally.lost else 0


def workforce_of(workers: int | None, scheduler: str | None) -> Workforce:
    """Return workers of this machine, or those of a scheduler.

    Raises:
        BadCall: both are given.
    """
    if workers is not None and scheduler is not None:
        raise BadCall("--workers and --scheduler: a scheduler has workers of its own; one of both is right")
    return Workforce(workers, scheduler)


def call_campaign(plan: CampaignPlan, out: Path | None, workers: Workforce, finish: Finish) -> CampaignCall:
    """Carry out a campaign in a folder, or in one of its own in `campaigns/`, and finish it.

    Interrupted, the command ends here, with the status that says so.

    Raises:
        BadCall, RunNotWritten, WorkersLost: with what was wrong, in a line.
    """
    progress = CampaignProgress(sys.stderr)
    folder = None
    try:
        with CampaignInterruption() as interruption, told_in_one_line():
            called = CampaignFolder(out) if out else None
            ready = prepared(plan, lambda checked: _check_cheaply(checked, called, workers, interruption))
            folder = called or place_of(ready.plan, ready.fmus)
            folder.check(ready.plan, ready.fmus)  # before it is told what begins
            table = _carry_out(ready, folder, workers, interruption, progress)
            finish(folder, table)
    except KeyboardInterrupt:
        _end_interrupted(folder, progress)
    tally = progress.tally
    assert tally is not None
    if tally.kept == tally.total:
        click.echo(f"{folder.path} has all of its runs; none was carried out", err=True)
    return CampaignCall(ready.plan, folder, table, tally)


def _check_cheaply(
    plan: CampaignPlan, folder: CampaignFolder | None, workers: Workforce, interruption: CampaignInterruption
) -> None:
    """Check what takes no units, which may have to be built."""
    if folder is not None:
        folder.check_free()
    if folder is None or not folder.has_all(plan):
        with interruption.at_once():  # a server that does not answer holds up asyncio's end
            workers.check()


def _carry_out(
    ready: PreparedPlan,
    folder: CampaignFolder,
    workers: Workforce,
    interruption: CampaignInterruption,
    progress: CampaignProgress,
) -> CampaignTable:
    plan = ready.plan
    if not folder.has_all(plan):
        done = sum(map(folder.is_done, plan.runs()))
        told = f"{plan.size} run{'s' if plan.size > 1 else ''} of {plan.scenario} on {workers} into {folder.path}"
        click.echo(f"{told}{f'; {done} are done' if done else ''}", err=True)
    try:
        with contextlib.ExitStack() as opened, progress:
            start = partial(_started, workers, interruption)
            return carry_out_campaign(ready, folder, LateCrew(start, opened), progress, interruption.held_back)
    except (RecordNotWritten, CrewLost) as e:
        if progress.tally is None:
            raise
        stopped = WorkersLost if isinstance(e, CrewLost) else RunNotWritten
        raise stopped(f"{e}; {told_done(progress.tally)}; the same call goes on") from e


@contextlib.contextmanager
def _started(workers: Workforce, interruption: CampaignInterruption) -> Generator[Crew, None, None]:
    """Give workers; neither their start nor their end is interrupted."""
    opened = contextlib.ExitStack()
    try:
        with interruption.held_back():
            crew = opened.enter_context(workers.start())
        yield crew
    finally:
        with interruption.held_back():
            opened.close()


def _end_interrupted(folder: CampaignFolder | None, progress: CampaignProgress) -> NoReturn:
    if folder is None or progress.tally is None:
        kept = folder is not None and folder.is_there
        click.echo(f"Aborted! The same call goes on with {folder.path}" if folder and kept else "Aborted!", err=True)
        sys.exit(ABORTED)
    click.echo(f"{told_done(progress.tally)} in {folder.path}; the same call goes on", err=True)
    sys.exit(INTERRUPTED)
