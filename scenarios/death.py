"""What is left to do when the process of a run has died: its record is completed, and it is told what happened."""

import resource
import shutil
import signal
import sys
from pathlib import Path
from typing import Any

from cosim.exceptions import RecordNotWritten, UnitFailure
from cosim.failures import UnitCrashed, UnitHung
from cosim.heartbeat import Call, Heartbeat
from cosim.record.complete_record import complete_record
from scenarios.ended import Ended
from scenarios.exit_status import UNIT_FAILED
from scenarios.experiment import Outcome
from scenarios.listing import print_summary
from scenarios.record import Record
from scenarios.report import write_report
from scenarios.run_folder import RunFolder, told_if_not_written
from scenarios.run_summary import unit_data

_BY_SIGNAL = 128  # what shells add to a signal's number


def tell_death(heartbeat: Heartbeat, number: int | None, status: int, wall: float, *, hung: bool) -> int:
    """Complete what a run has left, tell what it died of, and return the exit status that says so.

    Args:
        heartbeat: what the run told while it lived.
        number: the signal that ended it, None where it ended itself.
        status: its exit status then.
        wall: seconds that it lived.
        hung: whether it was ended because a unit's call did not return.
    """
    facts = heartbeat.facts
    for folder in facts.get("scratch", []):
        shutil.rmtree(folder, ignore_errors=True)
    call = heartbeat.under_way
    failure = _failure(heartbeat, call, number, status, hung=hung)
    told = _how_it_ended(call, heartbeat.time, number, status) if failure is None else str(failure)
    sys.stderr.write(f"{told}\n")
    if "folder" in facts:
        data = _data(call, heartbeat.time, number, status) if failure is None else failure.as_data()
        reason = told if failure is None else f"{failure.verdict}: {failure.cause}"
        try:
            with told_if_not_written(Path(facts["folder"])):
                _complete(facts, {"reason": reason, "wall_seconds": wall, "failure": data}, failure)
        except RecordNotWritten as e:
            sys.stderr.write(f"{e}\n")
    return UNIT_FAILED if failure is not None or "folder" in facts else _BY_SIGNAL + (number or 0)


def _failure(
    heartbeat: Heartbeat, call: Call | None, number: int | None, status: int, *, hung: bool
) -> UnitFailure | None:
    """Return how the unit failed in whose call the process ended; None where it was not a unit."""
    if call is None:
        return None
    log = heartbeat.log_of(call.unit)
    if hung:
        return UnitHung(*call, heartbeat.limit, log)
    if number == signal.SIGKILL:
        return None
    how = f"it ended the process with status {status}" if number is None else _meaning(number)
    return UnitCrashed(*call, how, log)


def _meaning(number: int) -> str:
    return (signal.strsignal(number) or f"signal {number}").lower()


def _how_it_ended(call: Call | None, t: float, number: int | None, status: int) -> str:
    within = f", in {call.call} of {call.unit}" if call is not None else ", outside of its units"
    if number == signal.SIGKILL:
        return f"the run was killed at t = {t:.6g} s{within}: by someone, or by the system for want of memory"
    how = f"ended with status {status}" if number is None else _meaning(number)
    return f"the run crashed at t = {t:.6g} s{within}: {how}"


def _data(call: Call | None, t: float, number: int | None, status: int) -> dict[str, Any]:
    return {
        "kind": "killed" if number == signal.SIGKILL else "crash",
        "instance": call.unit if call is not None else None,
        "call": call.call if call is not None else None,
        "time": t,
        "status": f"status {status}" if number is None else _meaning(number),
        "log": [],
    }


def _complete(facts: dict[str, Any], known: dict[str, Any], failure: UnitFailure | None) -> None:
    folder = RunFolder.left_at(Path(facts["folder"]))
    try:
        complete_record(folder.signals)
    except FileNotFoundError:  # it died before it recorded
        simulated = 0.0
    else:
        time = Record(folder.signals).time
        simulated = float(time[-1]) if len(time) else 0.0
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    summary: dict[str, Any] = {
        **facts["configuration"],
        "complete": False,
        "success": False,
        "metrics": dict[str, Any](),
        "simulated_seconds": simulated,
        "cpu_seconds": spent.ru_utime + spent.ru_stime,
        "units": unit_data(facts["units"]),
        **known,
    }
    folder.write_summary(summary)
    folder.add_to_run(failure=known["failure"])
    write_report(folder, facts["title"], (), summary, facts["parameters"], facts["units"], ())
    outcome = Outcome(success=False, reason=known["reason"])
    print_summary(Ended(outcome=outcome, summary=summary, failure=failure), (), folder)
