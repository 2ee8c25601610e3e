"""Native test units: FMUs of both standards from the small C sources in `native/`, see `native/frame/unit.h`.

All sources are compiled into one library, which knows by the instantiation token what unit it is to be; each FMU holds a
copy of it. What is compiled and packed is kept in the cache folder, by the contents of the sources.
"""

import ctypes
import functools
import hashlib
import os
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import fmpy

from cosim.fmpy_edge import library_path
from fmus.compile import TARGETS, cache_folder, host_platform, zig_cc

SOURCES = Path(__file__).with_name("native")
HEADERS = Path(fmpy.__file__).parent / "c-code"

UNITS: dict[str, dict[str, str]] = {
    "m": {"m": "1"},
    "m/s": {"m": "1", "s": "-1"},
    "kg": {"kg": "1"},
    "N": {"kg": "1", "m": "1", "s": "-2"},
    "N/m": {"kg": "1", "s": "-2"},
    "N.s/m": {"kg": "1", "s": "-1"},
    "m/s2": {"m": "1", "s": "-2"},
    "s": {"s": "1"},
    "rad": {"rad": "1"},
    "rad/s": {"rad": "1", "s": "-1"},
    "deg": {"rad": "1", "factor": "0.017453292519943295"},
    "mm": {"m": "1", "factor": "0.001"},
    "K": {"K": "1"},
    "degC": {"K": "1", "offset": "273.15"},
}
PARAMETER, INPUT, OUTPUT = range(3)
REAL, INTEGER, BOOLEAN, BINARY, CLOCK = range(5)
NO_STATES, FIXED_STEP, INTERPOLATES, DERIVATIVES, EVENTS, EARLY_RETURN = (1 << i for i in range(6))
FMI3_TYPES = ("Float64", "Int32", "Boolean", "Binary", "Clock")
FMI2_TYPES = ("Real", "Integer", "Boolean")


class _Variable(ctypes.Structure):
    """`Variable` of native/frame/unit.h."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("causality", ctypes.c_int),
        ("type", ctypes.c_int),
        ("offset", ctypes.c_size_t),
        ("length", ctypes.c_size_t),
        ("start", ctypes.c_double),
        ("unit", ctypes.c_char_p),
        ("depends", ctypes.c_char_p),
        ("clock", ctypes.c_char_p),
        ("discrete", ctypes.c_int),
        ("counter", ctypes.c_int),
        ("resolution", ctypes.c_int),
    )


class _Model(ctypes.Structure):
    """The first fields of `Model` of native/frame/unit.h."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("variables", ctypes.POINTER(_Variable)),
        ("n_variables", ctypes.c_size_t),
        ("step", ctypes.c_double),
        ("abilities", ctypes.c_int),
    )


@dataclass(frozen=True)
class Variable:
    """A row of a unit's table."""

    reference: int
    name: str
    causality: int
    type: int
    length: int
    start: float
    unit: str
    depends: tuple[str, ...]
    clock: str
    discrete: bool
    counter: int
    resolution: int

    @property
    def is_continuous(self) -> bool:
        """Whether it varies between steps and events."""
        return self.type == REAL and not self.discrete and not self.clock


@dataclass(frozen=True)
class Declaration:
    """What a C source says of a unit."""

    name: str
    variables: tuple[Variable, ...]
    step: float
    abilities: int

    def reference(self, name: str) -> int:
        """Return a variable's value reference."""
        return next(v.reference for v in self.variables if v.name == name)


def native_fmu(name: str, fmi: int = 3, *, step: float | None = None, dependencies: bool = True, **flags: bool) -> Path:
    """Return a native unit's FMU.

    `step` is the communication step that it proposes, if not the declared one; without `dependencies` its description
    leaves out what outputs depend on; `flags` are attributes of its co-simulation interface that are to be otherwise,
    such as `canGetAndSetFMUstate=False`.
    """
    declaration = declarations()[name]
    options = repr((name, fmi, step, dependencies, sorted(flags.items())))
    file = _folder() / f"{name}-{fmi}-{hashlib.sha256(options.encode()).hexdigest()[:12]}.fmu"
    if not file.is_file():
        describe = _description2 if fmi == 2 else _description3
        description = describe(declaration, step or declaration.step, dependencies, flags)
        _write_once(file, lambda part: _pack(part, fmi, name, description))
    return file


