"""The command `handover resume`: resumes a run from its last checkpoint."""

import contextlib
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click

from handover.scenarios.cli.master_options import isolate_option, isolated
from handover.scenarios.cli.options import PATH, limit_options, limits, log_option
from handover.scenarios.cli.summaries.run import RunEnding
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors, require_extra
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.progress import logging_to_standard_error, progress_bar, say
from handover.scenarios.runs.execution.resume import InterruptedRun
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.results.run_folder import RunFolder

_HELP = """Resume a run that was interrupted, was killed or failed, from its last checkpoint.

DIR is the folder of a run with --checkpoint. Its results are those of a run without the break, bit for bit in its
signals; only the times that it took differ. Units and versions must be those that it began with. Of the options below
only --isolate is kept with the run: give the others again where they are wanted. Where the run cannot be resumed, its
record is completed all the same.

A checkpoint is data, but a unit is a program, and so is a scenario of one's own: the run's run.json names them. What is
not this package's is listed before it is run; with other code than the run began with, it is not resumed. Where the
folder is somebody else's, see that the code is yours.
"""


@click.command("resume", help=_HELP, short_help="Resume a run from its last checkpoint.")
@click.argument("folder", metavar="DIR", type=PATH)
@click.option("--no-report", is_flag=True, help="Write neither figures nor a report: `handover report` can, later.")
@isolate_option
@log_option
@limit_options
def resume(
    folder: Path, no_report: bool, isolate: Sequence[str], log_level: str | None, call_limit: float, pace: float | None
) -> None:
    """Resume a run from its last checkpoint."""
    with (
        Interruption() as interruption,
        one_line_errors(),
        logging_to_standard_error(log_level),
        contextlib.ExitStack() as opened,
    ):
        if not folder.is_dir():
            raise UsageError(f"{folder} is not a folder; name that of a run")
        if CampaignFolder(folder).is_there:
            raise UsageError(f"{folder} is the folder of a campaign; its command, run again, resumes it")
        run_folder = RunFolder.of_run(folder)
        run_folder.read_run()  # a folder that is not a run's is refused before what is missing here
        if not no_report:
            require_extra("reports", "report and figures", "--no-report")
        opened.enter_context(run_folder.held())
        interrupted = InterruptedRun(run_folder)
        for line in interrupted.own_code():
            say(f"this runs {line}")
        task = interrupted.task(opened)
        options = replace(task.options, **limits(call_limit, pace), **(isolated(isolate) if isolate else {}))
        task = replace(task, options=options, presented=not no_report)
        with contextlib.ExitStack() as bar:
            progress, ending = bar.enter_context(progress_bar(sys.stderr)), RunEnding(task, bar)
            result = run_task(task, progress, interruption, interrupted.resumption, concluded=ending.concluded)
    ending.exit(result)
