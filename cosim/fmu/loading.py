"""The typed edge to FMPy: loading and instantiating FMUs of both standards.

FMPy's classes of co-simulation units, quicker to make: 3 ms less an instance with FMI 3.
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


def _read_once(base: Any) -> Any:
    """Return a class of FMPy's that looks its functions up once for a library, and their types once at all."""
    signatures: dict[str, tuple[Any, Any, Any]] = {}
    loaded: dict[int, tuple[Any, Any]] = {}  # a library that units have loaded, and its functions, by its handle
    users: dict[int, int] = {}

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
                if not users[handle]:  # what is loaded next may get the same handle
                    del users[handle], loaded[handle]
            super().freeLibrary()

        def _look_up(self) -> None:
            for name, (names, types, returned) in signatures.items():
                function = getattr(self.dll, name)
                function.argnames, function.argtypes, function.restype = names, types, returned
                self._functions[name] = function

    Unit.__name__ = base.__name__  # FMPy tells the standard by how the name begins
    return Unit


FMU2Unit = _read_once(fmpy.fmi2.FMU2Slave)
"""A unit of FMI 2 as `fmpy.fmi2.FMU2Slave`."""

FMU3Unit = _read_once(fmpy.fmi3.FMU3Slave)
"""A unit of FMI 3 as `fmpy.fmi3.FMU3Slave`."""


Logger = Callable[[int, str], None]
"""Takes an FMI status and a message."""

Begins = Callable[[str], None]
"""Told what begins to be done with a unit."""

LOADING = "loading of its library"


def load_fmi3(
    path: Path,
    folder: Path,
    identifier: str,
    token: str,
    instance: str,
    log: Logger,
    begins: Begins,
    *,
    events: bool = False,
) -> Any:
    """Load and instantiate an FMI 3 co-simulation FMU, with event mode and early return or without.

    Returns:
        FMPy's `FMU3Slave`.

    Raises:
        InvalidFmu: the library does not load, lacks a function, or does not instantiate.
    """

    def log_message(_environment: Any, status: int, _category: bytes, message: bytes) -> None:
        log(status, message.decode("utf-8", "replace"))

    with _loading(path):
        begins(LOADING)
        fmu = FMU3Unit(guid=token, modelIdentifier=identifier, unzipDirectory=str(folder), instanceName=instance)
        with _unloading(fmu):
            begins("fmi3InstantiateCoSimulation")
            fmu.instantiate(loggingOn=True, logMessage=log_message, eventModeUsed=events, earlyReturnAllowed=events)
        return fmu


def load_fmi2(path: Path, folder: Path, identifier: str, token: str, instance: str, log: Logger, begins: Begins) -> Any:
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
        begins(LOADING)
        fmu = FMU2Unit(guid=token, modelIdentifier=identifier, unzipDirectory=str(folder), instanceName=instance)
        _loggers[place] = log
        weakref.finalize(fmu, _loggers.pop, place, None)
        with _unloading(fmu):
            begins("fmi2Instantiate")
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
        raise InvalidFmu(path, f"could not be instantiated: {one_line(e)}") from e
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
