"""When each unit steps, and in which order: whole ticks of one exact time grid, units ordered by direct feedthrough."""

import logging
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

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


class TimeGrid(NamedTuple):
    """Exact times: after n ticks, (offset + n * numerator) / denominator seconds."""

    offset: int
    numerator: int
    denominator: int

    @classmethod
    def of(cls, start: Fraction, tick: Fraction) -> "TimeGrid":
        """Return the grid of times at whole ticks from a start on, both in seconds."""
        denominator = math.lcm(start.denominator, tick.denominator)
        return cls(int(start * denominator), int(tick * denominator), denominator)

    def time(self, ticks: int) -> float:
        """Return the time after so many ticks, s, rounded once."""
        return (self.offset + ticks * self.numerator) / self.denominator


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

    The results of a step count at once for the units after it, as values at the end of the step. Those of a unit whose
    step may span a communication point of others would count before their time: they count from the step's end on,
    but in an algebraic loop, whose units are iterated, at once.

    In initialization mode, dependencies may be others, and all loops can be solved.

    Attributes:
        start: when the run starts, s: the time of tick 0.
        tick: in seconds.
        grid: the times of all ticks.
        loops: the algebraic loops that are solved at the steps.
        spanning: the units in `continuous` whose steps may span a communication point at which another unit is due.
        declared_loops: those that FMUs declare, which have to be solved.
        initial_groups: all units in an order in which their outputs can be computed at the start.
        initial_passes: how often to go through all units in order until all values at the start are computed.

    Raises:
        ScheduleError: periods have no common communication step.
    """

    def __init__(self, system: System) -> None:
        units = list(system.units.values())
        self.start, self.tick = system.start, _tick(units)
        self.grid = TimeGrid.of(self.start, self.tick)
        parts = [u for u in units if u.sampled], [u for u in units if not u.sampled]
        steps = [_arranged(system, part, initial=False) for part in parts]
        start = [
            at_steps if at_steps.is_same_at_start(part) else _arranged(system, part, initial=True)
            for part, at_steps in zip(parts, steps, strict=True)
        ]
        for warning in (w for arrangement in steps for w in arrangement.warnings):
            _log.warning("%s", warning)
        self.loops = [loop for arrangement in steps for loop in arrangement.loops]
        self.declared_loops = [
            loop
            for part, at_steps in zip(parts, steps, strict=True)
            for loop in (declared_loops(system, [u.name for u in part]) if at_steps.presumes else at_steps.loops)
        ]
        self.sampled_groups, self.continuous_groups = (arrangement.groups for arrangement in steps)
        self.initial_groups = start[1].groups + start[0].groups
        self.initial_passes = 1 + sum(arrangement.late_ports for arrangement in start)
        self.sampled = self._slots(system, self.sampled_groups)
        self.continuous = self._slots(system, self.continuous_groups)
        others = {slot.every for slot in self.slots}
        self.spanning = frozenset(s.unit for s in self.continuous if any(every % s.every for every in others))

    @property
    def slots(self) -> tuple[Slot, ...]:
        """All units in an order in which their outputs can be computed at the start."""
        return self.continuous + self.sampled

    def time(self, ticks: int) -> float:
        """Return the time after so many ticks, s, rounded once."""
        return self.grid.time(ticks)

    def ticks(self, t: Fraction) -> int:
        """Return the number of whole ticks from the start to a time in seconds, rounded up."""
        return math.ceil((t - self.start) / self.tick)

    def end_of_steps(self, slot: Slot, stop: Fraction) -> float:
        """Return when the last step of a unit ends that begins before `stop`, or of a sampled one at it, s.

        It is as the unit computes it, t + dt, where that rounds to a later time.
        """
        points = self.ticks(stop)
        steps = points // slot.every + 1 if slot in self.sampled else -(-points // slot.every)
        return max(self.time(steps * slot.every), self.time((steps - 1) * slot.every) + slot.period)

    def _slots(self, system: System, groups: Sequence[Group]) -> tuple[Slot, ...]:
        periods = {n: system.units[n].period for group in groups for n in group.units}
        return tuple(Slot(n, int(period / self.tick), float(period)) for n, period in periods.items())


@dataclass(frozen=True)
class _Arrangement:
    """Units in an order, at the steps or at the start.

    Attributes:
        groups: the units in order, those of a loop that is solved together.
        loops: the loops that are solved.
        presumes: whether some of the loops, solved or not, are presumed.
        is_complete: whether all loops are solved.
        warnings: what the order means, where units get values of the step before.
        late_ports: how many inputs with declared feedthrough get those.
    """

    groups: tuple[Group, ...]
    loops: Sequence[AlgebraicLoop]
    presumes: bool
    is_complete: bool
    warnings: Sequence[str]
    late_ports: int

    def is_same_at_start(self, units: Sequence[PlacedUnit]) -> bool:
        """Return whether this order for the steps is also that for the start."""
        same = (_feedthrough_of(u, initial=True) == _feedthrough_of(u, initial=False) for u in units)
        return self.is_complete and all(same)


def _arranged(system: System, units: Sequence[PlacedUnit], *, initial: bool) -> _Arrangement:
    names = [u.name for u in units]
    loops, unsolved = solved_loops(system, names, initial=initial)
    sources = {n: {port: source.unit for port, source in system.sources_of(n).items()} for n in names}
    through = {u.name: _feedthrough_of(u, initial=initial) for u in units}
    declared = {n: _feeding_through(sources[n], through[n][0]) for n in names}
    presumed = {n: _feeding_through(sources[n], through[n][1]) for n in names}
    groups = groups_of_loops(names, loops)
    warnings = [unsolved_text(system, loop) for loop in unsolved]
    late_ports = 0

    def names_of(group: int, waits: set[int], needed: Mapping[str, set[str]]) -> tuple[str, str]:
        needs = {n for name in groups[group].units for n in needed[name]}
        return ", ".join(groups[group].units), ", ".join(
            sorted(n for i in waits for n in groups[i].units if n in needs)
        )

    def note_presumed(group: int, waits: set[int]) -> None:
        first, others = names_of(group, waits, presumed)
        warnings.append(f"{first} does not declare its direct feedthrough; it gets the previous values of {others}")

    def note_declared(group: int, waits: set[int]) -> None:
        nonlocal late_ports
        late = {n for i in waits for n in groups[i].units}
        ports = [(n, port) for n in groups[group].units for port in _ports(through[n][0])]
        late_ports += sum(sources[n].get(port) in late for n, port in ports)
        first, others = names_of(group, waits, declared)
        warnings.append(f"{first} steps first where units wait for each other; it gets the previous values of {others}")

    ordered = tuple(in_order(groups, declared, presumed, note_presumed, note_declared))
    presumes = bool(unsolved) or any(loop.is_presumed for loop in loops)
    return _Arrangement(ordered, loops, presumes, not unsolved, warnings, late_ports)


def common_divisor(periods: Sequence[Fraction]) -> Fraction:
    """Return the longest time of which all periods are multiples, s; 1 s where there are none."""
    if not periods:
        return Fraction(1)
    denominator = math.lcm(*(p.denominator for p in periods))
    return Fraction(math.gcd(*(int(p * denominator) for p in periods)), denominator)


def _tick(units: Sequence[PlacedUnit]) -> Fraction:
    """Return the common communication step of units, which must not be far below theirs."""
    tick = common_divisor([u.period for u in units])
    if units and tick * _MAX_TICKS_PER_STEP < min(u.period for u in units):
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
