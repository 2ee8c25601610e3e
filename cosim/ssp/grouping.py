"""Takes connections of single entries together to connections of whole arrays, or takes arrays apart.

SSP 1.0 knows no arrays: `a.p[1]` feeds `b.p[1]`, `a.p[2]` feeds `b.p[2]`, and so on.
"""

from collections.abc import Mapping, Sequence

from handover.cosim.fmu.description import FmuDescription, FmuPort
from handover.cosim.ssp.connected_ports import entry_names, find_entry
from handover.cosim.ssp.flattening import FlatConnection, Node
from handover.cosim.system.conversion import Linear
from handover.cosim.system.system import PortName

Wire = tuple[PortName, PortName, Linear | None]

Feeds = dict[int, tuple[PortName, int, Linear | None]]
"""By entry of an input: the output, its entry, and what the value goes through."""


class Grouping:
    """The connections of a flat system by ports, and the arrays that they take apart.

    Attributes:
        wires: output, input and transformation.
        apart: names of ports, by unit, whose entries are ports of their own in `wires`.
        faults: what cannot be connected.
    """

    def __init__(
        self,
        connections: Sequence[FlatConnection],
        descriptions: Mapping[str, FmuDescription],
        apart: Mapping[str, set[str]],
    ) -> None:
        self._descriptions = descriptions
        self.apart = {unit: set(names) for unit, names in apart.items()}
        self.faults: list[str] = []
        self.wires: list[Wire] = []
        self._feeds: dict[PortName, Feeds] = {}
        for c in connections:
            self._take(c)
        while self._part():
            pass
        self._refuse_what_cannot_be_parted()
        for target, feeds in self._feeds.items():
            self._wire(target, feeds)

    def _take(self, c: FlatConnection) -> None:
        a, i, source = self._entry(c.source, "output")
        b, k, target = self._entry(c.target, "input")
        if a is None or b is None:
            for port, node, role in ((a, c.source, "output"), (b, c.target, "input")):
                if port is None:
                    self.faults.append(f"{c.where}{'.'.join(node)} is no {role} of its FMU, so it cannot be connected")
            return
        if i is None and k is None and a.shape != b.shape:
            self.wires.append((source, target, c.linear))  # the system's check tells of it, with both ends
            return
        if (a.size if i is None else 1) != (b.size if k is None else 1):
            self.faults.append(f"{c.where}{source} -> {target}: a whole array and a single entry")
            return
        feeds = self._feeds.setdefault(target, {})
        for n in range(b.size if k is None else 1):
            entry = n if k is None else k
            if entry in feeds:
                self.faults.append(f"{c.where}{target} is fed twice")
            feeds[entry] = (source, n if i is None else i, c.linear)

    def _entry(self, node: Node, role: str) -> tuple[FmuPort | None, int | None, PortName]:
        unit, name = node
        d = self._descriptions[unit]
        found = find_entry(d.outputs if role == "output" else d.inputs, name)
        port, index = found or (None, None)
        return port, index, PortName(unit, name if port is None else port.name)

    def _port(self, name: PortName) -> FmuPort:
        d = self._descriptions[name.unit]
        return d.outputs[name.port] if name.port in d.outputs else d.inputs[name.port]

    def _part(self) -> bool:
        """Take apart what cannot be connected as a whole; tell whether anything was taken apart."""
        before = sum(map(len, self.apart.values()))
        for target, feeds in self._feeds.items():
            if not self._is_whole(target, feeds):
                for name in (target, *(source for source, _, _ in feeds.values())):
                    if self._port(name).shape:
                        self.apart.setdefault(name.unit, set()).add(name.port)
        return sum(map(len, self.apart.values())) > before

    def _is_whole(self, target: PortName, feeds: Feeds) -> bool:
        port = self._port(target)
        (source, _, linear) = next(iter(feeds.values()))
        if len(feeds) < port.size or self._is_apart(target) or self._is_apart(source):
            return False
        alike = all(feeds[k] == (source, k, linear) for k in feeds)
        return alike and self._port(source).shape == port.shape

    def _is_apart(self, name: PortName) -> bool:
        return name.port in self.apart.get(name.unit, ())

    def _refuse_what_cannot_be_parted(self) -> None:
        for unit, names in self.apart.items():
            d = self._descriptions[unit]
            for name in sorted(names):
                port = {**d.parameters, **d.inputs, **d.outputs}[name]
                if len(port.references) == 1:
                    told = f"{unit}.{name} is one array variable (FMI 3); its entries cannot be connected one by one"
                    self.faults.append(told)

    def _wire(self, target: PortName, feeds: Feeds) -> None:
        if self._is_whole(target, feeds):
            source, _, linear = next(iter(feeds.values()))
            self.wires.append((source, target, linear))
            return
        for k, (source, i, linear) in feeds.items():
            self.wires.append((self._part_of(source, i), self._part_of(target, k), linear))

    def _part_of(self, name: PortName, k: int) -> PortName:
        if not self._is_apart(name):
            return name
        return PortName(name.unit, entry_names(self._port(name))[min(k, len(entry_names(self._port(name))) - 1)])
