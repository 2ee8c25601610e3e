"""The calls of one unit's functions: each noted in the heartbeat, its status checked, its log lines kept.

A status above Warning raises the `UnitFailure` of that status; Warning is counted. A unit lives in this process or,
isolated, in one of its own, which may end in any call.
"""

import collections
import ctypes
import logging
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar

from handover.cosim.exceptions import InvalidFmu, UnitFailure, last_line
from handover.cosim.fmu.buffers import SUCCEEDED, OutputBuffer, SignalBuffer
from handover.cosim.fmu.failures import STATUS, UnitCrashed, UnitHung, failure_of
from handover.cosim.fmu.file.description import FmuDescription
from handover.cosim.fmu.heartbeat import Abandoned, Heartbeat
from handover.cosim.fmu.loading import LOADING, UNLOADING, load_unit
from handover.cosim.fmu.unit_warnings import UnitWarnings
from handover.cosim.isolation.unit_process import NoUnitProcess, UnitProcess


class _InstanceProcess:
    """The process of an instance.

    Inputs of an isolated instance are set, and its outputs read, together with the step: a failure may have arisen in
    another call than the one that reports it.

    Args:
        name: the instance's.
        fmu: path of its FMU.
        heartbeat: of the run.
        isolated: whether the process is to be one of its own.

    Attributes:
        own: that process, None for this one.
        cpu_address: of the CPU seconds of steps in it that were not taken yet, see `measure_cpu`; 0 in this process.

    Raises:
        InvalidFmu: a process cannot be started.
    """

    def __init__(self, name: str, fmu: Path, heartbeat: Heartbeat, *, isolated: bool) -> None:
        self._name, self._heartbeat = name, heartbeat
        self.own: UnitProcess | None = None
        self.cpu_address = 0
        if isolated:
            heartbeat.isolated.add(name)
            try:
                self.own = UnitProcess(heartbeat.limit, heartbeat.time_address)
            except NoUnitProcess as e:
                raise InvalidFmu(fmu, f"could not be loaded: {e}") from e

    @property
    def is_stepping(self) -> bool:
        """Whether a step was begun that nobody has waited for yet."""
        return self.own is not None and self.own.is_stepping

    @property
    def failed_call(self) -> str:
        """The call in which the last failure arose, if another one reported it; else empty."""
        return "" if self.own is None else self.own.failed_call

    def measure_cpu(self) -> None:
        """Measure the CPU time of steps in an isolated instance's process from now on."""
        if self.own is not None:
            self.cpu_address = self.own.measure_cpu()

    def take_cpu(self) -> float:
        """Return the CPU seconds of the steps in an isolated instance's process since this was called last, else 0."""
        if not self.cpu_address:
            return 0.0
        cell = ctypes.c_double.from_address(self.cpu_address)
        spent, cell.value = cell.value, 0.0
        return spent if 0.0 <= spent < math.inf else 0.0  # a unit may have written over it

    def begin_step(self, fmi: int, component: Any, t: float, dt: float, no_rollback: bool) -> None:
        """Begin a step without waiting for its end; in this process do nothing."""
        if self.own is not None:
            self.own.begin_step(fmi)(component, t, dt, no_rollback)

    def address_of_begin_step(self, fmi: int) -> int:
        """Return the address of the function that begins a step, 0 in this process."""
        return 0 if self.own is None else ctypes.cast(self.own.begin_step(fmi), ctypes.c_void_p).value or 0

    def failure(self, call: str, t: float, log: Sequence[str]) -> UnitFailure | None:
        """Return how an isolated instance's process ended in a call at t, None if it did not."""
        ending = None if self.own is None else self.own.ending
        if ending is None:
            return None
        where = (self._name, ending.call if ending.call.startswith("fmi") else call, t)
        return UnitHung(*where, self._heartbeat.limit, log) if ending.hung else UnitCrashed(*where, ending.how, log)

    def share(self, buffer: SignalBuffer) -> SignalBuffer:
        """Return a buffer, whose texts and binaries are not copied where they lie in shared memory."""
        if self.own is not None and isinstance(buffer, OutputBuffer):
            buffer.kept_elsewhere, buffer.copies = self.own, False
        return buffer

    def kill(self) -> None:
        """End the process of an isolated instance at once, while another thread may be in one of its calls."""
        if self.own is not None:
            self.own.kill()

    def close(self) -> None:
        """End the process of an isolated instance, after unloading its library, unless it has ended."""
        if self.own is not None:
            self.own.close()


