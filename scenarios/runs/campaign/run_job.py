"""Runs a job in this process, and gives its folder the name that says that it is complete."""

import contextlib
import os
import shutil
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import click

from handover.cosim.exceptions import CosimError, InitializationError, ScheduleError, UnitFailure, WiringError, one_line
from handover.scenarios.catalog import search_folder
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob
from handover.scenarios.runs.execution.errors import one_line_errors
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.progress import logging_to_standard_error
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.results.run_folder import RunFolder, is_full
from handover.scenarios.runs.results.summary import ElapsedTime, unstarted_run, unstarted_summary
from handover.scenarios.runs.results.task import Task, task_of

_REFUSALS = (InitializationError, UnitFailure, WiringError, ScheduleError)
"""Why a run cannot begin, where that depends on the run and not on the machine: it would end so each time."""


def run_job(job: RunJob, folder: Path) -> None:
    """Run a job into a folder, without figures or a report; if it cannot begin, the folder says why.

    Raises:
        As `run_task` and `RunRequest.open_point`, without `_REFUSALS`.
    """
    with contextlib.ExitStack() as opened:
        task, clock = _task(job, folder, opened), ElapsedTime().clock()
        try:
            with logging_to_standard_error(job.log_level):
                run_task(task, lambda _t, _end: None, Interruption())
        except _REFUSALS as e:
            _write_refusal(task, e, clock())


def record_failed_job(job: RunJob, folder: Path, failure: UnitFailure, spent: ElapsedTime) -> None:
    """Write the folder of a run whose process crashed while a unit was loaded or initialised."""
    with contextlib.ExitStack() as opened:
        _write_refusal(_task(job, folder, opened), failure, spent)


def _write_refusal(task: Task, refusal: CosimError, spent: ElapsedTime) -> None:
    task.folder.make()
    task.folder.write_run(unstarted_run(task, refusal))
    task.folder.write_summary(unstarted_summary(task, refusal, spent))


def _task(job: RunJob, folder: Path, opened: contextlib.ExitStack) -> Task:
    search_folder(job.modules)
    request = RunRequest(
        subject=job.scenario,
        parameters=job.parameters,
        start=job.start,
        stop=job.stop,
        step=job.step,
        inputs=Path(job.inputs) if job.inputs else None,
        seed=job.seed,
        options=job.options,
        recorded=job.recorded,
        presented=False,
    )
    fmus = {name: Path(path) for name, path in job.fmus.items()}
    return task_of(request, request.open_point(opened), fmus, RunFolder(folder))


def job_result(job: RunJob, work: Callable[[], object]) -> JobResult:
    """Call `work` for a job; return the result, with what was raised as the reason why the run is lost."""
    try:
        with one_line_errors():
            work()
    except click.ClickException as e:
        return lost_by(e, job, e.message)
    except BaseException as e:  # a run may raise anything: the campaign continues
        traceback.print_exc()
        return lost_by(e, job, f"{type(e).__name__}: {one_line(e)}")
    return JobResult(name=job.name)


def lost_by(error: BaseException, job: RunJob, text: str) -> JobResult:
    """Return the result of a run that an exception lost, with a sentence that says why."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError) and is_full(cause):
            return JobResult(name=job.name, lost=text, no_room=cause.strerror or one_line(cause))
        cause = cause.__cause__
    return JobResult(name=job.name, lost=text)


@contextlib.contextmanager
def printing_to(log: BinaryIO):
    """Redirect what this process prints, in Python or in native code, to a file meanwhile."""
    before = [os.dup(number) for number in (1, 2)]
    try:
        for number in (1, 2):
            os.dup2(log.fileno(), number)
        yield
    finally:
        for number, stream in ((1, sys.stdout), (2, sys.stderr)):
            stream.flush()
            os.dup2(before[number - 1], number)
            os.close(before[number - 1])


def finish(job: RunJob, folder: Path, log: BinaryIO) -> JobResult:
    """Rename the folder of a run that has ended as the job says; the result says why if it cannot be renamed.

    What the run printed goes into its `log.txt`. A folder without a summary is left as it is.
    """
    target = Path(job.runs, job.name)
    if not (folder / "summary.json").exists():
        return JobResult(name=job.name, lost="it ended without a summary")
    with contextlib.suppress(OSError):  # a full disk: the run itself is complete
        log.seek(0)
        if printed := log.read():
            (folder / "log.txt").write_bytes(printed)
    try:
        os.rename(folder, target)
    except OSError as e:
        if not (target / "summary.json").exists():  # else it ran twice, as when a worker seemed lost
            return lost_by(e, job, f"its folder cannot be named {target}: {e.strerror}")
        shutil.rmtree(folder, ignore_errors=True)
    return JobResult(name=job.name)
