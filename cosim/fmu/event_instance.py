"""An instance with event mode: what can be set and read in which mode, and the times of its next events.

The ticks of time-based clocks are exact fractions, so they do not drift. FMI 3.0, secs. 2.2.9 and 4.2.
"""

import ctypes
import enum
from collections.abc import Collection, Iterable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

from numpy.typing import NDArray

from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.buffers import SignalBuffer, Views, content_of
from handover.cosim.fmu.calls import Call
from handover.cosim.fmu.failures import UnitTerminated
from handover.cosim.fmu.file.clocks import FmuClock
from handover.cosim.fmu.file.default_experiment import exact_seconds
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.fmu.instance import Instance


class Qualifier(enum.IntEnum):
    """The meaning of an interval that a unit returned: fmi3IntervalQualifier."""

    NOT_YET_KNOWN = 0
    UNCHANGED = 1
    CHANGED = 2


class _ClockCalls:
    """Activates an instance's input clocks, and reads its output clocks, intervals and shifts."""

    def __init__(self, call: Call, clocks: Mapping[str, FmuClock]) -> None:
        self._call = call
        self._clocks = clocks
        outputs = [c for c in clocks.values() if not c.is_input]
        self._outputs = [c.name for c in outputs]
        self._references = (ctypes.c_uint32 * len(outputs))(*(c.reference for c in outputs))
        self._active = (ctypes.c_bool * len(outputs))()

    def tick(self, names: Iterable[str]) -> None:
        """Activate input clocks."""
        references = [self._clocks[n].reference for n in names]
        n = len(references)
        self._call("SetClock", (ctypes.c_uint32 * n)(*references), n, (ctypes.c_bool * n)(*[True] * n))

    def ticking(self) -> set[str]:
        """Return the output clocks that are active."""
        if not self._outputs:
            return set()
        self._call("GetClock", self._references, len(self._outputs), self._active)
        return {name for name, active in zip(self._outputs, self._active, strict=True) if active}

    def interval(self, name: str) -> tuple[Fraction, Qualifier]:
        """Return a clock's interval in seconds, and its qualifier."""
        clock, qualifier = self._clocks[name], ctypes.c_int()
        if clock.supports_fraction:
            counter, resolution = ctypes.c_uint64(), ctypes.c_uint64(1)
            self._get("GetIntervalFraction", clock, counter, resolution, qualifier)
            seconds = Fraction(counter.value, resolution.value or 1)
        else:
            decimal = ctypes.c_double()
            self._get("GetIntervalDecimal", clock, decimal, qualifier)
            is_known = qualifier.value != Qualifier.NOT_YET_KNOWN  # else the decimal may be anything, also NaN
            seconds = Fraction(repr(decimal.value)) if is_known else Fraction(0)
        return seconds, Qualifier(qualifier.value)

    def shift(self, name: str) -> Fraction:
        """Return the time of a clock's first tick, in seconds after the start."""
        clock = self._clocks[name]
        if clock.supports_fraction:
            counter, resolution = ctypes.c_uint64(), ctypes.c_uint64(1)
            self._get("GetShiftFraction", clock, counter, resolution)
            return Fraction(counter.value, resolution.value or 1)
        decimal = ctypes.c_double()
        self._get("GetShiftDecimal", clock, decimal)
        return Fraction(repr(decimal.value))

    def _get(self, function: str, clock: FmuClock, *results: Any) -> None:
        reference = ctypes.c_uint32(clock.reference)
        self._call(function, ctypes.byref(reference), 1, *(ctypes.byref(r) for r in results))