_LOG_LINES = 30
_WARNING, _DISCARD, _FATAL = 1, 2, 4

UNIT_LOG = logging.getLogger("handover.units")
"""Takes what units log, for programs that listen; without one nothing of it is printed, and a failure has its log."""
UNIT_LOG.addHandler(logging.NullHandler())
_LEVELS = (logging.DEBUG, logging.WARNING, logging.WARNING, logging.ERROR, logging.ERROR, logging.DEBUG)
"""Levels of the standards' statuses, by number."""


def _status_name(status: int) -> str:
    return STATUS[status] if 0 <= status < len(STATUS) else str(status)


def _nothing() -> None:
    pass


class CheckedCalls:
    """A unit that is loaded and instantiated, and what calls of it have in common.

    Each call is noted in `heartbeat`. If a call returns after the unit was abandoned, `Abandoned` is raised.
    An `isolated` instance lives in a process of its own: a crash there is a `UnitCrashed`, a hang a `UnitHung`.

    Raises:
        InvalidFmu: the library does not load or does not instantiate.
        UnitCrashed, UnitHung: an isolated instance does so meanwhile.
    """

    uses_events: ClassVar[bool] = False
    """Whether it is loaded with event mode, and so is allowed to end a step before its end."""

    def __init__(
        self, name: str, description: FmuDescription, folder: Path, heartbeat: Heartbeat | None, *, isolated: bool
    ) -> None:
        self.name = name
        self.description = description
        self.time = 0.0
        self.log: collections.deque[str] = collections.deque(maxlen=_LOG_LINES)
        self._fmi = description.fmi
        self._prefix = f"fmi{self._fmi}"
        self._heartbeat = heartbeat or Heartbeat()
        self._codes: dict[str, int] = {}
        self._failed: int | None = None
        self._warnings = UnitWarnings()
        d = description
        self._process = _InstanceProcess(name, d.path, self._heartbeat, isolated=isolated)
        try:
            self._fmu = self._load(folder)
        except InvalidFmu as e:
            self._process.close()
            self._fail_if_ended(LOADING)
            raise InvalidFmu(e.path, last_line(self.log) or e.fault, tuple(self.log)) from e
        finally:
            self._returned()
        self._component = self._fmu.component
        self.on_fatal: Callable[[], object] = _nothing
        """Is called when a call returns Fatal, after which no instance of the FMU may be called."""
        if UNIT_LOG.isEnabledFor(logging.DEBUG):
            self._log_all_categories()

    def judge(self, call: str, status: int) -> None:
        """Check the status of a call at `time`.

        Raises:
            UnitFailure: it is above Warning.
        """
        if status not in SUCCEEDED:
            self._fail(call, status)

    def end(self) -> None:
        """Terminate the unit, unless a call failed with another status than Discard: the standards forbid it then."""
        if not self.failed and not self._abandoned:
            self._call("Terminate")

    def free(self) -> None:
        """Free the unit and its library, unless no call may follow, see `lost`; end the process of an isolated one.

        Raises:
            UnitCrashed, UnitHung: an isolated instance does so meanwhile.
        """
        if self._component is not None and not self.lost:
            component, self._component = self._component, None
            self._begins(f"{self._prefix}FreeInstance")
            self._function("FreeInstance")(component)
            self._returned()
            self._begins(UNLOADING)
            self._fmu.freeLibrary()
            self._returned()
        if self._abandoned:
            self._process.kill()
        elif self.isolated:
            self._end_process()

    @property
    def warnings(self) -> UnitWarnings:
        """The calls that answered Warning until now, but for those in a plan, see `PlanStepper.publish_warnings`."""
        if self._process.own is not None:
            for warned in self._process.own.take_warnings():
                self._warnings.add(*warned)
        return self._warnings

    @property
    def isolated(self) -> bool:
        """Whether the instance lives in a process of its own."""
        return self._process.own is not None

    @property
    def fatal(self) -> bool:
        """Whether a call returned Fatal."""
        return self._failed == _FATAL

    @property
    def failed(self) -> bool:
        """Whether a call returned a status after which the unit cannot be stepped."""
        return self._failed not in (None, _DISCARD)

    @property
    def lost(self) -> bool:
        """Whether no call may follow, not even to free the unit: one returned Fatal, or did not return."""
        return self.fatal or self._abandoned

    @property
    def _abandoned(self) -> bool:
        return self.name in self._heartbeat.abandoned

    def _begins(self, call: str) -> None:
        code = self._codes.get(call)
        if code is None:
            code = self._codes[call] = self._heartbeat.code(self.name, call)
        self._heartbeat.begin(code, self.time)

    def _returned(self) -> None:
        self._heartbeat.end()
        if self._heartbeat.abandoned and self._abandoned:
            raise Abandoned

    def _load(self, folder: Path) -> Any:
        return load_unit(
            self.description, folder, self.name, self._take_log_line, self._begins,
            events=self.uses_events, process=self._process.own,
        )  # fmt: skip

    def _function(self, name: str) -> Any:
        return getattr(self._fmu.dll, self._prefix + name)

    def _call(self, name: str, *arguments: Any) -> None:
        self._begins(self._prefix + name)
        status = self._function(name)(self._component, *arguments)
        self._returned()
        if status:
            self._check(self._prefix + name, status)

    def _check(self, call: str, status: int, failing: str = "") -> None:
        """Count a Warning; raise a failure of a call, reported as `failing`."""
        if status == _WARNING:
            self._warnings.add(call, self.time)
        elif status not in SUCCEEDED:
            self._fail(failing or call, status)

    def _end_process(self) -> None:
        if self.lost:
            self._process.close()
            return
        try:
            self._fail_if_ended(f"{self._prefix}FreeInstance")
        finally:
            self._begins(UNLOADING)
            self._process.close()
            self._returned()
        self._fail_if_ended(UNLOADING)

    def _fail(self, call: str, status: int) -> None:
        self._failed = status
        if self.fatal:
            self.on_fatal()
        self._fail_if_ended(call)
        raise failure_of(self.name, self._process.failed_call or call, self.time, status, tuple(self.log))

    def _fail_if_ended(self, call: str) -> None:
        """Raise how the process of an isolated instance ended, if it did."""
        failure = self._process.failure(call, self.time, tuple(self.log))
        if failure is not None:
            self._failed = _FATAL
            raise failure

    def _take_log_line(self, status: int, message: str) -> None:
        level = _LEVELS[status] if 0 <= status < len(_LEVELS) else logging.WARNING
        if status <= 0 and not UNIT_LOG.isEnabledFor(level):
            return
        text = message.removeprefix(f"{self.name}: ")  # logs are shown with the instance's name
        line = f"[{_status_name(status)}] {text}"
        if status > 0:
            if status == _WARNING:
                self._warnings.note_message(text)
            self.log.append(line)
            self._heartbeat.log(self.name, line)
        UNIT_LOG.log(level, "%s: %s", self.name, line)

    def _log_all_categories(self) -> None:
        """Let the unit log by all its categories; some log by a few only where logging is on from the start."""
        call = f"{self._prefix}SetDebugLogging"
        self._begins(call)
        status = self._function("SetDebugLogging")(self._component, True, 0, None)
        self._returned()
        if status == _FATAL:
            self._fail(call, status)
        if status not in SUCCEEDED:
            UNIT_LOG.debug("%s: %s answered %s: it logs as from the start", self.name, call, _status_name(status))
