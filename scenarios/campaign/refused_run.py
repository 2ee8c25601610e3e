"""The folder of a run that ended before it had one, as when a unit does not start: it would end so each time."""

from typing import Any

from handover.cosim.exceptions import ScheduleError, UnitFailure, UnitRefused, WiringError, one_line
from handover.scenarios.resumption import Spent
from handover.scenarios.run_summary import configuration, files_and_forms, told_task
from handover.scenarios.task import Task

Refusal = UnitRefused | UnitFailure | WiringError | ScheduleError
"""Why a run cannot begin, where that follows from what it is and not from where it is carried out."""

REFUSALS = (UnitRefused, UnitFailure, WiringError, ScheduleError)


def write_refused_run(task: Task, refusal: Refusal, spent: Spent) -> None:
    """Write `run.json` and `summary.json` into the run's folder, as of a run in which a unit fails later.

    Raises:
        BadRunFolder: the folder cannot be made. RecordNotWritten: the disk is full.
    """
    failure = _failure(refusal)
    task.folder.make()
    task.folder.write_run(
        {**configuration(task), **files_and_forms(task), **told_task(task), "failure": failure}, task.fmus
    )
    task.folder.write_summary(
        {
            **configuration(task),
            "complete": False,
            "success": False,
            "reason": _reason(refusal),
            "metrics": {},
            "simulated_seconds": 0.0,
            "wall_seconds": spent.wall,
            "cpu_seconds": spent.cpu,
            "units": [],
            "failure": failure,
        }
    )


def _failure(refusal: Refusal) -> dict[str, Any]:
    if isinstance(refusal, UnitRefused):
        return refusal.failure.as_data()
    if isinstance(refusal, UnitFailure):
        return refusal.as_data()
    nothing = {"instance": None, "call": None, "time": 0.0, "log": list[str]()}
    return {"kind": "refused", "status": one_line(refusal), **nothing}


def _reason(refusal: Refusal) -> str:
    return f"{refusal.verdict}: {refusal.cause}" if isinstance(refusal, UnitFailure) else one_line(refusal)
