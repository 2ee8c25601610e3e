"""Places of a scenario: what a unit that takes one must have and may have, and how wiring leaves out the rest.

A scenario declares by name what it wires and reads of each of its units. Kinds, shapes and units of measurement are
those of the unit that it ships with, so that they are declared once.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.variable import Causality, Kind, Variable
from handover.cosim.exceptions import did_you_mean, suggestion
from handover.cosim.fmu.file.default_experiment import proposed_step
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.system.conversion import needs_no_conversion
from handover.cosim.system.system import PlacedUnit, PortName, System
from handover.fmus.catalog import Entry, find_unit, import_class

_CAUSALITIES = (Causality.INPUT, Causality.OUTPUT, Causality.PARAMETER)
_MOST_NAMED = 10
"""Ports of a kind that a note names; of more it says how many there are."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """What a unit in one place of a system must have and may have, besides ports of its own.

    Attributes:
        required: inputs, outputs and parameters without which the scenario cannot be, each with what to know of it
            besides its description by the scenario's own unit, such as its frame; "" where that says it all.
        optional: likewise those that the scenario wires, sets or reads where the unit has them.
        advised: optional outputs without which no run can succeed; a start for a unit of one's own has them, too.
        remarks: sentences on the whole: frames, signs, what is left out without the optional ones.
    """

    required: Mapping[str, str] = field(default_factory=dict[str, str])
    optional: Mapping[str, str] = field(default_factory=dict[str, str])
    advised: Sequence[str] = ()
    remarks: Sequence[str] = ()


@dataclass(frozen=True)
class PlacePort:
    """An input, output or parameter of a place.

    Attributes:
        declared: as the scenario's own unit declares it.
        is_required: whether a unit must have it.
        addition: what the place adds to its description; "" where that says it all.
    """

    declared: Variable
    is_required: bool
    addition: str

    @property
    def text(self) -> str:
        """All to know of it: the unit's description, and what the place adds."""
        return "; ".join(text for text in (self.declared.description, self.addition) if text)


def ports_of_place(place: Place, unit: Entry) -> list[PlacePort]:
    """Return a place's inputs, outputs and parameters, the required ones first, by what its own unit declares.

    Raises:
        KeyError: the unit does not declare one of them. UnknownBlock: its class cannot be imported.
    """
    declared = {v.name: v for v in describe(import_class(unit.block)).variables}
    return [
        PlacePort(declared[name], is_required, addition)
        for is_required, named in ((True, place.required), (False, place.optional))
        for name, addition in named.items()
    ]


def fit_places(system: System, places: Mapping[str, Place], units: Mapping[str, str], scenario: str) -> None:
    """Leave out of a system what the units in its places do not have and need not have; what they must have is a fault.

    The scenario's own units have all of it. What is left out of another one is noted in `System.notes`, and
    what is wrong with it in what `System.check` raises. Where the scenario connects whole units, an output that the own
    unit does not have feeds no input that another output matches, too: its unit connects all that the own one does.

    Args:
        system: as the scenario wires it.
        places: what each place needs, by the unit's name in the system.
        units: the scenario's own unit in each place, by its name in the catalog or its block's path.
        scenario: its name, or its class's path.
    """
    _prefer_own_outputs(system, {name: units[name] for name in places if name in system.units})
    for name, place in places.items():
        if name in system.units:
            own, placed = find_unit(units[name]), system.units[name]
            if placed.description.name != own.name or any(_missing(placed.description, place)):
                _Fitting(system, placed, place, own, f"handover list {scenario} --unit {name}").fit()


def presume_steps_of_places(system: System, units: Mapping[str, str]) -> None:
    """Give units whose FMUs propose no step that of the scenario's own units whose places they take."""
    for name in system.without_step:
        if name in units:
            own = find_unit(units[name])
            system.presume_step(name, own.step, f"as {own.name} has it, whose place it takes")


def sample_in_places(system: System, units: Mapping[str, str]) -> None:
    """Step sampled units that take the places of the scenario's own ones so that each of their ticks begins a step.

    A line says so, as it does of a unit without a sampling period of its own, which is sampled as the own one is.
    """
    for name in units.keys() & system.units.keys():
        placed, own = system.units[name], find_unit(units[name])
        d = placed.description
        period = proposed_step(d.step)
        if not placed.sampled or (not d.sampled and d.name == own.name):
            continue
        if not d.sampled:
            line = f"has no sampling period of its own: it is called every {float(placed.period):g} s"
        elif period and period != import_class(own.block).period and (period / placed.period).denominator != 1:
            system.units[name] = replace(placed, period=period)
            line = f"is sampled every {float(period):g} s, as it says, and {own.name} every {float(placed.period):g} s"
        else:
            continue
        system.notes.append(f"unit {name} ({d.name}) {line}")


def _prefer_own_outputs(system: System, units: Mapping[str, str]) -> None:
    """Let outputs that the scenario's own units have, too, feed the inputs that several outputs match."""

    def is_of_own(output: PortName) -> bool:
        return output.unit not in units or output.port in _own_outputs(units[output.unit])

    for target, outputs in system.prefer_matches(is_of_own).items():
        system.notes.append(
            f"{target}: {' and '.join(map(str, outputs))} match it, which the scenario's own units do not have, so "
            "nothing feeds it and it stays at its start value"
        )


def _own_outputs(unit: str) -> set[str]:
    return {v.name for v in describe(import_class(find_unit(unit).block)).outputs}


def _missing(unit: FmuDescription, place: Place) -> Iterator[str]:
    return (n for n in (*place.required, *place.optional) if not any(n in ports for ports in _ports(unit).values()))


