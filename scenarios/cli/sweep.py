"""The command `handover sweep`: a campaign over all combinations of parameters' values."""

import json
import sys
from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import click

from handover.cosim.stepping.options import MasterOptions
from handover.scenarios.cli.campaign import CampaignOutcome, pool_config, run_campaign_command
from handover.scenarios.cli.config_file import ConfiguredCommand, config_option
from handover.scenarios.cli.master_options import coupling_of, master_options
from handover.scenarios.cli.options import (
    WholeNumber,
    campaign_options,
    limit_options,
    limits,
    log_option,
    scenario_options,
    stop_option,
)
from handover.scenarios.cli.run import file_options, recorded_option
from handover.scenarios.runs.campaign.grid import parse_grid, set_parameters, split_units, vary_units
from handover.scenarios.runs.campaign.plan import MAX_REPETITIONS, CampaignPlan
from handover.scenarios.runs.execution.errors import one_line_errors, require_extra
from handover.scenarios.runs.execution.progress import doing, say
from handover.scenarios.runs.execution.request import RunRequest, experiment_type

_HELP = """Run a SCENARIO, SSP or FMU many times: all combinations of the given values, each --repeat times.

\b
NAME=VALUES is a list or a range of numbers:
  alpha=0.1,0.2,0.4       these values; those of arrays stand between ;
  alpha=0.1:0.4:4         START:STOP:N, 4 evenly spaced values with both ends
  servo.alpha_0=0.1,0.2   a parameter of the unit servo, whatever FMU it is
  --unit servo=a.fmu,b.fmu  the unit itself, by files or MODULE:CLASS

Parameters of FILE.fmu have its own names, those of FILE.ssp are UNIT.NAME or its own, as for `handover run -p`. Results
are the last, smallest and largest value of each output, and of what --record names.

\b
Examples
  handover sweep ir_grasp strategy=reflex,blind,forward --repeat 20 --paired
  handover sweep helix_handover alpha=0.1:0.4:4 -p patience=30 --out alphas
  handover sweep flyer_impedance force=1:20:10 --scheduler tcp://10.0.0.5:8786
  handover sweep x.fmu m=1,2,4 k=0:20:5 -p f=1 --stop 10

The folder of a campaign has a folder for each run in runs/, and runs.parquet with a row for each: parameters, seed,
success, metrics. The table is written as results come.

However a campaign was ended, run the same command again to resume; nothing that is done is repeated. A run in which a
unit fails is a row with its reason; a run that was lost, as with its machine, is then tried again. A larger
--repeat adds runs. Without --out, the command resumes its newest campaign in campaigns/ if that is not complete, else
it begins a new one.

A run's seed follows from --seed, its point and its repetition; runs of files draw no numbers from it. What a run
prints, as by --log-level, is in its log.txt.

Progress goes to standard error: a bar on a terminal, else a line every half minute.

\b
Exit status
  0    every run has ended, whether or not its task succeeded
  1    interrupted with Ctrl-C; run the same command again to resume
  2    usage error or invalid input; nothing was written
  3    a unit failed in a run, a run was lost, or the disk is full; what is done is kept
  130  aborted with Ctrl-C: before the first run, or by a second one
"""


@click.command("sweep", cls=ConfiguredCommand, help=_HELP, context_settings={"show_default": True})
@click.argument("scenario", metavar="SCENARIO|FILE.ssp|FILE.fmu")
@click.argument("grid", nargs=-1, metavar="[NAME=VALUES]...")
@click.option("--repeat", type=WholeNumber(1, MAX_REPETITIONS), default=1, help="Runs of each combination.")
@click.option(
    "--paired", is_flag=True, help="Let all combinations of a repetition share a seed, to compare them run by run."
)
@click.option("--json", "as_json", is_flag=True, help="Print the results of all points as JSON.")
@config_option
@scenario_options
@stop_option
@log_option
@campaign_options
@file_options
@recorded_option
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
    as_json: bool,
    log_level: str | None,
    workers: int | None,
    scheduler: str | None,
    start: Fraction | None,
    stop: Fraction | None,
    step: Fraction | None,
    inputs: Path | None,
    recorded: Sequence[str],
    call_limit: float,
    pace: float | None,
    **coupling: Any,
) -> None:
    """Run a SCENARIO many times."""
    require_extra("campaigns", "campaigns")
    if not no_report:
        require_extra("reports", "report and figures", "--no-report")
    pool = pool_config(workers, scheduler)
    with one_line_errors():
        request = RunRequest(
            subject=scenario,
            parameters=parameters,
            seed=seed,
            units=replaced,
            start=start,
            stop=stop,
            step=step,
            inputs=inputs,
        )
        request.check_options()
        experiment = experiment_type(scenario, start, stop, step, inputs)
        units, choices = split_units(experiment, replaced)
        points = vary_units(parse_grid(experiment, grid), choices)
        plan = CampaignPlan(
            scenario=scenario,
            points=points,
            fixed=set_parameters(experiment, parameters, points),
            repetitions=repeat,
            seed=seed,
            paired=paired,
            units=units,
            varied_units=tuple(choices),
            options=MasterOptions(**coupling_of(coupling), **limits(call_limit, pace)),
            start=start,
            stop=stop,
            step=step,
            inputs=inputs,
            recorded=tuple(recorded),
            log_level=log_level,
        )
    outcome = run_campaign_command(plan, out, pool, partial(_finish, as_json=as_json, report=not no_report))
    sys.exit(outcome.status)


def _finish(outcome: CampaignOutcome, *, as_json: bool, report: bool) -> None:
    """Print the results, then write the report, and print where it is."""
    from handover.scenarios.cli.summaries.campaign import campaign_data, print_campaign, print_report_place
    from handover.scenarios.runs.campaign.results import CampaignResults  # its statistics take long to load

    folder = outcome.folder
    results = CampaignResults(folder.read(), outcome.table)
    if not as_json:
        print_campaign(results, outcome.counts, folder)
    if report and not folder.is_reported:
        with doing("drawing figures, writing the report"):
            # Takes long to load.
            from handover.scenarios.pages.campaign_report.campaign_page import write_campaign_report

            for line in write_campaign_report(folder):
                say(line)
    if as_json:
        click.echo(json.dumps(campaign_data(results, outcome.counts, folder), indent=2, allow_nan=False))
    else:
        print_report_place(folder)
