"""One FMU, unpacked, loaded and instantiated, behind the same few methods for FMI 2 and FMI 3.

An instance has its values in preallocated buffers, `u` for inputs and `y` for outputs. Every call goes through the
heartbeat and is checked: a status above Warning raises the `UnitFailure` of that status, and Warning is counted.
"""

import collections
import ctypes
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from handover.cosim.blocks.ports import Floats
from handover.cosim.fmu.buffers import SUCCEEDED, InputDerivatives, OutputBuffer, SignalBuffer, Views, fill
from handover.cosim.fmu.calls import (
    NativeStep,
    State,
    StateCalls,
    StepEnd,
    StepReturns,
    derivatives_along,
    discarded_step,
    is_rounding,
)
from handover.cosim.fmu.checked_calls import CheckedCalls
from handover.cosim.fmu.failures import InvalidReturn, StepDiscarded, UnitError, UnitTerminated
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.fmu.heartbeat import Heartbeat

_WARNING, _DISCARD, _FATAL, _PENDING = 1, 2, 4, 5


class Instance(CheckedCalls):
    """A unit in a run. `folder` holds its unpacked FMU; `inputs` names the inputs that will be set while running.

    Raises:
        InvalidFmu, UnitCrashed, UnitHung: as `CheckedCalls`.
    """

    def __init__(
        self, name: str, description: FmuDescription, folder: Path, inputs: Iterable[str],
        heartbeat: Heartbeat | None = None, *, isolated: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(name, description, folder, heartbeat, isolated=isolated)
        self._states = StateCalls(self._call, self._fmi)
        d = description
        self._setters = self._buffers("Set", [d.inputs[i] for i in inputs])
        self._getters = self._buffers("Get", list(d.outputs.values()))
        self.u: dict[str, Views] = {k: v for b in self._setters for k, v in b.views.items()}
        self.y: dict[str, Views] = {k: v for b in self._getters for k, v in b.views.items()}
        self.du: dict[str, Views] = {}
        """Time derivatives of the inputs that were given to `interpolate`."""
        self.can_roll_back = False
        """Whether states from before the present communication point may be restored; passed to the unit in DoStep."""
        self._step_returns = StepReturns(self._fmi)
        self._do_step, self._step_call = self._function("DoStep"), f"{self._prefix}DoStep"

    def set_start(self, values: Mapping[str, Any]) -> None:
        """Set parameters or start values of other variables, before initialisation."""
        ports = self.description.settable
        for name, value in values.items():
            self._set_one(ports[name], value)

    def read(self, ports: Sequence[FmuPort]) -> list[SignalBuffer]:
        """Return buffers with the values of variables, without those that the unit does not give.

        Raises:
            UnitFatal: it answered Fatal.
        """
        given: list[SignalBuffer] = []
        log = tuple(self.log)
        for buffer in self._buffers("Get", list(ports)):
            self._begins(buffer.name)
            status = buffer()
            self._returned()
            if status in (_WARNING, _FATAL):
                self._check(buffer.name, status)
            if status in SUCCEEDED:
                given.append(buffer)
            elif len(buffer.views) > 1:  # one that is not given takes all of a call with it
                given += [one for p in ports if p.name in buffer.views for one in self.read([p])]
        self.log.clear()
        self.log.extend(log)
        return given

    def enter_initialization(self, t: float, stop: float | None, tolerance: float | None = None) -> None:
        """Enter initialisation mode at time t, of a run until `stop`; a tolerance is for the unit's own solver."""
        self.time = t
        experiment = tolerance is not None, tolerance or 0.0, t, stop is not None, stop or 0.0
        if self._fmi == 2:
            self._call("SetupExperiment", *experiment)
            self._call("EnterInitializationMode")
        else:
            self._call("EnterInitializationMode", *experiment)

    def exit_initialization(self) -> None:
        """Leave initialisation mode; steps follow."""
        self._call("ExitInitializationMode")

    def set_inputs(self) -> None:
        """Set the unit's inputs to the contents of `u`, and their derivatives to those of `du`."""
        self._set_or_get(self._setters)

    def set_some_inputs(self, names: Iterable[str]) -> None:
        """Set only these inputs of the unit to the contents of `u`."""
        setters = self._buffers("Set", [self.description.inputs[n] for n in names])
        for buffer in setters:
            for name, views in buffer.views.items():
                for target, source in zip(views, self.u[name], strict=True):
                    target[:] = source
        self._set_or_get(setters)

    def interpolate(self, names: Iterable[str]) -> None:
        """Set these inputs' time derivatives too, from `du`, whenever inputs are set (FMI 2)."""
        ports = [self.description.inputs[n] for n in names]
        buffer = InputDerivatives(self._function("SetRealInputDerivatives"), self._component, ports)
        self._setters.append(buffer)
        self.du = dict(buffer.views)

    def get_outputs(self) -> None:
        """Read the unit's outputs into `y`."""
        self._set_or_get(self._getters)

    def begin_step(self, t: float, dt: float) -> None:
        """Begin a step of an isolated instance, which `step` or `try_step` with the same times waits for."""
        self._process.begin_step(self._fmi, self._component, t, dt, not self.can_roll_back)

    @property
    def is_stepping(self) -> bool:
        """Whether a step was begun that is not waited for yet."""
        return self._process.is_stepping

    def step(self, t: float, dt: float) -> None:
        """Advance from t by dt.

        Raises:
            UnitFailure: the status is above Warning, or the unit asks to end the simulation.
        """
        self.time = self.judge_step(self._call_step(t, dt), dt)

    def try_step(self, t: float, dt: float) -> StepEnd:
        """Advance from t by dt, or as far as the unit gets; raises as `step` does, except for a discarded step."""
        status = self._call_step(t, dt)
        if status == _DISCARD and not self._process.failed_call:
            return StepEnd(self._reached(dt), early=True, discarded=True)
        self.time = self.judge_step(status, dt)
        return StepEnd(self.time, self.time < t + dt, self._step_returns.event)

    def discarded(self, reached: float, reason: str) -> StepDiscarded:
        """Return the failure of a step that the unit discarded and that is not repeated, for a reason."""
        return StepDiscarded(self.name, self._step_call, self.time, reached, reason, tuple(self.log))

    def judge_step(self, status: int, dt: float) -> float:
        """Return the time that a step of dt, which began at `time`, has reached.

        Raises:
            UnitTerminated: the unit asks to end the simulation; `time` is then what it has reached.
            InvalidReturn: it returned early without being allowed to, or with a time out of the step.
            UnitFailure: the status is above Warning.
        """
        if status == _DISCARD and not self._process.failed_call:
            how = "--repeat-discarded (repeat_discarded of MasterOptions)"
            raise self.discarded(self._reached(dt), f"steps are repeated shorter only with {how}")
        if status == _PENDING:  # FMI 2: an asynchronous step, which is not supported
            self._function("CancelStep")(self._component)
        self.judge(self._step_call, status)
        reached = self._step_returns.time_reached(self.time, dt, early_allowed=self.uses_events)
        if isinstance(reached, str):
            raise InvalidReturn(self.name, self._step_call, self.time, self._step_returns.last, reached, self.log)
        if self._step_returns.ends:
            raise self._terminated(reached, dt)
        return reached

    def check_memory(self, buffer: OutputBuffer) -> None:
        """Check the binaries that the unit gave.

        Raises:
            UnitError: one has a size but no memory.
        """
        if missing := buffer.missing():
            raise UnitError(self.name, buffer.name, self.time, missing, tuple(self.log))

    @property
    def setters(self) -> Sequence[SignalBuffer]:
        """The buffers that `set_inputs` sets."""
        return self._setters

    @property
    def getters(self) -> Sequence[SignalBuffer]:
        """The buffers that `get_outputs` reads."""
        return self._getters

    def measure_cpu(self) -> None:
        """Measure the CPU time of steps in its own process from now on, if it is isolated."""
        self._process.measure_cpu()

    @property
    def cpu_address(self) -> int:
        """Address of the CPU seconds that `take_cpu` takes, for C code; 0 where it is not isolated or measured."""
        return self._process.cpu_address

    def take_cpu(self) -> float:
        """Return the CPU seconds of the steps in its own process since this was called last; 0 if it has none."""
        return self._process.take_cpu()

    @property
    def native_step(self) -> NativeStep:
        """The call that `step` makes, for C code."""
        do_step = ctypes.cast(self._do_step, ctypes.c_void_p).value or 0
        begin = self._process.address_of_begin_step(self._fmi)
        return NativeStep(self._fmi, do_step, self._component or 0, self._step_returns.addresses, begin)

    def directional_derivative(self, outputs: Sequence[str], inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return the directional derivative dy = (dy/du) du of outputs at this instant, with the unit's state held.

        Args:
            outputs: names of the real outputs y.
            inputs: the direction du, by name of real inputs, all entries in row-major order.

        Returns:
            dy by output's name, flattened in row-major order.

        Raises:
            UnitFailure: the call failed.
        """
        return derivatives_along(self._call, self._fmi, self.description, outputs, inputs)

    def save_state(self) -> State:
        """Let the unit save its state; it is freed by `free_state`.

        Raises:
            UnitFailure: it cannot.
        """
        return self._states.save()

    def restore_state(self, state: State) -> None:
        """Restore a saved state of this instance, which may be used again.

        Raises:
            UnitFailure: it cannot.
        """
        self._states.restore(state)

    def free_state(self, state: State) -> None:
        """Free a saved state, unless no call may follow, see `lost`."""
        if not self.lost:
            self._states.free(state)

    def serialise_state(self) -> bytes:
        """Return the unit's state as bytes that are valid in another process too.

        Raises:
            UnitFailure: it cannot.
        """
        state = self.save_state()
        try:
            return self._states.serialise(state)
        finally:
            self.free_state(state)

    def deserialise_state(self, data: bytes) -> None:
        """Restore a state that `serialise_state` returned.

        Raises:
            UnitFailure: it cannot.
        """
        state = self._states.deserialise(data)
        try:
            self.restore_state(state)
        finally:
            self.free_state(state)

    def contents(self) -> list[list[bytes]]:
        """Return the contents of `y` and of `u` without strings and binaries; the unit may have advanced since."""
        return [b.contents() for b in self._restorable_buffers()]

    def refill(self, contents: Sequence[Sequence[bytes]]) -> None:
        """Set the buffers to what `contents` returned, possibly in another process."""
        for buffer, content in zip(self._restorable_buffers(), contents, strict=True):
            buffer.refill(content)

    def _call_step(self, t: float, dt: float) -> int:
        self.time = t
        self._step_returns.clear(t + dt)
        self._begins(self._step_call)
        status: int = self._do_step(self._component, t, dt, not self.can_roll_back, *self._step_returns.arguments)
        self._returned()
        if status == _WARNING:
            self._check(self._step_call, status)
        return status

    def _reached(self, dt: float) -> float:
        """Return how far a discarded step got; raise if the unit discarded it to end the simulation."""
        reached, terminated = discarded_step(self._function, self._component, self.time, self._fmi)
        if terminated:
            raise self._terminated(min(max(self.time, reached), self.time + dt), dt)
        return reached

    def _terminated(self, reached: float, dt: float) -> UnitTerminated:
        t, end, self.time = self.time, self.time + dt, reached
        log, completed = tuple(self.log), is_rounding(reached - end, end)
        return UnitTerminated(self.name, self._step_call, t, log, reached=reached, completed=completed)

    def _buffers(self, verb: str, ports: list[FmuPort]) -> list[SignalBuffer]:
        by_type: dict[str, list[FmuPort]] = collections.defaultdict(list)
        for p in ports:
            by_type[p.fmi_type].append(p)
        return [self._buffer(verb, group) for group in by_type.values()]

    def _buffer(self, verb: str, ports: list[FmuPort]) -> SignalBuffer:
        fmi_type = ports[0].fmi_type
        if fmi_type == "Enumeration":  # has no calls of its own
            fmi_type = "Integer" if self._fmi == 2 else "Int64"
        buffer_class = OutputBuffer if verb == "Get" and fmi_type in ("String", "Binary") else SignalBuffer
        call = f"{self._prefix}{verb}{fmi_type}"
        function = self._function(f"{verb}{fmi_type}")
        return self._process.share(buffer_class(call, function, self._component, self._fmi, ports))

    def _restorable_buffers(self) -> list[SignalBuffer]:
        """Return all buffers but those of inputs that hold addresses of other units' outputs."""
        return [*self._getters, *(b for b in self._setters if not b.name.endswith(("String", "Binary")))]

    def _set_or_get(self, buffers: Iterable[SignalBuffer]) -> None:
        for buffer in buffers:
            self._begins(buffer.name)
            status = buffer()
            self._returned()
            if status:
                self._check(buffer.name, status)
            if isinstance(buffer, OutputBuffer):
                self.check_memory(buffer)

    def _set_one(self, port: FmuPort, value: Any) -> None:
        buffer = self._buffer("Set", [port])
        kept = fill(port, buffer.views[port.name], value)
        self._begins(buffer.name)
        status = buffer()
        del kept
        self._returned()
        self._check(buffer.name, status, f"setting {port.name}")
