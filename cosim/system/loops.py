"""Algebraic loops: outputs that act on themselves at once, through direct feedthrough and connections.

Units that have to be stepped together, because they act on each other in a cycle.

Refuses circles of units that an algorithm cannot solve, before anything is loaded.
"""

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import ScheduleError
from handover.cosim.system.ordering import DescribeWait, Needs, ordered, strongly_connected
from handover.cosim.system.system import Connection, PortName, System


@dataclass(frozen=True)
class AlgebraicLoop:
    """Outputs each of which depends at once on all of them, and the connections through which they do.

    A circle of connections is none as long as an output in it does not depend at once on the input that it would have
    to depend on, be it of the same unit as one that does.
    """

    outputs: tuple[PortName, ...]
    connections: tuple[Connection, ...]
    message: str
    """A shortest cycle, spelled out: `a.y -> b.u, b.u feeds through to b.y, b.y -> a.u, ...`."""

    @property
    def units(self) -> tuple[str, ...]:
        """The units that it runs through."""
        return tuple(dict.fromkeys(p.unit for p in self.outputs))


def algebraic_loops(system: System, units: Collection[str]) -> list[AlgebraicLoop]:
    """Return the loops among some of a system's units by what their FMUs declare; presumed feedthrough makes none."""
    fed = {c.target: c for c in system.connections if c.source.unit in units}
    ways: dict[PortName, list[Connection]] = {}
    for name in units:
        d = system.units[name].description
        for y in d.outputs:
            ends = [PortName(name, u) for u in d.feedthrough.get(y, ())]
            ways[PortName(name, y)] = [fed[end] for end in ends if end in fed]
    needs = {y: [c.source for c in cs] for y, cs in ways.items()}
    cycles = [c for c in strongly_connected(needs) if len(c) > 1 or c[0] in needs[c[0]]]
    return [_loop(cycle, ways) for cycle in cycles]


def _loop(cycle: Sequence[PortName], ways: Mapping[PortName, Sequence[Connection]]) -> AlgebraicLoop:
    inside = set(cycle)
    kept = {y: [c for c in ways[y] if c.source in inside] for y in cycle}
    connections = tuple(dict.fromkeys(c for cs in kept.values() for c in cs))
    shortest = _shortest(cycle[0], kept)
    text = ", ".join(f"{c.source} -> {c.target}, {c.target} acts on {y} at once" for c, y in shortest)
    more = len(connections) - len({c for c, _ in shortest})
    if more:
        text += f" (and {more} more connection{'s' if more > 1 else ''} between these outputs and inputs)"
    return AlgebraicLoop(tuple(cycle), connections, text)


def _shortest(start: PortName, ways: Mapping[PortName, Sequence[Connection]]) -> list[tuple[Connection, PortName]]:
    """Return a shortest way from an output back to itself: connections, each with the output that it acts on."""
    onward: dict[PortName, tuple[Connection, PortName]] = {}
    found, queue = {start}, deque([start])
    while queue:  # backwards, from an output to those that it depends on
        y = queue.popleft()
        for c in ways[y]:
            if c.source == start or c.source not in found:
                onward[c.source] = (c, y)
                found.add(c.source)
                queue.append(c.source)
            if c.source == start:
                queue.clear()
                break
    way = [onward[start]]
    while way[-1][1] != start:
        way.append(onward[way[-1][1]])
    return way


@dataclass(frozen=True)
class Group:
    """A unit by itself, or the units of a circle in an order in which few connections lead back.

    Attributes:
        units: their names.
        circle: the connections that make the circle; a unit by itself has none.
        told: the algebraic loops among them, spelled out; empty if there is none.
    """

    units: tuple[str, ...]
    cycle: tuple[Connection, ...] = ()
    message: str = ""

    def back(self, units: Collection[str]) -> list[Connection]:
        """Return the circle's connections that lead back when only some of its units step, one after another."""
        place = {name: i for i, name in enumerate(self.units) if name in units}
        inside = [c for c in self.cycle if c.source.unit in place and c.target.unit in place]
        return [c for c in inside if place[c.source.unit] >= place[c.target.unit]]


def groups_of_loops(units: Sequence[str], loops: Sequence[AlgebraicLoop]) -> list[Group]:
    """Return the units, those of a loop together, and those of loops that share a unit."""
    return _groups(units, [c for loop in loops for c in loop.connections], loops)


