"""Units that have to be stepped together, because they act on each other in a circle."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.algebraic_loop import AlgebraicLoop
from handover.cosim.ordering import Needs, Told, ordered, strongly_connected
from handover.cosim.system import Connection, System


@dataclass(frozen=True)
class Group:
    """A unit by itself, or the units of a circle in an order in which few connections lead back.

    Attributes:
        units: their names.
        circle: the connections that make the circle; a unit by itself has none.
        told: the algebraic loops among them, spelled out; empty if there is none.
    """

    units: tuple[str, ...]
    circle: tuple[Connection, ...] = ()
    told: str = ""

    def back(self, units: Collection[str]) -> list[Connection]:
        """Return the circle's connections that lead back when only some of its units step, one after another."""
        place = {name: i for i, name in enumerate(self.units) if name in units}
        inside = [c for c in self.circle if c.source.unit in place and c.target.unit in place]
        return [c for c in inside if place[c.source.unit] >= place[c.target.unit]]


def groups_of_loops(units: Sequence[str], loops: Sequence[AlgebraicLoop]) -> list[Group]:
    """Return the units, those of a loop together, and those of loops that share a unit."""
    return _groups(units, [c for loop in loops for c in loop.connections], loops)


def groups_of_data_flow(system: System, units: Sequence[str], loops: Sequence[AlgebraicLoop]) -> list[Group]:
    """Return the units, those together that are connected in a circle, in an order in which the data flow.

    Values of one instant are needed: units of different periods, whose steps end at different times, make a circle only
    where they are in an algebraic loop; else they get each other's newest values.
    """
    period: Mapping[str, Fraction] = {n: system.units[n].period for n in units}
    flow = [c for c in system.connections if c.source.unit in period and c.target.unit in period]
    looped = {c for loop in loops for c in loop.connections}
    together = [c for c in flow if period[c.source.unit] == period[c.target.unit] or c in looped]
    groups = _groups(units, together, loops)
    return in_order(groups, _needs(units, together), _needs(units, flow), _silent, _silent)


def in_order(
    groups: Sequence[Group], firm: Needs[str], soft: Needs[str], told_soft: Told[int], told_firm: Told[int]
) -> list[Group]:
    """Order groups by what their units need of each other's; see `ordered`, which tells of groups by their index."""
    place = {name: i for i, group in enumerate(groups) for name in group.units}

    def lifted(needs: Needs[str], i: int) -> set[int]:
        names = groups[i].units
        others = {place[n] for name in names for n in needs.get(name, ()) if n in place}
        return others if len(names) == 1 and not groups[i].circle else others - {i}

    firm_groups = {i: lifted(firm, i) - {i} for i in range(len(groups))}
    soft_groups = {i: lifted(soft, i) for i in range(len(groups))}
    return [groups[i] for i in ordered(firm_groups, soft_groups, told_soft, told_firm)]


def _groups(units: Sequence[str], connections: Sequence[Connection], loops: Sequence[AlgebraicLoop]) -> list[Group]:
    needs = _needs(units, connections)
    sets = strongly_connected(needs)
    place = {n: i for i, names in enumerate(sets) for n in names}
    circles: dict[int, list[Connection]] = {i: [] for i in range(len(sets))}
    for c in connections:
        if place[c.source.unit] == place[c.target.unit]:
            circles[place[c.source.unit]].append(c)
    told: dict[int, str] = {}
    for loop in loops:
        i = place.get(loop.units[0], -1)
        told[i] = f"{told[i]}; {loop.told}" if i in told else loop.told
    orders = [_easily_ordered(names, needs) for names in sets]
    return [Group(tuple(order), tuple(circles[i]), told.get(i, "")) for i, order in enumerate(orders)]


def _easily_ordered(names: Sequence[str], needs: Needs[str]) -> list[str]:
    return ordered(dict.fromkeys(names, ()), needs, _silent, _silent)


def _needs(units: Sequence[str], connections: Sequence[Connection]) -> dict[str, set[str]]:
    needs: dict[str, set[str]] = {n: set() for n in units}
    for c in connections:
        needs[c.target.unit].add(c.source.unit)
    return needs


def _silent(_chosen: object, _waits: object) -> None:
    """Say nothing."""
