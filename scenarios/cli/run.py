"""The command `handover run`: one run of a scenario, of an SSP or of an FMU."""

import contextlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import click

from handover.cosim.record.formats import RECORD_FORMATS
from handover.cosim.stepping.options import MasterOptions
from handover.scenarios.cli.config_file import ConfiguredCommand, config_option
from handover.scenarios.cli.console import reserve_stdout
from handover.scenarios.cli.master_options import coupling_of, master_options
from handover.scenarios.cli.options import (
    HeadedOption,
    Seconds,
    limit_options,
    limits,
    log_option,
    scenario_options,
    stop_option,
)
from handover.scenarios.cli.summaries.run import AS_JSON, exit_with
from handover.scenarios.execution.errors import one_line_errors, require_extra
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.progress import log_told, progress_bar
from handover.scenarios.execution.request import RunRequest
from handover.scenarios.execution.runner import run_task

_option = partial(click.option, cls=HeadedOption, heading="Of FILE.ssp and FILE.fmu")
_STEP = _option(
    "--step",
    type=Seconds(),
    metavar="SECONDS",
    help="Communication step of all units.  [default: what each FMU proposes]",
)
_INPUT = _option(
    "--input",
    "inputs",
    type=click.Path(path_type=Path),
    metavar="FILE.csv",
    help="Of an FMU: inputs over time, a column `time` and columns by input's name, in the inputs' units; continuous"
    " reals lie on lines between two times, all else is held.  [default: constant at their start values]",
)


def file_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--step` and `--input`, which are for SSPs and FMUs."""
    return _STEP(_INPUT(command))


_HELP = """Run a SCENARIO once and write summary, signals, figures and a report into a folder.

FILE.ssp is a system from another tool (SSP 1.0 or 2.0), or from `handover export`: it runs until its stop time.
FILE.fmu is one unit, from any tool: it runs by itself, with its parameters set by -p and its inputs by --input.

Ctrl-C ends the run after its step; what was recorded until then is kept. Ctrl-C again aborts.

The run is a process of its own: if a unit crashes it, the unit is named and the record completed. On Windows it
is not, and such a unit ends the command.
"""

_record_option = partial(click.option, cls=HeadedOption, heading="Record")


@click.command("run", cls=ConfiguredCommand, help=_HELP, context_settings={"show_default": True})
@click.argument("scenario", metavar="SCENARIO|FILE.ssp|FILE.fmu")
@config_option
@scenario_options
@stop_option
@log_option
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder for the results.  [default: one of its own in runs/]"
)
@click.option("--no-report", is_flag=True, help="Write neither figures nor a report: `handover report` can, later.")
@click.option(
    "--strict",
    is_flag=True,
    help="Refuse an FMU whose description breaks the standard, even where it can be run nonetheless; see"
    " `handover check`.  [default: warn]",
)
@click.option(AS_JSON, "as_json", is_flag=True, help="Print the summary as JSON, with the run's folder.")
@click.help_option("-h", "--help")
@file_options
@_record_option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(list(RECORD_FORMATS)),
    help="Format of the record; may be given more than once. Parquet is always written.  [default: parquet]",
)
@_record_option(
    "--checkpoint",
    "every",
    type=Seconds(),
    metavar="SECONDS",
    help="Write a checkpoint every so many simulated seconds, for `handover resume`.",
)
@master_options
@limit_options
def run(
    scenario: str,
    parameters: Sequence[str],
    seed: int,
    replaced: Sequence[str],
    out: Path | None,
    stop: Fraction | None,
    step: Fraction | None,
    inputs: Path | None,
    formats: Sequence[str],
    every: Fraction | None,
    no_report: bool,
    as_json: bool,
    log_level: str | None,
    strict: bool,
    call_limit: float,
    pace: float | None,
    **coupling: Any,
) -> None:
    """Run a SCENARIO, an SSP or an FMU once."""
    json_to = reserve_stdout() if as_json else None
    with Interruption() as interruption, one_line_errors(), log_told(log_level), contextlib.ExitStack() as opened:
        if not no_report:
            require_extra("reports", "report and figures", "--no-report")
        request = RunRequest(
            subject=scenario,
            parameters=parameters,
            seed=seed,
            units=replaced,
            out=out,
            stop=stop,
            step=step,
            inputs=inputs,
            formats=formats,
            every=every,
            presented=not no_report,
        )
        request.check_options()
        options = MasterOptions(**coupling_of(coupling), **limits(call_limit, pace), strict=strict)
        task = replace(request, options=options).task(opened)
        with progress_bar(sys.stderr) as progress:
            result = run_task(task, progress, interruption)
    exit_with(result, task, json_to=json_to)
