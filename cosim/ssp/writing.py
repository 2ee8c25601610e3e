"""Writes a system as an SSP that other tools load: FMUs, their icons, and start values as parameter sets (SSV).

Where units and lines are drawn in other tools is in `handover.cosim.ssp.geometry`.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.blocks.start_values import numbers_of
from handover.cosim.blocks.units import Unit
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import NotExportable
from handover.cosim.fmu.file.archive import FmuArchive, write_archive
from handover.cosim.fmu.file.default_experiment import proposed_step
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.fmu.file.icon import read_icon
from handover.cosim.ssp.geometry import ConnectorName, Diagram, add_external_connectors
from handover.cosim.ssp.xml import (
    OMS_ANNOTATION,
    OMS_NAMESPACE,
    OSP_ANNOTATION,
    OSP_NAMESPACE,
    STEP_ANNOTATION,
    STRUCTURE,
    document,
    root_element,
)
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.schedule import common_divisor
from handover.cosim.system.system import Connection, PlacedUnit, System

Items = tuple[tuple[str, int], ...]


class DescribedTypes:
    """Collects the units and enumerations that types refer to by name, and writes types.

    Different units of one name cannot be distinguished in an SSP: these are left out, and the FMUs' own count.
    """

    def __init__(self, ports: Iterable[FmuPort]) -> None:
        self._units: dict[str, Unit | None] = {}
        self._enumerations: dict[Items, str] = {}
        for port in ports:
            if port.kind is Kind.REAL and port.unit.defined:
                known = self._units.setdefault(port.unit.symbol, port.unit)
                self._units[port.unit.symbol] = port.unit if known == port.unit else None
            if port.kind is Kind.ENUMERATION and port.items not in self._enumerations:
                taken = list(self._enumerations.values())
                same = sum(name.partition("-")[0] == port.name for name in taken)
                self._enumerations[port.items] = f"{port.name}-{same + 1}" if same else port.name

    def add_type(self, parent: ET.Element, prefix: str, port: FmuPort) -> ET.Element:
        """Add the element of a port's type, such as `<ssc:Real unit="m"/>`."""
        attributes: dict[str, str] = {}
        if port.kind is Kind.REAL and self._units.get(port.unit.symbol) == port.unit:
            attributes["unit"] = port.unit.symbol
        if port.kind is Kind.ENUMERATION and prefix == "ssc":
            attributes["name"] = self._enumerations[port.items]
        if port.kind is Kind.BINARY and port.mime:
            attributes["mime-type"] = port.mime
        return ET.SubElement(parent, f"{prefix}:{port.fmi_type}", attributes)

    def add_enumerations(self, root: ET.Element, prefix: str) -> None:
        """Add the definitions of all enumerations, if there are any."""
        parent = ET.SubElement(root, f"{prefix}:Enumerations") if self._enumerations else root
        for items, name in self._enumerations.items():
            enumeration = ET.SubElement(parent, "ssc:Enumeration", name=name)
            for item, value in items:
                ET.SubElement(enumeration, "ssc:Item", name=item, value=str(value))

    def add_units(self, root: ET.Element, prefix: str) -> None:
        """Add the definitions of all units, if there are any."""
        units = [unit for unit in self._units.values() if unit is not None]
        parent = ET.SubElement(root, f"{prefix}:Units") if units else root
        for unit in units:
            base = {n: str(x) for n, x in unit.base.nonzero().items()}
            base |= {"factor": repr(unit.factor)} if unit.factor != 1 else {}
            base |= {"offset": repr(unit.offset)} if unit.offset != 0 else {}
            ET.SubElement(ET.SubElement(parent, "ssc:Unit", name=unit.symbol), "ssc:BaseUnit", base)


def add_dimensions(parent: ET.Element, shape: Sequence[int]) -> None:
    """Add the extents of an array that is one variable."""
    for extent in shape:
        ET.SubElement(parent, "ssc:Dimension", size=str(extent))


def bound_values(unit: PlacedUnit) -> dict[str, tuple[FmuPort, Any]]:
    """Return the start values to bind, by port.

    An enumeration that equals the FMU's start value is left out: see `bound_enumerations`.
    """
    ports = unit.description.settable
    values = {name: (ports[name], value) for name, value in unit.start.items()}
    return {
        name: (port, value)
        for name, (port, value) in values.items()
        if port.kind is not Kind.ENUMERATION or port.start != str(int(numbers_of(port, value)[0]))
    }


