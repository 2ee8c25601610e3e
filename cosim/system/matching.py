"""Which outputs of one unit feed which inputs of another where whole units, or whole terminals, are connected.

Terminals come first: those of the same name, then those of the same kind whose members match by the rules of FMI 3.0
(`MatchingRule`). Of terminals that do not match, nothing is connected as a terminal:

- Such of one name and one kind are a fault, as is one that breaks the standard, and those of which several match are an
  ambiguity. Their inputs are left; those of a terminal that breaks the standard are not known, and `check` refuses it.
- Such of other names, or of one name and different kinds, do not belong together: their inputs are matched by name.

All other inputs are matched by name, too, a bus's member that the other terminal does not have among them.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from handover.cosim.blocks.terminals import MatchingRule
from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.fmu.file.terminals import FmuTerminal, TerminalMember
from handover.cosim.system.conversion import LinearTransformation, conversion, needs_no_conversion
from handover.cosim.system.port_names import Connection, PortName
from handover.cosim.system.wiring_faults import mismatch


@dataclass(frozen=True)
class MatchedPorts:
    """What `System.connect` did with two units: its text has a line for each input that it looked at.

    Attributes:
        source, target: the units.
        connected: inputs that an output feeds: one of the same name, or the like member of a terminal.
        left: inputs that have a matching output and are not connected, each with the reason.
        unmatched: inputs that nothing feeds, as no output has their name.
        outputs: of the inputs in `connected`, the outputs that feed them.
        terminals: of those that are connected by their terminals, these: the outputs', then the inputs'.
    """

    source: str
    target: str
    connected: tuple[str, ...]
    left: Mapping[str, str]
    unmatched: tuple[str, ...]
    outputs: Mapping[str, str] = field(default_factory=dict[str, str])
    terminals: Mapping[str, tuple[str, str]] = field(default_factory=dict[str, tuple[str, str]])

    def __str__(self) -> str:
        lines = [f"{self.source}.{self.outputs[n]} -> {self.target}.{n}{self._terminals_of(n)}" for n in self.connected]
        lines += [f"{self.target}.{name} left: {reason}" for name, reason in self.left.items()]
        lines += [f"{self.target}.{name} left: {self.source} has no output of this name" for name in self.unmatched]
        return "\n".join(lines)

    def _terminals_of(self, name: str) -> str:
        if name not in self.terminals:
            return ""
        a, b = self.terminals[name]
        return f" (terminal {a})" if a == b else f" (terminals {a}, {b})"


class DoNotMatch(Exception):
    """Two terminals cannot be connected; the message says why."""


@dataclass(frozen=True)
class TerminalFault:
    """Terminals that belong together and cannot be connected.

    Attributes:
        source: the unit that feeds.
        target: the unit that is fed.
        reason: which terminals these are, and why.
        inputs: the terminal's inputs; none where the terminal itself is at fault, so that they are not known.
    """

    source: str
    target: str
    reason: str
    inputs: tuple[str, ...] = ()

    def __str__(self) -> str:
        if not self.inputs:
            return f"{self.reason}; connect the ports that are meant one by one, not the units as a whole"
        ports = ", ".join(f"{self.target}.u.{port}" for port in self.inputs)
        return f"{self.reason}; connect its inputs one by one, which are {ports}, or make both terminals alike"

    def remaining(self, sources: Mapping[str, PortName | None]) -> "TerminalFault | None":
        """Return it unless all its inputs are fed, by what was said besides."""
        is_settled = bool(self.inputs) and all(port in sources for port in self.inputs)
        return None if is_settled else self


@dataclass(frozen=True)
class Ambiguity:
    """Several terminals of one of two units match: whoever wires them has to name those that are meant.

    Attributes:
        source: the unit that feeds.
        target: the other unit.
        pairs: the terminals that match, of outputs and of inputs.
        outputs: by terminal of the unit that feeds, its outputs.
        inputs: by terminal of the other unit, its inputs.
    """

    source: str
    target: str
    pairs: tuple[tuple[str, str], ...]
    outputs: Mapping[str, tuple[str, ...]]
    inputs: Mapping[str, tuple[str, ...]]

    def __str__(self) -> str:
        ours, theirs = (sorted({pair[side] for pair in self.pairs}) for side in (0, 1))
        a, b = f"{self.source}'s {' and '.join(ours)}", f"{self.target}'s {' and '.join(theirs)}"
        meant = f"connect({self.source}.y.{ours[0]}, {self.target}.u.{theirs[0]})"
        return f"{self.source}.y -> {self.target}.u: the terminals {a} match {b}; connect those that are meant: {meant}"

    def remaining(self, sources: Mapping[str, PortName | None]) -> "Ambiguity | None":
        """Return what is ambiguous of it after what was said besides, None if nothing is.

        Terminals whose inputs are all fed are settled, and such whose outputs feed one of the terminals.
        """
        used = {sources[port] for ports in self.inputs.values() for port in ports if port in sources}
        pairs = tuple(
            (x, y)
            for x, y in self.pairs
            if not any(PortName(self.source, port) in used for port in self.outputs[x])
            and not all(port in sources for port in self.inputs[y])
        )
        return replace(self, pairs=pairs) if pairs else None


@dataclass
class Matches:
    """All that matches of two units, before what else is said of their inputs.

    Attributes:
        connections: by input, the connection that would feed it.
        terminals: by input that is matched by its terminal, the terminals of output and input.
        left: inputs that have a matching output and cannot be connected, with the reason.
        faults: why terminals that belong together cannot be connected; their inputs are left.
        nothing: that nothing matches at all, with all that there is; "" where something does.
        ambiguities: what has to be said by whoever wires them; likewise.
    """

    connections: dict[str, Connection] = field(default_factory=dict[str, Connection])
    terminals: dict[str, tuple[str, str]] = field(default_factory=dict[str, tuple[str, str]])
    left: dict[str, str] = field(default_factory=dict[str, str])
    faults: list[TerminalFault] = field(default_factory=list[TerminalFault])
    nothing: str = ""
    ambiguities: list[Ambiguity] = field(default_factory=list[Ambiguity])

    def matched_ports(
        self, source: str, target: str, inputs: Collection[str], left: Mapping[str, str], fed: Collection[str]
    ) -> MatchedPorts:
        """Return what was connected of all that matches, as something else may have been said of some inputs.

        Args:
            source: the unit that feeds.
            target: the other unit.
            inputs: all of its inputs.
            left: by input that matches, why it is left; "" if it is connected.
            fed: inputs that get their values otherwise.
        """
        connected = tuple(n for n in inputs if left.get(n) == "")
        return MatchedPorts(
            source,
            target,
            connected,
            {n: reason for n, reason in left.items() if reason},
            tuple(n for n in inputs if n not in left and n not in fed),
            {n: self.connections[n].source.port for n in connected},
            {n: self.terminals[n] for n in connected if n in self.terminals},
        )


def matches_of(source: str, a: FmuDescription, target: str, b: FmuDescription) -> Matches:
    """Match all inputs of the unit `target` with outputs of `source`."""
    matches = Matches()
    if (a.terminals.by_name or a.terminals.fault) and (b.terminals.by_name or b.terminals.fault):
        matches = _TerminalMatching(source, a, target, b).result()
    for name, port in b.inputs.items():
        if name in matches.connections or name in matches.left or name not in a.outputs:
            continue
        if reason := mismatch(a.outputs[name], port):
            what = f"{source}.{name} is {a.outputs[name].signature}, it is {port.signature}"
            matches.left[name] = f"{what}: {reason}"
        else:
            matches.connections[name] = Connection(PortName(source, name), PortName(target, name))
    if not (matches.connections or matches.left or matches.faults or matches.ambiguities):
        ports = f"{source} has {', '.join(a.outputs) or 'no outputs'}, {target} {', '.join(b.inputs) or 'no inputs'}"
        matches.nothing = f"{source}.y -> {target}.u: no output has the name of an input; {ports}"
    return matches


class _TerminalMatching:
    """The terminals of two units that belong together."""

    def __init__(self, source: str, a: FmuDescription, target: str, b: FmuDescription) -> None:
        self._source, self._a, self._target, self._b = source, a, target, b
        self._matches = Matches()
        self._given = {n: t for n, t in a.terminals.by_name.items() if _ports_in(t, a.outputs)}
        self._fed = {n: t for n, t in b.terminals.by_name.items() if _ports_in(t, b.inputs)}

    def result(self) -> Matches:
        """Return what matches."""
        for unit, d in ((self._source, self._a), (self._target, self._b)):
            if d.terminals.fault:
                self._matches.faults.append(TerminalFault(self._source, self._target, f"{unit}: {d.terminals.fault}"))
        self._match_names()
        self._match_kinds()
        return self._matches

    def _match_names(self) -> None:
        """Match terminals of one name; such that are of one kind and do not fit are a fault."""
        theirs = self._b.terminals.by_name
        for name in [n for n in self._a.terminals.by_name if n in theirs]:
            a, b = self._a.terminals.by_name[name], theirs[name]
            is_faulty = bool(a.faults or b.faults)
            if not is_faulty and not (name in self._given and name in self._fed):
                continue  # one of them is of the other side, or cannot be connected as a whole
            try:
                self._take(a, b)
            except DoNotMatch as e:
                if is_faulty or a.kind == b.kind:
                    reason = f"{self._source}.{name} -> {self._target}.{name}: terminals that do not match: {e}"
                    inputs = _ports_in(b, self._b.inputs)
                    self._matches.faults.append(TerminalFault(self._source, self._target, reason, inputs))
                    self._leave(b, f"{self._source}.{name} does not match it")
                self._given.pop(name, None)
                self._fed.pop(name, None)

    def _match_kinds(self) -> None:
        """Match what is left by the kinds, where one fits only one."""
        fitting = {
            (x, y): found
            for x, a in self._given.items()
            for y, b in self._fed.items()
            if a.kind and a.kind == b.kind and (found := self._fits(a, b))
        }
        while fitting:
            ours, theirs = _connected_names(fitting)
            if len(ours) == len(theirs) == 1:
                self._take(self._given[ours[0]], self._fed[theirs[0]])
            else:
                outputs = {x: _ports_in(self._given[x], self._a.outputs) for x in ours}
                inputs = {y: _ports_in(self._fed[y], self._b.inputs) for y in theirs}
                pairs = tuple(pair for pair in fitting if pair[0] in ours)
                self._matches.ambiguities.append(Ambiguity(self._source, self._target, pairs, outputs, inputs))
                for y in theirs:
                    self._leave(
                        self._fed[y], f"of {self._source}, several match" if len(ours) > 1 else "others match, too"
                    )
            fitting = {pair: found for pair, found in fitting.items() if pair[0] not in ours}

    def _fits(self, a: FmuTerminal, b: FmuTerminal) -> bool:
        try:
            return bool(self._pairs(a, b))
        except DoNotMatch:
            return False

    def _pairs(self, a: FmuTerminal, b: FmuTerminal) -> list[Connection]:
        return matched_members((self._source, self._a, a), (self._target, self._b, b))

    def _take(self, a: FmuTerminal, b: FmuTerminal) -> None:
        for c in self._pairs(a, b):
            self._matches.connections[c.target.port] = c
            self._matches.terminals[c.target.port] = (a.name, b.name)
        self._given.pop(a.name, None)
        self._fed.pop(b.name, None)

    def _leave(self, b: FmuTerminal, reason: str) -> None:
        for port in _ports_in(b, self._b.inputs):
            self._matches.left[port] = f"its terminal {b.name} is not connected: {reason}"


def _ports_in(t: FmuTerminal, side: Mapping[str, FmuPort]) -> tuple[str, ...]:
    return () if t.reason else tuple(m.port for m in t.members if m.port in side)


def _connected_names(pairs: Mapping[tuple[str, str], bool]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names on both sides that the first pair and others like it link."""
    ours, theirs = {next(iter(pairs))[0]}, set[str]()
    while True:
        more = {y for x, y in pairs if x in ours}
        back = {x for x, y in pairs if y in more}
        if back == ours and more == theirs:
            return tuple(sorted(ours)), tuple(sorted(theirs))
        ours, theirs = back, more


