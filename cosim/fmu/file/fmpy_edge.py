"""The typed edge to FMPy: reads and validates model descriptions, and unpacks FMUs.

FMPy has no types, so units are read only here and loaded only in `handover.cosim.fmu.loading`.
Every file that FMPy opens is checked before: its parser would follow entities, and its unpacking paths out of a folder.
"""

import importlib
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple, Protocol, cast

import fmpy
import fmpy.fmi2
import fmpy.fmi3
from fmpy.model_description import ValidationError
from fmpy.validation import validate_model_description

from handover.cosim.exceptions import InvalidFmu, one_line
from handover.cosim.fmu.file.archive import DESCRIPTION, FmuArchive
from handover.cosim.fmu.file.large_description import description_of, xml_source_of
from handover.cosim.fmu.file.library_format import HEAD, shortage
from handover.cosim.fmu.file.model_structure import lost_references
from handover.cosim.fmu.file.reduced_description import reduced_fmu
from handover.cosim.fmu.file.xml import UnsafeXml, XmlElement, check_xml, parse_xml

_etree: Any = importlib.import_module("lxml.etree")  # neither it nor its classes have types

_BUILD_DESCRIPTION = "sources/buildDescription.xml"
_MAX_PROBLEMS = 3
_SUFFIXES = (".so", ".dll", ".dylib")


class ModelVariable(Protocol):
    """The parts of FMPy's `ModelVariable` that are used here."""

    name: str
    type: str
    causality: str
    variability: str | None
    initial: str | None
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
    initialUnknowns: list[Any]


def read_description(path: Path) -> tuple[ModelDescription, XmlElement, str]:
    """Read and validate a co-simulation FMU's model description.

    Returns:
        The description, its XML, for what FMPy does not read, and how it breaks the standard in parts that
        co-simulation does not touch, in one line; empty where it does not.

    Raises:
        InvalidFmu: it is not a valid co-simulation FMU; the message says why.
    """
    archive = FmuArchive(path)
    root = checked_xml(archive)
    fmi, fault = version_of(path, root), ""
    try:
        md: Any = fmpy.read_model_description(xml_source_of(archive))
    except Exception as e:  # FMPy raises plain Exception for unknown elements, lxml its own for malformed XML
        fault = _fault_of(e, root, fmi)
        try:
            md = fmpy.read_model_description(reduced_fmu(description_of(archive)))
        except Exception:  # as above: the fault is in what co-simulation reads
            raise InvalidFmu(path, f"its {DESCRIPTION} is not valid: {fault}") from e
    if md.coSimulation is None:
        raise InvalidFmu(path, "it has no co-simulation interface")
    return cast(ModelDescription, md), root, fault


def _fault_of(e: Exception, root: XmlElement, fmi: int) -> str:
    """Return why FMPy rejects a description, in one line."""
    if isinstance(e, LookupError) and (lost := [reference.line for reference in lost_references(root, fmi)]):
        return in_one_line(lost)
    if isinstance(e, LookupError):  # its text alone is a name or a number
        return f"{type(e).__name__}: {one_line(e)}"
    if not isinstance(e, ValidationError):
        return one_line(e)
    return in_one_line([" ".join(str(p).split()).rstrip(".") for p in cast(list[Any], e.problems)])


def in_one_line(problems: Sequence[str]) -> str:
    """Return the first problems, and how many more there are."""
    more = f"; and {len(problems) - _MAX_PROBLEMS} more" if len(problems) > _MAX_PROBLEMS else ""
    return "; ".join(problems[:_MAX_PROBLEMS]) + more


def checked_xml(archive: FmuArchive, *, whole: bool = False) -> XmlElement:
    """Return the root of an FMU's model description, after checking every XML file that FMPy's reader opens.

    Unless it is to be `whole`, a large one is reduced, see `large_description`.

    Raises:
        InvalidFmu: a file is malformed or unsafe to read.
    """
    try:
        root = parse_xml(archive.description() if whole else description_of(archive))
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
        raise InvalidFmu(path, f"its {DESCRIPTION} begins with <{root.tag[:80]}>; it must be <fmiModelDescription>")
    version = root.get("fmiVersion")
    if not version:
        raise InvalidFmu(path, f"its {DESCRIPTION} has no fmiVersion; it must be 2.0 or 3.0")
    if version != "2.0" and not version.startswith("3."):
        raise InvalidFmu(path, f"an FMU of FMI {version[:80]}; supported versions: 2.0 and 3.0")
    return int(version[0])


