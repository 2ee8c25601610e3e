"""Turns what a coupling does at a communication point into a flat list of operations."""

from collections.abc import Callable, Sequence
from ctypes import CDLL
from typing import Any

from numpy.typing import NDArray

from handover.cosim.fmu.buffers import Copy, OutputBuffer, SignalBuffer, Views
from handover.cosim.plan import operations
from handover.cosim.plan.memory import KeptMemory, Segment
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.options import Algorithm
from handover.cosim.stepping.transfers import FiniteCheck, Narrowing
from handover.cosim.system.schedule import Schedule, Slot

Judge = Callable[[int, float], None]
"""Takes what an operation that stopped the plan answered, and when, and raises what the general path would."""

ALWAYS = -1


class PlanMaker:
    """Lays out the operations of a plan: what `Jacobi` and `GaussSeidel` do, in the same order.

    Attributes:
        judges: for each operation that can stop the plan, what tells why.
        arrive, depart: the operations at a communication point before and after observers look.
        groups: by group, the units that are always due together.
        library: the functions of the loop.
        has_clock: whether CPU time is taken of steps.
    """

    def __init__(
        self, ensemble: Ensemble, schedule: Schedule, algorithm: Algorithm, library: CDLL, *, clock: bool
    ) -> None:
        self.judges: dict[int, Judge] = {}
        self.groups: dict[tuple[int, bool], list[str]] = {}
        self.arrive: list[Segment] = []
        self.depart: list[Segment] = []
        self._packed: list[bytes] = []
        self._ensemble, self.library, self.has_clock = ensemble, library, clock
        self._units = {name: i for i, name in enumerate(ensemble.instances)}
        for slots, sampled in ((schedule.sampled, True), (schedule.continuous, False)):
            for slot in slots:
                self.groups.setdefault((slot.every, sampled), []).append(slot.unit)
        self._group_of = {unit: i for i, units in enumerate(self.groups.values()) for unit in units}
        if algorithm is Algorithm.JACOBI:
            due = (*schedule.sampled, *schedule.continuous)
            self._add(self.arrive, due, self._publish)
            self._add(self.depart, due, self._feed)
            self._start_clock(self.depart)
            self._add(self.depart, due, self._step, self._charge)
        else:
            whole = (self._feed, self._step, self._publish, self._charge)
            for phase, slots in ((self.arrive, schedule.sampled), (self.depart, schedule.continuous)):
                self._start_clock(phase)
                self._add(phase, slots, *whole)

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

    def _start_clock(self, phase: list[Segment]) -> None:
        if self.has_clock:
            self._note(operations.start_clock())
            self._close(phase, ALWAYS, len(self._packed) - 1)

    def _close(self, phase: list[Segment], group: int, first: int) -> None:
        if phase and phase[-1].group == group and phase[-1].end == first:
            phase[-1].end = len(self._packed)
        else:
            phase.append(Segment(group, first, len(self._packed)))

    def _note(self, packed: bytes, judge: Judge | None = None) -> None:
        if judge is not None:
            self.judges[len(self._packed)] = judge
        self._packed.append(packed)

    def _feed(self, slot: Slot) -> None:
        unit, instance = self._units[slot.unit], self._ensemble.instances[slot.unit]
        feeding = self._ensemble.feeding(slot.unit)
        for n in feeding.narrowings:
            self._note(operations.fits(unit, n.values, n.width), _judge_fit(n))
        copies, given = _without_copies(feeding.copies, instance.setters)
        for target, source in copies:
            self._note(operations.copy(unit, target, source))
        for scaled in feeding.scaled:
            self._note(operations.scale(unit, scaled.target, scaled.source, scaled.linear))
        for buffer, arrays in zip(instance.setters, given, strict=True):
            self._access(slot.unit, buffer, arrays)

    def _step(self, slot: Slot) -> None:
        instance = self._ensemble.instances[slot.unit]

        def judge(status: int, t: float) -> None:  # noqa: ARG001
            instance.judge_step(status)

        code = self._ensemble.heartbeat.code(slot.unit, f"fmi{instance.description.fmi}DoStep")
        self._note(operations.step(self._units[slot.unit], instance.native_step, slot.period, code), judge)

    def _publish(self, slot: Slot) -> None:
        for buffer in self._ensemble.instances[slot.unit].getters:
            arrays = buffer.native.arrays
            self._access(slot.unit, buffer, arrays)
            if isinstance(buffer, OutputBuffer):
                kept = KeptMemory(self.library, len(arrays[0]))
                buffer.kept_elsewhere = kept
                self._note(operations.keep(self._units[slot.unit], arrays, kept.address), _out_of_memory)
        check = self._ensemble.finite_check(slot.unit)
        for block in check.blocks:
            self._note(operations.finite(self._units[slot.unit], block), self._judge_numbers(slot.unit, check))

    def _charge(self, slot: Slot) -> None:
        if self.has_clock:
            self._note(operations.charge(self._units[slot.unit]))

    def _access(self, unit: str, buffer: SignalBuffer, arrays: Views) -> None:
        instance = self._ensemble.instances[unit]

        def judge(status: int, t: float) -> None:  # noqa: ARG001
            instance.judge(buffer.name, status)

        code = self._ensemble.heartbeat.code(unit, buffer.name)
        self._note(operations.access(self._units[unit], buffer.native, arrays, code), judge)

    def _judge_numbers(self, unit: str, check: FiniteCheck) -> Judge:
        instance = self._ensemble.instances[unit]

        def judge(status: int, t: float) -> None:  # noqa: ARG001
            check(instance.time, instance.log)

        return judge


def _without_copies(copies: Sequence[Copy], setters: Sequence[SignalBuffer]) -> tuple[list[Copy], list[Views]]:
    """Return what has to be copied, and from where each buffer is set: where its source has all of it, from there."""
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


def _out_of_memory(_status: int, _t: float) -> None:
    raise MemoryError("there is no memory for what a unit gave")
