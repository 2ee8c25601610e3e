"""Algebraic loops of ports, the groups of units that have to be stepped together, and whether they can be solved.

An algebraic loop is a cycle of outputs that depend on themselves through direct feedthrough and connections, at one
instant. An output whose FMU declares no dependencies is taken to depend on all inputs, as the standards say, so loops
may be presumed, too. An algorithm that iterates works on groups of units: those of a loop, or all that are connected in
a cycle. `check_loops` and `check_cycles` reject what an algorithm cannot solve, before any unit is loaded.

The schedule's graph algorithms, topological order and strongly connected components, work on units, ports and groups of
units alike, which they call items.
"""

import heapq
from collections import defaultdict, deque
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import ScheduleError, counted
from handover.cosim.fmu.file.description import FmuDescription
from handover.cosim.system.system import Connection, PortName, System

T = TypeVar("T", bound=Hashable)

Needs = Mapping[T, Collection[T]]
"""The items that each item needs; needed items that are no keys are ignored."""

_DescribeWait = Callable[[T, set[T]], None]
"""Called for an item that is placed before others that it needs, with those others."""


def strongly_connected(needs: Needs[T]) -> list[list[T]]:
    """Return the strongly connected components: sets of items that need each other; each in the order given.

    Tarjan's algorithm, without recursion: systems have more units than Python has stack.
    """
    found: dict[T, int] = {}  # when each item was found
    lowest: dict[T, int] = {}  # the earliest item on the path that an item leads back to
    component: dict[T, T] = {}  # by item, the item at which its component was closed
    open_items: list[T] = []  # items of no component yet, as they were found
    for start in needs:
        if start in found:
            continue
        path: list[tuple[T, Iterator[T]]] = [(start, iter(needs[start]))]
        found[start] = lowest[start] = len(found)
        open_items.append(start)
        while path:
            item, others = path[-1]
            for other in others:
                if other not in found:
                    if other in needs:
                        found[other] = lowest[other] = len(found)
                        open_items.append(other)
                        path.append((other, iter(needs[other])))
                        break
                elif other not in component and found[other] < lowest[item]:
                    lowest[item] = found[other]
            else:
                path.pop()
                if path and lowest[item] < lowest[path[-1][0]]:
                    lowest[path[-1][0]] = lowest[item]
                while lowest[item] == found[item] and item not in component:
                    component[open_items.pop()] = item
    members: dict[T, list[T]] = defaultdict(list)
    for item in needs:
        members[component[item]].append(item)
    return list(members.values())


def ordered(
    firm: Needs[T], soft: Needs[T], describe_soft: _DescribeWait[T], describe_firm: _DescribeWait[T]
) -> list[T]:
    """Order the keys of `firm` so that each follows those that it needs; otherwise in the order given.

    Where needs form a cycle, it is broken at a soft need if there is one, else at a firm need of a cycle that does not
    wait for anything outside of it. The callbacks are called for each item at which a cycle was broken.
    """
    rank = {name: i for i, name in enumerate(firm)}
    waits_firm = {n: {m for m in firm[n] if m in rank} for n in rank}
    waits_soft = {n: {m for m in soft.get(n, ()) if m in rank} - waits_firm[n] for n in rank}
    followers: dict[T, list[T]] = defaultdict(list)
    for n in rank:
        for m in waits_firm[n] | waits_soft[n]:
            followers[m].append(n)
    ready = [(rank[n], n) for n in rank if not waits_firm[n] and not waits_soft[n]]
    left = dict.fromkeys(rank)
    order: list[T] = []
    while left:
        if ready:
            _, chosen = heapq.heappop(ready)
        elif (free := next((n for n in left if not waits_firm[n]), None)) is not None:
            chosen = free
            describe_soft(chosen, waits_soft[chosen])
        else:
            chosen = _blocked_by_its_cycle({n: waits_firm[n] for n in left})
            describe_firm(chosen, waits_firm[chosen])
        del left[chosen]
        order.append(chosen)
        for n in followers[chosen]:
            waits_firm[n].discard(chosen)
            waits_soft[n].discard(chosen)
            if n in left and not waits_firm[n] and not waits_soft[n]:
                heapq.heappush(ready, (rank[n], n))
    return order


