"""Algebraic loops: outputs that act on themselves at once, through direct feedthrough and connections."""

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from handover.cosim.ordering import strongly_connected
from handover.cosim.system import Connection, PortName, System


@dataclass(frozen=True)
class AlgebraicLoop:
    """Outputs each of which depends at once on all of them, and the connections through which they do.

    A circle of connections is none as long as an output in it does not depend at once on the input that it would have
    to depend on, be it of the same unit as one that does.
    """

    outputs: tuple[PortName, ...]
    connections: tuple[Connection, ...]
    told: str
    """A shortest circle, spelled out: `a.y -> b.u, b.u acts on b.y at once, b.y -> a.u, ...`."""

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
    circles = [c for c in strongly_connected(needs) if len(c) > 1 or c[0] in needs[c[0]]]
    return [_loop(circle, ways) for circle in circles]


def _loop(circle: Sequence[PortName], ways: Mapping[PortName, Sequence[Connection]]) -> AlgebraicLoop:
    inside = set(circle)
    kept = {y: [c for c in ways[y] if c.source in inside] for y in circle}
    connections = tuple(dict.fromkeys(c for cs in kept.values() for c in cs))
    shortest = _shortest(circle[0], kept)
    told = ", ".join(f"{c.source} -> {c.target}, {c.target} acts on {y} at once" for c, y in shortest)
    more = len(connections) - len({c for c, _ in shortest})
    if more:
        told += f" (and {more} more connection{'s' if more > 1 else ''} between these outputs and inputs)"
    return AlgebraicLoop(tuple(circle), connections, told)


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
