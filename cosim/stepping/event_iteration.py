"""The event iteration: units in event mode exchange values, at one instant, until none changes. FMI 3.0, 2.2.10."""

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence

from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.event_instance import EventInstance
from handover.cosim.fmu.failures import UnsettledEvents
from handover.cosim.stepping.event_ensemble import EventEnsemble

MAX_ITERATIONS = 100
"""Limit of iterations at one instant, and of exchanges of values within one."""


class EventIteration:
    """Settles what happens at one instant.

    In an iteration the units in event mode exchange values, in the schedule's order, until none changes; then all
    update their discrete states, which ends the ticks of clocks. A unit joins when it has an event, when a clock of its
    own is due, when an output clock makes one of its clocks tick, or when a discrete input changes. A clocked input is
    set at each tick of its clock, changed or not.
    """

    def __init__(self, ensemble: EventEnsemble, order: Sequence[str]) -> None:
        self._ensemble = ensemble
        units = ensemble.event_units
        self._units: Mapping[str, EventInstance] = {n: units[n] for n in order if n in units}
        self._triggers: Mapping[tuple[str, str], list[tuple[str, str]]] = defaultdict(list)
        for c in ensemble.system.clock_connections():
            self._triggers[c.source.unit, c.source.port].append((c.target.unit, c.target.port))

    def settle(self, t: float, flagged: Collection[str], present: Collection[str]) -> set[str]:
        """Settle the instant t, beginning with units that have an event; `present` are those that are at t.

        Returns:
            The units that were in event mode; all are in step mode again.

        Raises:
            UnsettledEvents: the iteration does not end. UnitTerminated: a unit terminates the simulation.
            UnitFailure: a call failed, or a unit would have to tick that is not at t.
        """
        inside = {n for n in self._units if self._units[n].in_event_mode}
        restless = set[str]()
        for unit in flagged:
            self._enter(unit, inside)
        for _ in range(MAX_ITERATIONS):
            self._tick_due(t, present, inside)
            self._exchange(t, present, inside)
            restless = {n for n in self._ordered(inside) if self._units[n].update(t)}
            for unit in self._ordered(inside):
                self._ensemble.publish(unit)
            restless |= self._disturbed(t, present)
            if not restless and not any(self._due(t, n) for n in present):
                break
        else:
            raise UnsettledEvents([n for n in self._units if n in restless] or self._ordered(inside), t, MAX_ITERATIONS)
        for unit in self._ordered(inside):
            self._units[unit].enter_step_mode()
        return inside

    def _tick_due(self, t: float, present: Collection[str], inside: set[str]) -> None:
        for unit in self._ordered(present):
            if due := self._due(t, unit):
                self._enter(unit, inside)
                self._units[unit].tick(due)

    def _due(self, t: float, unit: str) -> list[str]:
        timers = self._units[unit].timers if unit in self._units else []
        return [timer.clock.name for timer in timers if timer.is_due(t)]

    def _exchange(self, t: float, present: Collection[str], inside: set[str]) -> None:
        """Exchange values and ticks until none changes."""
        pending, ticked = set(inside), set[tuple[str, str]]()
        changed = set[str]()
        for _ in range(MAX_ITERATIONS):
            joining = self._disturbed(t, present) - inside
            for unit in self._ordered(joining):
                self._enter(unit, inside)
            pending |= joining
            changed = {n for n in self._ordered(inside) if self._pass_on(t, n, pending, ticked, present, inside)}
            if not changed:
                return
        raise UnsettledEvents(self._ordered(changed), t, MAX_ITERATIONS, "the exchange in event mode")

    def _pass_on(
        self,
        t: float,
        unit: str,
        pending: set[str],
        ticked: set[tuple[str, str]],
        present: Collection[str],
        inside: set[str],
    ) -> bool:
        """Set a unit's inputs and fetch the outputs that follow; return False where nothing has changed."""
        instance = self._units[unit]
        self._ensemble.gather(unit, t)
        if instance.has_other_inputs():
            instance.set_inputs()
        elif unit not in pending:
            return False
        pending.discard(unit)
        self._ensemble.publish(unit)
        ticks = {(unit, clock) for clock in instance.ticking()} - ticked
        if ticks:
            self._ensemble.publish(unit)  # once more, for what can be reached while the clock ticks
        for target, clock in (end for tick in sorted(ticks) for end in self._triggers[tick]):
            self._check_present(t, target, clock, present)
            self._enter(target, inside)
            self._units[target].tick([clock])
            pending.add(target)
        ticked |= ticks
        return True

    def _check_present(self, t: float, unit: str, clock: str, present: Collection[str]) -> None:
        if unit not in present:
            at = self._ensemble.instances[unit].time
            fault = f"that its clock {clock} ticks while it is at t = {at:.9g} s, and it cannot roll back"
            raise UnitFailure(unit, "fmi3SetClock", t, fault)

    def _disturbed(self, t: float, present: Collection[str]) -> set[str]:
        """Return the units at t whose discrete inputs have changed."""
        disturbed: set[str] = set()
        for unit in self._ordered(present):
            self._ensemble.gather(unit, t)
            if self._units[unit].wants_inputs():
                disturbed.add(unit)
        return disturbed

    def _ordered(self, units: Collection[str]) -> list[str]:
        return [n for n in self._units if n in units]

    def _enter(self, unit: str, inside: set[str]) -> None:
        if unit not in inside:
            self._units[unit].enter_event_mode()
            inside.add(unit)
