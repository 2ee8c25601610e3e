"""An SSP as a system that the master runs.

SSP 1.0 has no arrays: `a.p[1]` feeds `b.p[1]`, `a.p[2]` feeds `b.p[2]`, and so on. `Grouping` joins such connections to
connections of whole arrays, which the master copies as a whole, or splits arrays where they cannot be joined.
"""

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any

from handover.cosim.exceptions import InvalidFmu, InvalidSsp, WiringError, named_by_archive
from handover.cosim.files import scratch_folder
from handover.cosim.fmu.file.default_experiment import exact_seconds, proposed_step
from handover.cosim.fmu.file.description import FmuDescription, FmuPort, describe_fmu
from handover.cosim.ssp.archive import SspArchive
from handover.cosim.ssp.connected_ports import find_entry, split_arrays
from handover.cosim.ssp.flattening import FlatConnection, FlatSystem, Node, components_of, flatten
from handover.cosim.ssp.given_parameters import (
    SettableParameter,
    named_parameter,
    named_parameters,
    settable_parameters,
)
from handover.cosim.ssp.parameter_set import SspValue
from handover.cosim.ssp.reading import read_structure
from handover.cosim.ssp.start_values import start_value_doubts, start_values
from handover.cosim.ssp.structure import SspComponent, SspConnector, SspStructure
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import PlacedUnit, PortName, System

Wire = tuple[PortName, PortName, LinearTransformation | None]

Feeds = dict[int, tuple[PortName, int, LinearTransformation | None]]
"""By entry of an input: the output, its entry, and the transformation of the value."""


_ROUNDING = Fraction(1, 10**9)
"""Relative difference of two steps that are written as decimals and meant to be multiples."""


