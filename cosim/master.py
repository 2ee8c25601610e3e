"""Runs a system of FMUs: loads them, wires their buffers, steps them on the schedule's grid."""

import array
import contextlib
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cosim.exceptions import CosimError, UnitFailure, UnitRefused
from cosim.fmpy_edge import unpack
from cosim.instance import Instance
from cosim.schedule import Algorithm, Schedule, Slot
from cosim.signals import Signals
from cosim.system import System

Observer = Callable[[float, Signals], None]
"""Called at every communication point with the time and the signals that hold at that time."""


def never() -> bool:
    """Let a run go on to its stop time."""
    return False


_Copies = Sequence[tuple[NDArray[Any], NDArray[Any]]]


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
        """CPU seconds of every step, by unit."""
        self._instances: dict[str, Instance] = {}
        self._copies: dict[str, _Copies] = {}
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
        return Signals({n: i.y for n, i in self._instances.items()}, self._descriptions())

    def run(self, stop: Fraction, observers: Sequence[Observer] = (), until: Callable[[], bool] = never) -> None:
        """Step until `stop` seconds, or until `until()` says so after the observers have seen a communication point.

        Gauss-Seidel: at a communication point t, units with feedthrough act on the values at t, then the observers see
        all signals at t, then the other units go on from t. Jacobi: a step's results count from the time where it ends,
        for units with feedthrough too.

        Raises:
            UnitFailure: a unit's call failed; what observers saw before stays.
        """
        signals = self.signals
        jacobi = self.schedule.algorithm is Algorithm.JACOBI
        last = self.schedule.ticks(stop)
        for tick in range(last + 1):
            first = [s for s in self.schedule.algebraic if tick % s.every == 0]
            then = [s for s in self.schedule.integrating if tick % s.every == 0]
            if not first and not then and tick != last:
                continue
            self.time = self.schedule.time(tick)
            if jacobi:
                self._publish(first + then)
            else:
                self._one_after_another(first)
            for observe in observers:
                observe(self.time, signals)
            if tick == last or until():
                break
            if jacobi:
                self._all_at_once(first + then)
            else:
                self._one_after_another(then)

    def _one_after_another(self, due: Sequence[Slot]) -> None:
        for slot in due:
            self._feed(slot.unit)
            self._step(slot)
            self._instances[slot.unit].get_outputs()

    def _all_at_once(self, due: Sequence[Slot]) -> None:
        for slot in due:
            self._feed(slot.unit)
        for slot in due:
            self._step(slot)

    def _publish(self, due: Sequence[Slot]) -> None:
        """Fetch what steps that end now have computed."""
        for slot in due:
            self._instances[slot.unit].get_outputs()

    def _feed(self, unit: str) -> None:
        for target, source in self._copies[unit]:
            np.copyto(target, source, casting="unsafe")
        self._instances[unit].set_inputs()

    def _step(self, slot: Slot) -> None:
        began = time.process_time()
        self._instances[slot.unit].step(self.time, float(slot.period))
        self.cpu[slot.unit].append(time.process_time() - began)

    def _load(self, cleanup: contextlib.ExitStack) -> None:
        folder = Path(
            cleanup.enter_context(tempfile.TemporaryDirectory(prefix="handover-", ignore_cleanup_errors=True))
        )
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
            pairs = [
                (instance.u[p], self._instances[s.unit].y[s.port]) for p, s in self.system.sources_of(name).items()
            ]
            self._copies[name] = [(t, s) for targets, sources in pairs for t, s in zip(targets, sources, strict=True)]

    def _initialize(self) -> None:
        for name, unit in self.system.units.items():
            instance = self._instances[name]
            instance.set_start(unit.start)
            instance.enter_initialization(0.0, None)
        for slot in self.schedule.integrating + self.schedule.algebraic:  # what needs no input gives its outputs first
            if slot in self.schedule.algebraic:
                self._feed(slot.unit)
            self._instances[slot.unit].get_outputs()
        for name, instance in self._instances.items():
            self._feed(name)
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
