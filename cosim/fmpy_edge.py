"""The typed edge to FMPy: reading model descriptions, unpacking, and loading FMUs of both standards."""

import ctypes
import itertools
import os
import weakref
import zipfile
import zlib
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, cast
from xml.etree import ElementTree

import fmpy
import fmpy.fmi2
import fmpy.fmi3

from cosim.exceptions import InvalidFmu

Logger = Callable[[int, str], None]
"""Takes an FMI status and a message."""

STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")


class ModelVariable(Protocol):
    """The parts of FMPy's `ModelVariable` that are used here."""

    name: str
    type: str
    causality: str
    variability: str | None
    valueReference: int
    shape: tuple[int, ...] | None
    unit: str | None
    start: str | None
    min: str | None
    max: str | None
    description: str | None
    declaredType: Any


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


def read_description(path: Path) -> ModelDescription:
    """Read and validate the model description of a co-simulation FMU.

    Raises:
        InvalidFmu: with what is wrong with the file.
    """
    if not path.is_file():
        raise InvalidFmu(path, "there is no such file" if not path.exists() else "not a file but a folder")
    if not zipfile.is_zipfile(path):
        raise InvalidFmu(path, "not an FMU: an FMU is a zip archive, and this file is not one")
    try:
        md: Any = fmpy.read_model_description(str(path))
    except KeyError as e:
        raise InvalidFmu(path, f"not an FMU: {str(e.args[0]).lower()}") from e
    except (
        Exception
    ) as e:  # FMPy raises plain Exception for what it does not know, lxml its own for what it cannot parse
        raise InvalidFmu(path, f"its modelDescription.xml is not valid: {_one_line(e)}") from e
    if md.fmiVersion == "1.0":
        raise InvalidFmu(path, "an FMU of FMI 1.0; versions 2.0 and 3.0 can be used")
    if md.coSimulation is None:
        raise InvalidFmu(path, "it has no co-simulation interface")
    return cast(ModelDescription, md)


def mime_types(path: Path) -> dict[str, str]:
    """Return the MIME types of an FMI 3 FMU's binary variables by name; FMPy does not read them."""
    with zipfile.ZipFile(path) as z:
        root = ElementTree.fromstring(z.read("modelDescription.xml"))
    return {e.get("name", ""): e.get("mimeType", "application/octet-stream") for e in root.iter("Binary")}


def unpack(path: Path, folder: Path, fmi: int, identifier: str) -> None:
    """Unpack an FMU into a folder, after checking that it has a binary for this machine.

    Raises:
        InvalidFmu: damaged archive, a path that leads out of the folder, or no binary for this platform.
    """
    here = cast(str, fmpy.platform if fmi == 2 else fmpy.platform_tuple)
    binary = f"binaries/{here}/{identifier}{fmpy.sharedLibraryExtension}"
    try:
        with zipfile.ZipFile(path) as z:
            names = z.namelist()
            outside = [n for n in names if ".." in Path(n).parts or Path(n).is_absolute() or "\\" in n or ":" in n]
            if outside:
                raise InvalidFmu(path, f"the archive holds a path that leads out of it: {outside[0]}")
            if binary not in names:
                has = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") > 1})
                raise InvalidFmu(
                    path,
                    f"no binary for this machine ({here}); it has {', '.join(has) or 'none'}",
                )
            z.extractall(folder)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, OSError, EOFError) as e:
        raise InvalidFmu(path, f"the archive is damaged: {_one_line(e)}") from e


def load_fmi3(path: Path, folder: Path, identifier: str, token: str, instance: str, log: Logger) -> Any:
    """Load and instantiate an FMI 3 co-simulation FMU; return FMPy's `FMU3Slave`.

    Raises:
        InvalidFmu: the library does not load, lacks a function, or does not instantiate.
    """

    def log_message(_environment: Any, status: int, _category: bytes, message: bytes) -> None:
        log(status, message.decode("utf-8", "replace"))

    with _loading(path):
        fmu = fmpy.fmi3.FMU3Slave(
            guid=token, modelIdentifier=identifier, unzipDirectory=str(folder), instanceName=instance
        )
        with _unloading(fmu):
            fmu.instantiate(loggingOn=True, logMessage=log_message)
        return fmu


def load_fmi2(path: Path, folder: Path, identifier: str, token: str, instance: str, log: Logger) -> Any:
    """Load and instantiate an FMI 2 co-simulation FMU; return FMPy's `FMU2Slave`.

    Raises:
        InvalidFmu: the library does not load, lacks a function, or does not instantiate.
    """
    place = next(_places)
    callbacks = fmpy.fmi2.fmi2CallbackFunctions()
    callbacks.logger = _dispatch_fmi2
    callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    callbacks.componentEnvironment = place
    fmpy.fmi2.addLoggerProxy(ctypes.byref(callbacks))
    with _loading(path):
        fmu = fmpy.fmi2.FMU2Slave(
            guid=token, modelIdentifier=identifier, unzipDirectory=str(folder), instanceName=instance
        )
        _loggers[place] = log
        weakref.finalize(fmu, _loggers.pop, place, None)
        with _unloading(fmu):
            fmu.instantiate(callbacks=callbacks, loggingOn=True)
        return fmu


_places = itertools.count(1)
_loggers: dict[int, Logger] = {}


def _log_fmi2(environment: int | None, _instance: bytes, status: int, _category: bytes, message: bytes) -> None:
    log = _loggers.get(environment or 0)
    if log is not None:
        log(status, message.decode("utf-8", "replace"))


_dispatch_fmi2 = fmpy.fmi2.fmi2CallbackLoggerTYPE(_log_fmi2)
"""The logger of all FMI 2 units. FMPy's proxy, which puts the arguments into messages, knows one logger in a process,
the last that it was given, and calls it ever after: so it must be one that tells units apart and that stays."""


@contextmanager
def _loading(path: Path) -> Generator[None, None, None]:
    """Tell a failed loading as InvalidFmu, and stay in the working directory, which FMPy leaves when it fails."""
    before = Path.cwd()
    try:
        yield
    except Exception as e:  # FMPy raises plain Exception when a library does not load or instantiate
        raise InvalidFmu(path, f"could not be instantiated: {_one_line(e)}") from e
    finally:
        os.chdir(before)


@contextmanager
def _unloading(fmu: Any) -> Generator[None, None, None]:
    """Unload the library if the instance cannot be made."""
    try:
        yield
    except BaseException:
        fmu.freeLibrary()
        raise


def _one_line(e: BaseException) -> str:
    return " ".join(str(e).split()) or type(e).__name__