TerminalEnd = tuple[str, FmuDescription, FmuTerminal]
"""A terminal of a unit: the unit's name in the system, its description, the terminal."""


def matched_members(source: TerminalEnd, target: TerminalEnd) -> list[Connection]:
    """Return the connections from a terminal's outputs to the inputs of another; what goes back is not among them.

    Raises:
        DoNotMatch: a terminal has a fault, or the two do not match by their rule; nothing is to be connected then.
    """
    (unit_a, a, one), (unit_b, b, other) = source, target
    if reasons := [f"{unit}.{t.name}: {t.reason}" for unit, _, t in (source, target) if t.reason]:
        raise DoNotMatch("; ".join(reasons))
    if one.rule is not other.rule or one.rule is None:
        raise DoNotMatch("their matching rules differ")
    connections: list[Connection] = []
    for m, n in _paired(source, target, one.rule):
        if m.port in a.outputs and n.port in b.inputs:
            ends = PortName(unit_a, m.port), PortName(unit_b, n.port)
            connections.append(Connection(*ends, _transformation(ends, a.outputs[m.port], b.inputs[n.port], m, n)))
        elif (m.port in a.outputs) == (n.port in b.outputs):
            what = "outputs" if m.port in a.outputs else "inputs"
            raise DoNotMatch(f"{unit_a}.{m.port} and {unit_b}.{n.port} are both {what}")
    return connections