class Grouping:
    """The connections of a flat system by ports, and the arrays that have to be split for them.

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
        while self._split():  # each split array may leave another one that it was connected with in parts
            pass
        self._check_divisible()
        for target, feeds in self._feeds.items():
            self._wire(target, feeds)

    def _take(self, c: FlatConnection) -> None:
        a, i, source = self._entry(c.source, "output")
        b, k, target = self._entry(c.target, "input")
        if a is None or b is None:
            for port, node, role in ((a, c.source, "output"), (b, c.target, "input")):
                if port is None:
                    self.faults.append(
                        f"{c.where}{'.'.join(node)} is not a {role} of its FMU, so it cannot be connected"
                    )
            return
        if i is None and k is None and a.shape != b.shape:
            self.wires.append((source, target, c.linear))  # a fault, which the system's check reports with both ends
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
        port, index = find_entry(d.outputs if role == "output" else d.inputs, name) or (None, None)
        return port, index, PortName(unit, name if port is None else port.name)

    def _port(self, name: PortName) -> FmuPort:
        d = self._descriptions[name.unit]
        return d.outputs[name.port] if name.port in d.outputs else d.inputs[name.port]

    def _split(self) -> bool:
        """Split arrays that cannot be connected as a whole; return whether any further one was split."""
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

    def _check_divisible(self) -> None:
        for unit, names in self.apart.items():
            d = self._descriptions[unit]
            for name in sorted(names):
                port = {**d.settable, **d.outputs}[name]
                if len(port.references) == 1:
                    fault = f"{unit}.{name} is one array variable (FMI 3); its entries cannot be connected one by one"
                    self.faults.append(fault)

    def _wire(self, target: PortName, feeds: Feeds) -> None:
        if self._is_whole(target, feeds):
            source, _, linear = next(iter(feeds.values()))
            self.wires.append((source, target, linear))
            return
        for k, (source, i, linear) in feeds.items():
            self.wires.append((self._entry_name(source, i), self._entry_name(target, k), linear))

    def _entry_name(self, name: PortName, k: int) -> PortName:
        """Return the name of a port's entry: its own if it is split, else the port's."""
        if not self._is_apart(name):
            return name
        names = self._port(name).entry_names
        return PortName(name.unit, names[min(k, len(names) - 1)])  # of an array variable, a fault, there is one name


class SspFile:
    """A System Structure and Parameterization file, version 1.0 or 2.0, of co-simulation FMUs. A context manager.

    Systems within systems are flattened: their units are named `system.unit`. Its FMUs lie in a temporary folder until
    it is closed, so `system` has to be run before.

    Not supported, and rejected: signal dictionaries, components that are SSPs, mappings of booleans, integers or
    enumerations, connected parameters, single entries of FMI 3 arrays, clocks, files outside of the archive.
    Connections between types, such as Integer to Real, are too: SSP 2.0 leaves them to implementations.

    Args:
        path: the file.
        step: communication step of all units, s; without it each has the one of an annotation by `write_ssp`, or else
            the one that is annotated for libcosim, or else the system's, or else the one that its FMU proposes. Where
            one that the file states, or that an FMU proposes, is not taken, the system's notes say so.
        parameters: texts by the names of the property `parameters`, which come before what the file gives; of an array
            the values stand with commas between them, or a name such as `arm.p[1]` gives one.
        start, stop: of the run, s, by default those of its default experiment; units without a step take a 500th of
            what lies between them.

    Attributes:
        name: the system's name.
        system: the system, checked; its run starts at the given time, or at that of the default experiment.
        stop: the stop time of its default experiment, s, if it has one.
        parallel_step: communication step of all units where they step in parallel, s, if `write_ssp` annotated one.

    Raises:
        InvalidSsp: with all that is wrong with it.
    """

    def __init__(
        self, path: Path, step: Fraction | None = None, parameters: Mapping[str, str] = MappingProxyType({}),
        start: Fraction | None = None, stop: Fraction | None = None,
    ) -> None:  # fmt: skip
        archive = SspArchive(path)
        structure = read_structure(archive)
        self.path, self.name = path, structure.name
        self.stop = None if structure.stop is None else exact_seconds(structure.stop)
        self.parallel_step = structure.parallel_step
        self._opened = contextlib.ExitStack()
        self.folder = self._opened.enter_context(scratch_folder("ssp"))
        """Where its FMUs are unpacked until it is closed."""
        self._opened.enter_context(named_by_archive(self.folder, path))
        try:
            members = {n: c.member for n, c in components_of(structure.system)}
            archive.unpack(self.folder, set(members.values()))
            self._structure, self._step = structure, step
            self._start = exact_seconds(structure.start) if start is None else start
            end = self.stop if stop is None else stop
            self._duration = None if end is None else end - self._start
            self._descriptions = self._describe(members)
            self._flat, self.system = self._with(parameters)
        except BaseException:
            self.close()
            raise

    @property
    def parameters(self) -> dict[str, FmuPort]:
        """Parameters of components and of systems by the names by which they are given, starting from their values."""
        return {name: p.described(self._value(p)) for name, p in self._settable().items()}

    def port(self, name: str) -> FmuPort | None:
        """Return the declaration of a parameter by the name by which it is given; None if there is none.

        Besides `parameters`, these are entries of arrays, and outputs and local variables with start values.
        """
        found = named_parameter(self._settable(), self._descriptions, name)
        if found is None:
            return None
        port, declared = found.described(None), found.declared
        is_entry = isinstance(declared, FmuPort) and declared.name != found.name
        return replace(port, shape=()) if is_entry else port

    def faults(self, parameters: Mapping[str, str]) -> Sequence[str]:
        """Return what would be wrong with the file if it were opened with values of parameters."""
        try:
            self._with(parameters)
        except InvalidSsp as e:
            return e.faults
        return ()

    def close(self) -> None:
        """Remove the unpacked FMUs."""
        self._opened.close()

    def __enter__(self) -> "SspFile":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _describe(self, members: dict[str, str]) -> dict[str, FmuDescription]:
        if not members:
            raise InvalidSsp(self.path, ["there is no component in its system"])
        described: dict[str, FmuDescription] = {}
        for member in dict.fromkeys(members.values()):
            try:
                described[member] = describe_fmu(self.folder / member)
            except InvalidFmu as e:
                raise InvalidSsp(self.path, [f"{member}: {e.fault}"]) from e
        return {name: described[member] for name, member in members.items()}

    def _with(self, parameters: Mapping[str, str]) -> tuple[FlatSystem, System]:
        """Return the system with values of parameters, flat and as the master runs it.

        Raises:
            InvalidSsp: with all that is wrong with it.
        """
        structure, descriptions = self._structure, self._descriptions
        asked = self._named(parameters) if parameters else {}
        flat = flatten(structure.system, descriptions, asked)
        steps = {n: self._step or c.period or _stated_step(c, structure) for n, c in flat.components.items()}
        system = self._build(flat, descriptions, steps, structure.unsupported, self._duration)
        for line in (*structure.tolerated, *flat.tolerated):
            system.tolerate(line)
        system.start = self._start
        system.notes += _notes_on_steps(self._step, structure.step, system.units.values())
        return flat, system

    def _settable(self) -> dict[str, SettableParameter]:
        return {p.full_name: p for p in settable_parameters(self._structure.system, self._descriptions)}

    def _build(
        self,
        flat: FlatSystem,
        descriptions: dict[str, FmuDescription],
        steps: Mapping[str, Fraction | None],
        unsupported: Sequence[str],
        duration: Fraction | None,
    ) -> System:
        faults = list(flat.faults)
        starts, partly = dict[str, dict[str, object]](), dict[str, set[str]]()
        for unit, given in flat.given.items():
            ports = descriptions[unit].settable
            known = {name: (entry, g) for name, g in given.items() if (entry := find_entry(ports, name)) is not None}
            starts[unit], partly[unit], start_faults = start_values(known)
            faults += start_faults
            flat.tolerated += start_value_doubts(known)
        grouping = Grouping(flat.connections, descriptions, partly)
        faults += grouping.faults
        if faults:
            raise InvalidSsp(self.path, [*unsupported, *faults])
        system = System()
        for name, component in flat.components.items():
            unit = system.add(name, descriptions[name], period=steps[name], sampled=component.sampled)
            description = split_arrays(descriptions[name], grouping.apart.get(name, ()))
            system.units[name] = replace(unit, description=description, start=starts.get(name, {}))
        if duration is not None:
            system.presume_steps(duration)
        for source, target, linear in grouping.wires:
            system.connect(source, target, linear)
        try:
            system.check()
        except WiringError as e:
            raise InvalidSsp(self.path, [*unsupported, *e.faults]) from e
        if unsupported:
            raise InvalidSsp(self.path, unsupported)
        return system

    def _named(self, texts: Mapping[str, str]) -> dict[Node, SspValue]:
        """Return the values of parameters that a call gives."""
        asked, faults = named_parameters(self._settable(), self._descriptions, texts)
        if faults:
            raise InvalidSsp(self.path, faults)
        return asked

    def _value(self, parameter: SettableParameter) -> Any:
        """Return the value from which a parameter starts; None for the one that its FMU says."""
        path, name = parameter.path, parameter.name
        if isinstance(parameter.declared, SspConnector):
            value = self._flat.values_of_systems.get((path, name))
            return None if value is None else " ".join(value.texts)
        unit = self.system.units[path]
        if name in unit.description.parameters:
            return unit.start.get(name)
        names = parameter.declared.entry_names  # of an array that was split
        return " ".join(str(unit.start.get(n, unit.description.parameters[n].start)) for n in names)


def _stated_step(component: SspComponent, structure: SspStructure) -> Fraction | None:
    """Return the communication step that an SSP states for a component, by a hint for libcosim or for all, s.

    As libcosim does, a hint is rounded down to a multiple of the system's step, of which one is the least. Where
    `write_ssp` annotated a step for stepping in parallel, both are that one, and each unit keeps its own here.
    """
    base, hint = structure.step, component.hint
    if structure.parallel_step is not None:
        return None
    if base is None or hint is None:
        return hint or base
    parts = max(1, round(hint / base))
    return hint if abs(hint - parts * base) < hint * _ROUNDING else max(1, hint // base) * base


def _notes_on_steps(asked: Fraction | None, stated: Fraction | None, units: Iterable[PlacedUnit]) -> list[str]:
    """Return which communication step applies where the system states one and others differ."""
    if asked is not None:
        other = stated is not None and stated != asked
        return [f"all units step by {_seconds(asked)}, as asked; the system states {_seconds(stated)}"] if other else []
    own = {u.name: (u.period, proposed_step(u.description.experiment.step)) for u in units}
    others = [f"{n} {_seconds(p)}" for n, (period, p) in own.items() if period == stated and p not in (None, period)]
    if stated is None or not others:
        return []
    return [f"the system's step of {_seconds(stated)} is taken, not what FMUs propose: {', '.join(others)}"]


def _seconds(step: Fraction | None) -> str:
    return "none" if step is None else f"{float(step):g} s"