def bound_enumerations(unit: PlacedUnit) -> dict[str, int]:
    """Return the enumerations that differ from the FMU's start values, by name, as numbers.

    Other tools take no file that binds them: Ecos rejects it, libcosim ends its process.
    """
    values = bound_values(unit).items()
    return {name: int(numbers_of(port, x)[0]) for name, (port, x) in values if port.kind is Kind.ENUMERATION}


def parameter_set(unit: PlacedUnit, version: str, name: str) -> bytes:
    """Return the SSV file of a unit's start values.

    All units' sets have one name: Ecos applies the sets of one name, which it is called with.
    """
    return values_document(bound_values(unit), version, name)


def values_document(
    values: Mapping[str, tuple[FmuPort, Any]], version: str, name: str, descriptions: Mapping[str, str] | None = None
) -> bytes:
    """Return an SSV file of values, by name, each with its port; `descriptions` of some of them are shown to users."""
    types = DescribedTypes(port for port, _ in values.values() if port.kind is not Kind.ENUMERATION)
    root = root_element("ssv:ParameterSet", version, name)
    parameters = ET.SubElement(root, "ssv:Parameters")
    for port, value in values.values():
        texts, names = _texts(port, value), port.entry_names
        if len(names) == 1:
            texts = [" ".join(texts) if port.shape else texts[0]]
        description = (descriptions or {}).get(port.name)
        for name, text in zip(names, texts, strict=True):
            attributes = {"name": name} if description is None else {"name": name, "description": description}
            parameter = ET.SubElement(parameters, "ssv:Parameter", attributes)
            types.add_type(parameter, "ssv", port).set("value", text)
            add_dimensions(parameter, port.shape if len(names) == 1 else ())
    types.add_units(root, "ssv")
    return document(root)


def _texts(port: FmuPort, value: Any) -> list[str]:
    if port.kind is Kind.STRING:
        return [str(value)]
    if port.kind is Kind.BINARY:
        return [bytes(value).hex()]
    numbers = numbers_of(port, value).tolist()
    if port.kind is Kind.BOOLEAN:
        return ["true" if x else "false" for x in numbers]
    if port.kind is Kind.ENUMERATION:
        names = {number: name for name, number in port.items}
        return [names[int(x)] for x in numbers]
    return [repr(float(x)) if port.kind is Kind.REAL else str(int(x)) for x in numbers]


def write_ssp(
    system: System,
    path: Path,
    name: str,
    stop: Fraction | None = None,
    parallel_step: Fraction | None = None,
    *,
    replace: bool = True,
) -> Path:
    """Write a system with its FMUs and start values as an SSP; it appears complete or not at all.

    It is of version 1.0 if all units are of FMI 2, else of 2.0. A communication step other than the one that an FMU
    proposes is written to an annotation, which other tools may ignore; the steps for tools that step all units in
    parallel are annotated as OMSimulator, libcosim and Ecos read them. A conversion of units is written as a linear
    transformation, as not every tool converts. An input that comes from outside is a connector of the system.

    Args:
        system: the system.
        path: the file.
        name: the system's name.
        stop: the stop time of its default experiment, s.
        parallel_step: communication step of all units where they step in parallel, s; each keeps its own without.
        replace: whether a file of that name is replaced.

    Raises:
        WiringError: the system has faults.
        NotExportable: an array that is one variable is connected to one whose entries are variables, clocks are
            connected, an input follows values over time, or an FMU is unpacked.
        FileTaken: there is a file of that name, which is not to be replaced.
        OSError: the file cannot be written.
    """
    system.check()
    faults = [f"{end} follows values over time" for end in system.followed]
    unpacked = [f"{name}: {u.description.path}" for name, u in system.units.items() if u.description.path.is_dir()]
    if faults := faults + [f"{what} is an unpacked FMU: zip what is in it to an .fmu" for what in unpacked]:
        raise NotExportable(faults)
    files = _file_names(system)
    version = "1.0" if all(u.description.fmi == 2 for u in system.units.values()) else "2.0"
    contents = {f"resources/{file}": fmu.read_bytes() for fmu, file in files.items()}
    bound = {n: u for n, u in system.units.items() if bound_values(u)}
    sets = {n: f"resources/{_plain(n)}-{k}.ssv" for k, n in enumerate(bound, 1)}
    contents |= {sets[n]: parameter_set(u, version, name) for n, u in bound.items()}
    pngs = {fmu: read_icon(FmuArchive(fmu)).png for fmu in files}
    icons = {fmu: (f"resources/{Path(files[fmu]).stem}.png", png) for fmu, png in pngs.items() if png}
    contents |= dict(icons.values())
    drawn = {fmu: member for fmu, (member, _) in icons.items()}
    contents[STRUCTURE] = _Structure(system, version, files, drawn, sets, parallel_step).content(name, stop)
    return write_archive(path, contents, replace=replace)


