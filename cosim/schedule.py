"""When each unit steps and in which order: whole ticks of one exact grid, what is sampled before what goes on."""

import logging
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from cosim.exceptions import ScheduleError
from cosim.system import PlacedUnit, System

_log = logging.getLogger(__name__)

_FINEST = 10_000
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
    it was made from. Within each group a unit comes after those whose outputs act on its own at once (direct
    feedthrough), else units keep the order in which they were added. Feedthrough that an FMU does not declare is
    presumed, but where presumed feedthrough would close a loop it is left out of account, with a line in the log.

    Raises:
        ScheduleError: units depend on each other at once in a loop, or their periods fit no common grid.
    """

    def __init__(self, system: System) -> None:
        units = list(system.units.values())
        self.tick = _common_divisor(units)
        self.sampled = self._slots(system, [u for u in units if u.sampled])
        self.continuous = self._slots(system, [u for u in units if not u.sampled])

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

    def _slots(self, system: System, units: Sequence[PlacedUnit]) -> tuple[Slot, ...]:
        declared = {u.name: _sources(system, u, u.description.feedthrough) for u in units}
        presumed = {u.name: _sources(system, u, u.description.presumed_feedthrough) for u in units}
        periods = {u.name: u.period for u in units}
        return tuple(Slot(n, int(periods[n] / self.tick), float(periods[n])) for n in _ordered(declared, presumed))


def _common_divisor(units: Sequence[PlacedUnit]) -> Fraction:
    if not units:
        return Fraction(1)
    denominator = math.lcm(*(u.period.denominator for u in units))
    tick = Fraction(math.gcd(*(int(u.period * denominator) for u in units)), denominator)
    if tick * _FINEST < min(u.period for u in units):
        told = ", ".join(f"{u.name} {u.period} s" for u in units)
        raise ScheduleError(f"the communication steps of these units fit no common grid: {told}")
    return tick


def _sources(system: System, unit: PlacedUnit, feedthrough: Mapping[str, Collection[str]]) -> set[str]:
    acting = {u for us in feedthrough.values() for u in us}
    return {source.unit for port, source in system.sources_of(unit.name).items() if port in acting}


def _ordered(declared: Mapping[str, set[str]], presumed: Mapping[str, set[str]]) -> list[str]:
    """Order units so that each follows those it depends on; as given where nothing is said."""
    left = list(declared)
    order: list[str] = []
    while left:
        ahead = set(left)
        free = next((n for n in left if not (declared[n] | presumed[n]) & ahead), None)
        if free is None:
            free = next((n for n in left if not declared[n] & ahead), None)
            if free is not None:
                others = ", ".join(sorted(presumed[free] & ahead))
                _log.warning("%s does not declare what acts at once; it gets the former values of %s", free, others)
        if free is None:
            loop = " -> ".join(_loop(left, declared))
            raise ScheduleError(f"these units depend on each other at once (algebraic loop): {loop}")
        order.append(free)
        left.remove(free)
    return order


def _loop(names: Sequence[str], direct: Mapping[str, set[str]]) -> list[str]:
    path = [names[0]]
    while True:
        source = min(direct[path[-1]] & set(names))
        if source in path:
            return [source, *reversed(path[path.index(source) :])]
        path.append(source)