@functools.cache
def declarations() -> dict[str, Declaration]:
    """Return, by name, what the sources declare."""
    library = ctypes.CDLL(str(_library()))
    count = ctypes.c_size_t.in_dll(library, "n_native_models").value
    models = (ctypes.POINTER(_Model) * count).in_dll(library, "native_models")
    read = [_declaration(pointer.contents) for pointer in models]
    assert len({d.name for d in read}) == len(read), "two units have one name"
    return {d.name: d for d in read}


def _declaration(model: _Model) -> Declaration:
    def text(value: bytes | None) -> str:
        return (value or b"").decode()

    variables = tuple(
        Variable(
            i + 1, text(v.name), v.causality, v.type, v.length, v.start, text(v.unit), tuple(text(v.depends).split()),
            text(v.clock), bool(v.discrete), v.counter, v.resolution,
        )
        for i, v in enumerate(model.variables[: model.n_variables])
    )  # fmt: skip
    return Declaration(text(model.name), variables, model.step, model.abilities)


@functools.cache
def _folder() -> Path:
    digest = hashlib.sha256(fmpy.__version__.encode() + Path(__file__).read_bytes())
    for source in sorted(SOURCES.rglob("*.[ch]")):
        digest.update(source.name.encode() + source.read_bytes())
    folder = cache_folder() / "native-units" / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _library() -> Path:
    file = _folder() / f"units{TARGETS[host_platform()][1]}"
    if not file.is_file():
        _write_once(file, _compile)
    return file


def _compile(made: Path) -> None:
    sources = sorted(map(str, SOURCES.rglob("*.c")))
    flags = ["-target", TARGETS[host_platform()][0], "-shared", "-fPIC", "-O2", "-std=c11", "-Wall", "-Wextra", "-Werror"]
    lenient = ["-Wno-unused-parameter", "-Wno-missing-field-initializers"]
    done = zig_cc([*flags, *lenient, "-I", str(HEADERS), *sources, "-lm", "-o", str(made)])
    assert done.returncode == 0, done.stdout


def _write_once(file: Path, write: Callable[[Path], None]) -> None:
    """Let a file appear whole; another session may be making it too."""
    with tempfile.TemporaryDirectory(dir=file.parent) as scratch:
        part = Path(scratch) / file.name
        write(part)
        os.replace(part, file)


def _pack(file: Path, fmi: int, name: str, description: str) -> None:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(_library(), library_path(fmi, name))


def _description2(d: Declaration, step: float, dependencies: bool, flags: dict[str, bool]) -> str:
    assert all(v.type < BINARY and not v.length for v in d.variables), f"{d.name}: FMI 2 has no such variables"
    root = ElementTree.Element(
        "fmiModelDescription", fmiVersion="2.0", modelName=d.name, guid=d.name, variableNamingConvention="structured"
    )
    states = not d.abilities & NO_STATES
    given = {
        "canHandleVariableCommunicationStepSize": not d.abilities & FIXED_STEP,
        "canInterpolateInputs": bool(d.abilities & INTERPOLATES),
        "canGetAndSetFMUstate": states,
        "canSerializeFMUstate": states,
        "providesDirectionalDerivative": bool(d.abilities & DERIVATIVES),
    }
    ElementTree.SubElement(root, "CoSimulation", {"modelIdentifier": d.name, **_booleans({**given, **flags})})
    _add_units(root, d)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(step))
    rows = ElementTree.SubElement(root, "ModelVariables")
    for v in d.variables:
        ends = {"name": v.name, "valueReference": str(v.reference), **_kind(v)}
        row = ElementTree.SubElement(rows, "ScalarVariable", ends)
        ElementTree.SubElement(row, FMI2_TYPES[v.type], {**_start(v), **({"unit": v.unit} if v.unit else {})})
    structure = ElementTree.SubElement(root, "ModelStructure")
    for group in ("Outputs", "InitialUnknowns"):
        unknowns = ElementTree.SubElement(structure, group)
        for v in d.variables:
            if v.causality == OUTPUT:
                known = _dependencies(d, v, with_parameters=group == "InitialUnknowns") if dependencies else {}
                ElementTree.SubElement(unknowns, "Unknown", {"index": str(v.reference), **known})
    return _text(root)


