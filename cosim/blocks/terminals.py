"""Terminals: ports of a block that belong together, so that a whole pose or picture pair is connected by one line.

A block says each group once, in the class attribute `terminals` beside `feedthrough`:

    terminals = (terminal("gripper", TerminalKind.POSE, "p_WG", "q_WG"),)

An FMU has them in `terminalsAndIcons/terminalsAndIcons.xml` (FMI 3.0, sec. "Terminals and Icons"). There two terminals
match by their members' names, or by their order; a member has its port's name unless the block gives it another one.
"""

import enum
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from handover.cosim.blocks.units import BaseExponents, Unit
from handover.cosim.blocks.variable import Kind


class MatchingRule(enum.Enum):
    """How members of two terminals match, by the standard's names.

    Of a plug, all members of both must be there and match by name; of a bus, those that both have are connected; of a
    sequence, the members match by their order, and both have as many.
    """

    PLUG = "plug"
    BUS = "bus"
    SEQUENCE = "sequence"


class TerminalKind(enum.Enum):
    """What a terminal of this project's units carries; the kind says which members there may be, and how they match.

    A pose is a position and a quaternion, a twist the velocities of both, a motion all four; a wrench is force and
    torque. Pictures are of one size. A command is what a controller sets at once, measurements are what a sensor or a
    filter tells of one instant. Signals are ports that others have under other names, in this order.
    """

    POSE = "pose"
    TWIST = "twist"
    MOTION = "motion"
    WRENCH = "wrench"
    PICTURES = "pictures"
    COMMAND = "command"
    MEASUREMENTS = "measurements"
    SIGNALS = "signals"

    @property
    def rule(self) -> MatchingRule:
        """How its members match: units may have fewer pictures and measurements than others."""
        if self in (TerminalKind.PICTURES, TerminalKind.MEASUREMENTS):
            return MatchingRule.BUS
        return MatchingRule.SEQUENCE if self is TerminalKind.SIGNALS else MatchingRule.PLUG

    @property
    def standard_name(self) -> str:
        """The attribute `terminalKind`; the standard wants kinds of a vendor to begin with its name."""
        return f"_handover_{self.value}"

    @classmethod
    def of_standard_name(cls, name: str) -> "TerminalKind | None":
        """Return the kind that an FMU names; None if it is another tool's."""
        return next((kind for kind in cls if kind.standard_name == name), None)


@dataclass(frozen=True)
class Terminal:
    """Ports that are connected together.

    Attributes:
        name: its name, which no other terminal and no port or parameter of the block has.
        kind: what it carries.
        members: its ports by members' names; all of them inputs, or all outputs, and none in another terminal.
    """

    name: str
    kind: TerminalKind
    members: Mapping[str, str]


def terminal(name: str, kind: TerminalKind, /, *ports: str, **members: str) -> Terminal:
    """Declare a terminal of ports under their own names, and of others as `member="port"`.

    A member is named otherwise where the block that it is to be connected with has that name for it, as in
    `terminal("corrected", TerminalKind.MEASUREMENTS, p_WO_meas="p_WO")`.
    """
    return Terminal(name, kind, {port: port for port in ports} | members)


class MemberPort(Protocol):
    """What a kind asks of a member's port, of a block's as well as of an FMU's."""

    @property
    def name(self) -> str:
        """Its name."""
        ...

    @property
    def kind(self) -> Kind:
        """What its values are."""
        ...

    @property
    def shape(self) -> tuple[int, ...]:
        """Its extents, () of a scalar."""
        ...

    @property
    def unit(self) -> Unit:
        """Its unit of measurement."""
        ...

    @property
    def mime(self) -> str | None:
        """Its MIME type; a picture's says its size."""
        ...


@dataclass(frozen=True)
class _Quantity:
    """A member that a kind has once."""

    name: str
    extent: int
    base: BaseExponents

    def is_of(self, port: MemberPort) -> bool:
        fits = port.kind is Kind.REAL and port.shape == (self.extent,)
        return fits and (port.unit.base == self.base or not port.unit.defined)

    def __str__(self) -> str:
        return f"{self.name} ({_signature(Kind.REAL, (self.extent,), _text_of(self.base))})"


def _text_of(base: BaseExponents) -> str:
    return ".".join(f"{unit}{exponent if exponent != 1 else ''}" for unit, exponent in base.nonzero().items())


_POSE = (_Quantity("a position", 3, BaseExponents(m=1)), _Quantity("a quaternion", 4, BaseExponents()))
_TWIST = (
    _Quantity("a velocity", 3, BaseExponents(m=1, s=-1)),
    _Quantity("an angular velocity", 3, BaseExponents(rad=1, s=-1)),
)
_WRENCH = (
    _Quantity("a force", 3, BaseExponents(kg=1, m=1, s=-2)),
    _Quantity("a torque", 3, BaseExponents(kg=1, m=2, s=-2)),
)
_QUANTITIES = {
    TerminalKind.POSE: _POSE,
    TerminalKind.TWIST: _TWIST,
    TerminalKind.MOTION: (*_POSE, *_TWIST),
    TerminalKind.WRENCH: _WRENCH,
}


