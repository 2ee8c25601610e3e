"""Ports of a system's units by name: one end of a connection, all ports of one side, and which of two sides match."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from handover.cosim.blocks.variable import Causality
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.system.wiring_faults import mismatch


@dataclass(frozen=True)
class PortName:
    """One end of a connection: a port of a unit in a system."""

    unit: str
    port: str

    def __str__(self) -> str:
        return f"{self.unit}.{self.port}"


class PortNames:
    """Makes port names by attribute: `arm.y.p_WG`. `System.check` checks whether such a port exists.

    By itself it stands for all inputs, or all outputs, of its unit: `System.connect(arm.y, camera.u)`.
    """

    def __init__(self, unit: str, causality: Causality) -> None:
        self._unit = unit
        self._causality = causality

    def __getattr__(self, port: str) -> PortName:
        if port.startswith("__"):
            raise AttributeError(port)
        return PortName(self._unit, port)

    def __repr__(self) -> str:
        return f"{self._unit}.{'y' if self._causality is Causality.OUTPUT else 'u'}"


def unit_of(ports: PortNames, causality: Causality) -> str:
    """Return the unit whose ports of a causality these are.

    Raises:
        TypeError: they are something else.
    """
    if not isinstance(ports, PortNames):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(f"{ports!r} is one port or none, the other end a unit's: connect UNIT.y with UNIT.u")
    unit, own = vars(ports)["_unit"], vars(ports)["_causality"]
    if own is not causality:
        wanted = f"{unit}.{'y' if causality is Causality.OUTPUT else 'u'}"
        raise TypeError(f"{ports!r} are its {own.value}s: what feeds stands first; did you mean {wanted}?")
    return unit


@dataclass(frozen=True)
class MatchedPorts:
    """What `System.connect` did with two units: its text has a line for each input that it looked at.

    Attributes:
        source, target: the units.
        connected: inputs that the output of the same name feeds.
        left: inputs that have an output of the same name and are not connected, each with the reason.
        unmatched: inputs that nothing feeds, as no output has their name.
    """

    source: str
    target: str
    connected: tuple[str, ...]
    left: Mapping[str, str]
    unmatched: tuple[str, ...]

    def __str__(self) -> str:
        lines = [f"{self.source}.{name} -> {self.target}.{name}" for name in self.connected]
        lines += [f"{self.target}.{name} left: {reason}" for name, reason in self.left.items()]
        lines += [f"{self.target}.{name} left: {self.source} has no output of this name" for name in self.unmatched]
        return "\n".join(lines)


def matched_ports(
    source: str,
    target: str,
    outputs: Mapping[str, FmuPort],
    inputs: Mapping[str, FmuPort],
    fed: Mapping[str, str],
) -> MatchedPorts:
    """Match inputs with outputs of the same name, kind and shape, whose unit is the same or can be converted.

    `source` and `target` name the units; `fed` has the inputs that get their values otherwise, with what feeds each.
    """
    left: dict[str, str] = {}
    for name in [n for n in inputs if n in outputs]:
        a, b = outputs[name], inputs[name]
        if name in fed:
            left[name] = fed[name]
        elif reason := mismatch(a, b):
            left[name] = f"{source}.{name} is {a.signature}, it is {b.signature}: {reason}"
    connected = tuple(n for n in inputs if n in outputs and n not in left)
    unmatched = tuple(n for n in inputs if n not in outputs and n not in fed)
    return MatchedPorts(source, target, connected, left, unmatched)


def ambiguity(target: PortName, sources: Collection[PortName]) -> str:
    """Return that several outputs match an input, and how to choose."""
    *others, last = sorted(f"{s.unit}.y.{s.port}" for s in sources)
    return (
        f"{target}: {', '.join(others)} and {last} match it by name; connect the one that is meant: "
        f"connect({others[0]}, {target.unit}.u.{target.port})"
    )
