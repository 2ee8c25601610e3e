"""How the process of a run crashed, was killed or hung; completes the folder that it left."""

import shutil
import signal
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.failures import LimitsLowered, UnitCrashed, UnitHung
from handover.cosim.fmu.heartbeat import Call, Heartbeat
from handover.cosim.fmu.loaded_libraries import is_own_thread, units_at
from handover.cosim.record.reader import Record
from handover.cosim.record.stream import complete_record
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.runs.execution.child_process import ChildEnd
from handover.scenarios.runs.results.run_folder import RunFolder, disk_errors_reported
from handover.scenarios.runs.results.summary import ElapsedTime, RunResult, crashed_summary, failure_reason


class Crash:
    """The crash of a run's process. Scratch folders of the run are removed.

    Args:
        heartbeat: what the run reported while it ran.
        end: how its process ended.
        wall: seconds that it ran.

    Attributes:
        failure: how the unit failed in whose call the process ended; None where it was not in a unit's call.
        in_own_thread: whether a thread crashed that a unit's library has started.
        message: what happened, in a line.
        facts: what the run left in its heartbeat for this case: its folder, configuration and units.
        folder: of the run, None if there was none yet.
    """

    def __init__(self, heartbeat: Heartbeat, end: ChildEnd, wall: float) -> None:
        self.facts = heartbeat.facts
        for folder in self.facts.get("scratch", []):
            shutil.rmtree(folder, ignore_errors=True)
        self._end, self._wall, self._time, self._call = end, wall, heartbeat.time, heartbeat.under_way
        self.failure = _failure(heartbeat, self._call, end)
        self.in_own_thread = _crashed_in_own_thread(heartbeat)
        self.message = str(self.failure or "") or _crash_message(self._call, self._time, end, self.in_own_thread)
        self.folder: RunFolder | None = None
        if "folder" in self.facts:
            self.folder = RunFolder.of_run(Path(self.facts["folder"]), Path(self.facts["shown"]))

    @property
    def presented(self) -> bool:
        """Whether the run was to have figures and a report."""
        return bool(self.facts.get("presented", False))

    @property
    def concluded(self) -> int | None:
        """The exit status of the run if it had ended and written its summary before the crash; else None."""
        return self.facts.get("concluded")

    @property
    def was_killed(self) -> bool:
        """Whether it was killed from outside, and not because it hung."""
        return self._end.signal == signal.SIGKILL and not self._end.hung

    def complete(self, folder: RunFolder) -> RunResult:
        """Complete the record in the run's folder as far as it goes, and write the summary.

        Raises:
            RecordNotWritten: there is no room for it.
        """
        failure = self.failure
        call = None if self.in_own_thread else self._call
        data = _data(call, self._time, self._end) if failure is None else failure.as_data()
        reason = self.message if failure is None else failure_reason(failure)
        with disk_errors_reported(folder.path):
            known = self.facts["configuration"], self.facts["units"]
            simulated = _complete_record(folder)
            summary = crashed_summary(*known, reason, data, simulated, ElapsedTime(self._wall, self._end.cpu))
            folder.write_summary(summary)
            folder.add_to_run(failure=data)
        return RunResult(outcome=Outcome(success=False, reason=reason), summary=summary, failure=failure)


_OWN_THREAD = "a thread of its own"


def _crashed_in_own_thread(heartbeat: Heartbeat) -> bool:
    return heartbeat.crash is not None and is_own_thread(heartbeat.crash[0], heartbeat.facts)


def _failure(heartbeat: Heartbeat, call: Call | None, end: ChildEnd) -> UnitFailure | None:
    if lowered := heartbeat.facts.get("lowered"):
        unit, place = heartbeat.facts.get("limits") or (_units_in_process(heartbeat), "one of its calls")
        return LimitsLowered(unit, place, heartbeat.time, lowered, heartbeat.log_of(unit))
    if heartbeat.crash is not None and end.signal is not None and _crashed_in_own_thread(heartbeat):
        units = units_at(heartbeat.crash[1], heartbeat.facts)
        if not units:
            return None
        log = heartbeat.log_of(units[0])
        return UnitCrashed(" or ".join(units), _OWN_THREAD, heartbeat.time, _signal_name(end.signal), log)
    if call is None:
        return None
    log = heartbeat.log_of(call.unit)
    if end.hung:
        return UnitHung(*call, heartbeat.limit, log)
    if end.signal == signal.SIGKILL:
        return None
    how = f"it ended the process with status {end.status}" if end.signal is None else _signal_name(end.signal)
    return UnitCrashed(*call, how, log)


def _units_in_process(heartbeat: Heartbeat) -> str:
    libraries = heartbeat.facts.get("libraries", ())
    return " or ".join(dict.fromkeys(name for _, _, names in libraries for name in names)) or "of the run"


def _signal_name(number: int) -> str:
    return (signal.strsignal(number) or f"signal {number}").lower()


def _crash_message(call: Call | None, t: float, end: ChildEnd, in_own_thread: bool) -> str:
    if in_own_thread and end.signal is not None:
        meanwhile = f" (meanwhile {call.call} of {call.unit})" if call is not None else ""
        return f"a thread of one of the units crashed at t = {t:.6g} s{meanwhile}: {_signal_name(end.signal)}"
    within = f", in {call.call} of {call.unit}" if call is not None else ", outside of its units"
    if end.stopped:
        return f"the run was stopped at t = {t:.6g} s{within} (SIGSTOP), did not continue and was given up"
    if end.signal == signal.SIGKILL:
        return f"the run was killed at t = {t:.6g} s{within}: by someone, or by the system for want of memory"
    how = f"ended with status {end.status}" if end.signal is None else _signal_name(end.signal)
    return f"the run crashed at t = {t:.6g} s{within}: {how}"


def _data(call: Call | None, t: float, end: ChildEnd) -> dict[str, Any]:
    unit, name = (None, None) if call is None else (call.unit, call.call)
    kind = "killed" if end.signal == signal.SIGKILL else "crash"
    status = f"status {end.status}" if end.signal is None else _signal_name(end.signal)
    return {"kind": kind, "instance": unit, "call": name, "time": t, "status": status, "log": []}


def _complete_record(folder: RunFolder) -> float:
    """Complete a record and return how long it is, s."""
    try:
        complete_record(folder.signals)
    except FileNotFoundError:  # it crashed before it recorded
        return 0.0
    time = Record(folder.signals).time
    return float(time[-1] - time[0]) if len(time) else 0.0