def groups_of_data_flow(system: System, units: Sequence[str], loops: Sequence[AlgebraicLoop]) -> list[Group]:
    """Return the units, those together that are connected in a cycle, in an order in which the data flow.

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
    groups: Sequence[Group],
    firm: Needs[str],
    soft: Needs[str],
    describe_soft: DescribeWait[int],
    describe_firm: DescribeWait[int],
) -> list[Group]:
    """Order groups by what their units need of each other's; see `ordered`, which tells of groups by their index."""
    place = {name: i for i, group in enumerate(groups) for name in group.units}

    def lifted(needs: Needs[str], i: int) -> set[int]:
        names = groups[i].units
        others = {place[n] for name in names for n in needs.get(name, ()) if n in place}
        return others if len(names) == 1 and not groups[i].cycle else others - {i}

    firm_groups = {i: lifted(firm, i) - {i} for i in range(len(groups))}
    soft_groups = {i: lifted(soft, i) for i in range(len(groups))}
    return [groups[i] for i in ordered(firm_groups, soft_groups, describe_soft, describe_firm)]


def _groups(units: Sequence[str], connections: Sequence[Connection], loops: Sequence[AlgebraicLoop]) -> list[Group]:
    needs = _needs(units, connections)
    sets = strongly_connected(needs)
    place = {n: i for i, names in enumerate(sets) for n in names}
    cycles: dict[int, list[Connection]] = {i: [] for i in range(len(sets))}
    for c in connections:
        if place[c.source.unit] == place[c.target.unit]:
            cycles[place[c.source.unit]].append(c)
    text: dict[int, str] = {}
    for loop in loops:
        i = place.get(loop.units[0], -1)
        text[i] = f"{text[i]}; {loop.message}" if i in text else loop.message
    orders = [_easily_ordered(names, needs) for names in sets]
    return [Group(tuple(order), tuple(cycles[i]), text.get(i, "")) for i, order in enumerate(orders)]


def _easily_ordered(names: Sequence[str], needs: Needs[str]) -> list[str]:
    return ordered(dict.fromkeys(names, ()), needs, _silent, _silent)


def _needs(units: Sequence[str], connections: Sequence[Connection]) -> dict[str, set[str]]:
    needs: dict[str, set[str]] = {n: set() for n in units}
    for c in connections:
        needs[c.target.unit].add(c.source.unit)
    return needs


def _silent(_chosen: object, _waits: object) -> None:
    """Say nothing."""


_CURE = (
    "what would help: units that save their state (canGetAndSetFMUState) in their place, the algorithm jacobi, in "
    "which every connection acts a step later, or a unit in the loop whose output has no direct feedthrough"
)


def check_loops(system: System, loops: Sequence[AlgebraicLoop], rolls_back: bool) -> None:
    """Check that algebraic loops can be solved: their signals are real, and units can roll back a step.

    Args:
        system: it has no faults of wiring.
        loops: its algebraic loops.
        rolls_back: whether loops are solved at each step, and not at the start alone.

    Raises:
        ScheduleError: with all loops that cannot be solved, each spelled out, and what would help.
    """
    faults = [(loop, fault) for loop in loops if (fault := _fault(system, loop, rolls_back))]
    if not faults:
        return
    text = "".join(f"\n  - {loop.message}: {fault}" for loop, fault in faults)
    n = f"{len(faults)} algebraic loop{'s' if len(faults) > 1 else ''}"
    raise ScheduleError(f"{n} cannot be solved (outputs depend on themselves at once):{text}")


def check_cycles(system: System, groups: Sequence[Group]) -> None:
    """Check that all units which are connected in a cycle can roll back a step.

    Raises:
        ScheduleError: with all that cannot.
    """
    cycles = [group for group in groups if group.cycle]
    faults = [(group, stateless) for group in cycles if (stateless := _stateless(system, group.units))]
    if not faults:
        return
    text = "".join(f"\n  - {', '.join(names)} (connected in a cycle: {_list(g.units)})" for g, names in faults)
    raise ScheduleError(
        "iterating rolls steps back, which takes units that save their state (canGetAndSetFMUState), but these "
        f"do not:{text}\n  gauss-seidel and jacobi do without"
    )


def _fault(system: System, loop: AlgebraicLoop, rolls_back: bool) -> str | None:
    ends = [(c, system.units[c.source.unit].description.outputs[c.source.port].kind) for c in loop.connections]
    unreal = [f"{c.source} is {kind.value}" for c, kind in ends if kind is not Kind.REAL]
    if unreal:
        return (
            f"only real signals can be iterated, but {', '.join(unreal)}; a unit in between that delays one would help"
        )
    stateless = _stateless(system, loop.units) if rolls_back else []
    if stateless:
        verb = "do not save their states" if len(stateless) > 1 else "does not save its state"
        return f"{', '.join(stateless)} {verb}, so a step cannot be rolled back; {_CURE}"
    return None


def _stateless(system: System, units: Sequence[str]) -> list[str]:
    return [name for name in units if not system.units[name].description.capabilities.saves_state]


def _list(units: Sequence[str]) -> str:
    return ", ".join(units[:12]) + (f" and {len(units) - 12} more" if len(units) > 12 else "")
