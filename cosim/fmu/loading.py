"""The typed edge to FMPy: loads and instantiates FMUs of both standards.

FMPy's classes are extended to look up a library's functions only once, which saves 3 ms per instance of FMI 3, and
FMI 2 units get a logger that finds the instance that a message is from.
"""

import ctypes
import itertools
import os
import weakref
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import fmpy.fmi2
import fmpy.fmi3

from handover.cosim.exceptions import InvalidFmu, one_line
from handover.cosim.fmu.file.description import FmuDescription
from handover.cosim.fmu.file.fmpy_edge import library_path
from handover.cosim.isolation.unit_process import UnitProcess


def _read_once(base: Any) -> Any:
    """Return an FMPy class that looks up functions once per library, and reads their signatures only once."""
    signatures: dict[str, tuple[Any, Any, Any]] = {}
    loaded: dict[int, tuple[Any, Any]] = {}  # by handle, a loaded library and its functions
    users: dict[int, int] = {}  # by handle, the number of units that use it

    class Unit(base):
        def _loadFunctions(self) -> None:
            handle: int = self.dll._handle
            if handle in loaded:
                self.dll, self._functions = loaded[handle]
            elif signatures:
                self._look_up()
            else:
                super()._loadFunctions()
                signatures.update({n: (f.argnames, f.argtypes, f.restype) for n, f in self._functions.items()})
            loaded.setdefault(handle, (self.dll, self._functions))
            users[handle] = users.get(handle, 0) + 1

        def freeLibrary(self) -> None:
            handle: int = self.dll._handle
            if handle in users:
                users[handle] -= 1
                if not users[handle]:  # the next library that is loaded may get the same handle
                    del users[handle], loaded[handle]
            super().freeLibrary()

        def _look_up(self) -> None:
            for name, (names, types, returned) in signatures.items():
                function = getattr(self.dll, name)
                function.argnames, function.argtypes, function.restype = names, types, returned
                self._functions[name] = function

    Unit.__name__ = base.__name__  # FMPy derives the standard from the name's beginning
    return Unit


FMU2Unit = _read_once(fmpy.fmi2.FMU2Slave)
"""`fmpy.fmi2.FMU2Slave` with functions that are looked up once."""

FMU3Unit = _read_once(fmpy.fmi3.FMU3Slave)
"""`fmpy.fmi3.FMU3Slave` with functions that are looked up once."""

Logger = Callable[[int, str], None]
"""Takes an FMI status and a message."""

Begins = Callable[[str], None]
"""Called with the name of the call that begins."""

LOADING, UNLOADING = "loading of its library", "unloading of its library"


def load_unit(
    description: FmuDescription, folder: Path, instance: str, log: Logger, begins: Begins, *,
    events: bool = False, process: UnitProcess | None = None,
) -> Any:  # fmt: skip
    """Load and instantiate a co-simulation FMU.

    Args:
        description: of the FMU.
        folder: where it is unpacked.
        instance: name of the instance.
        log: takes what the unit logs.
        begins: called with the name of each call before it is made.
        events: whether an FMI 3 unit is to use event mode and early return.
        process: the process that loads the library, which FMPy then calls through the proxy; None: this one.

    Returns:
        FMPy's `FMU2Slave` or `FMU3Slave`.

    Raises:
        InvalidFmu: the library does not load, lacks a function, or does not instantiate.
    """
    with _loading(description.path):
        begins(LOADING)
        fmu = _loaded(description, folder, instance, log, process)
        with _unloading(fmu):
            if description.fmi == 2:
                begins("fmi2Instantiate")
                _instantiate_fmi2(fmu, log)
            else:
                begins("fmi3InstantiateCoSimulation")
                _instantiate_fmi3(fmu, log, events)
        return fmu


def _instantiate_fmi2(fmu: Any, log: Logger) -> None:
    environment = next(_environments)
    callbacks = fmpy.fmi2.fmi2CallbackFunctions()
    callbacks.logger = _dispatch_fmi2
    callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    callbacks.componentEnvironment = environment
    fmpy.fmi2.addLoggerProxy(ctypes.byref(callbacks))
    _loggers[environment] = log
    weakref.finalize(fmu, _loggers.pop, environment, None)
    fmu.instantiate(callbacks=callbacks, loggingOn=True)


def _instantiate_fmi3(fmu: Any, log: Logger, events: bool) -> None:
    def log_message(_environment: Any, status: int, _category: bytes, message: bytes) -> None:
        log(status, _text_of(message))

    fmu.instantiate(loggingOn=True, logMessage=log_message, eventModeUsed=events, earlyReturnAllowed=events)


def _text_of(message: bytes | None) -> str:
    """Return a unit's message, which may be no text at all: NULL, or bytes that are not UTF-8."""
    return (message or b"").decode("utf-8", "replace")


_environments = itertools.count(1)
_loggers: dict[int, Logger] = {}  # by the unit's componentEnvironment


def _log_fmi2(environment: int | None, _instance: bytes, status: int, _category: bytes, message: bytes) -> None:
    log = _loggers.get(environment or 0)
    if log is not None:
        log(status, _text_of(message))


_dispatch_fmi2 = fmpy.fmi2.fmi2CallbackLoggerTYPE(_log_fmi2)
"""The logger of all FMI 2 units. FMPy's proxy, which formats messages, has one logger per process, the last one that it
was given, and keeps calling it: so this must be one that distinguishes units and is never freed."""


def _loaded(d: FmuDescription, folder: Path, instance: str, log: Logger, process: UnitProcess | None) -> Any:
    """Return FMPy's object for a library that is loaded, into this process or into the unit's own."""
    kind: Any = FMU2Unit if d.fmi == 2 else FMU3Unit
    names = {"guid": d.token, "modelIdentifier": d.identifier, "unzipDirectory": str(folder), "instanceName": instance}
    if process is None:
        return kind(**names)
    process.load((folder / library_path(d.fmi, d.identifier)).resolve(), d.fmi, log)
    unit, first_base = kind.__new__(kind), kind.__mro__[-2]
    first_base.__init__(unit, **names, libraryPath=str(process.proxy))  # the class's own has no choice of library
    process.select()
    return unit


@contextmanager
def _loading(path: Path) -> Generator[None, None, None]:
    """Raise a failed loading as InvalidFmu, and restore the working directory, which FMPy changes when it fails."""
    working_directory = Path.cwd()
    try:
        yield
    except Exception as e:  # FMPy raises plain Exception when a library does not load or instantiate
        raise InvalidFmu(path, f"could not be instantiated: {one_line(e)}") from e
    finally:
        os.chdir(working_directory)


@contextmanager
def _unloading(fmu: Any) -> Generator[None, None, None]:
    """Unload the library if the instance cannot be made."""
    try:
        yield
    except BaseException:
        fmu.freeLibrary()
        raise
