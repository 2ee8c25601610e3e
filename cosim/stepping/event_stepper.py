"""Steps that end at events too: communication points are those of the schedule's grid and the instants of events.

At each, the event iteration lets units in event mode exchange values until none changes. FMI 3.0, 2.2.10.
"""

import math
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from handover.cosim.exceptions import ScheduleError, UnitFailure
from handover.cosim.fmu.event_instance import EventInstance
from handover.cosim.fmu.failures import UnsettledEvents
from handover.cosim.stepping.event_ensemble import EventEnsemble
from handover.cosim.stepping.options import Extrapolation, MasterOptions
from handover.cosim.stepping.stepper import Coupling
from handover.cosim.system.schedule import Schedule, Slot
from handover.cosim.system.system import System

_MAX_ITERATIONS = 100
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
        for _ in range(_MAX_ITERATIONS):
            self._tick_due(t, present, inside)
            self._exchange(t, present, inside)
            restless = {n for n in self._ordered(inside) if self._units[n].update(t)}
            for unit in self._ordered(inside):
                self._ensemble.publish(unit)
            restless |= self._disturbed(t, present)
            if not restless and not any(self._due(t, n) for n in present):
                break
        else:
            raise UnsettledEvents(
                [n for n in self._units if n in restless] or self._ordered(inside), t, _MAX_ITERATIONS
            )
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
        for _ in range(_MAX_ITERATIONS):
            joining = self._disturbed(t, present) - inside
            for unit in self._ordered(joining):
                self._enter(unit, inside)
            pending |= joining
            changed = {n for n in self._ordered(inside) if self._pass_on(t, n, pending, ticked, present, inside)}
            if not changed:
                return
        raise UnsettledEvents(self._ordered(changed), t, _MAX_ITERATIONS, "the exchange in event mode")

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


@dataclass
class Course:
    """The last step of a continuous unit, from `begun` to `reached`, in seconds, and whether it ended at an event."""

    period: Fraction
    begun: Fraction
    reached: Fraction
    event: bool = False