def _description3(d: Declaration, step: float, dependencies: bool, flags: dict[str, bool]) -> str:
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=d.name,
        instantiationToken=d.name,
        variableNamingConvention="structured",
    )
    states = not d.abilities & NO_STATES
    given = {
        "canHandleVariableCommunicationStepSize": not d.abilities & FIXED_STEP,
        "canGetAndSetFMUState": states,
        "canSerializeFMUState": states,
        "providesDirectionalDerivatives": bool(d.abilities & DERIVATIVES),
        "hasEventMode": bool(d.abilities & EVENTS),
        "mightReturnEarlyFromDoStep": bool(d.abilities & EARLY_RETURN),
    }
    ElementTree.SubElement(root, "CoSimulation", {"modelIdentifier": d.name, **_booleans({**given, **flags})})
    _add_units(root, d)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(step))
    rows = ElementTree.SubElement(root, "ModelVariables")
    time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    ElementTree.SubElement(rows, "Float64", time)
    for v in d.variables:
        _add_variable3(rows, d, v)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for group in ("Output", "InitialUnknown"):
        for v in d.variables:
            if v.causality == OUTPUT and (group == "Output" or not v.clock):
                known = _dependencies(d, v, with_parameters=group == "InitialUnknown") if dependencies else {}
                ElementTree.SubElement(structure, group, {"valueReference": str(v.reference), **known})
    return _text(root)


def _add_variable3(rows: ElementTree.Element, d: Declaration, v: Variable) -> None:
    row = ElementTree.SubElement(
        rows, FMI3_TYPES[v.type], {"name": v.name, "valueReference": str(v.reference), **_kind(v)}
    )
    if v.unit:
        row.set("unit", v.unit)
    if v.clock:
        row.set("clocks", str(d.reference(v.clock)))
    if v.type == BINARY:
        row.set("mimeType", "application/x-native")
        if v.causality == INPUT:
            ElementTree.SubElement(row, "Start", value="")
    elif v.type == CLOCK and v.counter:
        row.set("intervalVariability", "constant")
        row.set("supportsFraction", "true")
        row.set("intervalCounter", str(v.counter))
        row.set("resolution", str(v.resolution))
        row.set("intervalDecimal", repr(v.counter / v.resolution))
    elif v.type == CLOCK:
        row.set("intervalVariability", "triggered")
    else:
        row.attrib.update(_start(v))
    if v.length:
        ElementTree.SubElement(row, "Dimension", start=str(v.length))


def _kind(v: Variable) -> dict[str, str]:
    causality = ("parameter", "input", "output")[v.causality]
    variability = "fixed" if v.causality == PARAMETER else "continuous" if v.is_continuous else "discrete"
    return {"causality": causality, "variability": variability}


def _start(v: Variable) -> dict[str, str]:
    if v.causality == OUTPUT:
        return {}
    one = repr(v.start) if v.type == REAL else str(bool(v.start)).lower() if v.type == BOOLEAN else str(int(v.start))
    return {"start": " ".join([one] * (v.length or 1))}


def _dependencies(d: Declaration, v: Variable, with_parameters: bool) -> dict[str, str]:
    parameters = [p.name for p in d.variables if with_parameters and p.causality == PARAMETER]
    return {"dependencies": " ".join(str(d.reference(name)) for name in (*v.depends, *parameters))}


def _add_units(root: ElementTree.Element, d: Declaration) -> None:
    used: Sequence[str] = sorted({v.unit for v in d.variables if v.unit})
    if used:
        definitions = ElementTree.SubElement(root, "UnitDefinitions")
        for symbol in used:
            unit = ElementTree.SubElement(definitions, "Unit", name=symbol)
            ElementTree.SubElement(unit, "BaseUnit", UNITS[symbol])


def _booleans(flags: dict[str, bool]) -> dict[str, str]:
    return {name: str(value).lower() for name, value in flags.items()}


def _text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=False)
