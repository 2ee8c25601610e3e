"""An FMU's model description in one form for FMI 2 and FMI 3: ports with kind, shape and unit, clocks, capabilities.

FMI 2 has no arrays, and some tools do not use those of FMI 3: scalar variables named `p[1]`, `p[2]`, ... (or `R[1,1]`,
...) that agree in type, causality, unit and timing are grouped to one array port `p`, so that FMUs of both standards
and both forms are interchangeable.
"""

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.units import UNKNOWN, BaseExponents, Unit
from handover.cosim.blocks.variable import ELEMENT, Causality, Declared, Kind, element_names, indices_of
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.clocks import FmuClock, clocks_of, without_clocks
from handover.cosim.fmu.file.default_experiment import DefaultExperiment, default_experiment
from handover.cosim.fmu.file.feedthrough import feedthrough_of
from handover.cosim.fmu.file.terminals import Terminals, read_terminals
from handover.cosim.fmu.file.xml import XmlElement, collection_paused

if TYPE_CHECKING:
    from handover.cosim.fmu.file.fmpy_edge import ModelVariable


KINDS = {
    "Real": Kind.REAL,
    "Float32": Kind.REAL,
    "Float64": Kind.REAL,
    "Integer": Kind.INTEGER,
    **{f"{sign}Int{bits}": Kind.INTEGER for sign in ("", "U") for bits in (8, 16, 32, 64)},
    "Boolean": Kind.BOOLEAN,
    "Enumeration": Kind.ENUMERATION,
    "String": Kind.STRING,
    "Binary": Kind.BINARY,
}
"""Kinds by the standards' types; clocks, and types of later standards, have none."""
_WIDTHS = {"Real": Width.FLOAT64, "Integer": Width.INT32, **{w.value: w for w in Width}}
_MOST_ENTRIES = 2**28
"""Of an array: 2 GiB of reals."""


@dataclass(frozen=True, kw_only=True)
class Capabilities:
    """Capability flags of the co-simulation interface, for both standards; those that a standard lacks are False.

    Attributes:
        varies_step: its communication step may change during a run.
        saves_state, serialises_state: its state can be saved and restored, also as bytes.
        interpolates_inputs: it accepts derivatives of its inputs (FMI 2).
        output_derivatives: the highest order of output derivatives that it provides.
        directional_derivatives: it provides directional derivatives.
        event_mode, returns_early: it has event mode, and may end a step before its end (FMI 3).
        once_per_process: a process may hold only one instance of it.
        needs_tool: it runs only where other software is installed.
    """

    varies_step: bool = False
    saves_state: bool = False
    serialises_state: bool = False
    interpolates_inputs: bool = False
    output_derivatives: int = 0
    directional_derivatives: bool = False
    event_mode: bool = False
    returns_early: bool = False
    once_per_process: bool = False
    needs_tool: bool = False


def capabilities_of(root: XmlElement, fmi: int) -> Capabilities:
    """Read the flags off a model description."""
    element = next(root.named("CoSimulation"), None)
    if element is None:
        return Capabilities()

    def flag(name: str) -> bool:
        return element.get(name) in ("true", "1")

    state = "FMUstate" if fmi == 2 else "FMUState"
    return Capabilities(
        varies_step=flag("canHandleVariableCommunicationStepSize"),
        saves_state=flag(f"canGetAndSet{state}"),
        serialises_state=flag(f"canSerialize{state}"),
        interpolates_inputs=fmi == 2 and flag("canInterpolateInputs"),
        output_derivatives=int(element.get("maxOutputDerivativeOrder", "0")),
        directional_derivatives=flag("providesDirectionalDerivative" + ("" if fmi == 2 else "s")),
        event_mode=fmi == 3 and flag("hasEventMode"),
        returns_early=fmi == 3 and flag("mightReturnEarlyFromDoStep"),
        once_per_process=flag("canBeInstantiatedOnlyOncePerProcess"),
        needs_tool=flag("needsExecutionTool"),
    )


@dataclass(frozen=True, kw_only=True)
class FmuPort(Declared):
    """A parameter, input or output of an FMU, or another variable whose start value can be given.

    Attributes:
        references: one value reference in all, or one for each entry.
        start: its start value as written, entries with spaces between them.
        mime: MIME type of a binary.
        discrete: whether it changes at events only.
        nominal: the usual magnitude of its values, in its unit, where the FMU declares it.
        clocks: it can be accessed only while one of these ticks; always where there are none.
        tunable: whether a parameter may be changed at communication points; else it is fixed from the start on.
        guess: its start value is one from which the unit finds the true one as it is initialised (`approx`).
    """

    fmi_type: str
    references: tuple[int, ...]
    start: str | None = None
    mime: str | None = None
    discrete: bool = False
    nominal: float | None = None
    clocks: tuple[str, ...] = ()
    tunable: bool = False
    guess: bool = False

    @property
    def is_continuous(self) -> bool:
        """Whether its value is a real number that changes between events."""
        return self.kind is Kind.REAL and not self.discrete

    @property
    def entry_names(self) -> list[str]:
        """Names of its variables in the FMU: its own, or one for each entry."""
        if len(self.references) == 1:
            return [self.name]
        return element_names(self)

    @property
    def signature(self) -> str:
        """Kind, unit and shape, as in `real [3] m`, for messages."""
        shape = f" [{','.join(map(str, self.shape))}]" if self.shape else ""
        unit = self.unit.shown if self.kind is Kind.REAL else ""
        extra = self.mime if self.kind is Kind.BINARY else unit
        return f"{self.kind.value}{shape}{' ' + extra if extra else ''}"


