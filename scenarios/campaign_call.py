"""A campaign as a command carries it out: with its progress, ended in order by Ctrl-C, its end told in a line."""

import contextlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import click

from cosim.exceptions import RecordNotWritten
from scenarios.bad_call import BadCall, RunNotWritten, WorkersLost, told_in_one_line
from scenarios.campaign.bad_crew import CrewLost
from scenarios.campaign.campaign import carry_out_campaign
from scenarios.campaign.campaign_folder import CampaignFolder
from scenarios.campaign.campaign_interruption import CampaignInterruption
from scenarios.campaign.campaign_place import place_of
from scenarios.campaign.campaign_progress import CampaignProgress, told_done
from scenarios.campaign.campaign_table import CampaignTable
from scenarios.campaign.crew import Crew
from scenarios.campaign.idle_crew import IdleCrew
from scenarios.campaign.plan import CampaignPlan
from scenarios.campaign.plan_check import check_units, checked_plan, unit_fmus
from scenarios.campaign.tally import Tally
from scenarios.exit_status import ABORTED, INTERRUPTED, UNIT_FAILED

Workforce = Callable[[], contextlib.AbstractContextManager[Crew]]
"""Gives those who carry out runs, when all else has been checked."""

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


def workforce(workers: int | None, scheduler: str | None) -> Workforce:
    """Return workers of this machine, or those of a scheduler.

    Raises:
        BadCall: both are given.
    """
    if workers is not None and scheduler is not None:
        raise BadCall("--workers and --scheduler: a scheduler has workers of its own; one of both is right")

    def open_crew() -> contextlib.AbstractContextManager[Crew]:
        from scenarios.campaign.dask_crew import crew_at, embedded_crew  # loading Dask takes half a second

        return embedded_crew(workers) if scheduler is None else crew_at(scheduler)

    return open_crew


def call_campaign(plan: CampaignPlan, out: Path | None, workers: Workforce, finish: Finish) -> CampaignCall:
    """Carry out a campaign in a folder, or in one of its own in `campaigns/`, and finish it.

    Interrupted, the command ends here, with the status that says so.

    Raises:
        BadCall, RunNotWritten, WorkersLost: with what was wrong, in a line.
    """
    progress = CampaignProgress(sys.stderr)
    folder = None
    try:
        with CampaignInterruption(), told_in_one_line():
            plan = checked_plan(plan)
            fmus = unit_fmus(plan)
            check_units(plan, fmus)
            folder = CampaignFolder(out) if out else place_of(plan, fmus)
            folder.check(plan, fmus)  # before workers are started
            table = _carry_out(plan, folder, workers, progress)
            finish(folder, table)
    except KeyboardInterrupt:
        _end_interrupted(folder, progress)
    tally = progress.tally
    assert tally is not None
    if tally.kept == tally.total:
        click.echo(f"{folder.path} has all of its runs; none was carried out", err=True)
    return CampaignCall(plan, folder, table, tally)


def _carry_out(
    plan: CampaignPlan, folder: CampaignFolder, workers: Workforce, progress: CampaignProgress
) -> CampaignTable:
    try:
        with contextlib.nullcontext(IdleCrew(workers)) if folder.has_all(plan) else workers() as crew, progress:
            return carry_out_campaign(plan, folder, crew, progress)
    except (RecordNotWritten, CrewLost) as e:
        if progress.tally is None:
            raise
        stopped = WorkersLost if isinstance(e, CrewLost) else RunNotWritten
        raise stopped(f"{e}; {told_done(progress.tally)}; the same call goes on") from e


def _end_interrupted(folder: CampaignFolder | None, progress: CampaignProgress) -> NoReturn:
    if folder is None or progress.tally is None:
        click.echo("Aborted!", err=True)
        sys.exit(ABORTED)
    click.echo(f"{told_done(progress.tally)} in {folder.path}; the same call goes on", err=True)
    sys.exit(INTERRUPTED)
