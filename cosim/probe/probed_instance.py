"""An instance that notes each call before it is made, and that can be reset and rolled back."""

import ctypes
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import UnitFailure, log_lines
from handover.cosim.fmu.buffers import SignalBuffer
from handover.cosim.fmu.calls import is_rounding
from handover.cosim.fmu.event_instance import EventInstance
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.fmu.instance import Instance
from handover.cosim.probe.finding import Finding, fault
from handover.cosim.probe.isolated_process import Journal

_WITHOUT_NUMBERS = (Kind.STRING, Kind.BINARY)
MAX_EVENTS = 1000
"""Events in a step, and updates at an event, after which a unit counts as one that does not go on."""

_MAX_LINES = 24  # of a unit's log


class ProbedInstance(Instance):
    """A unit under test. Its inputs, strings and binaries aside, are held at their start values.

    It runs without event mode, see `ProbedEventInstance`; clocked ports, which can be reached only there, are left
    alone.

    Raises:
        InvalidFmu: as `Instance`.
    """

    def __init__(self, name: str, description: FmuDescription, folder: Path, journal: Journal) -> None:
        self._journal = journal
        journal.begins(f"fmi{description.fmi}Instantiate" + ("CoSimulation" if description.fmi == 3 else ""))
        inputs, outputs = (_without_clock(ports) for ports in (description.inputs, description.outputs))
        held = [p.name for p in inputs.values() if p.kind not in _WITHOUT_NUMBERS]
        super().__init__(name, replace(description, inputs=inputs, outputs=outputs), folder, held)

    def start(self, t: float, given: Mapping[str, Any] | None = None) -> None:
        """Set start values, those that are given or the FMU's, and go through initialisation; the outputs are read."""
        self.time = t
        starts = {**self._starts(), **(given or {})}
        self.set_start(starts)
        for name, views in self.u.items():
            if name in starts:
                views[0][:] = np.asarray(starts[name]).reshape(-1)
        self.enter_initialization(t, None)
        self.exit_initialization()
        self.get_outputs()

    def advance(self, dt: float) -> None:
        """Set the inputs, do a step and read the outputs, as the master does."""
        self.set_inputs()
        self.step(self.time, dt)
        self.get_outputs()

    def step(self, t: float, dt: float) -> None:
        """Note the step and do it."""
        self._journal.begins(f"{self._prefix}DoStep", t)
        super().step(t, dt)

    def seen(self) -> dict[str, bytes]:
        """Return the outputs as bytes, by name."""
        return {name: _bytes_of(self.description.outputs[name], views) for name, views in self.y.items()}

    def reset(self) -> None:
        """Reset the unit to what it was after instantiation, also after a failed call."""
        self._failed = None
        self._call("Reset")

    def check_readable(self, ports: Sequence[FmuPort]) -> None:
        """Read variables of one type, whatever their causality.

        Raises:
            UnitFailure: the unit does not give one of them.
        """
        self._set_or_get(self._buffers("Get", list(ports)))

    def keep_state(self) -> Any:
        """Return the unit's state."""
        state = ctypes.c_void_p()
        self._call(self._state("GetFMU"), ctypes.byref(state))
        return state

    def restore(self, state: Any, t: float) -> None:
        """Restore a state that was kept at time t, and read the outputs."""
        self._call(self._state("SetFMU"), state)
        self.time = t
        self.get_outputs()

    def drop_state(self, state: Any) -> None:
        """Free a state."""
        self._call(self._state("FreeFMU"), ctypes.byref(state))

    def serialised(self, state: Any) -> bytes:
        """Return a state as bytes."""
        size = ctypes.c_size_t()
        self._call(f"{self._state('SerializedFMU')}Size", state, ctypes.byref(size))
        content = ctypes.create_string_buffer(size.value)
        self._call(self._state("SerializeFMU"), state, self._as_bytes(content), size.value)
        return content.raw

    def deserialised(self, content: bytes) -> Any:
        """Return a state made of bytes."""
        state = ctypes.c_void_p()
        given = ctypes.create_string_buffer(content, len(content))
        verb = "DeSerializeFMU" if self._fmi == 2 else "DeserializeFMU"
        self._call(self._state(verb), self._as_bytes(given), len(content), ctypes.byref(state))
        return state

    def free(self) -> None:
        """Note the freeing and do it."""
        self._journal.begins(f"{self._prefix}FreeInstance")
        super().free()

    def _starts(self) -> Mapping[str, Any]:
        """Return the start values of parameters and inputs that have one which can be set."""
        ports = {**self.description.parameters, **self.description.inputs}
        starts = {name: _start_of(p) for name, p in ports.items()}
        return {name: value for name, value in starts.items() if value is not None}

    def _state(self, verb: str) -> str:
        return f"{verb}{'state' if self._fmi == 2 else 'State'}"

    def _as_bytes(self, buffer: Any) -> Any:
        return ctypes.cast(buffer, ctypes.POINTER(ctypes.c_char if self._fmi == 2 else ctypes.c_uint8))

    def _set_or_get(self, buffers: Iterable[SignalBuffer]) -> None:
        for buffer in buffers:
            self._journal.begins(f"{buffer.name} of {', '.join(list(buffer.views)[:5])}", self.time)
            super()._set_or_get([buffer])

    def _set_one(self, port: FmuPort, value: Any) -> None:
        self._journal.begins(f"setting {port.name}")
        super()._set_one(port, value)

    def _take_log_line(self, status: int, message: str) -> None:
        super()._take_log_line(status, message)
        if status > 0:
            self._journal.logs(message)

    def _call(self, name: str, *arguments: Any) -> None:
        self._journal.begins(self._prefix + name, self.time)
        super()._call(name, *arguments)


