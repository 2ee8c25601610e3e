"""The command `handover resume`."""

import contextlib
import sys
from dataclasses import replace
from pathlib import Path

import click

from handover.scenarios.cli.listing import exit_with
from handover.scenarios.cli.options import limit_options, limits
from handover.scenarios.cli.progress import progress_bar
from handover.scenarios.execution.errors import one_line_errors
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.resume import InterruptedRun
from handover.scenarios.execution.runner import run_task
from handover.scenarios.results.run_folder import RunFolder

_HELP = """Go on with a run that was interrupted, killed, or that failed, from its last checkpoint.

DIR is the folder of a run with --checkpoint. What it leaves at its end is what it would have left without the break,
bit for bit in its signals; only times that it took differ. Units and versions must be those that it began with. The
options below are not kept with the run: give them again where they are to count. Where it cannot go on, its record is
completed all the same.

A checkpoint holds Python objects, which can do anything when they are read: go on only with runs from people whom you
trust.
"""


@click.command("resume", help=_HELP, short_help="Go on with a run from its last checkpoint.")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--no-report", is_flag=True, help="Write neither figures nor a report: `handover report` can, later.")
@limit_options
def resume(folder: Path, no_report: bool, call_limit: float, pace: float | None) -> None:
    """Go on with a run from its last checkpoint."""
    with Interruption() as interruption, one_line_errors(), contextlib.ExitStack() as opened:
        of_run = RunFolder.of_run(folder)
        opened.enter_context(of_run.held())
        left = InterruptedRun(of_run)
        task = left.task(opened)
        task = replace(task, options=replace(task.options, **limits(call_limit, pace)), presented=not no_report)
        with progress_bar(sys.stderr) as progress:
            ended = run_task(task, progress, interruption, left.resumption)
    exit_with(ended, task)
