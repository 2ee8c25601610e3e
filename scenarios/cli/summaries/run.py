"""What a command prints of a run that has ended or crashed, and with which exit status it ends."""

import contextlib
import json
import shlex
import sys
from collections.abc import Generator, Sequence
from typing import NoReturn, TextIO

import click

from handover.cosim.exceptions import RecordNotWritten, counted
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.scenarios.cli.console import open_console, print_rows
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.runs.execution.child_process import ChildEnd
from handover.scenarios.runs.execution.crash import Crash
from handover.scenarios.runs.execution.exit_status import UNIT_FAILED, status_of_run
from handover.scenarios.runs.execution.progress import doing, say
from handover.scenarios.runs.results.run_folder import RunFolder, disk_errors_reported
from handover.scenarios.runs.results.summary import RunResult
from handover.scenarios.runs.results.tables import format_conversion, headline_rows, pace_rows, warning_lines
from handover.scenarios.runs.results.task import Task
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults

_MAX_CONVERSIONS = 8
"""Conversions of physical units that are listed at the end of a run."""


def print_summary_as_json(result: RunResult, folder: RunFolder, out: TextIO | None = None) -> None:
    """Print what `summary.json` says, with the run's folder; to standard output, unless `out` is given."""
    click.echo(json.dumps({**result.summary, "folder": str(folder.shown)}, indent=2, allow_nan=False), file=out)


def print_summary(result: RunResult, headline: Sequence[str], folder: RunFolder) -> None:
    """Print how a run ended, the metrics named in the headline, and where its report or results are."""
    _print_verdict(result, headline, folder)
    _print_place(folder)


def _print_verdict(result: RunResult, headline: Sequence[str], folder: RunFolder) -> None:
    console = open_console()
    summary = result.summary
    verdict = "[green]succeeded[/]" if summary["success"] else "[red]failed[/]"
    console.print(f"{summary['scenario']} {verdict}: ", end="")
    console.print(summary["reason"], markup=False, soft_wrap=True)
    metrics = summary["metrics"]
    rows = headline_rows(metrics, headline or result.outcome.metrics)
    rows.append(("simulated", f"{summary['simulated_seconds']:.1f} s in {summary['wall_seconds']:.1f} s of wall time"))
    rows += pace_rows(summary)
    rows += _conversion_rows(folder)
    print_rows(console, rows)


def _print_place(folder: RunFolder) -> None:
    console, shown = open_console(), folder.shown
    place = f"report: {shown / folder.report.name}" if folder.report.exists() else f"results: {shown}"
    console.print(place, markup=False, soft_wrap=True)
    if folder.checkpoint.exists():
        console.print(f"to resume: handover resume {shlex.quote(str(shown))}", markup=False, soft_wrap=True)


def _conversion_rows(folder: RunFolder) -> list[tuple[str, str]]:
    conversions = [format_conversion(c) for c in folder.read_run().get("conversions", [])]
    left = len(conversions) - _MAX_CONVERSIONS
    more = [(f"{counted(left, 'conversion')} more", "in the report")] if left > 0 else []
    return [(f"converted: {ends}", change) for ends, change in conversions[:_MAX_CONVERSIONS]] + more


class RunEnding:
    """Prints how a run ended as soon as that is known, what the command does then, and at last where the results are.

    Args:
        task: the run.
        bar: what is shown while the run goes on, closed at its end.
        json_to: where the summary goes as JSON, at last; None: it is printed for people.
    """

    def __init__(self, task: Task, bar: contextlib.ExitStack, json_to: TextIO | None = None) -> None:
        self._task, self._bar, self._json_to = task, bar, json_to
        self._printed = False

    @contextlib.contextmanager
    def concluded(self, result: RunResult) -> Generator[None, None, None]:
        """Print the verdict, and that figures and report are made meanwhile; for `run_task`."""
        self._bar.close()
        with contextlib.suppress(OSError):  # as where a unit has closed all streams: `exit` meets the error
            self._print(result)
        if not self._task.presented:
            yield
            return
        with doing("drawing figures, writing the report"):
            yield

    def exit(self, result: RunResult) -> NoReturn:
        """Print what is left to be said, and exit with the status of the run."""
        if not self._printed:
            self._print(result)
        for line in result.left_out:
            say(line)
        if self._json_to is not None:
            print_summary_as_json(result, self._task.folder, self._json_to)
        else:
            _print_place(self._task.folder)
        sys.exit(status_of_run(unit_failed=result.failure is not None, succeeded=result.outcome.success))

    def _print(self, result: RunResult) -> None:
        if result.failure:
            say(result.failure)
        for line in warning_lines(result.summary):
            say(line)
        if self._json_to is None:
            _print_verdict(result, self._task.experiment.headline, self._task.folder)
            sys.stdout.flush()
        self._printed = True


AS_JSON = "--json"
"""The option by which the summary is printed as JSON."""

_SIGNAL_STATUS = 128  # shells add it to a signal's number


def report_crash(heartbeat: Heartbeat, end: ChildEnd, wall: float) -> int:
    """Complete the folder of a run that crashed, print how it did, and return the exit status.

    A run that had ended, but whose process could not print, as where a unit has closed all that is open, is printed as
    its folder has it. For the arguments see `Crash`.
    """
    crash = Crash(heartbeat, end, wall)
    if crash.concluded is not None and crash.folder is not None and "unsaid" in heartbeat.facts:
        _report_concluded(crash.folder)
        return crash.concluded
    if crash.concluded is not None:
        say(f"{crash.message}; the run had ended before, and stays as it is")
        return crash.concluded
    say(f"{crash.message}")
    if crash.folder is None:
        return UNIT_FAILED if crash.failure is not None or crash.in_own_thread else _SIGNAL_STATUS + (end.signal or 0)
    try:
        result = crash.complete(crash.folder)
        as_json = AS_JSON in sys.argv  # what crashed was the process that had read the options
        if not as_json:
            _print_verdict(result, (), crash.folder)
        if crash.presented:
            with doing("writing the report"):
                _write_page(crash.folder)
        if as_json:
            print_summary_as_json(result, crash.folder)
        else:
            _print_place(crash.folder)
    except RecordNotWritten as e:
        say(e)
    return UNIT_FAILED


def _report_concluded(folder: RunFolder) -> None:
    """Print what a run left that had ended."""
    summary, headline = folder.read_summary(), folder.read_run().get("headline", ())
    result = RunResult(outcome=Outcome(success=summary["success"], reason=summary["reason"]), summary=summary)
    for line in (*warning_lines(summary), *summary.get("left_out", ())):
        say(line)
    if AS_JSON in sys.argv:
        print_summary_as_json(result, folder)
    else:
        print_summary(result, headline, folder)


def _write_page(folder: RunFolder) -> None:
    """Write the page of a run that crashed, and print what could not be shown in it."""
    from handover.scenarios.runs.reporting.run_page import write_run_page  # its plots take long to load

    faults = ToleratedFaults()
    with disk_errors_reported(folder.path), faults.tolerated("the report could not be written"):
        faults.lines += write_run_page(folder)
    for line in faults.lines:
        say(line)
