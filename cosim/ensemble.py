"""The units of a system in a run: loaded, wired through their buffers, initialised, and freed at the end."""

import array
import contextlib
import logging
import tempfile
import time
from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

from cosim.exceptions import CosimError
from cosim.fmpy_edge import unpack
from cosim.instance import Instance, State
from cosim.linear_inputs import LinearInputs
from cosim.narrowing import Narrowing, narrows
from cosim.saved_states import SavedStates
from cosim.scaled_copy import ScaledCopy
from cosim.schedule import Slot
from cosim.signal_buffer import Copy, joined
from cosim.signals import Signals
from cosim.system import PortName, System

_log = logging.getLogger(__name__)


class Ensemble:
    """Loads a system's units and carries out what an algorithm wants of them, one unit at a time.

    Raises:
        InvalidFmu: an FMU cannot be used; what was loaded until then is freed.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.instances: dict[str, Instance] = {}
        self.cpu: dict[str, array.array[float]] = {name: array.array("d") for name in system.units}
        """CPU seconds of every step, by unit; with Gauss-Seidel, setting inputs and getting outputs included."""
        self.lines: LinearInputs | None = None
        """What inputs follow that are extrapolated; None where all are held."""
        self._copies: dict[str, Sequence[Copy]] = {}
        self._scaled: dict[str, list[ScaledCopy]] = {}
        self._narrowings: dict[str, list[Narrowing]] = {}
        with contextlib.ExitStack() as cleanup:
            self._load(cleanup)
            self._wire()
            self._cleanup = cleanup.pop_all()

    def close(self) -> None:
        """Terminate and free all units."""
        self._cleanup.close()

    def signals(self) -> Signals:
        """Return the units' outputs as they are."""
        ports = {n: u.description.outputs for n, u in self.system.units.items()}
        return Signals({n: i.y for n, i in self.instances.items()}, ports, self)

    def initialize(self, slots: Sequence[Slot]) -> None:
        """Take all units through initialisation mode, in the order given.

        Raises:
            UnitFailure: a unit does not accept its start values or does not initialise.
        """
        for name, unit in self.system.units.items():
            self.instances[name].set_start(unit.start)
            self.instances[name].enter_initialization(0.0, None)
        known: set[str] = set()
        for slot in slots:
            self._feed_known(slot.unit, known)
            self.publish(slot.unit)
            known.add(slot.unit)
        for slot in slots:
            self.feed(slot.unit, 0.0)
            self.instances[slot.unit].exit_initialization()
            self.publish(slot.unit)
            self._end_at_close(self.instances[slot.unit])

    def extrapolate(self, tick: Fraction) -> None:
        """Let inputs follow lines from here on, the start; steps are whole numbers of `tick`, in seconds."""
        self.lines = LinearInputs(self.system, self.instances, tick)

    def feed(self, unit: str, t: float, dt: float | None = None) -> None:
        """Set a unit's inputs from their sources: as those are, or extrapolated for a step from t to t + dt.

        Raises:
            UnitFailure: the unit does not take them.
        """
        self._copy(unit, t)
        if self.lines is not None and dt is not None:
            self.lines.feed(unit, t, dt)
        self.instances[unit].set_inputs()

    def step(self, unit: str, t: float, dt: float) -> None:
        """Let a unit go from t to t + dt.

        Raises:
            UnitFailure: its call failed.
        """
        self.instances[unit].step(t, dt)
        if self.lines is not None:
            self.lines.step(unit)

    def publish(self, unit: str) -> None:
        """Fetch a unit's outputs, for observers and for the units that they feed."""
        self.instances[unit].get_outputs()
        if self.lines is not None:
            self.lines.publish(unit)

    def save(self, units: Collection[str]) -> SavedStates:
        """Save the states of units; `restore` goes back to them, `forget` frees them."""
        lines = self.lines.save(units) if self.lines is not None else {}
        return SavedStates({name: self.instances[name].save_state() for name in units}, lines)

    def restore(self, states: Mapping[str, State]) -> None:
        """Set saved states and fetch the outputs that belong to them."""
        if self.lines is not None and isinstance(states, SavedStates):
            self.lines.restore(states.lines)
        for name, state in states.items():
            self.instances[name].restore_state(state)
            self.publish(name)

    def forget(self, states: Mapping[str, State]) -> None:
        """Free saved states."""
        for name, state in states.items():
            self.instances[name].free_state(state)

    @contextlib.contextmanager
    def stopwatch(self) -> Generator[Callable[[str], None], None, None]:
        """Give a function that charges the CPU time since it was last called, or since the start, to a unit."""
        began = time.process_time()

        def charge(unit: str) -> None:
            nonlocal began
            ended = time.process_time()
            self.cpu[unit].append(ended - began)
            began = ended

        yield charge

    def _copy(self, unit: str, t: float) -> None:
        for narrowing in self._narrowings[unit]:
            narrowing.check(t)
        for target, source in self._copies[unit]:
            target[...] = source
        for scaled in self._scaled[unit]:
            scaled()

    def _feed_known(self, unit: str, known: Collection[str]) -> None:
        """Set only inputs whose sources are known already; the others keep their start values."""
        self._copy(unit, 0.0)
        sources = self.system.sources_of(unit)
        self.instances[unit].set_some_inputs([port for port, s in sources.items() if s.unit in known])

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
            self.instances[name] = instance

    def _wire(self) -> None:
        changes = {c.target: change for c in self.system.connections if (change := self.system.change_by(c))}
        for name, instance in self.instances.items():
            copies: list[Copy] = []
            self._scaled[name] = []
            self._narrowings[name] = []
            for port, source in self.system.sources_of(name).items():
                other, target = self.instances[source.unit], instance.description.inputs[port]
                output, change = other.description.outputs[source.port], changes.get(PortName(name, port))
                if change is not None:
                    self._scaled[name].append(ScaledCopy(instance.u[port][0], other.y[source.port][0], change))
                    _log.info("%s (%s) -> %s.%s (%s): %s", source, output.unit, name, port, target.unit, change)
                else:
                    copies += zip(instance.u[port], other.y[source.port], strict=True)
                if target.width and narrows(output, target):
                    values = other.y[source.port][0]
                    self._narrowings[name].append(Narrowing(str(source), name, port, target.width, values))
            self._copies[name] = joined(copies)

    def _end_at_close(self, instance: Instance) -> None:
        def end() -> None:
            with contextlib.suppress(CosimError):  # freeing follows whether or not the unit agrees to end
                instance.end()

        self._cleanup.callback(end)
