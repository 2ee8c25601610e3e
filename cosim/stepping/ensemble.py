"""The units of a system in a run: loaded, wired through their buffers, initialised, stepped, and freed at the end.

At the end of a run units are terminated, then freed, then their files are removed, whatever of that fails.
"""

import array
import collections
import contextlib
import functools
import logging
import time
from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import CosimError, InvalidFmu, shown_path
from handover.cosim.files import scratch_folder
from handover.cosim.fmu.calls import State
from handover.cosim.fmu.failures import StartValuesLost, UnitTerminated
from handover.cosim.fmu.file.fmpy_edge import unpack
from handover.cosim.fmu.heartbeat import Abandoned, Heartbeat
from handover.cosim.fmu.host_process import HostProcess
from handover.cosim.fmu.instance import Instance
from handover.cosim.fmu.loaded_libraries import note_libraries
from handover.cosim.fmu.start_values import LostValue, keep_start
from handover.cosim.stepping.external_inputs import ExternalInputs
from handover.cosim.stepping.extrapolation import LinearExtrapolation, Memory
from handover.cosim.stepping.transfers import Feeding, FiniteCheck, feedings, finite_checks
from handover.cosim.system.schedule import Slot
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

_log = logging.getLogger(__name__)


class CleanupStack:
    """Cleanups to run at the end, the last one added first, each once, even where others fail."""

    def __init__(self) -> None:
        self._cleanups: collections.deque[Callable[[], object]] = collections.deque()
        self._first_error: Exception | None = None

    def add(self, cleanup: Callable[[], object]) -> None:
        """Add a cleanup, which runs before those added until now."""
        self._cleanups.append(cleanup)

    def close(self) -> None:
        """Run what is left. Where a cleanup does not return, another thread may call this again and continues after it.

        Raises:
            Exception: the first that a cleanup raised, after all have run.
        """
        while self._cleanups:
            try:
                self._cleanups.pop()()
            except Exception as e:
                self._first_error = self._first_error or e
        first, self._first_error = self._first_error, None
        if first is not None:
            raise first


class SavedStates(dict[str, State]):
    """Saved states by unit, with what the extrapolation of inputs remembers of these units."""

    def __init__(self, memories: Mapping[str, Memory]) -> None:
        super().__init__()
        self.memories = memories


class LastStep:
    """Lets a communication step be completed in which a unit asks to end the simulation, and passes that on then.

    Where the unit has not completed its own step, the others cannot meet it: its request is passed on at once.
    """

    def __init__(self) -> None:
        self._first: UnitTerminated | None = None

    @contextlib.contextmanager
    def completed(self) -> Generator[None, None, None]:
        """Keep the request that a unit's completed step makes, for `end`."""
        try:
            yield
        except UnitTerminated as e:
            if not e.completed:
                raise
            self._first = self._first or e

    def end(self) -> None:
        """End the communication step.

        Raises:
            UnitTerminated: the first request that was kept.
        """
        if self._first is not None:
            raise self._first


