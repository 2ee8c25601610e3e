"""When each unit steps and in which order: whole ticks of one exact grid, feedthrough before what integrates."""

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from cosim.exceptions import ScheduleError
from cosim.system import PlacedUnit, System


class Algorithm(enum.Enum):
    """How units that are due at the same time get their inputs.

    JACOBI: all from the values at that time. GAUSS_SEIDEL: one after another, each from the newest values.
    """

    JACOBI = "jacobi"
    GAUSS_SEIDEL = "gauss-seidel"


@dataclass(frozen=True)
class Slot:
    """A unit in the schedule: it steps every `every` ticks, by `period` seconds."""

    unit: str
    every: int
    period: Fraction


class Schedule:
    """The grid, and the units in the order in which they step at one communication point.

    A tick is the greatest common divisor of the units' periods; times are tick counts, so they do not drift. Units with
    direct feedthrough (sampled sensors, controllers) stand in `algebraic`, each after those that it depends on: they
    turn the values at t into further values at t. The others stand in `integrating` in the order in which they were
    added: they go from t to t + period. A command therefore acts in the step that follows the picture it was made from.

    Raises:
        ScheduleError: units depend on each other at once in a loop; the message spells the loop out.
    """

    def __init__(self, system: System, algorithm: Algorithm = Algorithm.GAUSS_SEIDEL) -> None:
        units = list(system.units.values())
        self.algorithm = algorithm
        self.tick = _common_divisor([u.period for u in units])
        direct = {u.name: _direct_sources(system, u) for u in units}
        order = _ordered([u.name for u in units if u.description.feedthrough], direct)
        slots = {u.name: Slot(u.name, int(u.period / self.tick), u.period) for u in units}
        self.algebraic: tuple[Slot, ...] = tuple(slots[name] for name in order)
        self.integrating: tuple[Slot, ...] = tuple(slots[u.name] for u in units if u.name not in order)

    @property
    def slots(self) -> tuple[Slot, ...]:
        """All units, those with feedthrough first."""
        return self.algebraic + self.integrating

    def time(self, ticks: int) -> float:
        """Return the time after so many ticks, rounded once."""
        return ticks * self.tick.numerator / self.tick.denominator

    def ticks(self, duration: Fraction) -> int:
        """Return the number of whole ticks in a duration, rounded up."""
        return math.ceil(duration / self.tick)


def _common_divisor(periods: Sequence[Fraction]) -> Fraction:
    denominator = math.lcm(*(p.denominator for p in periods))
    return Fraction(math.gcd(*(int(p * denominator) for p in periods)), denominator)


def _direct_sources(system: System, unit: PlacedUnit) -> set[str]:
    acting = {u for us in unit.description.feedthrough.values() for u in us}
    return {source.unit for port, source in system.sources_of(unit.name).items() if port in acting}


def _ordered(names: Sequence[str], direct: dict[str, set[str]]) -> list[str]:
    """Order units so that each follows those it depends on; as given where nothing is said."""
    left = list(names)
    order: list[str] = []
    while left:
        free = next((n for n in left if not direct[n] & set(left)), None)
        if free is None:
            loop = " -> ".join(_loop(left, direct))
            raise ScheduleError(f"these units depend on each other at once (algebraic loop): {loop}")
        order.append(free)
        left.remove(free)
    return order


def _loop(names: Sequence[str], direct: dict[str, set[str]]) -> list[str]:
    path = [names[0]]
    while True:
        source = min(direct[path[-1]] & set(names))
        if source in path:
            return [source, *reversed(path[path.index(source) :])]
        path.append(source)
