"""The command `handover sweep`."""

import contextlib
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import click

from cosim.exceptions import RecordNotWritten
from cosim.master_options import MasterOptions
from scenarios.bad_call import BadCall, RunNotWritten, told_in_one_line
from scenarios.campaign.campaign import carry_out_campaign, check_campaign
from scenarios.campaign.campaign_folder import CampaignFolder
from scenarios.campaign.campaign_interruption import CampaignInterruption
from scenarios.campaign.campaign_place import place_of
from scenarios.campaign.campaign_progress import CampaignProgress, told_done
from scenarios.campaign.campaign_summary import print_campaign
from scenarios.campaign.campaign_table import CampaignTable
from scenarios.campaign.crew import Crew
from scenarios.campaign.grid import parse_grid, set_parameters
from scenarios.campaign.plan import MOST_REPETITIONS, CampaignPlan
from scenarios.campaign.plan_check import checked_plan, unit_fmus
from scenarios.chosen import replacements, scenario_named
from scenarios.exit_status import ABORTED, INTERRUPTED, UNIT_FAILED
from scenarios.headed_options import HeadedCommand, HeadedOption
from scenarios.limit_arguments import limit_options, limits
from scenarios.master_arguments import coupling_of, master_options
from scenarios.scenario_arguments import scenario_options
from scenarios.ssp_run import is_ssp

_HELP = """Run a SCENARIO many times: all combinations of the given values, each --repeat times.

\b
NAME=VALUES is a list or a range of numbers:
  alpha=0.1,0.2,0.4       these values; those of arrays stand between ;
  alpha=0.1:0.4:4         START:STOP:N, 4 evenly spaced values with both ends

\b
Examples
  handover sweep ir_grasp strategy=reflex,blind,forward --repeat 20 --paired
  handover sweep helix_handover alpha=0.1:0.4:4 -p patience=30 --out alphas
  handover sweep flyer_impedance force=1:20:10 --scheduler tcp://10.0.0.5:8786

The folder of a campaign has a folder for each run in runs/, and runs.parquet with a row for each: parameters, seed,
success, metrics. The table is written as results come.

However a campaign was ended, the same call goes on and repeats nothing that is done. A run in which a unit fails is a
row with its reason; a run that was lost, as with its machine, is tried again by the next call. A larger --repeat adds
runs. Without --out, the call goes on with its newest campaign in campaigns/ that is not complete, or begins one.

A run's seed follows from --seed, its point and its repetition.

Progress goes to standard error: a bar on a terminal, else a line every half minute.

\b
Exit status
  0    every run has ended, whether or not its task succeeded
  1    interrupted with Ctrl-C; the same call goes on
  2    bad call or bad input; nothing was written
  3    a unit failed in a run, a run was lost, or the disk is full; what is done is kept
  130  aborted with Ctrl-C: before the first run, or by a second one
"""

_worker_option = partial(click.option, cls=HeadedOption, heading="Workers")


@click.command("sweep", cls=HeadedCommand, help=_HELP, context_settings={"show_default": True})
@click.argument("scenario", metavar="SCENARIO")
@click.argument("grid", nargs=-1, metavar="[NAME=VALUES]...")
@click.option("--repeat", type=click.IntRange(1, MOST_REPETITIONS), default=1, help="Runs of each combination.")
@click.option(
    "--paired", is_flag=True, help="Let all combinations of a repetition share a seed, to compare them run by run."
)
@scenario_options
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder of the campaign; one that is there goes on.  [default: one of its own in campaigns/]",
)
@click.option("--no-report", is_flag=True, help="Write no report page at the end.")
@click.help_option("-h", "--help")
@_worker_option(
    "--workers",
    type=click.IntRange(min=1),
    metavar="N",
    help="Runs at the same time, on this machine.  [default: one a core]",
)
@_worker_option(
    "--scheduler",
    metavar="ADDRESS",
    help="Dask scheduler whose workers carry out the runs; they see this folder under the same path.",
)
@master_options
@limit_options
def sweep(
    scenario: str,
    grid: Sequence[str],
    repeat: int,
    paired: bool,
    parameters: Sequence[str],
    seed: int,
    replaced: Sequence[str],
    out: Path | None,
    no_report: bool,
    workers: int | None,
    scheduler: str | None,
    call_limit: float,
    pace: float | None,
    **coupling: Any,
) -> None:
    """Run a SCENARIO many times."""
    if workers is not None and scheduler is not None:
        raise BadCall("--workers and --scheduler: a scheduler has workers of its own; one of both is right")
    if is_ssp(scenario):
        raise BadCall(f"{scenario}: a scenario can be swept, an SSP has no parameters of its own")
    experiment = scenario_named(scenario)
    with told_in_one_line():
        points = parse_grid(experiment, grid)
        plan = CampaignPlan(
            scenario=scenario,
            points=points,
            fixed=set_parameters(experiment, parameters, points),
            repetitions=repeat,
            seed=seed,
            paired=paired,
            units={name: str(file) for name, file in replacements(experiment, replaced).items()},
            options=MasterOptions(**coupling_of(coupling), **limits(call_limit, pace)),
        )
    _sweep(plan, out, lambda: _workforce(workers, scheduler), report=not no_report)


def _workforce(workers: int | None, scheduler: str | None) -> contextlib.AbstractContextManager[Crew]:
    from scenarios.campaign.dask_crew import crew_at, embedded_crew  # loading Dask takes half a second

    return embedded_crew(workers) if scheduler is None else crew_at(scheduler)


_Workforce = Callable[[], contextlib.AbstractContextManager[Crew]]


def _sweep(plan: CampaignPlan, out: Path | None, workforce: _Workforce, *, report: bool) -> NoReturn:
    """Carry out a campaign, tell how it went, and exit with the status that says so."""
    progress = CampaignProgress(sys.stderr)
    folder = None
    try:
        with CampaignInterruption(), told_in_one_line():
            plan = checked_plan(plan)
            folder = CampaignFolder(out) if out else place_of(plan, unit_fmus(plan))
            check_campaign(plan, folder)
            table = _carry_out(plan, folder, workforce, progress)
            if report:
                _write_report(folder)
    except KeyboardInterrupt:
        _end_interrupted(folder, progress)
    tally = progress.tally
    assert tally is not None
    print_campaign(plan, table, tally, folder)
    sys.exit(UNIT_FAILED if tally.failed or tally.lost else 0)


def _write_report(folder: CampaignFolder) -> None:
    from scenarios.reporting.campaign_page import write_campaign_page  # what draws takes long to load

    write_campaign_page(folder.path)


def _carry_out(
    plan: CampaignPlan, folder: CampaignFolder, workforce: _Workforce, progress: CampaignProgress
) -> CampaignTable:
    try:
        with workforce() as crew, progress:
            return carry_out_campaign(plan, folder, crew, progress)
    except RecordNotWritten as e:
        done = f"; {told_done(progress.tally)}; the same call goes on when there is room" if progress.tally else ""
        raise RunNotWritten(f"{e}{done}") from e


def _end_interrupted(folder: CampaignFolder | None, progress: CampaignProgress) -> NoReturn:
    if folder is None or progress.tally is None:
        click.echo("Aborted!", err=True)
        sys.exit(ABORTED)
    click.echo(f"{told_done(progress.tally)} in {folder.path}; the same call goes on", err=True)
    sys.exit(INTERRUPTED)
