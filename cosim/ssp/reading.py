"""Reads SystemStructure.ssd and the parameter files that it refers to."""

import re
from collections.abc import Iterator, Mapping
from fractions import Fraction

from handover.cosim.blocks.units import UNKNOWN, Unit
from handover.cosim.fmu.file.default_experiment import INVALID_STEP, SHORTEST_STEP, proposed_step
from handover.cosim.fmu.file.xml import XmlElement
from handover.cosim.ssp.archive import SspArchive
from handover.cosim.ssp.parameter_set import (
    SspValue,
    mapped_values,
    read_linear,
    read_mapping,
    read_parameter_set,
    read_units,
    unit_named,
)
from handover.cosim.ssp.structure import (
    SspComponent,
    SspConnection,
    SspConnector,
    SspEnd,
    SspNestedSystem,
    SspStructure,
)
from handover.cosim.ssp.xml import (
    OMS_ANNOTATION,
    OSP_ANNOTATION,
    STEP_ANNOTATION,
    SspPart,
    local,
    short_name,
)

FMU_TYPE = "application/x-fmu-sharedlibrary"
SET_TYPE = "application/x-ssp-parameter-set"
MAPPING_TYPE = "application/x-ssp-parameter-mapping"

_PERIOD = re.compile(r"[1-9]\d{0,11}(/[1-9]\d{0,11})?")
"""Seconds as `write_ssp` writes them; limited in length, as longer fractions could take long to compute with."""

_MAX_NAME = 255
"""Characters of an element's name: units keep it in fixed buffers, and files may be called by it."""

_NO_TYPES = ("ConnectorGeometry", "Annotations", "Dimension", "MetaData", "Signature")
"""Children of a connector that are not its type."""


def read_structure(archive: SspArchive) -> SspStructure:
    """Read the structure of an SSP's system.

    Raises:
        InvalidSsp: it is malformed, or refers to what is missing, or to what is not supported and cannot be left out.
    """
    with archive.opened():
        part = SspPart(archive.path, archive.structure_name, archive.structure(), "ssd:SystemStructureDescription")
        systems = list(part.children(part.root, "ssd:System"))
        if len(systems) != 1:
            raise part.fault(part.root, f"there are {len(systems)} outermost systems; expected one")
        reader = _Reader(archive, part, read_units(part, part.root, "ssd"))
        system = reader.system(systems[0])
        return SspStructure(
            part.text(part.root, "name"),
            system,
            *_times(part),
            _annotated_period(part, systems[0], "parallel"),
            _step_of_system(part, systems[0]),
            tuple(part.unsupported),
            tuple(part.tolerated),
        )


def _times(part: SspPart) -> tuple[float, float | None]:
    """Return start and stop time of the default experiment, s."""
    for experiment in part.children(part.root, "ssd:DefaultExperiment"):
        start = part.number(experiment, "startTime", 0.0)
        if "stopTime" not in experiment.attributes:
            return start, None
        stop = part.number(experiment, "stopTime")
        if stop <= start:
            raise part.fault(
                experiment, f"the default experiment ends at {stop:g} s; expected a time above {start:g} s"
            )
        return start, stop
    return 0.0, None


def _annotated_period(part: SspPart, e: XmlElement, name: str) -> Fraction | None:
    """Return an attribute of the annotation in which `write_ssp` keeps a communication step."""
    for child in _annotated(part, e, STEP_ANNOTATION):
        given = child.get(name)
        if not _PERIOD.fullmatch(given):
            raise part.fault(child, f"{name}={given[:80]!r} is not a number of seconds such as 1/30")
        return Fraction(given)
    return None


def _annotated(part: SspPart, e: XmlElement, kind: str) -> Iterator[XmlElement]:
    """Yield what the annotations of one kind hold of an element."""
    for annotation in part.children(e, "ssd:Annotations", "ssc:Annotation"):
        if annotation.get("type") == kind:
            yield from annotation.children


def _hinted_step(part: SspPart, e: XmlElement) -> Fraction | None:
    """Return the communication step of a component that is annotated for libcosim; 0 s is none there, too."""
    for child in _annotated(part, e, OSP_ANNOTATION):
        if local(child.tag) == "StepSizeHint":
            step = part.number(child, "value")
            if step and not step >= SHORTEST_STEP:
                raise part.fault(child, f"value={child.get('value')[:80]!r} {INVALID_STEP}")
            return proposed_step(step)
    return None


def _step_of_system(part: SspPart, system: XmlElement) -> Fraction | None:
    """Return the communication step that is annotated for OMSimulator, or else for libcosim, or else stated."""
    holders = [*_annotated(part, system, OMS_ANNOTATION)]
    for experiment in part.children(part.root, "ssd:DefaultExperiment"):
        holders += _annotated(part, experiment, OSP_ANNOTATION)
        if "stepSize" in experiment.attributes:
            holders.append(experiment)
    steps = [step for holder in holders for step in _steps(part, holder)]
    return next(iter(steps), None)


def _steps(part: SspPart, e: XmlElement) -> Iterator[Fraction | None]:
    for name in ("stepSize", "baseStepSize"):
        if name in e.attributes:
            given, step = e.attributes[name], part.number(e, name)
            if not step >= SHORTEST_STEP:
                raise part.fault(e, f"{name}={given[:80]!r} {INVALID_STEP}")
            yield proposed_step(step)
    for child in e.children:
        yield from _steps(part, child)