def _ports(unit: FmuDescription) -> dict[Causality, Mapping[str, FmuPort]]:
    """Return by what it is to be where a unit's ports are; an input may be set like a parameter."""
    return {
        Causality.INPUT: unit.inputs,
        Causality.OUTPUT: unit.outputs,
        Causality.PARAMETER: {**unit.parameters, **unit.inputs},
    }


class _Fitting:
    """One unit in a place."""

    def __init__(self, system: System, unit: PlacedUnit, place: Place, own: Entry, listed_by: str) -> None:
        self._listed_by = listed_by
        self._system, self._unit, self._own = system, unit, own
        self._ports = ports_of_place(place, own)
        self._what = f"unit {unit.name} ({unit.description.name})"

    def fit(self) -> None:
        """Find what is missing and of another kind; disconnect the former."""
        self._system.allow_no_match(self._unit.name)
        absent: dict[Causality, list[str]] = {causality: [] for causality in _CAUSALITIES}
        for port in self._ports:
            v = port.declared
            found = _ports(self._unit.description)[v.causality].get(v.name)
            if found is not None:
                self._check(found, v)
                continue
            self._system.disconnect_port(PortName(self._unit.name, v.name))
            if port.is_required:
                self._system.add_fault(self._fault_of_missing(port))
            else:
                absent[v.causality].append(v.name)
        self._note(absent)

    def _check(self, found: FmuPort, wanted: Variable) -> None:
        """Check the kind of an output that the scenario itself reads, and of an input that was left as it matches none.

        Ports of connections are checked with these, and what an input is set to with the values.
        """
        end, system = PortName(self._unit.name, found.name), self._system
        is_set = found.name in (*system.fed_inputs(end.unit), *self._unit.start)
        is_used = is_set or any(c.source == end for c in system.connections)
        if found.causality is not wanted.causality or wanted.causality is Causality.PARAMETER or is_used:
            return
        if fault := _difference(found, wanted):
            self._system.add_fault(f"{end} ({found.signature}): {fault}, as that of {self._own.name}")

    def _fault_of_missing(self, port: PlacePort) -> str:
        v, d = port.declared, self._unit.description
        others = [n for n in _ports(d)[v.causality] if n not in {p.declared.name for p in self._ports}]
        elsewhere = next((c for c in _CAUSALITIES if v.name in _ports(d)[c] and c is not Causality.PARAMETER), None)
        like = [n for n in others if (p := _ports(d)[v.causality][n]).unit == v.unit and not _difference(p, v)]
        meant = suggestion(v.name, others) or did_you_mean(like)
        by_name = f"; {meant}" if meant else ""
        hint = f"; its {v.name} is an {elsewhere.value}" if elsewhere else by_name
        return f"{self._what} needs the {v.causality.value} {v.name} ({signature(v)}): {port.text}{hint}"

    def _note(self, absent: Mapping[Causality, Sequence[str]]) -> None:
        """Note what is left out, and which of the unit's inputs nothing feeds: their names may be misspelled."""
        if parts := [
            _without(causality, names, self._own.name, self._listed_by) for causality, names in absent.items() if names
        ]:
            self._system.notes.append(f"{self._what} has {'; '.join(parts)}")
        fed = {*self._system.fed_inputs(self._unit.name), *self._unit.start}
        missing = [n for names in absent.values() for n in names]
        for name in self._unit.description.outputs:
            if all(p.declared.name != name for p in self._ports) and (
                meant := suggestion(name, absent[Causality.OUTPUT])
            ):
                self._system.notes.append(f"{self._unit.name}.{name}: nothing reads it; {meant}")
        for name in self._unit.description.inputs:
            if name not in fed and all(p.declared.name != name for p in self._ports):
                text = f"{self._unit.name}.{name}: nothing feeds it, so it stays at its start value"
                meant = suggestion(name, missing)
                self._system.notes.append(f"{text}; {meant}" if meant else text)


def signature(v: Variable) -> str:
    """Return kind, shape, unit and items of what a block declares, as in `real [3] m`."""
    shape = f" [{','.join(map(str, v.shape))}]" if v.shape else ""
    unit = f" {v.unit.shown}" if v.kind is Kind.REAL and v.unit.shown else ""
    return f"{v.kind.value}{shape}{unit}"


def _without(causality: Causality, names: Sequence[str], own: str, listed_by: str) -> str:
    """Return which ports a unit does not have, and what the scenario does without them."""
    many = len(names) > 1
    what = {
        Causality.INPUT: f"what the scenario would feed {'them' if many else 'it'} is not connected",
        Causality.OUTPUT: f"what the scenario would make of {'them' if many else 'it'} is left out",
        Causality.PARAMETER: f"what the scenario would set {'them' if many else 'it'} to is not used",
    }
    named = ", ".join(names)
    if len(names) > _MOST_NAMED:
        named = f"of {own}'s {len(names)}, which `{listed_by}` shows"
    return f"no {causality.value}{'s' if many else ''} {named}: {what[causality]}"


def _difference(found: FmuPort, wanted: Variable) -> str | None:
    """Return how an output must be to be read like that of the scenario's own unit, None if it is."""
    if found.kind is not wanted.kind or found.shape != wanted.shape:
        return f"it must be {signature(wanted)}"
    if found.kind is Kind.ENUMERATION and found.items != wanted.items:
        return f"its items must be {', '.join(f'{name} = {value}' for name, value in wanted.items)}"
    a, b = found.unit, wanted.unit
    if found.kind is Kind.REAL and a != b and not needs_no_conversion(a, b):
        return f"its unit must be {b.symbol}"
    return None