class _ClockTimer:
    """The times of a time-based input clock.

    Periodic clocks (constant, fixed, tunable) tick at start + shift + k * interval; the interval is the description's,
    or else the one that the unit returns while it is initialised (the parameters that it may depend on do not change in
    a run).
    A changing clock gives the interval to its next tick whenever it has ticked, a countdown clock in any event mode.

    Attributes:
        next: the time of the next tick, s; None while a countdown has not begun.
    """

    def __init__(self, clock: FmuClock, calls: _ClockCalls, start: Fraction) -> None:
        """Read from the unit, in initialisation mode of a run from `start` on, what the description leaves open."""
        self.clock = clock
        self._calls = calls
        self.next: Fraction | None = None
        if clock.variability in ("changing", "countdown"):
            self._count_from(start)
            return
        shift, self._interval = clock.shift, clock.interval
        if clock.interval is None:
            self._interval, _ = calls.interval(clock.name)
            shift = calls.shift(clock.name)
        if not self._interval:
            raise ValueError(f"its clock {clock.name!r} ticks every {self._interval} s")
        self.next = start + shift

    def is_due(self, t: float) -> bool:
        """Whether it ticks at t."""
        return self.next is not None and float(self.next) <= t

    def tick(self) -> None:
        """Set the time of the next tick, after the unit has updated its discrete states in event mode."""
        if self.clock.variability == "countdown" or self.next is None:
            self.next = None
        elif self.clock.variability == "changing":
            ticked, self.next = self.next, None
            self._count_from(ticked)
        elif self._interval:
            self.next += self._interval

    def ask(self, t: float) -> None:
        """Read a countdown clock's interval, in event mode at t."""
        if self.clock.variability == "countdown":
            self._count_from(Fraction(t))

    def _count_from(self, begin: Fraction) -> None:
        interval, qualifier = self._calls.interval(self.clock.name)
        if qualifier is Qualifier.CHANGED or (self.next is None and qualifier is Qualifier.UNCHANGED):
            self.next = begin + interval


