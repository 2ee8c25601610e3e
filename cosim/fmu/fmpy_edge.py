"""The typed edge to FMPy: reading model descriptions, and unpacking.

FMUs are loaded in `handover.cosim.fmu.loading`.
"""

from pathlib import Path
from typing import Any, Protocol, cast

import fmpy
import fmpy.fmi2
import fmpy.fmi3
from fmpy.model_description import ValidationError
from fmpy.validation import validate_model_description

from handover.cosim.exceptions import InvalidFmu, one_line
from handover.cosim.fmu.archive import DESCRIPTION, FmuArchive
from handover.cosim.fmu.library_format import HEAD, shortage
from handover.cosim.fmu.xml import UnsafeXml, XmlElement, check_xml, parse_xml

_BUILD_DESCRIPTION = "sources/buildDescription.xml"


class ModelVariable(Protocol):
    """The parts of FMPy's `ModelVariable` that are used here."""

    name: str
    type: str
    causality: str
    variability: str | None
    valueReference: int
    shape: tuple[int, ...] | None
    unit: str | None
    relativeQuantity: bool | None
    nominal: str | None
    start: str | None
    min: str | None
    max: str | None
    description: str | None
    declaredType: Any
    clocks: list[Any] | None


class ModelDescription(Protocol):
    """The parts of FMPy's `ModelDescription` that are used here."""

    fmiVersion: str
    modelName: str
    guid: str
    coSimulation: Any
    defaultExperiment: Any
    unitDefinitions: list[Any]
    modelVariables: list[ModelVariable]
    outputs: list[Any]


def read_description(path: Path) -> tuple[ModelDescription, XmlElement]:
    """Read and validate the model description of a co-simulation FMU; return it with its XML, for what FMPy leaves out.

    Raises:
        InvalidFmu: with what is wrong with the file.
    """
    archive = FmuArchive(path)
    root = checked_xml(archive)
    version_of(path, root)
    try:
        md: Any = fmpy.read_model_description(str(path))
    except (
        Exception
    ) as e:  # FMPy raises plain Exception for what it does not know, lxml its own for what it cannot parse
        raise InvalidFmu(path, f"its modelDescription.xml is not valid: {one_line(e)}") from e
    if md.coSimulation is None:
        raise InvalidFmu(path, "it has no co-simulation interface")
    return cast(ModelDescription, md), root


def checked_xml(archive: FmuArchive) -> XmlElement:
    """Return the root of an FMU's model description, after looking at every XML file that FMPy's reader opens.

    Raises:
        InvalidFmu: a file is malformed or not to be read.
    """
    try:
        root = parse_xml(archive.description())
    except UnsafeXml as e:
        raise InvalidFmu(archive.path, f"its {DESCRIPTION} cannot be read: {e}") from e
    if _BUILD_DESCRIPTION in archive.names:
        try:
            check_xml(archive.read(_BUILD_DESCRIPTION))
        except UnsafeXml as e:
            raise InvalidFmu(archive.path, f"its {_BUILD_DESCRIPTION} cannot be read: {e}") from e
    return root


def version_of(path: Path, root: XmlElement) -> int:
    """Return the major version of a model description's standard, 2 or 3.

    Raises:
        InvalidFmu: it is of another version, or not a model description.
    """
    if root.tag != "fmiModelDescription":
        raise InvalidFmu(path, f"its {DESCRIPTION} begins with <{root.tag[:80]}>; <fmiModelDescription> is right")
    version = root.get("fmiVersion")
    if not version:
        raise InvalidFmu(path, f"its {DESCRIPTION} does not say its fmiVersion; 2.0 or 3.0 is right")
    if version != "2.0" and not version.startswith("3."):
        raise InvalidFmu(path, f"an FMU of FMI {version[:80]}; versions 2.0 and 3.0 can be used")
    return int(version[0])


def problems_of(path: Path) -> tuple[list[str], str]:
    """Return what FMPy's validation has to say of an FMU that passed `checked_xml`, and why it stopped, if it did.

    Where the schema is not kept, the rules beyond it are tried nonetheless, as far as the reader gets.
    """
    try:
        fmpy.read_model_description(str(path), validate_variable_names=True, validate_model_structure=True)
    except ValidationError as e:
        problems = [str(p) for p in cast(list[Any], e.problems)]
    except Exception as e:  # FMPy's reader raises KeyError, ValueError, ... where it does not understand a description
        return [], f"{type(e).__name__}: {one_line(e)}"
    else:
        return [], ""
    try:
        md: Any = fmpy.read_model_description(str(path), validate=False)
        problems += validate_model_description(md, validate_variable_names=True, validate_model_structure=True)
    except Exception as e:
        return problems, f"{type(e).__name__}: {one_line(e)}"
    return problems, ""


def required_functions(fmi: int) -> list[str]:
    """Return the functions that FMPy loads of a co-simulation FMU: it refuses a library that lacks any of them."""
    slave = fmpy.fmi2.FMU2Slave if fmi == 2 else fmpy.fmi3.FMU3Slave
    return sorted(name for name in dir(slave) if name.startswith(f"fmi{fmi}"))


def mime_types(root: XmlElement) -> dict[str, str]:
    """Return the MIME types of an FMI 3 FMU's binary variables by name; FMPy does not read them."""
    variables = root.named("ModelVariables", "Binary")
    return {e.get("name"): e.get("mimeType", "application/octet-stream") for e in variables}


def platform_folder(fmi: int) -> str:
    """Return the folder of `binaries/` that holds this machine's library, by the standard's name."""
    return cast(str, fmpy.platform if fmi == 2 else fmpy.platform_tuple)


def library_path(fmi: int, identifier: str) -> str:
    """Return where in an FMU this machine's library lies."""
    return f"binaries/{platform_folder(fmi)}/{identifier}{fmpy.sharedLibraryExtension}"


def unpack(path: Path, folder: Path, fmi: int, identifier: str) -> None:
    """Unpack an FMU into a folder, after checking that it has a whole binary for this machine.

    Raises:
        InvalidFmu: damaged archive, a path that leads out of the folder, or no binary for this platform,
            or one that is cut off: the system would load it and end this process.
    """
    archive = FmuArchive(path)
    if library_path(fmi, identifier) not in archive.names:
        inside = [n.split("/") for n in archive.names if n.startswith("binaries/")]
        has = sorted({parts[1] for parts in inside if len(parts) > 2})
        raise InvalidFmu(
            path, f"no binary for this machine ({platform_folder(fmi)}); it has {', '.join(has) or 'none'}"
        )
    for name in archive.names:
        here = name.startswith(f"binaries/{platform_folder(fmi)}/") and name.endswith(fmpy.sharedLibraryExtension)
        short = shortage(archive.head(name, HEAD), archive.size(name)) if here else ""
        if short:
            raise InvalidFmu(path, f"{name}: {short}")
    archive.unpack(folder)
