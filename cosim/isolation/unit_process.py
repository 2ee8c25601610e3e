"""The process of an isolated unit: its start with shared memory, its end.

The calls themselves are made in C, by the library `proxy`, whose functions have the names of both standards.
"""

import contextlib
import ctypes
import functools
import itertools
import os
import re
import signal
import socket
import subprocess
import sys
import sysconfig
import tempfile
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handover.cosim.isolation.compile import isolation_files

_SIZE = 2**32 if sys.platform == "linux" else 2**28
"""Bytes of the shared memory; the system allocates only the pages that are used."""
_SPIN = 50
"""Microseconds for which a side looks again and again before it sleeps, which takes longer than that to end."""
_PATIENCE = 5.0
"""Seconds that a process has to end after it was asked to."""

_Sockets = tuple[socket.socket | None, socket.socket | None]

_numbers = itertools.count()
_LOGGER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
_RUNNING, _BY_SIGNAL, _BY_EXIT, _BY_LIMIT, _BY_MASTER = range(5)


class NoUnitProcess(Exception):
    """Units cannot have processes of their own on this machine, or one cannot be started; the message says why."""


@dataclass(frozen=True)
class Ending:
    """How a process ended that should not have.

    Attributes:
        how: in words.
        call: the FMI call that it was in; empty if that is the one which the master made.
        hung: whether it was ended because the call took longer than the limit.
    """

    how: str
    call: str
    hung: bool = False


class UnitProcess:
    """A process for one unit, which lives until `close`, or until this process ends.

    Args:
        limit: seconds of wall time that a call may take before the process is ended; 0: any.
        time: address of a double that holds the simulated time of each call that the unit makes; 0: of none.

    Attributes:
        proxy: the library whose functions make the calls, of the instance that `select` chose.

    Raises:
        NoUnitProcess: it cannot be started.
    """

    def __init__(self, limit: float = 0.0, time: int = 0) -> None:
        files = isolation_files()
        if files is None:
            raise NoUnitProcess(unavailable())
        self.proxy, program = files
        self._library = _loaded(self.proxy)
        memory = _memory()
        sockets = _socket_pair()
        try:
            os.ftruncate(memory, _SIZE)
            ours, other = (end.fileno() if end else -1 for end in sockets)
            self._connection = self._library.isolation_open(memory, _SIZE, next(_numbers), _spin(), ours)
            if not self._connection:
                raise NoUnitProcess("the memory that it shares with this one cannot be mapped")
            self._process = subprocess.Popen(
                [str(program), str(memory), str(_SIZE), str(os.getpid()), str(other), _libpython(), _path_of_python()],
                stdin=subprocess.DEVNULL,
                pass_fds=[fd for fd in (memory, other) if fd >= 0],
                start_new_session=True,  # Ctrl-C is for this process
            )
        except (OSError, NoUnitProcess) as e:
            _close(memory, sockets)
            raise NoUnitProcess(f"a process for a unit cannot be started: {e}") from e
        self._library.isolation_started(self._connection, self._process.pid, limit, time)
        self._logger: Any = None
        weakref.finalize(self, self._library.isolation_close, self._connection)
        self._end = weakref.finalize(self, _end, self._process, memory, sockets)

    def load(self, library: Path, fmi: int, log: Callable[[int, str], None]) -> None:
        """Load a unit's library.

        Raises:
            OSError: it does not load or lacks a function; the system's words.
        """
        lines: list[str] = []

        def keep(_environment: Any, _status: int, _category: bytes, message: bytes) -> None:
            lines.append(message.decode("utf-8", "replace"))

        self._logger = _LOGGER(keep)
        self._library.isolation_log_to(self._connection, self._logger)
        status = self._library.isolation_load(self._connection, os.fsencode(library), f"fmi{fmi}".encode())
        self._library.isolation_log_to(self._connection, _LOGGER())
        if status > 1:
            for line in lines[:-1]:
                log(status, line)
            raise OSError(_explained(lines[-1]) if lines else "its process ended")

    def select(self) -> None:
        """Let the next instance that this thread makes through the proxy be the one of this process."""
        self._library.isolation_select(self._connection)

    @property
    def ending(self) -> Ending | None:
        """How the process ended within a call; None while it runs, and if it was ended after Fatal."""
        number = ctypes.c_int()
        ending = self._library.isolation_ending(self._connection, ctypes.byref(number))
        if ending in (_RUNNING, _BY_MASTER):
            return None
        if ending == _BY_SIGNAL and number.value == signal.SIGKILL:
            return Ending("killed, by someone or by the system for want of memory", self.failed_call)
        if ending == _BY_SIGNAL:
            return Ending((signal.strsignal(number.value) or f"signal {number.value}").lower(), self.failed_call)
        if ending == _BY_EXIT:
            return Ending(f"it ended its process with status {number.value}", self.failed_call)
        return Ending("its process is gone", self.failed_call, hung=ending == _BY_LIMIT)

    @property
    def failed_call(self) -> str:
        """The call in which the last failure arose, if it is not the one that reported it; else empty."""
        return self._library.isolation_failed_call(self._connection).decode()

    def begin_step(self, fmi: int) -> Any:
        """Return the function that begins a step without waiting for its end, with the arguments of FMI 2's DoStep."""
        return getattr(self._library, f"isolation_begin_step_{fmi}")

    @property
    def is_stepping(self) -> bool:
        """Whether a step was begun that nobody has waited for."""
        return self._library.isolation_is_stepping(self._connection)

    def take_warnings(self) -> Iterator[tuple[str, float, int]]:
        """Yield, once, the calls that answered Warning after they had returned OK: what is set waits for the step.

        Of each the name, the simulated time of the first in s, and how many there were.
        """
        first, n = ctypes.c_double(), ctypes.c_uint64()
        while call := self._library.isolation_take_warnings(self._connection, ctypes.byref(first), ctypes.byref(n)):
            yield call.decode(), first.value, n.value

    def measure_cpu(self) -> int:
        """Measure the CPU time of steps from now on; return the address of their seconds, to be taken away from there.

        Waiting for the master does not count. Between a step's begin and its end only the process writes there.
        """
        return self._library.isolation_measure_cpu(self._connection)

    def kill(self) -> None:
        """End the process at once; a call that another thread waits for returns Fatal."""
        self._process.kill()

    def close(self) -> None:
        """Unload the library and end the process, which may have ended; what was read from it stays valid."""
        if self._process.returncode is None:
            self._library.isolation_unload(self._connection)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_PATIENCE if self.ending is None else 0.0)
            self._library.isolation_over(self._connection)
        self._end()