def _blocked_by_its_cycle(waits: Needs[T]) -> T:
    cycles = strongly_connected(waits)
    return next(c[0] for c in cycles if all(set(waits[n]) <= set(c) for n in c))


@dataclass(frozen=True)
class AlgebraicLoop:
    """Outputs that all depend on each other by direct feedthrough, and the connections through which they do.

    A cycle of connections is not an algebraic loop if one output in it has no direct feedthrough from the input that is
    part of the cycle, even if another output of the same unit has.
    """

    outputs: tuple[PortName, ...]
    connections: tuple[Connection, ...]
    message: str
    """A shortest cycle, spelled out: `a.y -> b.u, b.u feeds through to b.y, b.y -> a.u, ...`."""
    is_presumed: bool = False
    """Whether it is one only if all outputs depend on all inputs of units that do not declare it."""

    @property
    def units(self) -> tuple[str, ...]:
        """The units that it runs through."""
        return tuple(dict.fromkeys(p.unit for p in self.outputs))


Feeding = Mapping[PortName, Sequence[Connection]]
"""By output, the connections into inputs that feed through to it."""


def declared_loops(system: System, units: Collection[str]) -> list[AlgebraicLoop]:
    """Return the loops among some of a system's units by what their FMUs declare."""
    return _loops(_feeding(system, units, _declared), frozenset())


def solved_loops(
    system: System, units: Collection[str], *, initial: bool
) -> tuple[list[AlgebraicLoop], list[AlgebraicLoop]]:
    """Return the loops that are to be solved among some of a system's units, and presumed ones that cannot be.

    Presumed feedthrough counts where its signal is real; of others nothing can be iterated. At the start (`initial`)
    all loops can be solved; at the steps, presumed ones with a unit that cannot roll back are not, but what is declared
    of them is.
    """
    declared = _feeding(system, units, _declared_initially if initial else _declared)
    presumed = _feeding(system, units, _presumed_initially if initial else _presumed)
    real = {y: [c for c in cs if _kind(system, c) is Kind.REAL and c not in declared[y]] for y, cs in presumed.items()}
    if not any(real.values()):
        return _loops(declared, frozenset()), []
    doubtful = frozenset((c.target, y) for y, cs in real.items() for c in cs)
    solved: list[AlgebraicLoop] = []
    unsolved: list[AlgebraicLoop] = []
    for loop in _loops({y: [*declared[y], *real[y]] for y in declared}, doubtful):
        if not loop.is_presumed or initial or not _stateless(system, loop.units):
            solved.append(loop)
        else:
            unsolved.append(loop)
            solved += _loops({y: declared[y] for y in loop.outputs}, frozenset())
    return solved, unsolved


def _declared(d: FmuDescription) -> Mapping[str, tuple[str, ...]]:
    return d.feedthrough


def _presumed(d: FmuDescription) -> Mapping[str, tuple[str, ...]]:
    return d.presumed_feedthrough


def _declared_initially(d: FmuDescription) -> Mapping[str, tuple[str, ...]]:
    return d.initial_feedthrough


def _presumed_initially(d: FmuDescription) -> Mapping[str, tuple[str, ...]]:
    return d.presumed_initial_feedthrough


def _feeding(
    system: System, units: Collection[str], feedthrough: Callable[[FmuDescription], Mapping[str, tuple[str, ...]]]
) -> dict[PortName, list[Connection]]:
    inside = set(units)
    by_target = {c.target: c for c in system.connections if c.source.unit in inside}
    feeding: dict[PortName, list[Connection]] = {}
    for name in units:
        d = system.units[name].description
        through = feedthrough(d)
        for y in d.outputs:
            inputs = [PortName(name, u) for u in through.get(y, ())]
            feeding[PortName(name, y)] = [by_target[u] for u in inputs if u in by_target]
    return feeding


def _loops(feeding: Feeding, doubtful: Collection[tuple[PortName, PortName]]) -> list[AlgebraicLoop]:
    """Return the loops; those that need one of the doubtful pairs of an input and an output are presumed."""
    needs = {y: [c.source for c in cs] for y, cs in feeding.items()}
    cycles = [c for c in strongly_connected(needs) if len(c) > 1 or c[0] in needs[c[0]]]
    return [_loop(cycle, feeding, doubtful) for cycle in cycles]


