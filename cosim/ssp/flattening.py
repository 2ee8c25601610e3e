"""Flattens nested systems: which variable of which FMU feeds which, and with which values all start.

Connections of systems within systems are composed to connections from FMU to FMU, connectors are checked against the
variables of their FMUs, and all faults are collected.
"""

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from handover.cosim.blocks.units import UNKNOWN, Unit
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import MOST_FAULTS, nearest
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.ssp.connected_ports import find_entry, ports_of, settable_names, unfed, variable_names
from handover.cosim.ssp.given_parameters import put
from handover.cosim.ssp.parameter_set import SspValue
from handover.cosim.ssp.start_values import Given, chained, converted, unit_doubt
from handover.cosim.ssp.structure import SspComponent, SspConnection, SspConnector, SspElement, SspEnd, SspNestedSystem
from handover.cosim.system.conversion import LinearTransformation

_log = logging.getLogger(__name__)

Node = tuple[str, str]
"""A connector: the path of its element, empty for the outermost system, and its name."""

OUTPUT_KINDS = {"output", "calculatedParameter"}
"""Kinds of connector that a component gives values by."""

INPUT_KINDS = {"input", "parameter"}
"""Kinds of connector that a component takes values by."""

_WHOLE = (Kind.INTEGER, Kind.ENUMERATION)
_KINDS: Mapping[str, tuple[Kind, ...]] = {
    **dict.fromkeys(("Real", "Float32", "Float64"), (Kind.REAL,)),
    **dict.fromkeys(("Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))), _WHOLE),
    **{kind.value.capitalize(): (kind,) for kind in (Kind.BOOLEAN, Kind.STRING, Kind.ENUMERATION, Kind.BINARY)},
}
"""What a connector's type may be in an FMU."""


@dataclass(frozen=True)
class Fed:
    """What feeds a connector, by which connection."""

    source: Node
    by: SspConnection


@dataclass(frozen=True)
class FlatConnection:
    """A variable that feeds another. `linear` replaces a conversion of units; None leaves that to the master."""

    source: Node
    target: Node
    linear: LinearTransformation | None
    where: str


@dataclass
class FlatSystem:
    """Components by path, connections between their variables, and values for variables by component and name.

    `values_of_systems` are those of systems' own connectors; `tolerated` is what is not as it should be.
    """

    components: Mapping[str, SspComponent]
    connections: list[FlatConnection] = field(default_factory=list[FlatConnection])
    given: dict[str, dict[str, Given]] = field(default_factory=dict[str, dict[str, Given]])
    faults: list[str] = field(default_factory=list[str])
    tolerated: list[str] = field(default_factory=list[str])
    values_of_systems: dict[Node, SspValue] = field(default_factory=dict[Node, SspValue])


def components_of(system: SspNestedSystem, path: str = "") -> Iterator[tuple[str, SspComponent]]:
    """Yield the components of a system and of the systems in it, each with its path, such as `arm.joint`."""
    for element in system.elements.values():
        here = _join(path, element.name)
        if isinstance(element, SspComponent):
            yield here, element
        else:
            yield from components_of(element, here)


def flatten(
    system: SspNestedSystem,
    descriptions: Mapping[str, FmuDescription],
    asked: Mapping[Node, SspValue] = MappingProxyType({}),
) -> FlatSystem:
    """Return a system's components, connections and start values; all that is wrong is in `faults`.

    The values of `asked` come before those that the file gives.
    """
    return _Flattening(system, descriptions, asked).flat


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


class _Flattening:
    def __init__(
        self,
        system: SspNestedSystem,
        descriptions: Mapping[str, FmuDescription],
        asked: Mapping[Node, SspValue],
    ) -> None:
        self._descriptions = descriptions
        self._connectors: dict[Node, SspConnector] = {}
        self._fed: dict[Node, Fed] = {}
        self._values: dict[Node, SspValue] = {}
        self.flat = FlatSystem(dict(components_of(system)))
        self._paths = set[str]()
        self._left_out = 0
        self._enter(system, "")
        if (more := self._left_out - MOST_FAULTS) > 0:
            _log.warning("and %s more values are left out", f"{more:,}")
        self._values |= {node: value for node, value in asked.items() if node[0] not in descriptions}
        passed_on = {fed.source for fed in self._fed.values()}
        for target in self._fed:
            if target not in passed_on:
                self._follow(target)
        for (path, name), value in self._values.items():
            if path in descriptions:
                self.flat.given.setdefault(path, {}).setdefault(name, Given(value))
        for (path, name), value in asked.items():
            entry = find_entry(unfed(descriptions[path]), name) if path in descriptions else None
            if entry is not None:
                put(self.flat.given.setdefault(path, {}), entry, name, value)
        self.flat.values_of_systems = {node: v for node, v in self._values.items() if node[0] not in descriptions}

    def _enter(self, system: SspNestedSystem, path: str) -> None:
        self._connectors |= {(path, c.name): c for c in system.connectors.values()}
        for element in system.elements.values():
            here = _join(path, element.name)
            if here in self._paths:
                twice = f"two elements are called {here!r}, with the systems they are in"
                self.flat.faults.append(element.where + twice)
            self._paths.add(here)
            if isinstance(element, SspNestedSystem):
                self._enter(element, here)
            else:
                self._connectors |= {(here, c.name): c for c in element.connectors.values()}
                self.flat.faults += _connector_faults(element, here, self._descriptions[here])
                self.flat.tolerated += _connector_doubts(element, here, self._descriptions[here])
                self._bind(element, here)
        self._bind(system, path)
        for connection in system.connections:
            self._connect(system, path, connection)

    def _bind(self, element: SspElement, path: str) -> None:
        """Apply an element's bindings; bindings further out, and later ones, replace earlier ones."""
        for binding in element.bindings:
            for name, value in binding.items():
                if not self._assign(element, path, name, value):
                    self._left_out += 1
                    if self._left_out > MOST_FAULTS:
                        continue
                    near = nearest(name, self._names(element, path))
                    what = f"{path or element.name} has nothing called {name!r} that can be set"
                    _log.warning("%s%s; its value is left out%s", value.where, what, near and f"; {near}")

    def _assign(self, element: SspElement, path: str, name: str, value: SspValue) -> bool:
        """Give a value to a name as seen from an element; return False if there is none of that name."""
        if isinstance(element, SspComponent):
            assigned = find_entry(self._descriptions[path].settable, name) is not None
        else:
            assigned = name in element.connectors
        if assigned:
            self._values[path, name] = value
        for child in element.elements.values() if isinstance(element, SspNestedSystem) else ():
            if name.startswith(f"{child.name}."):
                rest = name.removeprefix(f"{child.name}.")
                assigned = self._assign(child, _join(path, child.name), rest, value) or assigned
        return assigned

    def _names(self, element: SspElement, path: str) -> Iterator[str]:
        """Yield the names that values can be given to, as seen from an element."""
        if isinstance(element, SspComponent):
            yield from settable_names(self._descriptions[path])
        else:
            yield from element.connectors
        for child in element.elements.values() if isinstance(element, SspNestedSystem) else ():
            yield from (f"{child.name}.{name}" for name in self._names(child, _join(path, child.name)))

    def _connect(self, system: SspNestedSystem, path: str, connection: SspConnection) -> None:
        ends = [(end, self._end(system, path, end, connection)) for end in (connection.start, connection.end)]
        nodes = [node for _, node in ends if node is not None]
        if len(nodes) < 2:
            return
        gives = [self._gives(end, node) for (end, _), node in zip(ends, nodes, strict=True)]
        where = f"{connection.where}{connection.start} - {connection.end}: "
        if None in gives:
            kind = self._connectors[nodes[gives.index(None)]].kind
            self.flat.faults.append(f"{where}connectors of kind {kind!r} cannot be connected; inputs and outputs can")
        elif gives[0] == gives[1]:
            self.flat.faults.append(
                f"{where}both ends {'give' if gives[0] else 'take'} a value; connect an output with an input"
            )
        else:
            source, target = nodes if gives[0] else reversed(nodes)
            if target in self._fed:
                self.flat.faults.append(f"{where}{_join(*target)} is fed twice")
            self._fed[target] = Fed(source, connection)

    def _end(self, system: SspNestedSystem, path: str, end: SspEnd, connection: SspConnection) -> Node | None:
        owner: SspElement = system
        if end.element is not None:
            if end.element not in system.elements:
                near = nearest(end.element, system.elements)
                self.flat.faults.append(f"{connection.where}there is no element {end.element!r}; {near}")
                return None
            owner = system.elements[end.element]
        if end.connector not in owner.connectors:
            near = nearest(end.connector, owner.connectors)
            self.flat.faults.append(f"{connection.where}{owner.name!r} has no connector {end.connector!r}; {near}")
            return None
        return (path if end.element is None else _join(path, owner.name)), end.connector

    def _gives(self, end: SspEnd, node: Node) -> bool | None:
        """Return whether an end is a source within its system; None where it is neither source nor sink."""
        kind = self._connectors[node].kind
        if kind not in OUTPUT_KINDS | INPUT_KINDS:
            return None
        return kind in (INPUT_KINDS if end.element is None else OUTPUT_KINDS)

    def _follow(self, target: Node) -> None:
        """Follow what feeds a connector through the systems between; add a connection if it is a component's."""
        hops: list[tuple[SspConnection, Node]] = []
        node, seen = target, set[Node]()
        while node in self._fed and (node not in seen):
            seen.add(node)
            hops.append((self._fed[node].by, node))
            node = self._fed[node].source
        where = hops[0][0].where
        if node in seen:
            self.flat.faults.append(f"{where}{_join(*target)} is fed by itself")
            return
        try:
            linear = self._composed(node, hops[::-1])
        except ValueError as e:
            self.flat.faults.append(f"{where}{_join(*node)} -> {_join(*target)}: {e}")
            return
        if target[0] not in self._descriptions:
            return
        if node[0] in self._descriptions:
            self.flat.connections.append(FlatConnection(node, target, linear, where))
        elif node in self._values:
            self.flat.given.setdefault(target[0], {})[target[1]] = Given(self._values[node], self._unit(node), linear)

    def _composed(self, source: Node, hops: list[tuple[SspConnection, Node]]) -> LinearTransformation | None:
        """Return the transformation of a value on its way; None where it is the master's own conversion of units."""
        total, unit = LinearTransformation(), self._unit(source)
        ends = self._own_unit(source), self._own_unit(hops[-1][1])
        for connection, node in hops:
            following = self._unit(node)
            doubt = unit_doubt(unit, following)
            if doubt and not connection.keeps_units and not unit_doubt(*ends):  # of which the system says so
                self.flat.tolerated.append(f"{connection.where}{connection.start} - {connection.end}: {doubt}")
            change = None if connection.keeps_units else converted(unit, following)
            total = total if change is None else chained(total, change)
            total = total if connection.linear is None else chained(total, connection.linear)
            unit = unit if following == UNKNOWN else following
        try:
            own = converted(*ends) or LinearTransformation()
        except ValueError:  # units that cannot be converted, which `suppressUnitConversion` allows
            return total
        return None if total == own else total

    def _own_unit(self, node: Node) -> Unit:
        """Return the unit that a variable has in its FMU."""
        d = self._descriptions.get(node[0])
        entry = None if d is None else find_entry(ports_of(d), node[1])
        return UNKNOWN if entry is None else entry[0].unit

    def _unit(self, node: Node) -> Unit:
        """Return the unit of a variable in its FMU, or else that of its connector."""
        own = self._own_unit(node)
        return self._connectors[node].unit if own == UNKNOWN else own


def _connector_faults(component: SspComponent, path: str, d: FmuDescription) -> list[str]:
    """Return what is wrong with the connectors of a component; `path` is its name, with those of the systems around it.

    Connectors of other kinds than inputs, outputs and parameters are not checked: they cannot be connected here.
    """
    ports = ports_of(d)
    faults: list[str] = []
    for c in component.connectors.values():
        entry = find_entry(ports, c.name)
        if entry is not None and c.kind in INPUT_KINDS | OUTPUT_KINDS:
            faults += [f"{c.where}{path}.{c.name} {fault}" for fault in _differences(c, entry[0])]
        elif c.kind in ("input", "output", "parameter"):
            near = nearest(c.name, variable_names(d)) if len(faults) < MOST_FAULTS else ""
            faults.append(f"{c.where}the FMU of {path!r} has no variable {c.name!r}; {near}")
    return faults


def _differences(c: SspConnector, port: FmuPort) -> list[str]:
    differences: list[str] = []
    if port.causality.value != c.kind:
        differences.append(f"is of kind {c.kind} here and of causality {port.causality.value} in its FMU")
    if c.type_name in _KINDS and port.kind not in _KINDS[c.type_name]:
        differences.append(f"is of type {c.type_name} here and {port.type_name} in its FMU")
    if _differ(c.unit, port.unit):
        differences.append(f"is in {c.unit.symbol} here and in {port.unit.symbol} in its FMU")
    return differences


def _connector_doubts(component: SspComponent, path: str, d: FmuDescription) -> list[str]:
    """Return of which connectors of a component the unit cannot be compared with that in its FMU."""
    ports = ports_of(d)
    known = [(c, entry[0]) for c in component.connectors.values() if (entry := find_entry(ports, c.name)) is not None]
    return [f"{c.where}{path}.{c.name}: {doubt}" for c, port in known if (doubt := unit_doubt(c.unit, port.unit))]


def _differ(a: Unit, b: Unit) -> bool:
    try:
        return converted(a, b) is not None
    except ValueError:
        return True