def unavailable() -> str:
    """Return why units cannot have processes of their own here; empty if they can.

    Raises:
        CompilationError: the program does not compile, or cannot be written.
    """
    if isolation_files() is not None:
        return ""
    return "units can be isolated on Linux and macOS only, with the program that is compiled with this package"


_OF_PYTHON = re.compile(r"(?:undefined symbol: |flat namespace '_)(_?Py\w+)")


def _explained(message: str) -> str:
    """Return the linker's message; where a library uses Python and this one has no library, the cause and the cure."""
    symbol = _OF_PYTHON.search(message)
    if symbol is None or _libpython():
        return message
    cause = (
        f"it uses Python ({symbol[1]}), but names no library of Python that it needs: it expects to be loaded by Python"
    )
    here = (
        f"the process of an isolated unit is not, and the Python here, {sys.executable}, has no shared library for it"
    )
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    cure = f"run it without isolation, or install Debian's libpython{version} or a Python built with --enable-shared"
    return f"{cause}; {here}. Cure: {cure}"


@functools.cache
def _libpython() -> str:
    """Return the path of this Python's shared library, or an empty string.

    It is found as `handover.fmus.interpreter` finds it, which FMUs carry and which stands above this.
    """
    names = [str(sysconfig.get_config_var(name) or "") for name in ("INSTSONAME", "LDLIBRARY")]
    libdir, *others = (str(sysconfig.get_config_var(v) or "") for v in ("LIBDIR", "LIBPL", "PYTHONFRAMEWORKPREFIX"))
    multiarch = os.path.join(libdir, str(sysconfig.get_config_var("MULTIARCH") or ""))
    places = [
        Path(p) / n for n in names for p in (libdir, multiarch, *others, os.path.join(sys.base_prefix, "lib")) if p
    ]
    return next((str(p) for p in places if p.name and p.suffix != ".a" and p.is_file()), "")


def _path_of_python() -> str:
    """Return a PATH on which this Python comes first: one that a library starts finds its packages by that."""
    return os.pathsep.join(p for p in (os.path.dirname(sys.executable), os.environ.get("PATH", "")) if p)


def _end(process: "subprocess.Popen[bytes]", memory: int, sockets: _Sockets) -> None:
    """End a process, if it has not ended, and what its unit has forked and left: it leads a process group."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    if process.returncode is None:
        process.kill()
        process.wait()
    _close(memory, sockets)


def _close(memory: int, sockets: _Sockets) -> None:
    os.close(memory)
    for end in sockets:
        if end is not None:
            end.close()


def _memory() -> int:
    """Return the descriptor of a new file in memory, or of one without a name."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("unit")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def _socket_pair() -> _Sockets:
    """Return two connected sockets, over which the sides wake each other where the system has no futex."""
    return (None, None) if sys.platform == "linux" else socket.socketpair()


def _spin() -> int:
    affinity = getattr(os, "sched_getaffinity", None)
    processors = len(affinity(0)) if affinity is not None else os.cpu_count() or 1
    return _SPIN if processors > 1 else 0


@functools.cache
def _loaded(file: Path) -> ctypes.CDLL:
    library = ctypes.CDLL(str(file))
    connection = ctypes.c_void_p
    signatures: dict[str, tuple[Any, tuple[Any, ...]]] = {
        "open": (connection, (ctypes.c_int, ctypes.c_uint64, ctypes.c_int, ctypes.c_uint32, ctypes.c_int)),
        "started": (None, (connection, ctypes.c_long, ctypes.c_double, ctypes.c_void_p)),
        "select": (None, (connection,)),
        "log_to": (None, (connection, _LOGGER)),
        "load": (ctypes.c_int, (connection, ctypes.c_char_p, ctypes.c_char_p)),
        "unload": (ctypes.c_int, (connection,)),
        "ending": (ctypes.c_int, (connection, ctypes.POINTER(ctypes.c_int))),
        "failed_call": (ctypes.c_char_p, (connection,)),
        "take_warnings": (
            ctypes.c_char_p,
            (connection, ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_uint64)),
        ),
        "is_stepping": (ctypes.c_bool, (connection,)),
        "over": (None, (connection,)),
        "measure_cpu": (ctypes.c_void_p, (connection,)),
        "close": (None, (connection,)),
        "begin_step_2": (None, (connection, ctypes.c_double, ctypes.c_double, ctypes.c_int)),
        "begin_step_3": (None, (connection, ctypes.c_double, ctypes.c_double, ctypes.c_int)),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, f"isolation_{name}")
        function.restype, function.argtypes = result, arguments
    return library