class Ensemble:
    """Loads a system's units and makes the calls that an algorithm asks for, one unit at a time.

    Args:
        system: the units.
        heartbeat: notes their calls.
        cleanups: gets what terminates and frees them; the caller closes it, also if this fails.
        isolated: units that are loaded in processes of their own.

    Raises:
        InvalidFmu: an FMU is invalid.
    """

    def __init__(self, system: System, heartbeat: Heartbeat, cleanups: CleanupStack, isolated: Collection[str]) -> None:
        self.system = system
        self._isolated = isolated
        self.heartbeat = heartbeat
        self.host = HostProcess()
        """How this process was before units were loaded; it is put back after each."""
        self.instances: dict[str, Instance] = {}
        self.cpu: dict[str, array.array[float]] = {name: array.array("d") for name in system.units}
        """CPU seconds of every step, by unit; with Gauss-Seidel, setting inputs and getting outputs included."""
        self.measures_cpu = False
        """Whether CPU time is taken of steps."""
        self.extrapolation: LinearExtrapolation | None = None
        """Sets the inputs that are extrapolated; None where all are held."""
        self._cleanups = cleanups
        self._corrupt: set[Path] = set()
        """FMUs of which an instance returned Fatal."""
        self._load()
        self._feedings = feedings(system, self.instances)
        self.external_inputs = ExternalInputs(system, self.instances)
        self._finite = finite_checks(system, self.instances)

    def signals(self) -> Signals:
        """Return the units' outputs and the inputs that come from outside, as they are."""
        ports = {n: u.description.outputs for n, u in self.system.units.items()}
        views = {n: i.y for n, i in self.instances.items()}
        for end in self.system.externals:
            instance = self.instances[end.unit]
            ports[end.unit] = {**ports[end.unit], end.port: instance.description.inputs[end.port]}
            views[end.unit] = {**views[end.unit], end.port: instance.u[end.port]}
        return Signals(views, ports, self)

    def initialize(
        self, slots: Sequence[Slot], compute_values: Callable[[], None], stops: Mapping[str, float],
        tolerances: Mapping[str, float],
    ) -> None:  # fmt: skip
        """Take all units through initialisation mode.

        Args:
            slots: in the order in which they leave it.
            compute_values: is called in between, to set inputs and get outputs in any order.
            stops: by unit, the end of its last step, s; where there is none, it may step on without end.
            tolerances: by unit, the relative tolerance for its own solver; where there is none, it chooses.

        Raises:
            UnitFailure: a unit does not accept its start values or does not initialise.
            StartValuesLost: values of units do not hold; see `keep_start`.
        """
        start, lost = float(self.system.start), dict[str, list[LostValue]]()
        for name, unit in self.system.units.items():
            self.instances[name].set_start(unit.start)
            self.instances[name].enter_initialization(start, stops.get(name), tolerances.get(name))
            self._note_limits(name, "its initialisation")
            lost[name] = keep_start(self.instances[name], unit.start, self.system.fed_inputs(name))
        if affected := [name for name in lost if lost[name]]:
            raise StartValuesLost(affected, start, [value for name in affected for value in lost[name]])
        compute_values()
        for slot in slots:
            self.feed(slot.unit, start)
            self.instances[slot.unit].exit_initialization()
            self._end_at_close(self.instances[slot.unit])
            self.publish(slot.unit)

    def extrapolate(self, tick: Fraction) -> None:
        """Extrapolate inputs linearly from now, the start, on; steps are multiples of `tick`, in seconds."""
        self.extrapolation = LinearExtrapolation(self.system, self.instances, tick)

    def get_input_state(self) -> dict[str, Any]:
        """Return what is kept of inputs that come from outside or are extrapolated, for `set_input_state`."""
        external = {"external": self.external_inputs.get_state()} if self.external_inputs else {}
        return external if self.extrapolation is None else {**external, "lines": self.extrapolation.get_state()}

    def set_input_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_input_state` returned, which may be part of a mapping."""
        if self.external_inputs:
            self.external_inputs.set_state(state["external"])
        if self.extrapolation is not None:
            self.extrapolation.set_state(state["lines"])

    def feed(self, unit: str, t: float, dt: float | None = None) -> None:
        """Set a unit's inputs from their sources: as those are, or extrapolated for a step from t to t + dt.

        Raises:
            UnitFailure: the unit does not accept them.
        """
        self.gather(unit, t)
        if self.extrapolation is not None and dt is not None:
            self.extrapolation.feed(unit, t, dt)
        self.instances[unit].set_inputs()

    def feeding(self, unit: str) -> Feeding:
        """Return what `feed` does before it sets a unit's inputs, where none are extrapolated."""
        return self._feedings[unit]

    def feed_known(self, unit: str, known: Collection[str]) -> None:
        """Set at the start only the inputs whose sources are among the known units; the others keep their values.

        Raises:
            UnitFailure: the unit does not accept them.
        """
        self.gather(unit, float(self.system.start))
        self.set_known(unit, known)

    def set_known(self, unit: str, known: Collection[str]) -> None:
        """Set, of the inputs that were gathered, only those whose sources are among the known units.

        Raises:
            UnitFailure: the unit does not accept them.
        """
        sources = self.system.sources_of(unit)
        ports = [port for port, s in sources.items() if s.unit in known]
        free = [port for port in self.system.fed_inputs(unit) if port not in sources]
        self.instances[unit].set_some_inputs([*ports, *free])

    def gather(self, unit: str, t: float) -> None:
        """Copy to a unit's buffers what its sources give, and what inputs follow over time at t.

        `set_inputs` then passes it to the unit.

        Raises:
            UnitFailure: a number does not fit its input.
        """
        self._feedings[unit].transfer(t)

    def begin(self, unit: str, t: float, dt: float) -> bool:
        """Begin a step, which `step` finishes, in the process of an isolated unit; return whether it is one.

        Raises:
            UnitFailure: what comes before a step failed.
        """
        instance = self.instances[unit]
        if instance.isolated:
            instance.begin_step(t, dt)
        return instance.isolated

    def step(self, unit: str, t: float, dt: float) -> None:
        """Step a unit from t to t + dt.

        Raises:
            UnitTerminated: it asks to end the simulation. UnitFailure: its call failed.
        """
        self.instances[unit].step(t, dt)
        if self.extrapolation is not None:
            self.extrapolation.step(unit)

    def publish(self, unit: str) -> None:
        """Fetch a unit's outputs, for observers and for the units that they feed.

        Raises:
            NotFinite: one that feeds a unit is NaN or infinite. UnitFailure: the unit does not give them.
        """
        instance = self.instances[unit]
        instance.get_outputs()
        self._finite[unit](instance.time, instance.log)
        if self.extrapolation is not None:
            self.extrapolation.publish(unit)

    @contextlib.contextmanager
    def saved(self, units: Collection[str]) -> Generator[SavedStates, None, None]:
        """Save the states of units for a while, to which `restore` rolls back, and free them in the end.

        After a failure, that failure is raised and the states are freed as far as possible; a thread whose units were
        taken from it frees none.

        Raises:
            UnitFailure: a unit does not give its state.
        """
        states = SavedStates({} if self.extrapolation is None else self.extrapolation.save(units))
        try:
            for name in units:
                states[name] = self.instances[name].save_state()
            yield states
        except Abandoned:
            raise
        except BaseException:
            self._forget_quietly(states)
            raise
        self.forget(states)

    def restore(self, states: SavedStates) -> None:
        """Set saved states and fetch the outputs that belong to them."""
        if self.extrapolation is not None:
            self.extrapolation.restore(states.memories)
        for name, state in states.items():
            self.instances[name].restore_state(state)
            self.publish(name)

    def forget(self, states: Mapping[str, State]) -> None:
        """Free saved states, except those of units that must not be called any more."""
        for name, state in states.items():
            if not self.is_corrupt(self.instances[name]):
                self.instances[name].free_state(state)

    def finite_check(self, unit: str) -> FiniteCheck:
        """Return the check that `publish` makes of a unit's outputs."""
        return self._finite[unit]

    def measure_cpu(self) -> None:
        """Take the CPU time of steps from now on."""
        self.measures_cpu = True
        for instance in self.instances.values():
            instance.measure_cpu()

    @contextlib.contextmanager
    def stopwatch(self) -> Generator[Callable[[str], None], None, None]:
        """Yield a function that charges a unit with the CPU time since its last call, or since the start."""
        began = time.process_time() if self.measures_cpu else 0.0

        def charge(unit: str) -> None:
            nonlocal began
            if self.measures_cpu:
                ended = time.process_time()
                self.cpu[unit].append(ended - began + self.instances[unit].take_cpu())
                began = ended

        yield charge

    def _forget_quietly(self, states: Mapping[str, State]) -> None:
        for name, state in states.items():
            with contextlib.suppress(CosimError):
                self.forget({name: state})

    def _load(self) -> None:
        temporary = contextlib.ExitStack()
        folder = temporary.enter_context(scratch_folder("units"))
        self._cleanups.add(temporary.close)
        self._cleanups.add(self.host.close)
        self.heartbeat.record_scratch_folder(str(folder))
        unpacked: dict[Path, Path] = {}
        named: dict[Path, list[str]] = collections.defaultdict(list)
        for name, unit in self.system.units.items():
            d = unit.description
            if d.path not in unpacked:
                unpacked[d.path] = folder / str(len(unpacked))
                unpack(d.path, unpacked[d.path], d.fmi, d.identifier)
            try:
                instance = self._make(name, unpacked[d.path])
            except InvalidFmu as e:
                raise InvalidFmu(e.path, f"{name}: {e.fault}", e.log) from e
            finally:
                self.host.restore()
                self._note_limits(name, "its loading or instantiation")
            if not instance.isolated:
                instance.on_fatal = functools.partial(self._corrupt.add, d.path)
                named[unpacked[d.path]].append(name)
            self._cleanups.add(functools.partial(self._free, instance))
            process = ", in a process of its own" if instance.isolated else ""
            _log.info("%s: %s (FMI %d) of %s is loaded%s", name, d.name, d.fmi, shown_path(d.path), process)
            self.instances[name] = instance
        note_libraries(self.heartbeat, named)

    def _note_limits(self, unit: str, call: str) -> None:
        """Note for the case that the run cannot go on with them that a unit lowered hard limits in a call."""
        if self.host.lowered_limits() and "limits" not in self.heartbeat.facts:
            self.heartbeat.record_facts(limits=(unit, call))

    def _make(self, name: str, folder: Path) -> Instance:
        d = self.system.units[name].description
        isolated = name in self._isolated
        return Instance(name, d, folder, self.system.fed_inputs(name), self.heartbeat, isolated=isolated)

    def _end_at_close(self, instance: Instance) -> None:
        def end() -> None:  # the unit is freed next, whether or not it terminates properly
            if not self.is_corrupt(instance):
                instance.end()

        self._cleanups.add(end)

    def _free(self, instance: Instance) -> None:
        if instance.isolated or not self.is_corrupt(instance):
            instance.free()

    def is_corrupt(self, instance: Instance) -> bool:
        """Return whether an instance of the same FMU returned Fatal: the standards then forbid calls of all of them.

        Of an instance in a process of its own, that holds for itself alone.
        """
        return instance.fatal if instance.isolated else instance.description.path in self._corrupt