@dataclass(frozen=True, kw_only=True)
class FmuDescription:
    """An FMU's ports and identity.

    `feedthrough` names, by output, the inputs with declared direct feedthrough to it. `presumed_feedthrough` names them
    where an FMU declares no dependencies, which the standards take as all inputs, or does not list the output at all.
    `initial_feedthrough` and `presumed_initial_feedthrough` are the same in initialization mode (`InitialUnknowns`).

    `sampled` says that all outputs are discrete and the step is fixed: such a unit computes at instants, from the
    inputs of the instant. It is stepped without event mode, where it samples by itself, even if it declares a clock for
    hosts with event mode. So its results are the same in all hosts. That needs ports that can be accessed without a
    clock, so a unit with clocked ports, or with clocks that are not constant, is not sampled in this sense.

    `initial` are outputs and local variables whose start values may be given (`initial` is `exact` or `approx`).

    `step` is the communication step that it proposes, in seconds. `untouched_fault` says how its model description
    breaks the standard in parts that co-simulation does not touch; a run warns of it. `terminals` group ports that are
    connected together.
    """

    path: Path
    fmi: int
    name: str
    identifier: str
    token: str
    step: float | None
    parameters: Mapping[str, FmuPort]
    inputs: Mapping[str, FmuPort]
    outputs: Mapping[str, FmuPort]
    feedthrough: Mapping[str, tuple[str, ...]]
    presumed_feedthrough: Mapping[str, tuple[str, ...]]
    sampled: bool
    initial_feedthrough: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    presumed_initial_feedthrough: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    capabilities: Capabilities = Capabilities()
    experiment: DefaultExperiment = DefaultExperiment()
    untouched_fault: str = ""
    clocks: Mapping[str, FmuClock] = field(default_factory=dict[str, FmuClock])
    initial: Mapping[str, FmuPort] = field(default_factory=dict[str, FmuPort])
    terminals: Terminals = Terminals()

    @property
    def settable(self) -> dict[str, FmuPort]:
        """All variables that can be given start values."""
        return {**self.parameters, **self.inputs, **self.initial}

    def __repr__(self) -> str:
        """Return what it is; all that it has is too long for a line."""
        counts = f"{len(self.inputs)} inputs, {len(self.outputs)} outputs, {len(self.parameters)} parameters"
        return f"<FMI {self.fmi} unit {self.name}: {counts}>"

    def _repr_html_(self) -> str:
        from handover.cosim.fmu.file.port_table import description_html  # of notebooks alone

        return description_html(self)


@collection_paused()
def describe_fmu(path: Path) -> FmuDescription:
    """Read an FMU's model description (FMI 2.0 or 3.0, co-simulation).

    Raises:
        InvalidFmu: the file is missing, not an FMU, of another standard, has no co-simulation interface, a fault in
            what co-simulation reads of its description, or a clock with an invalid interval.
    """
    from handover.cosim.fmu.file.fmpy_edge import mime_types, read_description  # FMPy takes long to import

    md, root, untouched_fault = read_description(path)
    experiment = default_experiment(root)
    is_fmi2 = md.fmiVersion == "2.0"
    units = {u.name: _unit(u) for u in md.unitDefinitions}
    mimes = {} if is_fmi2 else mime_types(root)
    ports = [_port(v, units, mimes) for v in md.modelVariables if v.causality in ("parameter", "input", "output")]
    starting = [_port(v, units, mimes) for v in md.modelVariables if _is_started(v)]
    ports = [p for p in ports if p is not None]
    if large := [p for p in ports if p.size > _MOST_ENTRIES]:
        shape = ",".join(map(str, large[0].shape))
        raise InvalidFmu(path, f"its {large[0].name} [{shape:.60}] has more than {_MOST_ENTRIES} entries")
    grouped = _group_elements(ports)
    by_causality: dict[Causality, dict[str, FmuPort]] = {c: {} for c in Causality}
    for p in grouped:
        by_causality[p.causality][p.name] = p
    feedthrough = feedthrough_of(md, grouped)
    outputs = [v for v in md.modelVariables if v.causality == "output"]
    capabilities = capabilities_of(root, 2 if is_fmi2 else 3)
    clocks = _clocks(path, root)
    is_discrete = bool(outputs) and all(v.variability == "discrete" for v in outputs)
    is_clocked = not without_clocks(clocks) or any(p.clocks for p in grouped)
    return FmuDescription(
        path=path,
        fmi=2 if is_fmi2 else 3,
        name=md.modelName or md.coSimulation.modelIdentifier,
        identifier=md.coSimulation.modelIdentifier,
        token=md.guid or "",
        step=experiment.step,
        experiment=experiment,
        untouched_fault=untouched_fault,
        parameters=by_causality[Causality.PARAMETER],
        inputs=by_causality[Causality.INPUT],
        outputs=by_causality[Causality.OUTPUT],
        feedthrough=feedthrough.declared,
        presumed_feedthrough=feedthrough.presumed,
        initial_feedthrough=feedthrough.initially_declared,
        presumed_initial_feedthrough=feedthrough.initially_presumed,
        sampled=is_discrete and not capabilities.varies_step and not is_clocked,
        capabilities=capabilities,
        clocks=clocks,
        initial={p.name: p for p in _group_elements([p for p in starting if p is not None])},
        terminals=read_terminals(
            FmuArchive(path),
            {v.name: v.causality for v in md.modelVariables},
            {**by_causality[Causality.INPUT], **by_causality[Causality.OUTPUT]},
        ),
    )


