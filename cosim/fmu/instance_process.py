"""Where an instance lives: in this process, or isolated in one of its own, which may end in any call."""

import ctypes
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import InvalidFmu, UnitFailure
from handover.cosim.fmu.buffers import OutputBuffer, SignalBuffer
from handover.cosim.fmu.failures import UnitCrashed, UnitHung
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.isolation.unit_process import NoUnitProcess, UnitProcess


class InstanceProcess:
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