class EventInstance(Instance):
    """A unit in event mode or in step mode; after initialisation it is in event mode.

    In step mode only continuous inputs can be set, in event mode discrete ones too. Clocked inputs and outputs can be
    accessed only while one of their clocks is active; in `y` clocked outputs keep their values of the last tick.

    Attributes:
        in_event_mode: whether it is in event mode.
        active: the clocks that tick in the present iteration.
        timers: its time-based clocks.
        next_event: the time of its next event that is known beforehand, s; None if there is none.
    """

    uses_events: ClassVar[bool] = True

    def __init__(
        self, name: str, description: FmuDescription, folder: Path, inputs: Iterable[str],
        heartbeat: Heartbeat | None = None, *, isolated: bool = False,
    ) -> None:  # fmt: skip
        fed = list(inputs)
        super().__init__(name, description, folder, fed, heartbeat, isolated=isolated)
        self.in_event_mode = False
        self.active: set[str] = set()
        self.timers: list[_ClockTimer] = []
        self.next_event: float | None = None
        self._fed = [description.inputs[i] for i in fed]
        self._outputs = list(description.outputs.values())
        self._initialized = False
        self._last_set: dict[str, bytes] = {}  # by input, the value given last; none where its clock has begun to tick
        self._parts: dict[tuple[str, tuple[str, ...]], list[SignalBuffer]] = {}
        self._clock_calls = _ClockCalls(self._call, description.clocks)
        self._flags = [ctypes.c_bool() for _ in range(5)]
        self._next = ctypes.c_double()

    def exit_initialization(self) -> None:
        """Read when the clocks will tick, then leave initialisation mode for event mode.

        Raises:
            UnitFailure: the call failed, or a clock has an invalid interval.
        """
        timed = [c for c in self.description.clocks.values() if c.is_input and not c.is_triggered]
        try:
            self.timers = [_ClockTimer(c, self._clock_calls, exact_seconds(self.time)) for c in timed]
        except ValueError as e:
            raise UnitFailure(self.name, "fmi3ExitInitializationMode", self.time, str(e), tuple(self.log)) from e
        super().exit_initialization()
        self._initialized = self.in_event_mode = True
        self._note_as_set(self._fed)

    def set_inputs(self) -> None:
        """Set those inputs, from `u`, that the unit accepts in its present mode."""
        ports = self._settable()
        self._set(ports)
        self._note_as_set(ports)

    def get_outputs(self) -> None:
        """Read into `y` the outputs that can be accessed in the present mode."""
        self._get([p for p in self._outputs if self._is_reachable(p)])

    def wants_inputs(self) -> bool:
        """Return whether a discrete input, one without clocks, differs from the value that the unit was given last."""
        return any(p.discrete and not p.clocks and self._differs(p) for p in self._fed)

    def has_other_inputs(self) -> bool:
        """Return whether an input that can be set in the present mode has another value than it was given last.

        One whose clock has begun to tick counts as such until it is set: a message that is the same again is another
        message.
        """
        return any(self._differs(p) for p in self._settable())

    def enter_event_mode(self) -> None:
        """Leave step mode."""
        self._call("EnterEventMode")
        self.in_event_mode = True

    def enter_step_mode(self) -> None:
        """Leave event mode."""
        self._call("EnterStepMode")
        self.in_event_mode = False

    def tick(self, clocks: Collection[str]) -> None:
        """Activate input clocks, in event mode; `update` ends their tick."""
        self._clock_calls.tick(sorted(clocks))
        self._activate(set(clocks))

    def ticking(self) -> set[str]:
        """Return the output clocks that tick in the present iteration; they count as active."""
        clocks = self._clock_calls.ticking()
        self._activate(clocks)
        return clocks

    def update(self, t: float) -> bool:
        """End an iteration in event mode at t; return whether the unit needs another one.

        Raises:
            UnitTerminated: it asks to end the simulation.
            UnitFailure: its call failed.
        """
        self.time = t
        again, terminate, _, _, known = self._flags
        self._call("UpdateDiscreteStates", *(ctypes.byref(f) for f in self._flags), ctypes.byref(self._next))
        if terminate.value:
            raise UnitTerminated(self.name, "fmi3UpdateDiscreteStates", t, tuple(self.log))
        self.next_event = self._next.value if known.value else None
        for timer in self.timers:
            if timer.clock.name in self.active:
                timer.tick()
            timer.ask(t)
        self.active.clear()
        return again.value

    def get_timing(self) -> Mapping[str, Any]:
        """Return, as a JSON object, what is needed besides the unit's state to resume a run from here."""
        return {
            "held": {name: content.hex() for name, content in self._last_set.items()},
            "ticks": {t.clock.name: None if t.next is None else str(t.next) for t in self.timers},
            "next_event": self.next_event,
            "in_event_mode": self.in_event_mode,
        }

    def set_timing(self, timing: Mapping[str, Any]) -> None:
        """Restore what `get_timing` returned."""
        self._last_set = {name: bytes.fromhex(content) for name, content in timing["held"].items()}
        self.next_event, self.in_event_mode = timing["next_event"], timing["in_event_mode"]
        for timer in self.timers:
            tick = timing["ticks"][timer.clock.name]
            timer.next = None if tick is None else Fraction(tick)

    def _activate(self, clocks: Collection[str]) -> None:
        """Let clocks count as active; inputs of those that were not are to be set, whatever they were given before."""
        begun = set(clocks) - self.active
        self.active |= begun
        for port in self._fed:
            if not begun.isdisjoint(port.clocks):
                self._last_set.pop(port.name, None)

    def _is_reachable(self, port: FmuPort) -> bool:
        return not port.clocks or not self._initialized or not self.active.isdisjoint(port.clocks)

    def _settable(self) -> list[FmuPort]:
        takes_discrete = self.in_event_mode or not self._initialized
        return [p for p in self._fed if self._is_reachable(p) and (takes_discrete or not p.discrete)]

    def _differs(self, port: FmuPort) -> bool:
        return content_of(port, self.u[port.name]) != self._last_set.get(port.name)

    def _note_as_set(self, ports: Iterable[FmuPort]) -> None:
        for p in ports:
            self._last_set[p.name] = content_of(p, self.u[p.name])

    def _set(self, ports: list[FmuPort]) -> None:
        if len(ports) == len(self.u):
            self._set_or_get(self._setters)
            return
        parts = self._part("Set", ports)
        for part, whole in _pairs(parts, self.u):
            part[:] = whole
        self._set_or_get(parts)

    def _get(self, ports: list[FmuPort]) -> None:
        if len(ports) == len(self.y):
            self._set_or_get(self._getters)
            return
        parts = self._part("Get", ports)
        self._set_or_get(parts)
        for part, whole in _pairs(parts, self.y):
            whole[:] = part

    def _part(self, verb: str, ports: list[FmuPort]) -> list[SignalBuffer]:
        """Return separate buffers for some of the ports; they are made once for each selection."""
        key = verb, tuple(p.name for p in ports)
        if key not in self._parts:
            self._parts[key] = self._buffers(verb, ports)
        return self._parts[key]


def _pairs(parts: Iterable[SignalBuffer], whole: Mapping[str, Views]) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
    """Yield the arrays of some ports, each with the array of the same port in `u` or `y`."""
    for buffer in parts:
        for name, views in buffer.views.items():
            yield from zip(views, whole[name], strict=True)