class _Reader:
    def __init__(self, archive: SspArchive, part: SspPart, units: Mapping[str, Unit]) -> None:
        self._archive, self._part, self._units = archive, part, units

    def system(self, e: XmlElement) -> SspNestedSystem:
        part = self._part
        elements: dict[str, SspComponent | SspNestedSystem] = {}
        for holder in part.children(e, "ssd:Elements"):
            for child in holder.children:
                element = self._element(child)
                if element.name in elements:
                    raise part.fault(child, f"two elements are called {element.name!r}")
                elements[element.name] = element
        connections = tuple(map(self._connection, part.children(e, "ssd:Connections", "ssd:Connection")))
        return SspNestedSystem(
            part.text(e, "name"), self._connectors(e), self._bindings(e), part.where(e, ""), elements, connections
        )

    def _element(self, e: XmlElement) -> SspComponent | SspNestedSystem:
        name, called = local(e.tag), e.get("name")
        if len(called) > _MAX_NAME:
            text = f"a name of {len(called)} characters, {called[:20]!r}...; at most {_MAX_NAME} are taken"
            raise self._part.fault(e, text)
        if name == "System":
            return self.system(e)
        if name == "Component":
            return self._component(e)
        raise self._part.fault(e, f"<{short_name(e.tag)}> is not supported; <ssd:Component> and <ssd:System> are")

    def _component(self, e: XmlElement) -> SspComponent:
        part = self._part
        type_name, implementation = e.get("type", FMU_TYPE), e.get("implementation", "any")
        if type_name != FMU_TYPE:
            raise part.fault(e, f"a component of type {type_name[:80]!r}; only FMUs ({FMU_TYPE}) are supported")
        if implementation not in ("any", "CoSimulation"):
            raise part.fault(e, f"a component for {implementation[:80]}; only co-simulation is supported")
        name, member = part.text(e, "name"), self._member(e, part.text(e, "source"))
        period, sampled = self._annotated_step(e)
        hint = _hinted_step(part, e)
        return SspComponent(
            name, self._connectors(e), self._bindings(e), part.where(e, ""), member, period, sampled, hint
        )

    def _member(self, e: XmlElement, uri: str) -> str:
        try:
            return self._archive.member(uri)
        except ValueError as fault:
            raise self._part.fault(e, str(fault)) from fault

    def _annotated_step(self, e: XmlElement) -> tuple[Fraction | None, bool | None]:
        """Return the communication step of a component, and whether it is sampled, as `write_ssp` annotates them."""
        period = _annotated_period(self._part, e, "period")
        sampled = [self._part.flag(child, "sampled") for child in _annotated(self._part, e, STEP_ANNOTATION)]
        return period, sampled[0] if sampled else None

    def _connectors(self, e: XmlElement) -> dict[str, SspConnector]:
        part = self._part
        connectors: dict[str, SspConnector] = {}
        for c in part.children(e, "ssd:Connectors", "ssd:Connector"):
            name = part.text(c, "name")
            if name in connectors:
                raise part.fault(c, f"two connectors are called {name!r}")
            types = [t for t in c.children if local(t.tag) not in _NO_TYPES]
            unit = unit_named(types[0], self._units) if types else UNKNOWN
            type_name = local(types[0].tag) if types else ""
            connectors[name] = SspConnector(name, part.text(c, "kind"), type_name, unit, part.where(c, ""))
        return connectors

    def _connection(self, e: XmlElement) -> SspConnection:
        part = self._part
        for indices in ("startIndices", "endIndices"):
            if indices in e.attributes:
                part.leave_out(e, f"{indices} is not supported; whole connectors can be connected")
        return SspConnection(
            SspEnd(e.get("startElement") or None, part.text(e, "startConnector")),
            SspEnd(e.get("endElement") or None, part.text(e, "endConnector")),
            read_linear(part, e),
            part.flag(e, "suppressUnitConversion"),
            part.where(e, ""),
        )

    def _bindings(self, e: XmlElement) -> tuple[Mapping[str, SspValue], ...]:
        listed = self._part.children(e, "ssd:ParameterBindings", "ssd:ParameterBinding")
        return tuple(self._binding(binding, e.get("name")) for binding in listed)

    def _binding(self, e: XmlElement, owner: str) -> Mapping[str, SspValue]:
        part, root = self._content(e, "ssv:ParameterSet", SET_TYPE, "ssd:ParameterValues")
        prefix = e.get("prefix")
        values = {prefix + name: v for name, v in read_parameter_set(part, root, self._units).items()}
        for mapping in self._part.children(e, "ssd:ParameterMapping"):
            entries = read_mapping(*self._content(mapping, "ssm:ParameterMapping", MAPPING_TYPE))
            values = mapped_values(values, entries, owner)
        return values

    def _content(self, e: XmlElement, wanted: str, type_name: str, *holder: str) -> tuple[SspPart, XmlElement]:
        """Return the element that a binding or a mapping refers to, or else contains, with the file that it is in."""
        part = self._part
        if e.get("type", type_name) != type_name:
            raise part.fault(e, f"type {e.get('type')[:80]!r} is not supported; {type_name} is")
        if e.get("sourceBase", "SSD") != "SSD":
            raise part.fault(e, f"sourceBase={e.get('sourceBase')[:80]!r} is not supported; SSD is")
        inside = [c for h in part.children(e, *holder) for c in h.children]
        inside = [c for c in inside if local(c.tag) not in ("MetaData", "Signature")]
        if "source" in e.attributes:
            member = self._member(e, e.attributes["source"])
            other = SspPart(self._archive.path, member, self._archive.read(member), wanted, part)
            return other, other.root
        if len(inside) != 1:
            raise part.fault(e, f"neither a source nor one <{wanted}> inside")
        part.check_root(inside[0], wanted)
        return part, inside[0]