def _file_names(system: System) -> dict[Path, str]:
    names: dict[Path, str] = {}
    for unit in system.units.values():
        file = unit.description.path
        if file not in names:
            plain = f"{_plain(file.stem)}.fmu"
            names[file] = plain if plain not in names.values() else f"{_plain(file.stem)}-{len(names) + 1}.fmu"
    return names


def _plain(name: str) -> str:
    """Return a name that is the same in a URI and on every disk."""
    return re.sub(r"[^A-Za-z0-9._-]", "_", name)


class _Structure:
    def __init__(
        self, system: System, version: str, files: Mapping[Path, str], icons: Mapping[Path, str],
        sets: Mapping[str, str], parallel_step: Fraction | None,
    ) -> None:  # fmt: skip
        self._system, self._version, self._files, self._sets = system, version, files, sets
        self._icons = icons
        self._parallel_step = parallel_step
        self._base = parallel_step or common_divisor([u.period for u in system.units.values()])
        self._external = [*system.externals]
        self._connected = {*self._external, *(end for c in system.connections for end in (c.source, c.target))}
        self._types = DescribedTypes(p for u in system.units.values() for p in self._shown(u))
        self._diagram = Diagram(system, {name: self._shown(unit) for name, unit in system.units.items()})

    def content(self, name: str, stop: Fraction | None) -> bytes:
        """Return SystemStructure.ssd."""
        root = root_element("ssd:SystemStructureDescription", self._version, name)
        root.attrib.update({"xmlns:oms": OMS_NAMESPACE, "xmlns:osp": OSP_NAMESPACE})
        system = ET.SubElement(root, "ssd:System", name=name)
        self._add_external_connectors(system)
        elements = ET.SubElement(system, "ssd:Elements")
        for unit in self._system.units.values():
            self._add_component(elements, unit)
        self._add_connections(system)
        self._diagram.add_system(system)
        self._add_master(system)
        self._types.add_enumerations(root, "ssd")
        self._types.add_units(root, "ssd")
        times = {"startTime": self._system.start, "stopTime": stop}
        given = {name: repr(float(t)) for name, t in times.items() if t is not None}
        experiment = ET.SubElement(root, "ssd:DefaultExperiment", given)
        annotation = _annotation(ET.SubElement(experiment, "ssd:Annotations"), OSP_ANNOTATION)
        algorithm = ET.SubElement(annotation, "osp:Algorithm")  # in which libcosim takes even an xmlns for one
        ET.SubElement(algorithm, "osp:FixedStepAlgorithm", baseStepSize=repr(float(self._base)))
        return document(root)

    def _add_master(self, system: ET.Element) -> None:
        """Add the step of a master that steps all units in parallel: OMSimulator imports no system without."""
        annotations = ET.SubElement(system, "ssd:Annotations")
        oms = ET.SubElement(_annotation(annotations, OMS_ANNOTATION), "oms:Annotations")
        step = {"description": "oms-ma", "stepSize": repr(float(self._base))}
        tolerances = {"absoluteTolerance": "0.0001", "relativeTolerance": "0.0001"}
        ET.SubElement(ET.SubElement(oms, "oms:SimulationInformation"), "oms:FixedStepMaster", {**step, **tolerances})
        if self._parallel_step is not None:
            _add_step(annotations, parallel=str(self._parallel_step))

    def _add_external_connectors(self, system: ET.Element) -> None:
        """Add a connector of the system for each input that comes from outside."""
        connectors = ET.SubElement(system, "ssd:Connectors") if self._external else system
        for end in self._external:
            port = self._system.units[end.unit].description.inputs[end.port]
            for name in port.entry_names:
                connector = ET.SubElement(connectors, "ssd:Connector", name=f"{end.unit}.{name}", kind="input")
                self._types.add_type(connector, "ssc", port)
                add_dimensions(connector, port.shape if len(port.references) == 1 else ())
        add_external_connectors(list(connectors) if self._external else ())

    def _shown(self, unit: PlacedUnit) -> list[FmuPort]:
        """Return a unit's inputs and outputs, of the enumerations only what is connected: see `bound_values`."""
        ports = [*unit.description.inputs.values(), *unit.description.outputs.values()]
        ends = {end.port for end in self._connected if end.unit == unit.name}
        return [p for p in ports if p.kind is not Kind.ENUMERATION or p.name in ends]

    def _add_component(self, elements: ET.Element, unit: PlacedUnit) -> None:
        d = unit.description
        component = ET.SubElement(
            elements,
            "ssd:Component",
            name=unit.name,
            type="application/x-fmu-sharedlibrary",
            source=f"resources/{self._files[d.path]}",
        )
        shown = self._shown(unit)
        connectors = ET.SubElement(component, "ssd:Connectors") if shown else component
        for port in shown:
            for name in port.entry_names:
                connector = ET.SubElement(connectors, "ssd:Connector", name=name, kind=port.causality.value)
                self._types.add_type(connector, "ssc", port)
                add_dimensions(connector, port.shape if len(port.references) == 1 else ())
                self._diagram.add_connector(connector, unit.name)
        self._diagram.add_element(component, unit.name, self._icons.get(d.path, ""))
        if unit.name in self._sets:
            bindings = ET.SubElement(component, "ssd:ParameterBindings")
            ET.SubElement(bindings, "ssd:ParameterBinding", source=self._sets[unit.name])
        annotations = ET.SubElement(component, "ssd:Annotations")
        if (unit.period, unit.sampled) != (proposed_step(d.step), d.sampled):
            _add_step(annotations, period=str(unit.period), sampled=str(unit.sampled).lower())
        hint = repr(float(self._parallel_step or unit.period))
        ET.SubElement(_annotation(annotations, OSP_ANNOTATION), "osp:StepSizeHint", value=hint)

    def _add_connections(self, system: ET.Element) -> None:
        connections, clocks = self._system.connections, self._system.clock_connections()
        parent = ET.SubElement(system, "ssd:Connections") if connections or self._external else system
        for end in self._external:
            for name in self._system.units[end.unit].description.inputs[end.port].entry_names:
                ends = {"startConnector": f"{end.unit}.{name}", "endElement": end.unit, "endConnector": name}
                _add_connection(parent, ends, None)
        faults: list[str] = []
        for c in connections:
            if c in clocks:
                faults.append(
                    f"{c.source} -> {c.target} lets a clock tick; this package knows connectors of values only"
                )
                continue
            a, b = self._ports(c)
            from_, to = a.entry_names, b.entry_names
            if len(from_) != len(to):
                one, other = (c.source, c.target) if len(from_) < len(to) else (c.target, c.source)
                faults.append(f"{one} is one array variable and each entry of {other} one; both must be of one kind")
                continue
            linear = c.transformation or self._system.transformation_of(c)
            for y, u in zip(from_, to, strict=True):
                ends = {"startElement": c.source.unit, "startConnector": y}
                ends |= {"endElement": c.target.unit, "endConnector": u}
                connection = _add_connection(parent, ends, linear)
                self._diagram.add_connection(
                    connection, ConnectorName(c.source.unit, y), ConnectorName(c.target.unit, u)
                )
        if faults:
            raise NotExportable(faults)

    def _ports(self, c: Connection) -> tuple[FmuPort, FmuPort]:
        units = self._system.units
        a, b = units[c.source.unit].description, units[c.target.unit].description
        return a.outputs[c.source.port], b.inputs[c.target.port]


def _annotation(annotations: ET.Element, kind: str) -> ET.Element:
    return ET.SubElement(annotations, "ssc:Annotation", type=kind)


def _add_step(annotations: ET.Element, **step: str) -> None:
    """Add this package's own annotation of a communication step."""
    annotation = _annotation(annotations, STEP_ANNOTATION)
    ET.SubElement(annotation, "Step", {"xmlns": "urn:handover:communication", **step})


def _add_connection(parent: ET.Element, ends: dict[str, str], linear: LinearTransformation | None) -> ET.Element:
    if linear is None:
        return ET.SubElement(parent, "ssd:Connection", ends)
    element = ET.SubElement(parent, "ssd:Connection", {**ends, "suppressUnitConversion": "true"})
    numbers = {"factor": repr(linear.factor), "offset": repr(linear.offset)}
    ET.SubElement(element, "ssc:LinearTransformation", numbers)
    return element