def problems_of(path: Path) -> tuple[list[str], str]:
    """Return the problems that FMPy finds in an FMU that passed `checked_xml`, and why it stopped, if it did.

    Where the description violates the schema, the rules beyond it are checked nonetheless, as far as the reader gets.
    """
    archive = FmuArchive(path)
    try:
        fmpy.read_model_description(xml_source_of(archive), validate_variable_names=True, validate_model_structure=True)
    except ValidationError as e:
        problems = [str(p) for p in cast(list[Any], e.problems)]
    except Exception as e:  # FMPy's reader raises KeyError, ValueError, ... for descriptions that it cannot interpret
        return [], f"{type(e).__name__}: {one_line(e)}"
    else:
        return [], ""
    try:
        md: Any = fmpy.read_model_description(xml_source_of(archive), validate=False)
        problems += validate_model_description(md, validate_variable_names=True, validate_model_structure=True)
    except Exception as e:  # as above
        return problems, f"{type(e).__name__}: {one_line(e)}"
    return problems, ""


def terminal_problems(content: bytes) -> list[str]:
    """Return how a terminals file that `parse_xml` reads breaks FMI 3.0's schema, which FMPy has and does not use."""
    schema = _etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"))
    schema.validate(_etree.fromstring(content))
    return [f"line {e.line}: {e.message.rstrip('.')}" for e in schema.error_log]


def required_functions(fmi: int) -> list[str]:
    """Return the functions that FMPy looks up in a co-simulation FMU: it rejects a library that lacks any of them."""
    slave = fmpy.fmi2.FMU2Slave if fmi == 2 else fmpy.fmi3.FMU3Slave
    return sorted(name for name in dir(slave) if name.startswith(f"fmi{fmi}"))


def mime_types(root: XmlElement) -> dict[str, str]:
    """Return the MIME types of an FMI 3 FMU's binary variables by name; FMPy does not read them."""
    variables = root.named("ModelVariables", "Binary")
    return {e.get("name"): e.get("mimeType", "application/octet-stream") for e in variables}


class MissingLibrary(NamedTuple):
    """Why an FMU has no library for this machine: the place, what is there, and what would be right."""

    where: str
    what: str
    cure: str

    @property
    def line(self) -> str:
        """All of it in one line."""
        return f"{self.where}: {self.what}; {self.cure}"


def platform_folder(fmi: int) -> str:
    """Return the folder of `binaries/` that holds this machine's library, by the standard's name."""
    return fmpy.platform if fmi == 2 else fmpy.platform_tuple


def library_path(fmi: int, identifier: str) -> str:
    """Return the path of this machine's library in an FMU."""
    return f"binaries/{platform_folder(fmi)}/{identifier}{fmpy.sharedLibraryExtension}"


def libraries_in(archive: FmuArchive) -> list[PurePosixPath]:
    """Return the paths of all shared libraries in an FMU that are for a platform."""
    paths = [PurePosixPath(n) for n in archive.names if n.startswith("binaries/") and n.endswith(_SUFFIXES)]
    return [p for p in paths if len(p.parts) == 3]


def platforms_in(archive: FmuArchive) -> list[str]:
    """Return the folders of `binaries/` that hold a shared library."""
    return sorted({p.parts[1] for p in libraries_in(archive)})


def missing_library(archive: FmuArchive, fmi: int, identifier: str) -> MissingLibrary | None:
    """Return why there is no library for this machine: another name, another standard's folder, or none at all."""
    wanted = library_path(fmi, identifier)
    if wanted in archive.names:
        return None
    folder, has = platform_folder(fmi), platforms_in(archive)
    here = [p.name for p in libraries_in(archive) if p.parts[1] == folder]
    other = platform_folder(5 - fmi)
    if here:
        what = f"no library is named like the modelIdentifier {identifier!r}; there is {', '.join(here)}"
        return MissingLibrary(f"binaries/{folder}", what, f"{wanted} is wanted")
    if other in has:
        what = f"the library for this machine is in the folder of FMI {5 - fmi}.0, {other}"
        return MissingLibrary("binaries", what, f"{wanted} is wanted")
    what = f"no library for this machine ({folder}); there are libraries for {', '.join(has) or 'none'}"
    if any(n.startswith("sources/") and not n.endswith("/") for n in archive.names):
        return MissingLibrary("binaries", what, "it carries C sources: compile it, for instance with `fmpy compile`")
    return MissingLibrary("binaries", what, f"export it for this platform too: {wanted}")


def unpack(path: Path, folder: Path, fmi: int, identifier: str) -> None:
    """Unpack an FMU into a folder, after checking that it has a complete binary for this machine.

    Raises:
        InvalidFmu: a damaged archive, a path that leads out of the folder, no binary for this platform, or a truncated
            one: loading that would end this process by a signal.
    """
    archive = FmuArchive(path)
    if lack := missing_library(archive, fmi, identifier):
        raise InvalidFmu(path, lack.line)
    for name in archive.names:
        is_ours = name.startswith(f"binaries/{platform_folder(fmi)}/") and name.endswith(fmpy.sharedLibraryExtension)
        fault = shortage(archive.head(name, HEAD), archive.size(name)) if is_ours else ""
        if fault:
            raise InvalidFmu(path, f"{name}: {fault}")
    archive.unpack(folder)
