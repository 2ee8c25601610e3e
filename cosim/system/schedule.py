"""When each unit steps, and in which order: whole ticks of one exact time grid, units ordered by direct feedthrough."""

import logging
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.exceptions import ScheduleError
from handover.cosim.system.loops import (
    AlgebraicLoop,
    Group,
    declared_loops,
    groups_of_loops,
    in_order,
    solved_loops,
    unsolved_text,
)
from handover.cosim.system.system import PlacedUnit, System

_log = logging.getLogger(__name__)

Feedthrough = Mapping[str, Collection[str]]
"""By output, the inputs that it depends on directly."""

_MAX_TICKS_PER_STEP = 10_000  # of the shortest period; more means that the periods have no sensible common divisor


@dataclass(frozen=True)
class Slot:
    """A unit in the schedule: it steps every `every` ticks, by `period` seconds (rounded once)."""

    unit: str
    every: int
    period: float


class Schedule:
    """The time grid, and the units in the order in which they step at one communication point.

    A tick is the greatest common divisor of the units' periods; times are tick counts, so they do not drift. The units
    in `sampled` compute, at a communication point t, outputs at t from inputs at t. Those in `continuous` step from t
    to t + period. So a camera's picture at t becomes a command at t, which acts in the step that begins at t.

    Within each of the two, a unit comes after those whose outputs feed its inputs with direct feedthrough; otherwise
    units keep the order in which they were added. Units in an algebraic loop are a `Group` and stand side by side; an
    algorithm solves it. Feedthrough that an FMU does not declare is presumed, and ignored where it would close a loop
    that cannot be solved. Units may need each other's outputs in a cycle that is no algebraic loop, because each single
    output can be computed after others: one of the units then gets values of the previous step. Both cases are logged.

    In initialization mode, dependencies may be others, and all loops can be solved.

    Attributes:
        loops: the algebraic loops that are solved at the steps.
        declared_loops: those that FMUs declare, which have to be solved.
        initial_groups: all units in an order in which their outputs can be computed at the start.
        initial_passes: how often to go through all units in order until all values at the start are computed.

    Raises:
        ScheduleError: periods have no common communication step.
    """

    def __init__(self, system: System) -> None:
        units = list(system.units.values())
        self.tick = _common_divisor(units)
        parts = [u for u in units if u.sampled], [u for u in units if not u.sampled]
        self.loops: list[AlgebraicLoop] = []
        self.declared_loops = [loop for part in parts for loop in declared_loops(system, [u.name for u in part])]
        self.initial_passes = 1
        self.sampled_groups, self.continuous_groups = (self._groups(system, part, initial=False) for part in parts)
        sampled, continuous = (self._groups(system, part, initial=True) for part in parts)
        self.initial_groups = continuous + sampled
        self.sampled = self._slots(system, self.sampled_groups)
        self.continuous = self._slots(system, self.continuous_groups)

    @property
    def groups(self) -> tuple[Group, ...]:
        """All units in the order of `slots`, those of algebraic loops together, as at the steps."""
        return self.continuous_groups + self.sampled_groups

    @property
    def slots(self) -> tuple[Slot, ...]:
        """All units in an order in which their outputs can be computed at the start."""
        return self.continuous + self.sampled

    def time(self, ticks: int) -> float:
        """Return the time after so many ticks, rounded once."""
        return ticks * self.tick.numerator / self.tick.denominator

    def ticks(self, duration: Fraction) -> int:
        """Return the number of whole ticks in a duration, rounded up."""
        return math.ceil(duration / self.tick)

    def _groups(self, system: System, units: Sequence[PlacedUnit], *, initial: bool) -> tuple[Group, ...]:
        """Return the groups of units in order, at the start or at the steps, of which is logged what it means."""
        names = [u.name for u in units]
        loops, unsolved = solved_loops(system, names, initial=initial)
        sources = {n: {port: source.unit for port, source in system.sources_of(n).items()} for n in names}
        through = {u.name: _feedthrough_of(u, initial=initial) for u in units}
        declared = {n: _feeding_through(sources[n], through[n][0]) for n in names}
        presumed = {n: _feeding_through(sources[n], through[n][1]) for n in names}
        groups = groups_of_loops(names, loops)

        def units_of(waits: set[int], needed: Mapping[str, set[str]], group: int) -> str:
            needs = {n for name in groups[group].units for n in needed[name]}
            return ", ".join(sorted(n for i in waits for n in groups[i].units if n in needs))

        def log_presumed(group: int, waits: set[int]) -> None:
            if initial:
                return
            names, others = ", ".join(groups[group].units), units_of(waits, presumed, group)
            _log.warning("%s does not declare its direct feedthrough; it gets the previous values of %s", names, others)

        def note_declared(group: int, waits: set[int]) -> None:
            if initial:
                late = {n for i in waits for n in groups[i].units}
                ports = [(n, port) for n in groups[group].units for port in _ports(through[n][0])]
                self.initial_passes += sum(sources[n].get(port) in late for n, port in ports)
                return
            names, others = ", ".join(groups[group].units), units_of(waits, declared, group)
            _log.warning(
                "%s steps first where units wait for each other; it gets the previous values of %s", names, others
            )

        if not initial:
            self.loops += loops
            for loop in unsolved:
                _log.warning("%s", unsolved_text(system, loop))
        return tuple(in_order(groups, declared, presumed, log_presumed, note_declared))

    def _slots(self, system: System, groups: Sequence[Group]) -> tuple[Slot, ...]:
        periods = {n: system.units[n].period for group in groups for n in group.units}
        return tuple(Slot(n, int(period / self.tick), float(period)) for n, period in periods.items())


def _common_divisor(units: Sequence[PlacedUnit]) -> Fraction:
    if not units:
        return Fraction(1)
    denominator = math.lcm(*(u.period.denominator for u in units))
    tick = Fraction(math.gcd(*(int(u.period * denominator) for u in units)), denominator)
    if tick * _MAX_TICKS_PER_STEP < min(u.period for u in units):
        steps = ", ".join(f"{u.name} {u.period} s" for u in units)
        raise ScheduleError(f"these units have no common communication step: {steps}")
    return tick


def _feedthrough_of(unit: PlacedUnit, *, initial: bool) -> tuple[Feedthrough, Feedthrough]:
    """Return a unit's declared and presumed feedthrough."""
    d = unit.description
    if initial:
        return d.initial_feedthrough, d.presumed_initial_feedthrough
    return d.feedthrough, d.presumed_feedthrough


def _ports(feedthrough: Feedthrough) -> set[str]:
    return {u for us in feedthrough.values() for u in us}


def _feeding_through(sources: Mapping[str, str], feedthrough: Feedthrough) -> set[str]:
    """Return the units that feed inputs with direct feedthrough to outputs."""
    inputs = _ports(feedthrough)
    return {unit for port, unit in sources.items() if port in inputs}
