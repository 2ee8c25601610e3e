"""Runs a system of FMUs: loads them, wires their buffers, steps them on the schedule's grid."""

import array
import contextlib
import tempfile
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

from cosim.exceptions import CosimError, UnitFailure, UnitRefused
from cosim.fmpy_edge import unpack
from cosim.instance import Instance
from cosim.narrowing import Narrowing, narrows
from cosim.schedule import Algorithm, Schedule, Slot
from cosim.signal_buffer import Copy, joined
from cosim.signals import Signals
from cosim.system import System

Observer = Callable[[float, Signals], None]
"""Called at every communication point with the time and the signals that hold at that time."""


def never() -> bool:
    """Let a run go on to its stop time."""
    return False


class Master:
    """Co-simulates a system of FMUs at fixed steps, each unit at its own rate. Use as a context manager.

    Entering loads and initialises the units; `run` steps them; leaving terminates and frees them, whatever happened.

    Raises:
        WiringError: the system has faults. InvalidFmu: an FMU cannot be used. ScheduleError: see `Schedule`.
        UnitRefused: a unit did not accept its parameters or did not initialise.
    """

    def __init__(self, system: System, algorithm: Algorithm = Algorithm.GAUSS_SEIDEL) -> None:
        system.check()
        self.system = system
        self.schedule = Schedule(system, algorithm)
        self.time = 0.0
        self.cpu: dict[str, array.array[float]] = {name: array.array("d") for name in system.units}
        """CPU seconds of every step, by unit; with Gauss-Seidel, setting inputs and getting outputs included."""
        self._due: dict[str, int] = dict.fromkeys(system.units, 0)
        self._instances: dict[str, Instance] = {}
        self._copies: dict[str, Sequence[Copy]] = {}
        self._narrowings: dict[str, list[Narrowing]] = {}
        self._cleanup = contextlib.ExitStack()

    def __enter__(self) -> "Master":
        with self._cleanup as cleanup:
            self._load(cleanup)
            try:
                self._initialize()
            except UnitFailure as e:
                raise UnitRefused(e) from e
            self._cleanup = cleanup.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._cleanup.close()

    @property
    def signals(self) -> Signals:
        """The units' outputs as they are."""
        return Signals({n: i.y for n, i in self._instances.items()}, self._descriptions(), self)

    def run(self, stop: Fraction, observers: Sequence[Observer] = (), until: Callable[[], bool] = never) -> None:
        """Step until `stop` seconds, or until `until()` says so after the observers have seen a communication point.

        Gauss-Seidel: at a communication point t, sampled units act on the values at t, then the observers see all
        signals at t, then the other units go on from t. Jacobi: a step's results count from the time where it ends, for
        sampled units too. A second call goes on where the first one ended.

        Raises:
            UnitFailure: a unit's call failed; what observers saw before stays.
        """
        signals = self.signals
        jacobi = self.schedule.algorithm is Algorithm.JACOBI
        last = self.schedule.ticks(stop)
        while True:
            tick = min(last, *self._due.values())
            self.time = self.schedule.time(tick)
            sampled = [s for s in self.schedule.sampled if self._due[s.unit] == tick]
            continuous = [s for s in self.schedule.continuous if self._due[s.unit] == tick]
            if jacobi:
                self._publish(sampled + continuous)
            else:
                self._one_after_another(sampled)
            for observe in observers:
                observe(self.time, signals)
            if tick == last or until():
                break
            if jacobi:
                self._all_at_once(sampled + continuous)
            else:
                self._one_after_another(continuous)

    def _one_after_another(self, due: Sequence[Slot]) -> None:
        began = time.process_time()
        for slot in due:
            self._feed(slot.unit)
            self._step(slot)
            self._instances[slot.unit].get_outputs()
            began = self._charge(slot, began)

    def _all_at_once(self, due: Sequence[Slot]) -> None:
        for slot in due:
            self._feed(slot.unit)
        began = time.process_time()
        for slot in due:
            self._step(slot)
            began = self._charge(slot, began)

    def _publish(self, due: Sequence[Slot]) -> None:
        """Fetch what steps that end now have computed."""
        for slot in due:
            self._instances[slot.unit].get_outputs()

    def _feed(self, unit: str, known: Collection[str] | None = None) -> None:
        """Set a unit's inputs from its sources, or only from those whose outputs are known already."""
        for narrowing in self._narrowings[unit]:
            narrowing.check(self.time)
        for target, source in self._copies[unit]:
            target[...] = source
        if known is None:
            self._instances[unit].set_inputs()
        else:
            sources = self.system.sources_of(unit)
            self._instances[unit].set_some_inputs([port for port, s in sources.items() if s.unit in known])

    def _step(self, slot: Slot) -> None:
        self._instances[slot.unit].step(self.time, slot.period)
        self._due[slot.unit] += slot.every

    def _charge(self, slot: Slot, began: float) -> float:
        """Note the CPU time that a unit took since `began`; return what it is by then."""
        ended = time.process_time()
        self.cpu[slot.unit].append(ended - began)
        return ended

    def _load(self, cleanup: contextlib.ExitStack) -> None:
        temporary = tempfile.TemporaryDirectory(prefix="handover-", ignore_cleanup_errors=True)
        folder = Path(cleanup.enter_context(temporary))
        unpacked: dict[Path, Path] = {}
        for name, unit in self.system.units.items():
            d = unit.description
            if d.path not in unpacked:
                unpacked[d.path] = folder / str(len(unpacked))
                unpack(d.path, unpacked[d.path], d.fmi, d.identifier)
            instance = Instance(name, d, unpacked[d.path], self.system.sources_of(name))
            cleanup.callback(instance.free)
            self._instances[name] = instance
        for name, instance in self._instances.items():
            copies: list[Copy] = []
            self._narrowings[name] = []
            for port, source in self.system.sources_of(name).items():
                other, target = self._instances[source.unit], instance.description.inputs[port]
                copies += zip(instance.u[port], other.y[source.port], strict=True)
                if target.width and narrows(other.description.outputs[source.port], target):
                    values = other.y[source.port][0]
                    self._narrowings[name].append(Narrowing(str(source), name, port, target.width, values))
            self._copies[name] = joined(copies)

    def _initialize(self) -> None:
        for name, unit in self.system.units.items():
            instance = self._instances[name]
            instance.set_start(unit.start)
            instance.enter_initialization(0.0, None)
        known: set[str] = set()
        for slot in self.schedule.slots:
            self._feed(slot.unit, known)
            self._instances[slot.unit].get_outputs()
            known.add(slot.unit)
        for slot in self.schedule.slots:
            instance = self._instances[slot.unit]
            self._feed(slot.unit)
            instance.exit_initialization()
            instance.get_outputs()
            self._cleanup_end(instance)

    def _cleanup_end(self, instance: Instance) -> None:
        def end() -> None:
            with contextlib.suppress(CosimError):  # freeing follows whether or not the unit agrees to end
                instance.end()

        self._cleanup.callback(end)

    def _descriptions(self) -> Mapping[str, Mapping[str, Any]]:
        return {n: u.description.outputs for n, u in self.system.units.items()}
