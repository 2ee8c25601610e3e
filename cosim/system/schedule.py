"""When each unit steps and in which order: whole ticks of one exact grid, what is sampled before what goes on."""

import logging
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.exceptions import ScheduleError
from handover.cosim.system.loops import AlgebraicLoop, Group, algebraic_loops, groups_of_loops, in_order
from handover.cosim.system.system import PlacedUnit, System

_log = logging.getLogger(__name__)

_MAX_TICKS_PER_STEP = 10_000
"""How many ticks the shortest period may have; more means that the periods do not fit each other."""


@dataclass(frozen=True)
class Slot:
    """A unit in the schedule: it steps every `every` ticks, by `period` seconds (rounded once)."""

    unit: str
    every: int
    period: float


class Schedule:
    """The grid, and the units in the order in which they step at one communication point.

    A tick is the greatest common divisor of the units' periods; times are tick counts, so they do not drift. Sampled
    units stand in `sampled`: at a communication point t they turn the values at t into further values at t. The others
    stand in `continuous`: they go from t to t + period. A command therefore acts in the step that follows the picture
    it was made from.

    Within each of the two a unit comes after those whose outputs have direct feedthrough to its own, else
    units keep the order in which they were added. Units in an algebraic loop make a `Group` and stand side by side; an
    algorithm may solve it. Feedthrough that an FMU does not declare is presumed, but where presumed feedthrough would
    close a loop it is left out of account. Units may need each other's outputs in a cycle that is no loop, as each
    output can be worked out after others: one of them then gets former values. Both are told in the log.

    Attributes:
        loops: the algebraic loops.
        initial_passes: how often to go through all units in order until all values at the start are worked out.

    Raises:
        ScheduleError: periods have no common communication step.
    """

    def __init__(self, system: System) -> None:
        units = list(system.units.values())
        self.tick = _common_divisor(units)
        self.loops: list[AlgebraicLoop] = []
        self.initial_passes = 1
        self.sampled_groups = self._groups(system, [u for u in units if u.sampled])
        self.continuous_groups = self._groups(system, [u for u in units if not u.sampled])
        self.sampled = self._slots(system, self.sampled_groups)
        self.continuous = self._slots(system, self.continuous_groups)

    @property
    def groups(self) -> tuple[Group, ...]:
        """All units in the order of `slots`, those of algebraic loops together."""
        return self.continuous_groups + self.sampled_groups

    @property
    def slots(self) -> tuple[Slot, ...]:
        """All units in an order in which their outputs can be worked out at the start."""
        return self.continuous + self.sampled

    def time(self, ticks: int) -> float:
        """Return the time after so many ticks, rounded once."""
        return ticks * self.tick.numerator / self.tick.denominator

    def ticks(self, duration: Fraction) -> int:
        """Return the number of whole ticks in a duration, rounded up."""
        return math.ceil(duration / self.tick)

    def _groups(self, system: System, units: Sequence[PlacedUnit]) -> tuple[Group, ...]:
        names = [u.name for u in units]
        loops = algebraic_loops(system, names)
        self.loops += loops
        sources = {n: {port: source.unit for port, source in system.sources_of(n).items()} for n in names}
        declared = {u.name: _feeding_through(sources[u.name], u.description.feedthrough) for u in units}
        presumed = {u.name: _feeding_through(sources[u.name], u.description.presumed_feedthrough) for u in units}
        groups = groups_of_loops(names, loops)

        def units_of(waits: set[int], needed: Mapping[str, set[str]], group: int) -> str:
            needs = {n for name in groups[group].units for n in needed[name]}
            return ", ".join(sorted(n for i in waits for n in groups[i].units if n in needs))

        def log_presumed(group: int, waits: set[int]) -> None:
            names, others = ", ".join(groups[group].units), units_of(waits, presumed, group)
            _log.warning("%s does not declare its direct feedthrough; it gets the former values of %s", names, others)

        def log_declared(group: int, waits: set[int]) -> None:
            late = {n for i in waits for n in groups[i].units}
            ports = [(n, port) for n in groups[group].units for port in _feedthrough_ports(system.units[n])]
            self.initial_passes += sum(sources[n].get(port) in late for n, port in ports)
            names, others = ", ".join(groups[group].units), units_of(waits, declared, group)
            _log.warning(
                "%s steps first where units wait for each other; it gets the former values of %s", names, others
            )

        return tuple(in_order(groups, declared, presumed, log_presumed, log_declared))

    def _slots(self, system: System, groups: Sequence[Group]) -> tuple[Slot, ...]:
        periods = {n: system.units[n].period for group in groups for n in group.units}
        return tuple(Slot(n, int(period / self.tick), float(period)) for n, period in periods.items())


def _common_divisor(units: Sequence[PlacedUnit]) -> Fraction:
    if not units:
        return Fraction(1)
    denominator = math.lcm(*(u.period.denominator for u in units))
    tick = Fraction(math.gcd(*(int(u.period * denominator) for u in units)), denominator)
    if tick * _MAX_TICKS_PER_STEP < min(u.period for u in units):
        text = ", ".join(f"{u.name} {u.period} s" for u in units)
        raise ScheduleError(f"the communication steps of these units have no common communication step: {text}")
    return tick


def _feedthrough_ports(unit: PlacedUnit) -> set[str]:
    return {u for us in unit.description.feedthrough.values() for u in us}


def _feeding_through(sources: Mapping[str, str], feedthrough: Mapping[str, Collection[str]]) -> set[str]:
    """Return the units that feed inputs with direct feedthrough to outputs."""
    acting = {u for us in feedthrough.values() for u in us}
    return {unit for port, unit in sources.items() if port in acting}