def _is_started(v: "ModelVariable") -> bool:
    """Return whether an output or a local variable can be set before the start (FMI 2.0.4, sec. 2.2.7: `initial`)."""
    given = v.initial in ("exact", "approx") and v.start is not None
    return given and v.causality in ("output", "local") and v.variability != "constant"


def _clocks(path: Path, root: XmlElement) -> dict[str, FmuClock]:
    try:
        return clocks_of(root)
    except ValueError as e:
        raise InvalidFmu(path, str(e)) from e


def _unit(u: Any) -> Unit:
    if u.baseUnit is None:
        return Unit(u.name, defined=False)
    names = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    base = BaseExponents(**{n: int(getattr(u.baseUnit, n) or 0) for n in names})
    return Unit(u.name, base, float(u.baseUnit.factor or 1.0), float(u.baseUnit.offset or 0.0))


def _port(v: "ModelVariable", units: Mapping[str, Unit], mimes: Mapping[str, str]) -> FmuPort | None:
    kind = KINDS.get(v.type)
    if kind is None:  # clocks, see `handover.cosim.fmu.file.clocks`, and types of later standards
        return None
    declared = v.declaredType
    unit = v.unit or (declared.unit if declared is not None else None)
    relative = v.relativeQuantity
    if relative is None:
        relative = declared is not None and declared.relativeQuantity
    nominal = v.nominal if v.nominal is not None or declared is None else declared.nominal
    items: list[Any] = declared.items if declared is not None and kind is Kind.ENUMERATION else []
    low = v.min if v.min is not None or declared is None else declared.min
    high = v.max if v.max is not None or declared is None else declared.max
    return FmuPort(
        name=v.name,
        kind=kind,
        causality=Causality(v.causality),
        fmi_type=v.type,
        references=(v.valueReference,),
        shape=tuple(v.shape or ()),
        unit=_unit_of(unit, units, relative),
        start=v.start,
        minimum=float(low) if low is not None else None,
        maximum=float(high) if high is not None else None,
        items=tuple((i.name, int(i.value)) for i in items),
        mime=mimes.get(v.name),
        discrete=(v.variability or ("continuous" if kind is Kind.REAL else "discrete")) != "continuous",
        nominal=float(nominal) if nominal is not None else None,
        width=_WIDTHS.get(v.type),
        description=v.description or "",
        clocks=tuple(c.name for c in v.clocks or ()),
        tunable=v.causality == "parameter" and v.variability == "tunable",
        guess=v.initial == "approx",
    )


def _unit_of(name: str | None, units: Mapping[str, Unit], relative: bool) -> Unit:
    """Return a variable's unit; that of a difference (5 degC of warming) has no offset."""
    if not name:
        return UNKNOWN
    unit = units.get(name, Unit(name, defined=False))
    return replace(unit, offset=0.0) if relative else unit


def _group_elements(ports: list[FmuPort]) -> list[FmuPort]:
    """Return the ports, with scalars that are elements of an array grouped to one array port."""
    groups: dict[str, list[tuple[tuple[int, ...], FmuPort]]] = defaultdict(list)
    for p in ports:
        is_entry = p.name.endswith("]") and not p.shape and p.kind is not Kind.BINARY
        match = ELEMENT.match(p.name) if is_entry else None
        indices = tuple(int(i) for i in match[2].split(",")) if match else ()
        groups[match["base"] if match else p.name].append((indices, p))
    grouped: list[FmuPort] = []
    for base, members in groups.items():
        if len(members) == 1 and not members[0][0]:
            grouped.append(members[0][1])
            continue
        members.sort(key=lambda m: m[0])
        first = members[0][1]
        shape = members[-1][0]
        is_complete = math.prod(shape) == len(members) and [m[0] for m in members] == indices_of(shape)
        is_uniform = len({(p.fmi_type, p.causality, p.unit, p.discrete, p.clocks, p.tunable) for _, p in members}) == 1
        if shape and is_complete and is_uniform:
            starts = [p.start for _, p in members]
            start = None if None in starts else " ".join(str(s) for s in starts)
            references = tuple(p.references[0] for _, p in members)
            grouped.append(replace(first, name=base, references=references, shape=shape, start=start))
        else:
            grouped.extend(p for _, p in members)
    return grouped
