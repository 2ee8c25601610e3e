"""Fixed steps, each unit at its own rate, on one exact grid: the same calls as `GridStepper` makes, made in C."""

import array
import ctypes
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from handover.cosim.fmu.failures import UnitTerminated
from handover.cosim.fmu.heartbeat import Abandoned
from handover.cosim.fmu.host_process import identity_address
from handover.cosim.plan import memory
from handover.cosim.plan.plan_maker import SIZE, PlanMaker
from handover.cosim.record.recorder import Recorder
from handover.cosim.record.tail import RecordBlock
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.stepper import Coupling
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.signals import ObserveAfter, Observer, Signals

_STRETCH = 0.05
"""Seconds of wall time after which the loop returns to Python, where a signal such as Ctrl-C is handled."""
_MAX_STEPS = 4096
"""Limit of communication points until then."""
_MAX_ROOM, _LEAST_ROOM, _MAX_SPENT = 2 * _MAX_STEPS, 64, 2**20
"""CPU times that the loop can hold before `publish_cpu_times` fetches them: of a unit, at most and at least, and of all
units where these are many."""
_LAST_REACHED, _PAUSED, _RECORD_FULL, _STOPPED, _ABANDONED = range(5)
_MAX_TICKS = 2**62


class PlanStepper:
    """Communication points are whole ticks of the schedule's grid at which a unit is due: counted, so without drift.

    Its states are those of `GridStepper`: either can resume from the other's.

    Attributes:
        coupling: what does the same as the plan on the general path.
        arriving: whether a unit's request to end the simulation, or a failure, came before observers saw the signals.
    """

    def __init__(self, schedule: Schedule, ensemble: Ensemble, coupling: Coupling, plan: PlanMaker) -> None:
        self._schedule, self._ensemble, self.coupling = schedule, ensemble, coupling
        self.arriving = False
        self._library, self._clock = plan.library, plan.has_clock
        self._judges, self._units = plan.judges, list(ensemble.instances)
        self._calls = plan.calls
        self._members = list(plan.groups.values())
        n = len(self._units)
        self._operations = ctypes.create_string_buffer(plan.packed, len(plan.packed))
        self._groups = (memory.Group * len(plan.groups))(
            *(memory.Group(every, 0, -1, sampled) for every, sampled in plan.groups)
        )
        self._arrive = (memory.Segment * len(plan.arrive))(*plan.arrive)
        self._depart = (memory.Segment * len(plan.depart))(*plan.depart)
        self._depart_from = min((segment.first for segment in plan.depart), default=len(plan.packed))
        self._times = (ctypes.c_double * n)()
        self._room = min(_MAX_ROOM, max(_LEAST_ROOM, _MAX_SPENT // max(n, 1)))
        self._spent = (ctypes.c_double * (n * self._room if self._clock else 0))()
        self._n_spent = (ctypes.c_int64 * n)()
        self._warned = (memory.Warned * (len(plan.packed) // SIZE))()
        self._unpublished = 0  # communication points whose CPU times the ensemble does not have yet
        self._plan = memory.Plan(
            operations=ctypes.addressof(self._operations),
            arrive=self._arrive,
            depart=self._depart,
            groups=self._groups,
            n_arrive=len(plan.arrive),
            n_depart=len(plan.depart),
            n_groups=len(plan.groups),
            offset=schedule.grid.offset,
            numerator=schedule.grid.numerator,
            denominator=schedule.grid.denominator,
            time=schedule.time(0),
            unit_times=self._times,
            spent=self._spent,
            n_spent=self._n_spent,
            spent_capacity=self._room,
            heartbeat=ensemble.heartbeat.address,
            identity=identity_address(),
            warned=self._warned,
        )
        self._read_times()

    @property
    def time(self) -> float:
        """Simulated time in seconds."""
        return self._plan.time

    def arrive(self, last: int) -> bool:
        """Go to the next tick at which a unit is due; see `Stepper`."""
        self._make_room(1)
        return self._checked(self._library.plan_arrive(self._plan, min(last, _MAX_TICKS))) == _LAST_REACHED

    def depart(self) -> None:
        """Step what is due at the tick."""
        self._checked(self._library.plan_depart(self._plan))

    def run(
        self, last: int, signals: Signals, observers: Sequence[Observer],
        until: Callable[[], bool] | None = None, pause: Callable[[], None] | None = None,
    ) -> None:  # fmt: skip
        """Step until tick `last` as `Master.run` says; `pause` is called before the observers.

        The loop itself writes the rows of a recorder that is the first of the observers, also one in an `ObserveAfter`.
        Without other observers, it passes many communication points in one call.
        """
        first = observers[0] if observers else None
        seen = first.t_0 if isinstance(first, ObserveAfter) else -math.inf
        first = first.observe if isinstance(first, ObserveAfter) else first
        recorder = first if isinstance(first, Recorder) else None
        watching = observers if recorder is None else observers[1:]
        rows = None if recorder is None else _rows_of(recorder, signals)
        watched = bool(watching) or until is not None or pause is not None
        points, leave = 1, False
        while True:
            self._make_room(points)
            began = time.perf_counter()
            # The loop does not write the row of the first point: whether it was seen before shows when it is reached.
            written = rows if leave else None
            outcome = self._library.plan_run(self._plan, min(last, _MAX_TICKS), points, leave, written)
            self._checked(outcome)
            if recorder is not None:
                if not leave and self.time > seen:
                    recorder(self.time, signals)
                _flush_if_full(recorder)
            if pause is not None:
                pause()
            for observe in watching:
                observe(self.time, signals)
            if outcome == _LAST_REACHED or (until is not None and until()):
                break
            if self._ensemble.heartbeat.stopped:
                raise Abandoned
            leave = True
            if not watched:
                points = (
                    min(2 * points, _MAX_STEPS, self._room)
                    if time.perf_counter() - began < _STRETCH
                    else max(points // 2, 1)
                )

    def publish_cpu_times(self) -> None:
        """Hand over to the ensemble the CPU times that the loop has measured."""
        if not self._unpublished:
            return
        for i, unit in enumerate(self._units):
            spent = array.array("d", self._spent[i * self._room : i * self._room + self._n_spent[i]])
            self._ensemble.cpu[unit].extend(spent)
            self._n_spent[i] = 0
        self._unpublished = 0

    def publish_warnings(self) -> None:
        """Hand over to the units' instances how many calls answered Warning."""
        for i, (unit, call) in self._calls.items():
            warned = self._warned[i]
            if warned.n:
                self._ensemble.instances[unit].warnings.add(call, warned.first, warned.n)
                warned.n = 0

    def publish_unit_times(self) -> None:
        """Hand over to the units' instances the times that they have reached."""
        for instance, t in zip(self._ensemble.instances.values(), self._times, strict=True):
            instance.time = t

    def get_state(self) -> Mapping[str, Any]:
        """Return the ticks; see `Stepper`."""
        self.publish_unit_times()
        grouped = list(zip(self._members, self._groups, strict=True))
        due = {unit: group.due for units, group in grouped for unit in units}
        acted = {unit: group.acted for units, group in grouped for unit in units if group.sampled}
        order = [slot.unit for slot in self._schedule.slots]
        return {
            "tick": self._plan.tick,
            "due": {unit: due[unit] for unit in order},
            "acted": {slot.unit: acted[slot.unit] for slot in self._schedule.sampled},
            "coupling": self.coupling.get_state(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore the ticks that `get_state` returned."""
        for units, group in zip(self._members, self._groups, strict=True):
            group.due = state["due"][units[0]]
            group.acted = state["acted"].get(units[0], -1)
        self.coupling.set_state(state["coupling"])
        self._plan.tick = state["tick"]
        self._plan.time = self._schedule.time(state["tick"])
        self._read_times()

    def _make_room(self, points: int) -> None:
        """Make sure that the CPU times of so many further communication points can be held."""
        if self._clock:
            if self._unpublished + points > self._room:
                self.publish_cpu_times()
            self._unpublished += points

    def _checked(self, outcome: int) -> int:
        """Return an outcome of the loop, unless it is a failure, which is raised as on the general path."""
        if outcome == _ABANDONED:
            raise Abandoned
        if outcome == _STOPPED:
            stopped_at = self._plan.stopped_at
            self.arriving = stopped_at < self._depart_from
            self.publish_unit_times()
            try:
                self._judges[stopped_at](self._plan.status, self.time)
            except UnitTerminated as e:
                self._read_times()
                if e.completed:
                    self._complete(stopped_at)
                    self.publish_unit_times()
                raise
            raise RuntimeError(f"operation {stopped_at} of the plan stopped it without a reason")
        return outcome

    def _complete(self, stopped_at: int) -> None:
        """Carry out what is left of a communication step in which a unit asked to end the simulation; see `LastStep`.

        Raises:
            UnitFailure: another unit's call failed. UnitTerminated: another asked for the same without completing.
        """
        tick, arriving = self._plan.tick, self.arriving
        for segment in self._arrive if arriving else self._depart:
            group = self._groups[segment.group] if segment.group >= 0 else None
            is_due = group is None or (group.due == tick and not (arriving and group.acted >= tick))
            if segment.end <= stopped_at + 1 or not is_due:
                continue
            outcome = self._library.plan_carry_out(self._plan, max(segment.first, stopped_at + 1), segment.end)
            try:
                self._checked(outcome)
            except UnitTerminated as e:
                if not e.completed:
                    raise
                return  # that one has completed what was left

    def _read_times(self) -> None:
        for i, instance in enumerate(self._ensemble.instances.values()):
            self._times[i] = instance.time


def _flush_if_full(recorder: Recorder) -> None:
    if recorder.block.filled == recorder.block.capacity:
        recorder.flush()


def _rows_of(recorder: Recorder, signals: Signals) -> "memory.Rows":
    """Return where a recorder's rows go; open it if no row has been recorded yet."""
    if not recorder.is_open:
        recorder.open(signals)
    _flush_if_full(recorder)  # full where a flush failed before; the loop writes a row before it looks
    block: RecordBlock = recorder.block
    parts = (memory.Part * len(block.parts))(
        *(memory.Part(p.values.ctypes.data, p.rows.ctypes.data, p.values.nbytes) for p in block.parts)
    )
    return memory.Rows(block.counters.ctypes.data, block.time.ctypes.data, block.capacity, parts, len(block.parts))