def _loop(
    cycle: Sequence[PortName], feeding: Feeding, doubtful: Collection[tuple[PortName, PortName]]
) -> AlgebraicLoop:
    inside = set(cycle)
    kept = {y: [c for c in feeding[y] if c.source in inside] for y in cycle}
    connections = tuple(dict.fromkeys(c for cs in kept.values() for c in cs))
    shortest = _shortest(cycle[0], kept)
    message = ", ".join(
        f"{c.source} -> {c.target}, {c.target} {'may feed' if (c.target, y) in doubtful else 'feeds'} through to {y}"
        for c, y in shortest
    )
    more = len(connections) - len({c for c, _ in shortest})
    if more:
        message += f" (and {counted(more, 'more connection')} between these outputs and inputs)"
    is_presumed = any((c.target, y) in doubtful for y, cs in kept.items() for c in cs)
    return AlgebraicLoop(tuple(cycle), connections, message, is_presumed)


def _shortest(start: PortName, feeding: Mapping[PortName, Sequence[Connection]]) -> list[tuple[Connection, PortName]]:
    """Return a shortest path from an output back to itself: connections, each with the output that it feeds."""
    onward: dict[PortName, tuple[Connection, PortName]] = {}
    visited, queue = {start}, deque([start])
    while queue:  # breadth first and backwards, from an output to those that it depends on
        y = queue.popleft()
        for c in feeding[y]:
            if c.source == start or c.source not in visited:
                onward[c.source] = (c, y)
                visited.add(c.source)
                queue.append(c.source)
            if c.source == start:
                queue.clear()
                break
    path = [onward[start]]
    while path[-1][1] != start:
        path.append(onward[path[-1][1]])
    return path


@dataclass(frozen=True)
class Group:
    """A unit by itself, or the units of a cycle in an order in which few connections lead back.

    Attributes:
        units: their names.
        cycle: the connections that form the cycle; a unit by itself has none.
        message: the algebraic loops among them, spelled out; empty if there is none.
    """

    units: tuple[str, ...]
    cycle: tuple[Connection, ...] = ()
    message: str = ""

    def back(self, units: Collection[str]) -> list[Connection]:
        """Return the cycle's connections that lead back when only some of its units step, one after another."""
        position = {name: i for i, name in enumerate(self.units) if name in units}
        inside = [c for c in self.cycle if c.source.unit in position and c.target.unit in position]
        return [c for c in inside if position[c.source.unit] >= position[c.target.unit]]


def groups_of_loops(units: Sequence[str], loops: Sequence[AlgebraicLoop]) -> list[Group]:
    """Return the units, those of a loop together, and those of loops that share a unit."""
    return _groups(units, [c for loop in loops for c in loop.connections], loops)


