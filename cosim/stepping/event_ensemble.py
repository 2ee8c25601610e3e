"""Units of which some have events: their steps may end early, be discarded, and be rolled back."""

import contextlib
import logging
from collections.abc import Callable, Collection, Generator, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from handover.cosim.exceptions import CosimError
from handover.cosim.fmu.calls import State, StepEnd
from handover.cosim.fmu.event_instance import EventInstance
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.fmu.instance import Instance
from handover.cosim.stepping.ensemble import CleanupStack, Ensemble
from handover.cosim.system.schedule import Slot
from handover.cosim.system.system import PlacedUnit, System

_log = logging.getLogger(__name__)

_MIN_STEP = 2.0**-10
"""The shortest step that is tried, as a part of the discarded one."""


class EventEnsemble(Ensemble):
    """Loads the units that have events in event mode, and saves states at the beginning of steps to roll back to.

    Attributes:
        ends: how the last step of each unit ended.
    """

    def __init__(self, system: System, heartbeat: Heartbeat, cleanups: CleanupStack, isolated: Collection[str]) -> None:
        self.ends: dict[str, StepEnd] = {}
        self._begun: dict[str, tuple[float, State]] = {}
        super().__init__(system, heartbeat, cleanups, isolated)
        staying = (u.name for u in system.units.values() if not u.sampled and not can_roll_back(u))
        self._staying = dict.fromkeys(staying)
        self._warned: set[str] = set()

    def initialize(
        self, slots: Sequence[Slot], compute_values: Callable[[], None], stops: Mapping[str, float],
        tolerances: Mapping[str, float],
    ) -> None:  # fmt: skip
        """Take all units through initialisation mode; those with events are in event mode after that."""
        super().initialize(slots, compute_values, stops, tolerances)
        self._cleanups.add(self._forget_begins)

    @property
    def event_units(self) -> dict[str, EventInstance]:
        """The units that run in event mode."""
        return {n: i for n, i in self.instances.items() if isinstance(i, EventInstance)}

    def begin(self, unit: str, t: float, dt: float) -> bool:
        """Begin a step in the process of an isolated unit; see `Ensemble`."""
        if self.instances[unit].isolated:
            self._keep_begin_of_step(unit, t)
        return super().begin(unit, t, dt)

    def step(self, unit: str, t: float, dt: float) -> None:
        """Step a unit from t to t + dt, or as far as it comes; see `ends`.

        Raises:
            UnitFailure: its call failed, or it discards the step and that cannot be repeated shorter.
        """
        if self.system.units[unit].sampled:
            super().step(unit, t, dt)
            return
        instance = self.instances[unit]
        if not instance.is_stepping:
            self._keep_begin_of_step(unit, t)
        end = instance.try_step(t, dt)
        self.ends[unit] = self._repeat(instance, t, dt, end) if end.discarded else end

    def bring(self, unit: str, t: float, dt: float) -> bool:
        """Roll a unit back to the beginning of its step, and step it by dt only, to t; return False if it cannot.

        Its inputs are those of the step before: they are part of its state.

        Raises:
            UnitFailure: its call failed, or it does not come as far as before.
        """
        if unit not in self._begun:
            if unit not in self._warned:
                self._warned.add(unit)
                _log.warning("%s cannot roll back to the event at t = %.9g s: it stays at the end of its step", unit, t)
            return False
        begin, state = self._begun[unit]
        instance = self.instances[unit]
        instance.restore_state(state)
        end = instance.try_step(begin, dt)
        if end.early:
            raise instance.discarded(end.reached, "it had come farther from the same state before")
        self.ends[unit] = replace(end, reached=t)
        self.publish(unit)
        return True

    def get_begins(self, units: Iterable[str]) -> dict[str, tuple[float, str]]:
        """Return when the steps of units that can roll back began, and their serialised states there."""
        begins: dict[str, tuple[float, str]] = {}
        for unit in units:
            if unit in self._begun:
                begin, state = self._begun[unit]
                with self._at(unit, lambda i, state=state: i.restore_state(state)) as instance:
                    begins[unit] = begin, instance.serialise_state().hex()
        return begins

    def set_begins(self, begins: Mapping[str, tuple[float, str]]) -> None:
        """Restore what `get_begins` returned."""
        for unit, (begin, state) in begins.items():
            with self._at(unit, lambda i, state=state: i.deserialise_state(bytes.fromhex(state))):
                self._keep_begin(unit, begin)

    @contextlib.contextmanager
    def _at(self, unit: str, set_state: Callable[[Instance], None]) -> Generator[Instance, None, None]:
        """Put a unit into another state for a while."""
        instance = self.instances[unit]
        with self.saved([unit]) as here:
            set_state(instance)
            yield instance
            instance.restore_state(here[unit])

    def _repeat(self, instance: Instance, t: float, dt: float, end: StepEnd) -> StepEnd:
        """Repeat a step that was discarded, shorter: as far as the unit came, or else half as far, and so on."""
        if instance.name in self._staying:
            raise instance.discarded(end.reached, _unable([instance.name]))
        if others := [n for n in self._staying if n != instance.name]:
            raise instance.discarded(end.reached, f"the others would have to roll back too, and {_unable(others)}")
        tried = dt
        while tried > dt * _MIN_STEP:
            came = end.reached - t
            tried = came if 0.0 < came < tried else tried / 2.0
            instance.restore_state(self._begun[instance.name][1])
            end = instance.try_step(t, tried)
            if not end.discarded:
                _log.info("%s discarded a step of %.6g s at t = %.9g s; %.6g s were taken", instance.name, dt, t, tried)
                return end if end.early else replace(end, early=True)
        raise instance.discarded(end.reached, f"steps down to {tried:.3g} s were tried")

    def _keep_begin_of_step(self, unit: str, t: float) -> None:
        if unit not in self._staying and not self.system.units[unit].sampled:
            self._keep_begin(unit, t)

    def _keep_begin(self, unit: str, t: float) -> None:
        self._forget_begin(unit)
        self._begun[unit] = (t, self.instances[unit].save_state())

    def _forget_begins(self) -> None:
        for unit in list(self._begun):
            with contextlib.suppress(CosimError):  # termination continues, whether or not the unit accepts this
                self._forget_begin(unit)

    def _forget_begin(self, unit: str) -> None:
        if unit in self._begun:
            _, state = self._begun.pop(unit)
            self.forget({unit: state})

    def _make(self, name: str, folder: Path) -> Instance:
        unit = self.system.units[name]
        make = EventInstance if unit.uses_events else Instance
        inputs, isolated = self.system.fed_inputs(name), name in self._isolated
        return make(name, unit.description, folder, inputs, self.heartbeat, isolated=isolated)


def can_roll_back(unit: PlacedUnit) -> bool:
    """Return whether a unit's step can be rolled back and repeated shorter."""
    return unit.description.capabilities.saves_state and unit.description.capabilities.varies_step


def _unable(units: Iterable[str]) -> str:
    names = ", ".join(units)
    return (
        f"{names} cannot save its state or vary its step (canGetAndSetFMUstate, canHandleVariableCommunicationStepSize)"
    )