class EventStepper:
    """Communication points are the schedule's, and every instant at which a unit has an event.

    - A step ends at the next multiple of the unit's period, or before it at an event that is known: a tick of a clock
      or a `nextEventTime`, of any unit where the unit can vary its step, else of its own.
    - Where a unit returns early, all that can roll back (they save states and vary their steps) are rolled back to the
      beginning of their steps and step to the instant too, with the inputs they had; the others stay at the ends of
      their steps, which is logged once. Sampled units hold their outputs between their instants anyway.
    - At such an instant the event iteration settles what changes, then sampled units act on that, and what they change
      in turn is settled; observers see the instant once, after all of it.
    - A unit that returns early where its step began has its event settled by itself, after observers saw the instant.
    - A step that is discarded and repeated shorter is like an early return without an event.

    Times are exact: periods and clocks' intervals are fractions that are added up, events are the units' floats. Two
    times count as the same instant when they are the same double, as this is what units get.
    """

    def __init__(self, schedule: Schedule, ensemble: EventEnsemble, coupling: Coupling) -> None:
        self.time = schedule.time(0)
        self._start = self._now = schedule.start
        self._schedule = schedule
        self._ensemble = ensemble
        self._coupling = coupling
        self._periods = {s.unit: s.every * schedule.tick for s in schedule.slots}
        self._courses = {s.unit: Course(self._periods[s.unit], self._start, self._start) for s in schedule.continuous}
        self._due = dict.fromkeys((s.unit for s in schedule.sampled), self._start)
        self._acted: dict[str, Fraction] = {}
        self._iteration = EventIteration(ensemble, [s.unit for s in schedule.slots])
        self._adapting = {n for n in self._courses if ensemble.system.units[n].description.capabilities.varies_step}

    def arrive(self, last: int) -> bool:
        """Go to the next point at which a unit is due or has an event, and settle events; see `Stepper`."""
        stop = self._start + last * self._schedule.tick
        self._now = min((stop, *self._due.values(), *(c.reached for c in self._courses.values())), key=float)
        self.time = float(self._now)
        flagged = self._flagged()
        if flagged or self._is_between():
            self._roll_back()
        present = self._present()
        self._ensemble.external_inputs.ask(self.time)
        self._coupling.arrive(self.time, [], self._continuous())
        self._iteration.settle(self.time, flagged, present)
        for unit in present:
            self._courses[unit].event = False
        if sampled := [s for s in self._sampled() if self._acted.get(s.unit) != self._due[s.unit]]:
            self._coupling.arrive(self.time, sampled, [])
            self._acted.update((s.unit, self._due[s.unit]) for s in sampled)
            self._iteration.settle(self.time, [], present)
        return self.time == float(stop)

    def depart(self) -> None:
        """Step what is due.

        Raises:
            UnsettledEvents: units return early again and again without advancing. UnitFailure: a call failed.
        """
        sampled = self._sampled()
        self._step(sampled, self._continuous())
        for slot in sampled:
            self._due[slot.unit] += self._periods[slot.unit]
        units: list[str] = []
        for _ in range(_MAX_ITERATIONS):
            stalled = self._continuous()
            if not stalled:
                return
            units = [slot.unit for slot in stalled]
            self._iteration.settle(self.time, self._flagged(), units)
            self._step([], stalled)
        raise UnsettledEvents(units, self.time, _MAX_ITERATIONS, "fmi3DoStep")

    def _step(self, sampled: Sequence[Slot], due: Sequence[Slot]) -> None:
        targets = {slot.unit: self._target(slot.unit) for slot in due}
        slots = [Slot(slot.unit, slot.every, float(targets[slot.unit] - self._now)) for slot in due]
        self._coupling.depart(self.time, sampled, slots)
        self._ensemble.host.restore_arithmetic()  # by another rounding one instant would be several doubles
        for unit, target in targets.items():
            end, course = self._ensemble.ends[unit], self._courses[unit]
            course.begun, course.event = self._now, end.event
            course.reached = Fraction(end.reached) if end.early and end.reached < float(target) else target

    def get_state(self) -> Mapping[str, Any]:
        """Return times, the coupling's state, and states to which units ahead may have to roll back; see `Stepper`."""
        ahead = [n for n, c in self._courses.items() if float(c.reached) > self.time]
        return {
            "coupling": self._coupling.get_state(),
            "begins": self._ensemble.get_begins(ahead),
            "now": str(self._now),
            "due": {n: str(t) for n, t in self._due.items()},
            "acted": {n: str(t) for n, t in self._acted.items()},
            "courses": {n: [str(c.begun), str(c.reached), c.event] for n, c in self._courses.items()},
            "units": {n: i.get_timing() for n, i in self._ensemble.event_units.items()},
            **self._ensemble.get_input_state(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore the times that `get_state` returned."""
        self._now = Fraction(state["now"])
        self.time = float(self._now)
        self._due = {n: Fraction(t) for n, t in state["due"].items()}
        self._acted = {n: Fraction(t) for n, t in state["acted"].items()}
        for name, (begun, reached, event) in state["courses"].items():
            self._courses[name] = Course(self._periods[name], Fraction(begun), Fraction(reached), event)
        for name, timing in state["units"].items():
            self._ensemble.event_units[name].set_timing(timing)
        self._ensemble.set_begins(state["begins"])
        self._ensemble.set_input_state(state)
        self._coupling.set_state(state["coupling"])

    def _present(self) -> list[str]:
        return [n for n, c in self._courses.items() if float(c.reached) == self.time]

    def _continuous(self) -> list[Slot]:
        present = self._present()
        return [s for s in self._schedule.continuous if s.unit in present]

    def _sampled(self) -> list[Slot]:
        return [s for s in self._schedule.sampled if float(self._due[s.unit]) == self.time]

    def _flagged(self) -> list[str]:
        """Return the units at this point that have an event: reported by the step that ended here or announced."""
        units = self._ensemble.event_units
        return [
            n
            for n in self._present()
            if n in units and (self._courses[n].event or self._time_reached(units[n].next_event))
        ]

    def _time_reached(self, t: float | None) -> bool:
        return t is not None and t <= self.time

    def _is_between(self) -> bool:
        """Whether a unit at this point is there before its period has passed."""
        courses = self._courses.values()
        return any(float(c.reached) == self.time and (c.reached - self._start) % c.period for c in courses)

    def _roll_back(self) -> None:
        """Roll back the units that are ahead and step them to this point, where they can."""
        for unit, course in self._courses.items():
            if float(course.reached) <= self.time:
                continue
            if self._ensemble.bring(unit, self.time, float(self._now - course.begun)):
                course.reached, course.event = self._now, self._ensemble.ends[unit].event
            self._ensemble.host.restore_arithmetic()

    def _target(self, unit: str) -> Fraction:
        """Return when a step from here ends: after the period, or at an event that is known before."""
        period = self._courses[unit].period
        target = self._start + (math.floor((self._now - self._start) / period) + 1) * period
        while float(target) <= self.time:
            target += period
        event_units = self._ensemble.event_units
        watched = event_units if unit in self._adapting else event_units.keys() & {unit}
        times = (t for name in watched for t in _announced(event_units[name]))
        return min((t for t in times if self.time < float(t) < float(target)), default=target)


def _announced(instance: EventInstance) -> list[Fraction]:
    """Return the times of events that a unit has announced: ticks of its clocks, and its `nextEventTime`."""
    times = [timer.next for timer in instance.timers if timer.next is not None]
    return times if instance.next_event is None else [*times, Fraction(instance.next_event)]


def has_events(system: System, options: MasterOptions) -> bool:
    """Return whether steps may end off the grid, at events or discarded; an adaptive stepper repeats steps itself."""
    return system.has_events or (options.repeat_discarded and options.adaptive is None)


def check_off_grid(system: System, options: MasterOptions) -> None:
    """Reject options that need all steps on a grid; `check_control` rejects events where the step follows the error.

    Raises:
        ScheduleError: inputs are to be extrapolated, although steps may end anywhere.
    """
    if not has_events(system, options):
        return
    eventful = ", ".join(u.name for u in system.units.values() if u.uses_events)
    where = f"at events ({eventful})" if eventful else "when one is discarded"
    if options.extrapolation is Extrapolation.LINEAR:
        raise ScheduleError(
            f"inputs can follow lines only where all steps lie on one grid, and steps may end off it {where}: let "
            "inputs be held"
        )