def groups_of_data_flow(system: System, units: Sequence[str], loops: Sequence[AlgebraicLoop]) -> list[Group]:
    """Return the units in the order of the data flow, those that are connected in a cycle together.

    To iterate, units must end their steps at the same time. Units of different periods do not; they form a cycle only
    where they are in an algebraic loop, and otherwise get each other's latest values.
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
    describe_soft: _DescribeWait[int],
    describe_firm: _DescribeWait[int],
) -> list[Group]:
    """Order groups by the needs of their units, see `ordered`; the callbacks get groups by their index."""
    group_of = {name: i for i, group in enumerate(groups) for name in group.units}

    def needs_of_group(needs: Needs[str], i: int) -> set[int]:
        names = groups[i].units
        others = {group_of[n] for name in names for n in needs.get(name, ()) if n in group_of}
        return others if len(names) == 1 and not groups[i].cycle else others - {i}

    firm_groups = {i: needs_of_group(firm, i) - {i} for i in range(len(groups))}
    soft_groups = {i: needs_of_group(soft, i) for i in range(len(groups))}
    return [groups[i] for i in ordered(firm_groups, soft_groups, describe_soft, describe_firm)]


def _groups(units: Sequence[str], connections: Sequence[Connection], loops: Sequence[AlgebraicLoop]) -> list[Group]:
    needs = _needs(units, connections)
    components = strongly_connected(needs)
    component_of = {n: i for i, names in enumerate(components) for n in names}
    cycles: dict[int, list[Connection]] = {i: [] for i in range(len(components))}
    for c in connections:
        if component_of[c.source.unit] == component_of[c.target.unit]:
            cycles[component_of[c.source.unit]].append(c)
    messages: dict[int, str] = {}
    for loop in loops:
        i = component_of.get(loop.units[0], -1)
        messages[i] = f"{messages[i]}; {loop.message}" if i in messages else loop.message
    orders = [_softly_ordered(names, needs) for names in components]
    return [Group(tuple(order), tuple(cycles[i]), messages.get(i, "")) for i, order in enumerate(orders)]


def _softly_ordered(names: Sequence[str], needs: Needs[str]) -> list[str]:
    """Order units of a cycle by their needs as far as that is possible: none of the needs is firm."""
    return ordered(dict.fromkeys(names, ()), needs, _silent, _silent)


def _needs(units: Sequence[str], connections: Sequence[Connection]) -> dict[str, set[str]]:
    needs: dict[str, set[str]] = {n: set() for n in units}
    for c in connections:
        needs[c.target.unit].add(c.source.unit)
    return needs


def _silent(_item: object, _waits: object) -> None:
    """Report nothing about a broken cycle."""


_REMEDIES = (
    "remedies: units that save their state (canGetAndSetFMUState) in their place, or a unit in the loop whose output "
    "has no direct feedthrough, which delays it by a step"
)


def check_loops(system: System, loops: Sequence[AlgebraicLoop]) -> None:
    """Check that algebraic loops can be solved: their signals are real, and units can roll back a step.

    Args:
        system: one whose wiring is valid.
        loops: its declared loops.

    Raises:
        ScheduleError: with all loops that cannot be solved, each spelled out, and the remedies.
    """
    faults = [(loop, fault) for loop in loops if (fault := _fault(system, loop))]
    if not faults:
        return
    lines = "".join(f"\n  - {loop.message}: {fault}" for loop, fault in faults)
    n = counted(len(faults), "algebraic loop")
    raise ScheduleError(f"{n} cannot be solved (outputs depend on themselves by direct feedthrough):{lines}")


def unsolved_text(system: System, loop: AlgebraicLoop) -> str:
    """Return what a presumed loop that cannot be solved at the steps means, for the log."""
    stateless = _stateless(system, loop.units)
    return (
        "there may be an algebraic loop, as outputs without declared dependencies depend on all inputs: "
        f"{loop.message}. It is solved at the start, but not at the steps: {_unable(stateless)}. If it is one, a unit "
        "in it gets values of the step before: signals are late by a step, and may grow without bound if it amplifies"
    )


def check_cycles(system: System, groups: Sequence[Group], others: Sequence[str]) -> None:
    """Check that all units which are connected in a cycle can roll back a step; `others` are the way out.

    Raises:
        ScheduleError: with all units that cannot.
    """
    cycles = [group for group in groups if group.cycle]
    faults = [(group, stateless) for group in cycles if (stateless := _stateless(system, group.units))]
    if not faults:
        return
    lines = "".join(f"\n  - {', '.join(names)} (connected in a cycle: {_list(g.units)})" for g, names in faults)
    raise ScheduleError(
        "iterating rolls steps back, which needs units that save their state (canGetAndSetFMUState), but these "
        f"do not:{lines}\n  {' and '.join(others)} need no rollback, but for algebraic loops"
    )


def _fault(system: System, loop: AlgebraicLoop) -> str | None:
    kinds = [(c, _kind(system, c)) for c in loop.connections]
    not_real = [f"{c.source} is {kind.value}" for c, kind in kinds if kind is not Kind.REAL]
    if not_real:
        return (
            f"only real signals can be iterated, but {', '.join(not_real)}; remedy: a unit in between that delays one"
        )
    stateless = _stateless(system, loop.units)
    return f"{_unable(stateless)}; {_REMEDIES}" if stateless else None


def _kind(system: System, c: Connection) -> Kind:
    return system.units[c.source.unit].description.outputs[c.source.port].kind


def _unable(stateless: Sequence[str]) -> str:
    verb = "do not save their states" if len(stateless) > 1 else "does not save its state"
    return f"{', '.join(stateless)} {verb}, so a step cannot be rolled back"


def _stateless(system: System, units: Sequence[str]) -> list[str]:
    return [name for name in units if not system.units[name].description.capabilities.saves_state]


def _list(units: Sequence[str]) -> str:
    return ", ".join(units[:12]) + (f" and {len(units) - 12} more" if len(units) > 12 else "")