def matched_ports_of_terminals(
    source: TerminalEnd, target: TerminalEnd, connections: Sequence[Connection]
) -> MatchedPorts:
    """Return what was connected of two terminals; inputs of the target that none of the connections feeds are left."""
    (unit_a, _, one), (unit_b, b, other) = source, target
    outputs = {c.target.port: c.source.port for c in connections}
    left = {m.port: "its terminal was not connected" for m in other.members if m.port in b.inputs}
    if connections:
        left = dict.fromkeys(left, f"{unit_a}.{one.name} has no such member")
    rest = {port: reason for port, reason in left.items() if port not in outputs}
    return MatchedPorts(
        unit_a, unit_b, tuple(outputs), rest, (), outputs, dict.fromkeys(outputs, (one.name, other.name))
    )


def _paired(
    source: TerminalEnd, target: TerminalEnd, rule: MatchingRule
) -> Sequence[tuple[TerminalMember, TerminalMember]]:
    (unit_a, _, one), (unit_b, _, other) = source, target
    if rule is MatchingRule.SEQUENCE:
        counts = len(one.members), len(other.members)
        if counts[0] != counts[1]:
            raise DoNotMatch(
                f"{unit_a}.{one.name} has {counts[0]} members in sequence, {unit_b}.{other.name} {counts[1]}"
            )
        return list(zip(one.members, other.members, strict=True))
    theirs = {n.name: n for n in other.members}
    ours = {m.name: m for m in one.members}
    if rule is MatchingRule.PLUG and ours.keys() != theirs.keys():
        lacking = [(unit_b, other, ours.keys() - theirs.keys()), (unit_a, one, theirs.keys() - ours.keys())]
        lacks = [f"{u}.{t.name} has no member {', '.join(sorted(names))}" for u, t, names in lacking if names]
        raise DoNotMatch(f"{' and '.join(lacks)}; a plug is connected as a whole")
    return [(m, theirs[name]) for name, m in ours.items() if name in theirs]


def _transformation(
    ends: tuple[PortName, PortName], a: FmuPort, b: FmuPort, m: TerminalMember, n: TerminalMember
) -> LinearTransformation | None:
    """Return the change of sign between two flows that both count inwards, or both outwards; else None.

    Raises:
        DoNotMatch: the ports do not fit each other.
    """
    where = f"{ends[0]} ({a.signature}) -> {ends[1]} ({b.signature})"
    if reason := mismatch(a, b):
        raise DoNotMatch(f"{where}: {reason}")
    flows = ("inflow", "outflow")
    if m.kind == n.kind and m.kind in flows:
        if a.kind is not Kind.REAL:
            raise DoNotMatch(f"{where}: both are {m.kind}, and {a.kind.value} values have no opposite here")
        c = LinearTransformation() if needs_no_conversion(a.unit, b.unit) else conversion(a.unit, b.unit)
        return LinearTransformation(-c.factor, -c.offset)
    if m.kind != n.kind and not (m.kind in flows and n.kind in flows):
        raise DoNotMatch(f"{where}: one is {m.kind}, the other {n.kind}")
    return None
