"""Units, their parameters and the connections between them, checked before anything is loaded.

`System` collects what is wired, and `System.check` reports everything that is wrong with it: names, values, clocks, and
connections whose ports do not fit each other.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import count
from numbers import Rational
from os import PathLike
from pathlib import Path
from typing import Any, overload

from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.exceptions import InvalidFmu, WiringError
from handover.cosim.fmu.file.archive import description_state
from handover.cosim.fmu.file.default_experiment import (
    NO_STEP,
    DefaultExperiment,
    NoStep,
    exact_text,
    presumed_step,
    proposed_step,
)
from handover.cosim.fmu.file.description import FmuDescription, describe_fmu
from handover.cosim.system.conversion import LinearTransformation, conversion
from handover.cosim.system.matching import (
    Ambiguity,
    DoNotMatch,
    MatchedPorts,
    TerminalEnd,
    TerminalFault,
    matched_members,
    matched_ports_of_terminals,
    matches_of,
)
from handover.cosim.system.port_names import (
    Connection,
    PlacedUnit,
    PortName,
    PortNames,
    ambiguity,
    check_end,
    check_port,
    unit_of,
)
from handover.cosim.system.time_series import ExternalSource, NoSource, TimeSeries
from handover.cosim.system.wiring_faults import (
    clock_of,
    connection_doubt,
    connection_faults,
    event_faults,
    no_unit,
    outside_fault,
    period_doubt,
    port_fault,
    series_fault,
    value_faults,
)
from handover.cosim.typed_data import UNIT_NAME

_NUMBERS = count()
"""Of the systems of this process."""


class System:
    """Units and connections. No FMU is loaded: model descriptions are read, and the wiring is checked by them."""

    def __init__(self) -> None:
        self.units: dict[str, PlacedUnit] = {}
        self.connections: list[Connection] = []
        self.start = Fraction(0)
        """When its run starts, s, exactly."""
        self._sources: dict[str, dict[str, PortName]] = {}  # by unit, by input
        self._matches: dict[PortName, list[Connection]] = {}  # by input, what matches it
        self._unsettled: list[TerminalFault | Ambiguity] = []  # of terminals, unless their inputs are fed otherwise
        self._unmatched: dict[tuple[str, str], str] = {}  # by two units of which nothing matches, what there is
        self.followed: dict[PortName, TimeSeries] = {}
        """By input, the values over time that inputs follow."""
        self.externals: dict[PortName, ExternalSource] = {}
        """By input, the sources of inputs that come from outside."""
        self.notes: list[str] = []
        """Lines to show before it is run or exported, such as connections and values that its units need not have."""
        self._faults: list[str] = []
        self._name_faults: dict[str, str] = {}  # by unit
        self._step_faults: dict[str, NoStep] = {}  # by unit that has no communication step
        self._presumed_steps: dict[str, str] = {}  # by unit, what its step was taken from
        self._tolerated: list[str] = []
        self._descriptions: dict[tuple[Path, tuple[int, int] | None], FmuDescription] = {}
        self._number = next(_NUMBERS)  # which its units and their ports have

    def __copy__(self) -> "System":
        """Return a system with the same units, whose ports are valid in both; a change of one leaves the other."""
        made = System()
        for name, value in vars(self).items():
            if name != "_number":
                setattr(made, name, value.copy() if isinstance(value, (dict, list)) else value)
        made._sources = {unit: {**sources} for unit, sources in self._sources.items()}
        made._matches = {target: [*matches] for target, matches in self._matches.items()}
        return made

    def add(
        self, name: str, fmu: Path | str | FmuDescription, *, period: Fraction | None = None,
        sampled: bool | None = None, start: Mapping[str, Any] | None = None, **values: Any,
    ) -> PlacedUnit:  # fmt: skip
        """Add a unit under a name, with start values of its parameters and inputs, `add("arm", "arm.fmu", m=2.0)`.

        `start` has those whose names are none in Python, or are those of arguments: `start={"period": 0.5}`.

        `period` is its communication step in seconds. By default it is the step that its FMU proposes, or else a 500th
        of its default experiment, to one digit. `sampled` says whether it computes at instants, by default as its FMU
        declares: see `FmuDescription`. The returned unit gives port names for `connect`: inputs `unit.u.x`, outputs
        `unit.y.x`.

        Raises:
            InvalidFmu: the file is not a valid co-simulation FMU.
            TypeError: the period is not exact, an argument is of another type, or a value is given twice.
        """
        if not isinstance(name, str):  # type: ignore
            raise TypeError(f"name = {name!r:.60}: expected a text, such as 'arm'")
        if not isinstance(fmu, (str, PathLike, FmuDescription)):  # type: ignore
            raise TypeError(f"unit {name}: fmu = {fmu!r:.60}: expected the path of an FMU, such as 'arm.fmu'")
        if not (sampled is None or isinstance(sampled, bool)):  # type: ignore
            raise TypeError(f"unit {name}: sampled = {sampled!r:.60}: expected True or False{_as_value('sampled')}")
        if not (start is None or isinstance(start, Mapping)):  # type: ignore
            raise TypeError(f"unit {name}: start = {start!r:.60}: expected values by name{_as_value('start')}")
        if twice := [n for n in start or {} if n in values]:
            raise TypeError(f"unit {name}: {', '.join(twice)} stands in start and besides it: give one value")
        description = fmu if isinstance(fmu, FmuDescription) else self._described(Path(fmu))
        if not re.fullmatch(UNIT_NAME, name):
            self._name_faults[name] = f"a unit is called {name!r:.60}: expected a name that is seen, in one line"
        if name in self.units:
            self._name_faults[name] = f"two units are called {name!r}"
        period = self._period(name, description.experiment, period)
        is_sampled = description.sampled if sampled is None else sampled
        unit = PlacedUnit(name, description, {**(start or {}), **values}, period, is_sampled, self._number)
        self.units[name] = unit
        return unit

    def set_step(self, period: Fraction) -> None:
        """Give all units one communication step in seconds; sampled FMUs tick by themselves at their own period.

        Raises:
            TypeError: it is not exact.
        """
        self.units = {
            n: replace(u, period=self._period(n, u.description.experiment, period)) for n, u in self.units.items()
        }

    def presume_steps(self, duration: Fraction) -> None:
        """Give units that have no communication step a 500th of a run's duration in seconds, to one digit."""
        if (step := presumed_step(duration)) is None:
            return
        for name in self.without_step:
            self.presume_step(name, step, "a 500th of the run")

    @property
    def without_step(self) -> list[str]:
        """Names of the units that have no communication step."""
        return [name for name in self._step_faults if name in self.units]

    def presume_step(self, name: str, step: Fraction, source: str) -> None:
        """Give a unit that has no communication step one in seconds; a line says where that comes from."""
        self.units[name] = replace(self.units[name], period=step)
        self._presume(name, step, source)
        del self._step_faults[name]

    @overload
    def connect(
        self, source: PortName, target: PortName, transformation: LinearTransformation | None = None
    ) -> MatchedPorts | None: ...
    @overload
    def connect(self, source: PortNames, target: PortNames) -> MatchedPorts: ...
    def connect(
        self,
        source: PortName | PortNames,
        target: PortName | PortNames,
        transformation: LinearTransformation | None = None,
    ) -> MatchedPorts | None:
        """Let an output feed an input, `connect(arm.y.x, camera.u.x)`, or all that match, `connect(arm.y, camera.u)`.

        Real values are converted to the input's unit where both have the same dimension. A `transformation` replaces
        that conversion, whatever the units; it is for one connection of real values. Instead of ports, two terminals
        can be named, `connect(arm.y.gripper, camera.u.gripper)`: all outputs of the one feed the inputs of the other.
        Where the two do not match, none does, and `check` says why. Of terminals, what was connected is returned.

        Of two units, terminals that match are connected first: by their names, then by their kinds. Each other input is
        fed by the output of the same name, kind and shape whose unit is the same or can be converted. Inputs of a
        terminal that is refused are left. So is an input that is connected by its own name, follows values or comes
        from outside, whether that was said before or is said later. What was connected and what was left is returned.

        `check` finds inputs that several units match, terminals of which several match or that do not match as they
        should, until their inputs are fed otherwise. It finds two units of which nothing matches, too.

        Raises:
            TypeError: an end is not a port, or not the outputs or inputs of a unit, or units or terminals are connected
                with a transformation, which is for one connection.
            ValueError: an end is a port of another `System`, or a whole unit is not of this one.
        """
        for end, ports in ((source, "y"), (target, "u")):
            check_end(end, ports, self.units, self._number)
        if isinstance(source, PortNames) or isinstance(target, PortNames):
            if transformation is not None:
                raise TypeError("a transformation is for one connection: give unit.y.NAME and unit.u.NAME")
            return self._connect_matching(source, target)
        a, b = self._terminal(source), self._terminal(target)
        if a is None or b is None:
            self._connect(Connection(source, target, transformation))
            return None
        if transformation is not None:
            raise TypeError("a transformation is for one connection: give unit.y.NAME and unit.u.NAME")
        return self._connect_terminals(a, b)

    def _terminal(self, end: PortName) -> TerminalEnd | None:
        """Return the terminal that an end names; None where it names a port, as any terminal is hidden by."""
        unit = self.units.get(end.unit)
        if unit is None or end.port in {**unit.description.settable, **unit.description.outputs}:
            return None
        found = unit.description.terminals.by_name.get(end.port)
        return None if found is None else (end.unit, unit.description, found)

    def _connect_terminals(self, a: TerminalEnd, b: TerminalEnd) -> MatchedPorts:
        connections: list[Connection] = []
        try:
            connections = matched_members(a, b)
            if not connections:
                raise DoNotMatch("no output of the one has an input of the other")
        except DoNotMatch as e:
            what = f"{a[0]}.{a[2].name} -> {b[0]}.{b[2].name}: terminals that do not match: {e}"
            self._faults.append(f"{what}; connect the ports that are meant one by one instead")
        for c in connections:
            self._connect(c)
        return matched_ports_of_terminals(a, b, connections)

    def _connect(self, c: Connection) -> None:
        self._forget_matches(c.target)
        self._add(c)

    def _add(self, c: Connection) -> None:
        self.connections.append(c)
        self._feed(c)

    def _feed(self, c: Connection) -> None:
        self._sources.setdefault(c.target.unit, {})[c.target.port] = c.source

    def _connect_matching(self, source: Any, target: Any) -> MatchedPorts:
        a, b = unit_of(source, Causality.OUTPUT), unit_of(target, Causality.INPUT)
        inputs = self.units[b].description.inputs
        matches = matches_of(a, self.units[a].description, b, self.units[b].description)
        if matches.nothing:
            self._unmatched[a, b] = matches.nothing
        self._unsettled += [x for x in (*matches.faults, *matches.ambiguities) if x not in self._unsettled]
        fed = {
            port: f"{end} feeds it"
            for port, end in self._sources.get(b, {}).items()
            if PortName(b, port) not in self._matches
        }
        fed |= dict.fromkeys(_ports_of(b, self.followed), "it follows values over time")
        fed |= dict.fromkeys(_ports_of(b, self.externals), "it comes from outside")
        left = {n: fed.get(n, matches.left.get(n, "")) for n in inputs if n in {**matches.connections, **matches.left}}
        for port, c in matches.connections.items():
            if port in fed:
                continue
            known = self._matches.setdefault(c.target, [])
            if c not in known:
                known.append(c)
                if len(known) == 1:
                    self._add(c)
            left[port] = f"{known[0].source} matches it, too" if known[0] != c else ""
        return matches.matched_ports(a, b, inputs, left, fed)

    def _forget_matches(self, target: PortName) -> None:
        """Take back that an input was connected by its match, as something else is said of it."""
        if self._matches.pop(target, None):
            self.connections = [c for c in self.connections if c.target != target]
            self._sources.get(target.unit, {}).pop(target.port, None)  # several matches may be left, and none connected

    def disconnect(self, end: PortName) -> None:
        """Remove the connections of a port, or of all ports of a terminal, and what they are set to or follow.

        Raises:
            ValueError: there is no such port, it is of another `System`, or the terminal has a fault, so that its ports
                are not known.
            TypeError: it is not a port.
        """
        self._check_port(end, "unit.y.NAME or unit.u.NAME")
        if (found := self._terminal(end)) is None:
            if fault := port_fault(self.units, end):
                raise ValueError(fault)
            self.disconnect_port(end)
            return
        _, _, terminal = found
        if terminal.reason:
            raise ValueError(f"terminal {end}: {terminal.reason}; disconnect its ports one by one")
        for member in terminal.members:
            self.disconnect_port(PortName(end.unit, member.port))

    def disconnect_port(self, end: PortName) -> None:
        """Remove the connections of a port alone, whether the unit has a port of this name or not.

        Raises:
            TypeError: it is not a port.
            ValueError: it is of another `System`, or there is no such unit.
        """
        self._check_port(end, "unit.y.NAME or unit.u.NAME")
        if end.unit not in self.units:
            raise ValueError(no_unit(self.units, end))
        self._matches.pop(end, None)
        for matches in self._matches.values():
            matches[:] = [m for m in matches if m.source != end]
        self.connections = [c for c in self.connections if end not in (c.source, c.target)]
        for sources in self._sources.values():
            for port in [p for p, source in sources.items() if source == end]:
                del sources[port]
        self._sources.get(end.unit, {}).pop(end.port, None)
        self.followed.pop(end, None)
        self.externals.pop(end, None)
        unit = self.units[end.unit]
        self.units[end.unit] = replace(unit, start={n: x for n, x in unit.start.items() if n != end.port})
        self._connect_last_matches()

    def _connect_last_matches(self) -> None:
        """Connect inputs whose match was taken away and that one other output matches."""
        for target, (match,) in [(t, m) for t, m in self._matches.items() if len(m) == 1]:
            if target.port not in self._sources.get(target.unit, {}):
                self._add(match)

    def remove(self, name: str) -> None:
        """Remove a unit with all that is said of it.

        Raises:
            KeyError: there is no such unit.
        """
        del self.units[name]
        for table in (self._sources, self._name_faults, self._step_faults, self._presumed_steps):
            table.pop(name, None)
        for ends in (self._matches, self.followed, self.externals):
            for end in [end for end in ends if end.unit == name]:
                del ends[end]
        self._matches = {
            target: left
            for target, matches in self._matches.items()
            if (left := [c for c in matches if c.source.unit != name])
        }
        self._unsettled = [x for x in self._unsettled if name not in (x.source, x.target)]
        self.allow_no_match(name)
        self.connections = [c for c in self.connections if name not in (c.source.unit, c.target.unit)]
        for sources in self._sources.values():
            for port in [port for port, source in sources.items() if source.unit == name]:
                del sources[port]
        self._connect_last_matches()

    def prefer_matches(self, is_preferred: Callable[[PortName], bool]) -> dict[PortName, list[PortName]]:
        """Where several outputs match an input, leave those that are not preferred.

        Args:
            is_preferred: returns whether an output is; it is called only with such outputs.

        Returns:
            By input of whose matches none is preferred, so that none of them feeds it, the outputs that match it.
        """
        unfed: dict[PortName, list[PortName]] = {}
        for target, matches in [(t, list(m)) for t, m in self._matches.items() if len(m) > 1]:
            kept = [c for c in matches if is_preferred(c.source)]
            if not kept:
                unfed[target] = [c.source for c in matches]
                self._forget_matches(target)
            elif len(kept) < len(matches):
                self._matches[target] = kept
                i = next((i for i, c in enumerate(self.connections) if c.target == target), len(self.connections))
                self.connections[i : i + 1] = kept[:1]  # in the same place: the order of connections stays
                self._feed(kept[0])
        return unfed

    def allow_no_match(self, unit: str) -> None:
        """Let `check` accept that nothing matches of this unit and another with which it was connected as a whole."""
        self._unmatched = {units: text for units, text in self._unmatched.items() if unit not in units}

    def add_fault(self, fault: str) -> None:
        """Let `check` raise a fault that the caller has found, besides those that it finds."""
        self._faults.append(fault)

    def tolerate(self, line: str) -> None:
        """Add to what is `tolerated`."""
        self._tolerated.append(line)

    def follow(self, target: PortName, series: TimeSeries) -> None:
        """Let an input that no output feeds follow values over time, which are in its unit.

        Raises:
            TypeError: the target is not a port, or these are no values over time.
            ValueError: it is a port of another `System`.
        """
        self._check_port(target)
        if not isinstance(series, TimeSeries):  # type: ignore
            raise TypeError(f"{target} cannot follow {series!r:.60}: expected a TimeSeries, as of Record.series")
        self._forget_matches(target)
        self.followed[target] = series

    def external(self, target: PortName, source: ExternalSource | None = None) -> None:
        """Let an input that no output feeds come from outside: its source is asked at each communication point.

        Observers see the value as the signal `unit.port`, so a record holds it; a run whose sources are
        `Record.series` of these does what the recorded one did, byte for byte. A second call puts another source in
        the place of the first.

        Args:
            target: the input.
            source: gives its values, in its unit; None gives none, and the input keeps its start value.

        Raises:
            TypeError: the target is not a port, or the source gives no values.
            ValueError: it is a port of another `System`.
        """
        self._check_port(target)
        if source is not None and not callable(getattr(source, "at", None)):
            raise TypeError(f"{target} cannot come from {source!r:.60}: expected an object with a method at(t)")
        self._forget_matches(target)
        self.externals[target] = NoSource() if source is None else source

    def check(self) -> None:
        """Check all names, values and connections.

        Raises:
            WiringError: with every fault of the system.
        """
        faults = [
            *self._name_faults.values(),
            *self._faults,
            *self._step_faults.values(),
            *self._unmatched.values(),
            *(str(left) for x in self._unsettled if (left := x.remaining(self._feeds(x.target)))),
        ]
        outputs = Counter(f"{name}.{port}" for name, u in self.units.items() for port in u.description.outputs)
        faults += [f"two outputs are called {name}: call a unit otherwise" for name, n in outputs.items() if n > 1]
        faults += [ambiguity(to, [c.source for c in cs]) for to, cs in self._matches.items() if len(cs) > 1]
        if not isinstance(self.start, Rational):  # type: ignore
            faults.append(f"its start, {self.start!r}, is not exact; give {exact_text(self.start)}")
        for unit in self.units.values():
            faults += value_faults(unit.name, unit.description, unit.start)
            faults += event_faults(unit.name, unit.description, unit.sampled)
        fed: dict[PortName, PortName] = {}
        for c in self.connections:
            faults += connection_faults(self.units, c)
            if c.target in fed:
                faults.append(f"{c.target} is fed twice: by {fed[c.target]} and by {c.source}")
            fed[c.target] = c.source
        for end, series in self.followed.items():
            faults += series_fault(self.units, end, self._sources.get(end.unit, {}), series)
        for end, source in self.externals.items():
            faults += outside_fault(self.units, end, self._sources.get(end.unit, {}), self.followed, source)
        if faults:
            raise WiringError(faults)

    def __repr__(self) -> str:
        """Return its units' names."""
        return f"<system of {', '.join(self.units) or 'no units'}>"

    def _repr_html_(self) -> str | None:  # None: a notebook shows the names
        from handover.cosim.system.graph import system_svg  # of notebooks alone

        return system_svg(self) if self.units else None

    @property
    def untouched_faults(self) -> dict[Path, str]:
        """How model descriptions break the standard in what co-simulation does not touch, or need not here, by FMU."""
        faults: dict[Path, str] = {}
        for d in (u.description for u in self.units.values()):
            lines = [f for f in (d.untouched_fault, d.experiment.step_fault) if f]
            if lines:
                faults[d.path] = "; ".join(lines)
        return faults

    @property
    def tolerated(self) -> list[str]:
        """What is not as it should be with a checked system that can be run nonetheless; see `MasterOptions.strict`."""
        doubts = [*map(period_doubt, self.units.values())]
        doubts += [connection_doubt(self.units, c) for c in self.connections]
        return [*self._presumed_steps.values(), *self._tolerated, *filter(None, doubts)]

    @property
    def remarks(self) -> list[str]:
        """Lines to show before a run or an export: `tolerated`, `undefined_starts` and `notes`."""
        return [*self.tolerated, *self.undefined_starts, *self.notes]

    @property
    def undefined_starts(self) -> list[str]:
        """Variables whose start value in the FMU is NaN and that get no other, a line each."""
        return [
            f"{unit.name}.{name} starts from NaN, as its FMU says: give it a value, or see that the unit computes one"
            for unit in self.units.values()
            for name, port in unit.description.settable.items()
            if port.kind is Kind.REAL and "nan" in (port.start or "").lower()
            if name not in unit.start and name not in self.fed_inputs(unit.name)
        ]

    @property
    def has_events(self) -> bool:
        """Whether a unit runs in event mode: then steps may end at any time, not only on the schedule's grid."""
        return any(u.uses_events for u in self.units.values())

    def sources_of(self, unit: str) -> dict[str, PortName]:
        """Return, by input's name, the outputs that feed a unit; its clocks are not among them."""
        sources = self._sources.get(unit, {})
        clocks = self.units[unit].description.clocks if unit in self.units else ()
        return {port: source for port, source in sources.items() if port not in clocks}

    def fed_inputs(self, unit: str) -> list[str]:
        """Return the names of the inputs of a unit that are set during a run."""
        return [*self.sources_of(unit), *_ports_of(unit, self.followed), *_ports_of(unit, self.externals)]

    def _feeds(self, unit: str) -> dict[str, PortName | None]:
        """Return by input that is set during a run the output that feeds it; None where no output does."""
        sources = self._sources.get(unit, {})
        return {port: sources.get(port) for port in self.fed_inputs(unit)}

    def clock_connections(self) -> list[Connection]:
        """Return the connections between clocks."""
        return [c for c in self.connections if c.target.port in self.units[c.target.unit].description.clocks]

    def transformation_of(self, c: Connection) -> LinearTransformation | None:
        """Return how a valid connection transforms values; None where it copies them, or connects clocks."""
        transformation = c.transformation
        if clock_of(self.units, c.target):
            return None
        if transformation is None:
            a = self.units[c.source.unit].description.outputs[c.source.port]
            b = self.units[c.target.unit].description.inputs[c.target.port]
            if a.kind is not Kind.REAL or a.unit == b.unit or not (a.unit.defined and b.unit.defined):
                return None
            transformation = conversion(a.unit, b.unit)
        return None if transformation.is_identity else transformation

    def _period(self, name: str, proposed: DefaultExperiment, period: Fraction | None) -> Fraction:
        if period is not None and not isinstance(period, Rational):  # type: ignore
            right = f"give {exact_text(period)}{_as_value('period')}"
            raise TypeError(f"{name}: period = {period!r} is not exact, so time would drift; {right}")
        self._step_faults.pop(name, None)
        self._presumed_steps.pop(name, None)
        if period is not None and period > 0:
            return Fraction(period)
        if period is None and (step := proposed_step(proposed.step)) is not None:
            return step
        if period is None and (step := proposed.presumed_step) is not None:
            self._presume(name, step, "a 500th of its default experiment")
            return step
        reason = proposed.step_fault or NO_STEP if period is None else f"its communication step is {period} s"
        self._step_faults[name] = NoStep(name, reason)
        return Fraction(1, 100)  # any: `check` reports the fault, but more units can be added until then

    def _check_port(self, end: object, right: str = "unit.u.NAME") -> None:
        check_port(end, right, self.units, self._number)

    def _presume(self, name: str, step: Fraction, source: str) -> None:
        self._presumed_steps[name] = f"{name}: {NO_STEP}; {float(step):g} s is taken, {source}"

    def _described(self, path: Path) -> FmuDescription:
        if str(path).isidentifier() and not path.exists():
            raise InvalidFmu(path, f"there is no such file; a unit of the catalog is handover.unit({str(path)!r})")
        key = path, _state(path)  # a rebuilt FMU is another one
        if key not in self._descriptions:
            self._descriptions[key] = describe_fmu(path)
        return self._descriptions[key]


def _state(fmu: Path) -> tuple[int, int] | None:
    try:
        return description_state(fmu)
    except OSError:
        return None


def _as_value(name: str) -> str:
    """Return how a variable of an FMU is given that is named like an argument."""
    return f"; a variable that is called so is given by start={{{name!r}: VALUE}}"


def _ports_of(unit: str, ends: Iterable[PortName]) -> list[str]:
    """Return the ports of one unit among ends."""
    return [end.port for end in ends if end.unit == unit]
