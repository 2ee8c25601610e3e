"""Terminals of an FMU, from any tool: `terminalsAndIcons/terminalsAndIcons.xml` of FMI 3.0, in FMUs of either version.

The file groups variables, so that tools connect what belongs together. A run that names no terminal does without it, so
a fault in it keeps no unit from running: it is kept with the terminal, and reported where that one is to be connected.
A system connects ports, and scalars `p[1]`, `p[2]`, ... are one array port there; members that are its entries are one
member. Terminals within a terminal are named `outer.inner`: each has a rule of its own.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from handover.cosim.blocks.terminals import MatchingRule, TerminalKind, kind_fault
from handover.cosim.exceptions import InvalidFmu, nearest
from handover.cosim.fmu.file.archive import TERMINALS, FmuArchive
from handover.cosim.fmu.file.xml import UnsafeXml, XmlElement, parse_xml

if TYPE_CHECKING:
    from handover.cosim.fmu.file.description import FmuPort

_CONNECTABLE = ("input", "output", "parameter", "calculatedParameter")


@dataclass(frozen=True)
class TerminalMember:
    """A port in a terminal, with the name by which it is matched ("" in a sequence without names).

    `kind` is the standard's `variableKind`: the values of a `signal` are equal at both ends; `inflow` and `outflow` sum
    up to zero.
    """

    name: str
    port: str
    kind: str


@dataclass(frozen=True, kw_only=True)
class FmuTerminal:
    """A terminal of an FMU.

    Attributes:
        name: its name, after those of the terminals that it lies in.
        rule: how its members match; None if that is another tool's rule.
        kind: the attribute `terminalKind`, "" where there is none.
        members: its inputs and outputs, in the file's order.
        line: the line at which it begins.
        faults: how it breaks the standard.
        limits: why it cannot be connected here, although it is sound.
    """

    name: str
    rule: MatchingRule | None
    kind: str
    members: tuple[TerminalMember, ...]
    line: int
    faults: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """Why it cannot be connected; empty if it can."""
        return "; ".join((*self.faults, *self.limits))

    @property
    def where(self) -> str:
        """Name and line, for messages."""
        return f"terminal {self.name!r} (line {self.line})"


@dataclass(frozen=True)
class Terminals:
    """All terminals of an FMU by name, and why the whole file cannot be read ("" if it can, or if there is none)."""

    by_name: Mapping[str, FmuTerminal] = field(default_factory=dict[str, FmuTerminal])
    fault: str = ""


def read_terminals(archive: FmuArchive, causalities: Mapping[str, str], ports: "Mapping[str, FmuPort]") -> Terminals:
    """Read an FMU's terminals.

    Args:
        archive: the FMU.
        causalities: of all variables of its model description, by name.
        ports: its inputs and outputs by name, with scalars grouped to arrays.
    """
    if TERMINALS not in archive.names:
        return Terminals()
    try:
        root = parse_xml(archive.read(TERMINALS))
    except (UnsafeXml, InvalidFmu) as e:
        return Terminals(fault=f"its {TERMINALS} cannot be read: {e}")
    if root.tag != "fmiTerminalsAndIcons":
        return Terminals(fault=f"its {TERMINALS} begins with <{root.tag[:80]}>; it must be <fmiTerminalsAndIcons>")
    reader = _Reader(causalities, ports)
    found: dict[str, FmuTerminal] = {}
    for t in (t for group in root.named("Terminals") for t in reader.terminals(group, "")):
        if t.name in found:
            first = found[t.name]
            twice = f"there are two of this name, at the lines {first.line} and {t.line}: names are unique"
            found[t.name] = replace(first, faults=(*first.faults, twice))
        else:
            found[t.name] = t
    return Terminals(found)


class _Reader:
    """Reads the terminals of one file."""

    def __init__(self, causalities: Mapping[str, str], ports: "Mapping[str, FmuPort]") -> None:
        self._causalities, self._ports = causalities, ports
        self._entries = {
            entry: (port.name, i) for port in ports.values() for i, entry in enumerate(port.entry_names)
        }  # of each variable the port, and which of its entries it is

    def terminals(self, parent: XmlElement, outer: str) -> Iterator[FmuTerminal]:
        """Yield the terminals in an element, and those in them."""
        for element in parent.named("Terminal"):
            name = f"{outer}{element.get('name')}"
            yield self._terminal(element, name)
            yield from self.terminals(element, f"{name}.")

    def _terminal(self, element: XmlElement, name: str) -> FmuTerminal:
        rule = next((r for r in MatchingRule if r.value == element.get("matchingRule")), None)
        listed = list(element.named("TerminalMemberVariable"))
        faults = [f for member in listed if (f := self._fault(member, rule))]
        if rule is not MatchingRule.SEQUENCE:
            faults += [f"{twice}: it must be unique" for twice in _twice(listed, "memberName")]
        limits = [*_twice(listed, "variableName")]
        if rule is None:
            limits.append(f"its matching rule is {element.get('matchingRule')!r}; plug, bus and sequence are known")
        if next(element.named("TerminalStreamMemberVariable"), None) is not None:
            limits.append("it has stream variables: connect their ports one by one")
        members: list[TerminalMember] = []
        if not faults and not limits:
            members, more = self._members(listed)
            limits += more
        kind = TerminalKind.of_standard_name(element.get("terminalKind"))
        if kind is not None and not faults and not limits:
            fault = kind_fault(kind, [self._ports[m.port] for m in members])
            faults += [fault] if fault else []
        return FmuTerminal(
            name=name,
            rule=rule,
            kind=element.get("terminalKind"),
            members=tuple(members),
            line=element.line,
            faults=tuple(faults),
            limits=tuple(limits),
        )

    def _fault(self, member: XmlElement, rule: MatchingRule | None) -> str:
        variable = member.get("variableName")
        if variable not in self._causalities:
            return f"there is no variable {variable!r} (line {member.line}); {nearest(variable, self._causalities)}"
        if self._causalities[variable] not in _CONNECTABLE:
            return f"{variable!r} is {self._causalities[variable]}; its members are inputs, outputs and parameters"
        if rule in (MatchingRule.PLUG, MatchingRule.BUS) and not member.get("memberName"):
            return f"{variable!r} has no memberName, by which a {rule.value} is matched"
        return ""

    def _members(self, listed: list[XmlElement]) -> tuple[list[TerminalMember], list[str]]:
        """Return a terminal's ports, and which of them are there in part only; parameters are not connected."""
        parts: dict[str, list[tuple[int, str, str]]] = defaultdict(list)
        for member in listed:
            if self._causalities[member.get("variableName")] not in ("input", "output"):
                continue
            variable = member.get("variableName")
            port, i = self._entries.get(variable, (variable, 0))
            name = member.get("memberName").removesuffix(variable.removeprefix(port))
            parts[port].append((i, name, member.get("variableKind")))
        members: list[TerminalMember] = []
        limits: list[str] = []
        for port, entries in parts.items():
            if port not in self._ports:
                limits.append(f"its variable {port} is of a type that is not connected in terminals")
                continue
            size = len(self._ports[port].entry_names)
            names, kinds = {name for _, name, _ in entries}, {kind for *_, kind in entries}
            if [i for i, *_ in entries] != list(range(size)) or len(names) > 1 or len(kinds) > 1:
                limits.append(
                    f"its members are entries of the array {port} in part, or in another order: connect {port}"
                )
            members.append(TerminalMember(min(names), port, min(kinds)))
        return members, limits


def _twice(listed: list[XmlElement], attribute: str) -> Iterator[str]:
    """Yield what two members of one terminal share."""
    lines: dict[str, list[int]] = defaultdict(list)
    for member in listed:
        if value := member.get(attribute):
            lines[value].append(member.line)
    for value, at in lines.items():
        if len(at) > 1:
            yield f"{len(at)} members have the {attribute} {value!r} (lines {', '.join(map(str, at))})"
