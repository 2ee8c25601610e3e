"""Turns what a coupling does at a communication point into a flat list of operations, packed as in `plan.h`."""

import contextlib
import ctypes
import enum
import struct
from collections.abc import Callable, Sequence
from ctypes import CDLL
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Width
from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.buffers import Copy, NativeCall, OutputBuffer, SignalBuffer, Views
from handover.cosim.fmu.calls import NativeStep
from handover.cosim.fmu.failures import UnitTerminated
from handover.cosim.plan.memory import KeptMemory, Segment
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.pending_steps import n_sources
from handover.cosim.stepping.transfers import FiniteCheck, Narrowing
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.schedule import Schedule, Slot

Judge = Callable[[int, float], None]
"""Takes the status of an operation that stopped the plan, and the time, and raises what the general path would."""

ALWAYS = -1
"""The group of operations that are executed at every communication point."""

SIZE = 72
"""Bytes of an operation."""
_COPY, _CHECK, _ACCESS, _KEEP, _STEP, _CHARGE, _PLAIN = "PPNiidd", "PNqqQ", "PPPNPNP", "PPNP", "PPdPPPP", "P", ""
_TYPES = {
    np.dtype(name): number
    for number, name in enumerate(
        ("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64")
    )
}


class _Kind(enum.IntEnum):
    COPY = 0
    CONVERT = 1
    SCALE = 2
    FITS = 3
    FINITE = 4
    ACCESS_2 = 5
    ACCESS_3 = 6
    BINARIES_3 = 7
    KEEP_BYTES = 8
    KEEP_TEXTS = 9
    STEP_2 = 10
    STEP_3 = 11
    START_CLOCK = 12
    CHARGE = 13
    BEGIN_STEP = 14


def copy(unit: int, target: NDArray[Any], source: NDArray[Any]) -> bytes:
    """Copy numbers or addresses, which become numbers of the target's type."""
    a, b = _TYPES[source.dtype], _TYPES[target.dtype]
    kind, n = (_Kind.COPY, source.nbytes) if a == b else (_Kind.CONVERT, len(source))
    return _packed(_COPY, kind, unit, target.ctypes.data, source.ctypes.data, n, b, a, 1.0, 0.0)


def scale(unit: int, target: NDArray[Any], source: NDArray[Any], linear: LinearTransformation) -> bytes:
    """Set reals to others times a factor plus an offset, each rounded once."""
    types = _TYPES[target.dtype], _TYPES[source.dtype]
    addresses = target.ctypes.data, source.ctypes.data
    return _packed(_COPY, _Kind.SCALE, unit, *addresses, len(source), *types, linear.factor, linear.offset)


def fits(unit: int, values: NDArray[Any], width: Width) -> bytes:
    """Stop where an integer does not fit a width."""
    where = values.ctypes.data, len(values), _TYPES[values.dtype]
    return _packed(_CHECK, _Kind.FITS, unit, *where, int(width.lowest), int(width.highest))


def finite(unit: int, values: NDArray[Any]) -> bytes:
    """Stop where a real is infinite or not a number."""
    return _packed(_CHECK, _Kind.FINITE, unit, values.ctypes.data, len(values), _TYPES[values.dtype], 0, 0)


def access(unit: int, call: NativeCall, arrays: Views, code: int) -> bytes:
    """Set or get variables from or to these arrays; `code` names the call in the heartbeat."""
    is_binary = len(arrays) == 2
    kind = _Kind.ACCESS_2 if call.fmi == 2 else _Kind.BINARIES_3 if is_binary else _Kind.ACCESS_3
    fixed = call.function, call.component, ctypes.addressof(call.references), len(call.references)
    sizes = arrays[1].ctypes.data if is_binary else 0
    return _packed(_ACCESS, kind, unit, *fixed, arrays[0].ctypes.data, len(arrays[0]), sizes, code=code)


def keep(unit: int, arrays: Views, kept: int) -> bytes:
    """Copy binaries, or texts, which have no sizes, to the memory that the `Kept` at address `kept` hold.

    Where `kept` is 0, only look whether a binary that has a size has memory.
    """
    kind, sizes = (_Kind.KEEP_BYTES, arrays[1].ctypes.data) if len(arrays) == 2 else (_Kind.KEEP_TEXTS, 0)
    return _packed(_KEEP, kind, unit, arrays[0].ctypes.data, sizes, len(arrays[0]), kept)


def step(unit: int, call: NativeStep, dt: float, code: int) -> bytes:
    """Let a unit step by dt; `code` names the call in the heartbeat."""
    kind = _Kind.STEP_2 if call.fmi == 2 else _Kind.STEP_3
    return _packed(_STEP, kind, unit, call.function, call.component, dt, *(call.flags or (0, 0, 0, 0)), code=code)


def begin_step(unit: int, call: NativeStep, dt: float) -> bytes:
    """Begin the step of an isolated unit by dt; `step` waits for its end."""
    return _packed(_STEP, _Kind.BEGIN_STEP, unit, call.begin, call.component, dt, 0, 0, 0, 0)