class ProbedEventInstance(ProbedInstance, EventInstance):
    """A unit under test that runs in event mode: its clocks tick, and its steps end at events."""

    def start(self, t: float, given: Mapping[str, Any] | None = None) -> None:
        """Go through initialisation and the first events."""
        super().start(t, given)
        self._settle()

    def advance(self, dt: float) -> None:
        """Advance by dt, from event to event."""
        target = self.time + dt
        self.set_inputs()
        for _ in range(MAX_EVENTS):
            known = [self.next_event, *(float(timer.next) for timer in self.timers if timer.next is not None)]
            end = min([target, *(t for t in known if t is not None and t > self.time)])
            self.step(self.time, end - self.time)
            if self._step_returns.event or self.time < target or end in known:
                self._settle()
            if self.time >= target or is_rounding(self.time - target, target):
                break
        else:
            raise UnitFailure(self.name, f"{self._prefix}DoStep", self.time, f"over {MAX_EVENTS} events in a step")
        self.get_outputs()

    def reset(self) -> None:
        """Reset the unit, which is neither initialised nor in event mode then."""
        super().reset()
        self._initialized = self.in_event_mode = False
        self.active.clear()

    def keep_state(self) -> Any:
        """Return the unit's state; the times of its events are kept here, for the state that is kept last."""
        self._timing = self.get_timing()
        return super().keep_state()

    def restore(self, state: Any, t: float) -> None:
        """Restore a state that was kept at time t, with the times of events."""
        self.set_timing(self._timing)
        super().restore(state, t)

    def _settle(self) -> None:
        """Handle the events of this instant, and return to step mode."""
        if not self.in_event_mode:
            self.enter_event_mode()
        for _ in range(MAX_EVENTS):
            due = [timer.clock.name for timer in self.timers if timer.is_due(self.time)]
            if due:
                self.tick(due)
            self.get_outputs()
            self.ticking()
            if not self.update(self.time) and not any(timer.is_due(self.time) for timer in self.timers):
                break
        else:
            raise UnitFailure(self.name, "fmi3UpdateDiscreteStates", self.time, f"wants over {MAX_EVENTS} updates")
        self.enter_step_mode()


def probed(name: str, description: FmuDescription, folder: Path, journal: Journal) -> ProbedInstance:
    """Return a unit under test, in event mode where a run would be.

    Raises:
        InvalidFmu: as `Instance`.
    """
    events = description.capabilities.event_mode and not description.sampled
    return (ProbedEventInstance if events else ProbedInstance)(name, description, folder, journal)


def _start_of(port: FmuPort) -> Any:
    """Return a port's start value as `Instance.set_start` takes it; None where there is none, or none that can be read.

    Of strings and binaries only scalars are set, as by the master.
    """
    if port.start is None or (port.kind in _WITHOUT_NUMBERS and port.shape):
        return None
    if port.kind is Kind.STRING:
        return port.start
    try:
        if port.kind is Kind.BINARY:
            return bytes.fromhex(port.start)
        if port.kind is Kind.BOOLEAN:
            values: list[Any] = [word in ("true", "1") for word in port.start.split()]
        else:
            values = [float(w) if port.kind is Kind.REAL else int(w) for w in port.start.split()]
        return np.array(values * port.size if len(values) == 1 else values).reshape(port.shape)
    except ValueError:
        return None


def _bytes_of(port: FmuPort, views: tuple[Any, ...]) -> bytes:
    if port.kind is Kind.STRING:
        return b"\0".join(ctypes.string_at(int(a)) if a else b"" for a in views[0])
    if port.kind is Kind.BINARY:
        pairs = zip(views[0], views[1], strict=True)
        return b"\0".join(ctypes.string_at(int(a), int(n)) if a else b"" for a, n in pairs)
    return views[0].tobytes()


def _without_clock(ports: Mapping[str, FmuPort]) -> dict[str, FmuPort]:
    return {name: port for name, port in ports.items() if not port.clocks}


def failure(e: UnitFailure) -> Finding:
    """Return a failed call as a finding, with the end of the unit's log."""
    return fault(f"{e.call} at t = {e.t:.6g} s answered {e.status}", log=log_tail(e.log))


def log_tail(log: Sequence[str]) -> tuple[str, ...]:
    """Return the end of a unit's log, which holds the cause: of a traceback, what was raised and where."""
    return tuple(log_lines(log)[-_MAX_LINES:])