def kind_fault(kind: TerminalKind, ports: Iterable[MemberPort]) -> str:
    """Return why ports are no terminal of a kind, and what would be one; empty if they are."""
    members = list(ports)
    if kind is TerminalKind.PICTURES:
        return _pictures_fault(members)
    quantities = _QUANTITIES.get(kind)
    if quantities is None:
        return ""
    wanted = f"a {kind.value} has {', '.join(map(str, quantities[:-1]))} and {quantities[-1]}"
    free = list(quantities)
    for port in members:
        quantity = next((q for q in free if q.is_of(port)), None)
        if quantity is None:
            taken = any(q.is_of(port) for q in quantities)
            return f"{port.name} is {'one more ' if taken else ''}{_described(port)}, but {wanted}"
        free.remove(quantity)
    return f"it has no {free[0].name.partition(' ')[2]}: {wanted}" if free else ""


def _pictures_fault(members: list[MemberPort]) -> str:
    for port in members:
        if port.kind is not Kind.BINARY:
            return f"{port.name} is {_described(port)}, but pictures are binary"
        if port.mime != members[0].mime:
            sizes = f"{members[0].name} ({members[0].mime}) and {port.name} ({port.mime})"
            return f"{sizes} differ in shape: the pictures of one terminal have one size"
    return ""


def _described(port: MemberPort) -> str:
    return _signature(port.kind, port.shape, port.unit.symbol if port.kind is Kind.REAL else "")


def _signature(kind: Kind, shape: tuple[int, ...], unit: str) -> str:
    extents = f" [{','.join(map(str, shape))}]" if shape else ""
    return f"{kind.value}{extents}{f' {unit}' if unit not in ('', '1') else ''}"


def terminal_faults(
    terminals: object, inputs: Iterable[MemberPort], outputs: Iterable[MemberPort], parameters: Collection[str] = ()
) -> list[str]:
    """Return what is wrong with a block's attribute `terminals`, each with the terminal that it is about.

    `parameters` are the names of the block's parameters.
    """
    example = 'such as (terminal("gripper", TerminalKind.POSE, "p_WG", "q_WG"),)'
    if not isinstance(terminals, (tuple, list)):
        return [f"{terminals!r} is not a tuple of terminals, {example}"]
    sides = {p.name: p for p in inputs}, {p.name: p for p in outputs}
    faults: list[str] = []
    names: set[str] = set()
    terminal_of: dict[str, str] = {}  # by port
    for t in terminals:  # type: ignore
        if not isinstance(t, Terminal):
            faults.append(f"{t!r} is not a terminal, {example}")
            continue
        if t.name in names or any(t.name in side for side in sides):
            what = "another terminal" if t.name in names else "a port"
            faults.append(f"{t.name!r}: {what} has this name; y.{t.name} and u.{t.name} would stand for either")
        if t.name in parameters:
            faults.append(f"{t.name!r}: a parameter has this name, and u.{t.name} would stand for either; rename one")
        if shared := [port for port in dict.fromkeys(t.members.values()) if port in terminal_of]:
            held = ", ".join(f"{port} is in {terminal_of[port]!r}" for port in shared)
            faults.append(f"{t.name!r}: {held}, too; a port is in one terminal, so that one connection feeds it")
        names.add(t.name)
        terminal_of = dict.fromkeys(t.members.values(), t.name) | terminal_of
        if fault := _fault_of(t, *sides):
            faults.append(f"{t.name!r}: {fault}")
    return faults


def _fault_of(t: Terminal, inputs: Mapping[str, MemberPort], outputs: Mapping[str, MemberPort]) -> str:
    if not (t.name.isascii() and t.name.isidentifier()):
        return "a name consists of ASCII letters, digits and underscores, so that y.NAME can stand for it"
    if not t.members:
        return "it has no members"
    if unknown := [port for port in t.members.values() if port not in inputs and port not in outputs]:
        return f"there is no input or output {', '.join(map(repr, unknown))}"
    twice = sorted({port for port in t.members.values() if list(t.members.values()).count(port) > 1})
    if twice:
        return f"{', '.join(twice)} is there under two names"
    fed, given = ([p for p in t.members.values() if p in side] for side in (inputs, outputs))
    if fed and given:
        return f"{', '.join(fed)} and {', '.join(given)} are inputs and outputs: make two terminals of them"
    side = inputs if fed else outputs
    return kind_fault(t.kind, [side[port] for port in t.members.values()])