def start_clock() -> bytes:
    """Read the CPU clock."""
    return _packed(_PLAIN, _Kind.START_CLOCK, 0)


def charge(unit: int, own: int) -> bytes:
    """Charge the CPU time since the clock was last read to a unit, and its own process's at address `own`, if not 0."""
    return _packed(_CHARGE, _Kind.CHARGE, unit, own)


def _packed(form: str, kind: _Kind, unit: int, *fields: Any, code: int = -1) -> bytes:
    return struct.pack(f"@iiq{form}", kind, unit, code, *fields).ljust(SIZE, b"\0")


class PlanMaker:
    """Lays out the operations of a plan: what `Jacobi` (`parallel`) or `GaussSeidel` does, in the same order.

    Attributes:
        judges: for each operation that can stop the plan, by its index, what raises the failure.
        calls: for each operation that is an FMI call with a status, by its index, the unit and the call.
        arrive, depart: the operations at a communication point before and after observers look.
        groups: by group, the units that are always due together.
        library: the functions of the loop.
        has_clock: whether CPU times of steps are measured.
    """

    def __init__(self, ensemble: Ensemble, schedule: Schedule, library: CDLL, *, parallel: bool, clock: bool) -> None:
        self.judges: dict[int, Judge] = {}
        self.calls: dict[int, tuple[str, str]] = {}
        self.groups: dict[tuple[int, bool], list[str]] = {}
        self.arrive: list[Segment] = []
        self.depart: list[Segment] = []
        self._packed: list[bytes] = []
        self._begun: Sequence[Slot] = ()  # the steps that have begun where an operation is executed
        self._ensemble, self.library, self.has_clock = ensemble, library, clock
        self._units = {name: i for i, name in enumerate(ensemble.instances)}
        for slots, sampled in ((schedule.sampled, True), (schedule.continuous, False)):
            for slot in slots:
                self.groups.setdefault((slot.every, sampled), []).append(slot.unit)
        self._group_of = {unit: i for i, units in enumerate(self.groups.values()) for unit in units}
        if parallel:
            due = (*schedule.sampled, *schedule.continuous)
            isolated = [slot for slot in due if self._is_isolated(slot)]
            self._add(self.arrive, due, self._publish)
            self._add(self.depart, due, self._feed)
            self._add(self.depart, isolated, self._begin)
            self._start_clock(self.depart)
            for slot in due:
                if slot not in isolated:
                    self._begun = due[: due.index(slot)]
                    self._add(self.depart, [slot], self._step, self._charge)
            self._begun = ()
            self._add(self.depart, isolated, self._step, self._charge)
        else:
            self._late = schedule.spanning
            self._add(self.arrive, [slot for slot in schedule.continuous if slot.unit in self._late], self._publish)
            for phase, slots in ((self.arrive, schedule.sampled), (self.depart, schedule.continuous)):
                self._start_clock(phase)
                self._add_in_order(phase, slots)

    @property
    def packed(self) -> bytes:
        """The operations as the loop reads them."""
        return b"".join(self._packed)

    def _add(self, phase: list[Segment], slots: Sequence[Slot], *actions: Callable[[Slot], None]) -> None:
        for slot in slots:
            first = len(self._packed)
            for act in actions:
                act(slot)
            self._close(phase, self._group_of[slot.unit], first)

    def _add_in_order(self, phase: list[Segment], slots: Sequence[Slot]) -> None:
        """Add what `PendingSteps` does: isolated units step while others do that do not read their outputs."""
        begun: list[Slot] = []
        for slot in slots:
            n = n_sources(self._ensemble, slot.unit, begun)
            self._add(phase, begun[:n], self._step, self._publish_in_time, self._charge)
            begun = begun[n:]
            self._begun = tuple(begun)
            if self._is_isolated(slot):
                self._add(phase, [slot], self._feed, self._begin)
                begun.append(slot)
            else:
                self._add(phase, [slot], self._feed, self._step, self._publish_in_time, self._charge)
            self._begun = ()
        self._add(phase, begun, self._step, self._publish_in_time, self._charge)

    def _is_isolated(self, slot: Slot) -> bool:
        return self._ensemble.instances[slot.unit].isolated

    def _start_clock(self, phase: list[Segment]) -> None:
        if self.has_clock:
            self._note(start_clock())
            self._close(phase, ALWAYS, len(self._packed) - 1)

    def _close(self, phase: list[Segment], group: int, first: int) -> None:
        if phase and phase[-1].group == group and phase[-1].end == first:
            phase[-1].end = len(self._packed)
        else:
            phase.append(Segment(group, first, len(self._packed)))

    def _note(self, packed: bytes, judge: Judge | None = None) -> None:
        if judge is not None:
            self.judges[len(self._packed)] = self._after_begun(judge) if self._begun else judge
        self._packed.append(packed)

    def _after_begun(self, judge: Judge) -> Judge:
        """Let the failures of steps that were begun, of units that come before, be raised first."""
        begun = [(self._ensemble.instances[slot.unit], slot.period) for slot in self._begun]

        def judge_in_order(status: int, t: float) -> None:
            try:
                judge(status, t)
            except UnitTerminated:  # no failure: the communication step may be completed
                raise
            except UnitFailure:
                for instance, dt in begun:
                    if instance.is_stepping:
                        with contextlib.suppress(UnitTerminated):
                            instance.step(t, dt)
                raise

        return judge_in_order

    def _feed(self, slot: Slot) -> None:
        unit, instance = self._units[slot.unit], self._ensemble.instances[slot.unit]
        feeding = self._ensemble.feeding(slot.unit)
        for n in feeding.narrowings:
            self._note(fits(unit, n.values, n.width), _judge_fit(n))
        copies, given = _without_copies(feeding.copies, instance.setters)
        for target, source in copies:
            self._note(copy(unit, target, source))
        for scaled in feeding.scaled:
            self._note(scale(unit, scaled.target, scaled.source, scaled.linear))
        for buffer, arrays in zip(instance.setters, given, strict=True):
            self._access(slot.unit, buffer, arrays)

    def _begin(self, slot: Slot) -> None:
        call = self._ensemble.instances[slot.unit].native_step
        self._note(begin_step(self._units[slot.unit], call, slot.period))

    def _step(self, slot: Slot) -> None:
        instance = self._ensemble.instances[slot.unit]

        def judge(status: int, t: float) -> None:  # noqa: ARG001
            instance.judge_step(status, slot.period)

        call = f"fmi{instance.description.fmi}DoStep"
        code = self._ensemble.heartbeat.code(slot.unit, call)
        self.calls[len(self._packed)] = slot.unit, call
        self._note(step(self._units[slot.unit], instance.native_step, slot.period, code), judge)

    def _publish_in_time(self, slot: Slot) -> None:
        if slot.unit not in self._late:
            self._publish(slot)

    def _publish(self, slot: Slot) -> None:
        for buffer in self._ensemble.instances[slot.unit].getters:
            arrays = buffer.native.arrays
            self._access(slot.unit, buffer, arrays)
            if isinstance(buffer, OutputBuffer) and (buffer.copies or len(arrays) == 2):
                kept = KeptMemory(self.library, len(arrays[0])) if buffer.copies else None
                buffer.kept_elsewhere = kept or buffer.kept_elsewhere
                address = kept.address if kept else 0
                self._note(keep(self._units[slot.unit], arrays, address), self._judge_kept(slot.unit, buffer))
        check = self._ensemble.finite_check(slot.unit)
        for block in check.blocks:
            self._note(finite(self._units[slot.unit], block), self._judge_numbers(slot.unit, check))

    def _judge_kept(self, unit: str, buffer: OutputBuffer) -> Judge:
        instance = self._ensemble.instances[unit]

        def judge(status: int, t: float) -> None:  # noqa: ARG001
            instance.check_memory(buffer)
            raise MemoryError("there is no memory for a copy of a unit's binaries or texts")

        return judge

    def _charge(self, slot: Slot) -> None:
        if self.has_clock:
            own = self._ensemble.instances[slot.unit].cpu_address
            self._note(charge(self._units[slot.unit], own))

    def _access(self, unit: str, buffer: SignalBuffer, arrays: Views) -> None:
        instance = self._ensemble.instances[unit]

        def judge(status: int, t: float) -> None:  # noqa: ARG001
            instance.judge(buffer.name, status)

        code = self._ensemble.heartbeat.code(unit, buffer.name)
        self.calls[len(self._packed)] = unit, buffer.name
        self._note(access(self._units[unit], buffer.native, arrays, code), judge)

    def _judge_numbers(self, unit: str, check: FiniteCheck) -> Judge:
        instance = self._ensemble.instances[unit]

        def judge(status: int, t: float) -> None:  # noqa: ARG001
            check(instance.time, instance.log)

        return judge


def _without_copies(copies: Sequence[Copy], setters: Sequence[SignalBuffer]) -> tuple[list[Copy], list[Views]]:
    """Return the copies that are left, and the arrays to set each buffer from: where possible, its source's."""
    left = list(copies)
    given: list[Views] = []
    for buffer in setters:
        arrays: list[NDArray[Any]] = []
        for array in buffer.native.arrays:
            whole = next((c for c in left if _is_all_of(array, c)), None)
            if whole is not None:
                left = [c for c in left if c is not whole]
            arrays.append(array if whole is None else whole[1])
        given.append(tuple(arrays))
    return left, given


def _is_all_of(array: NDArray[Any], copy: Copy) -> bool:
    target, source = copy
    same_memory = target.ctypes.data == array.ctypes.data and target.nbytes == array.nbytes
    return same_memory and source.dtype == target.dtype


def _judge_fit(narrowing: Narrowing) -> Judge:
    return lambda _status, t: narrowing.check(t)
