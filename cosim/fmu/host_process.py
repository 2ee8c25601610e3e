"""What units share with their host: directory, standard streams, signal handlers, limits, arithmetic, its identity.

A unit's library may change any of these as it is loaded or called, and then every other unit, and the host itself, runs
with that. `HostProcess` notes how they were and puts them back. A process that a unit has forked returns from the
unit's call, too, and would go on as a second host: `exit_if_forked` ends it.
"""

import contextlib
import ctypes
import ctypes.util
import mmap
import os
import signal
import sys
import time
from collections.abc import Mapping
from typing import Any

if sys.platform != "win32":
    import resource

    _LIMITED = {
        resource.RLIMIT_FSIZE: "RLIMIT_FSIZE",
        resource.RLIMIT_NOFILE: "RLIMIT_NOFILE",
        resource.RLIMIT_AS: "RLIMIT_AS",
        resource.RLIMIT_DATA: "RLIMIT_DATA",
        resource.RLIMIT_CPU: "RLIMIT_CPU",
        resource.RLIMIT_STACK: "RLIMIT_STACK",
    }
else:
    _LIMITED = {}

_POSIX = sys.platform != "win32"
_MADV_WIPEONFORK = 18  # Linux 4.14
_SIZE = 256  # bytes, more than a `struct sigaction` or a `fenv_t` has on any system
_SIGNALS = [n for n in range(1, 32) if _POSIX and n not in (signal.SIGKILL, signal.SIGSTOP)]
_STREAMS = (0, 1, 2)
_OUT_OF_THE_WAY = (700, 200)
"""Descriptors from which on the standard streams are copied: some units close those next to the ones that they open, or
the first few hundred. Where a process may have fewer (macOS: 256), the second."""
_INTERVAL = 0.2  # s


def _identity_page() -> mmap.mmap:
    """Return a page that holds 1, and in processes that are forked from this one 0 (Linux)."""
    page = mmap.mmap(-1, mmap.PAGESIZE, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS) if _POSIX else mmap.mmap(-1, 4096)
    with contextlib.suppress(OSError, ValueError, AttributeError):
        page.madvise(_MADV_WIPEONFORK)
    page[0] = 1
    return page


identity = _identity_page()
"""Its first byte is 0 in a process that was forked from this one since `mark_as_host`; C code: `identity_address`."""


def identity_address() -> int:
    """Return the address of the first byte of `identity`."""
    return ctypes.addressof(ctypes.c_char.from_buffer(identity))


def mark_as_host() -> None:
    """Make the calling process the host, as before calls of units begin: it may have been forked by its own program."""
    identity[0] = 1


def exit_if_forked() -> None:
    """End this process at once if a unit has forked it from the host in a call that returns here too."""
    if not identity[0]:
        os._exit(0)


class HostProcess:
    """Notes directory, standard streams, signal handlers, limits and floating-point environment, and puts them back.

    The floating-point environment (rounding, traps, flushing to zero) is that of the calling thread. On Windows only
    the directory is put back.
    """

    def __init__(self) -> None:
        self._libc: Any = ctypes.CDLL(None) if _POSIX else None
        self._libm: Any = _library_with("fegetenv") if _POSIX else None
        self._streams: dict[int, int] = {}
        self._hard_limits = hard_limits()
        self.note()

    def note(self) -> None:
        """Note how all is from here on, as before calls of units: the host's own program may have changed it."""
        self._close_copies()
        self._directory = _directory()
        self._streams = {n: copy for n in _STREAMS if (copy := copied(n)) is not None}
        self._handlers = {n: (self._handler(n), signal.getsignal(n)) for n in _SIGNALS}
        self._arithmetic = self._environment()
        self._limits = _limits()
        self._checked_at = time.monotonic()

    def restore(self, *, handlers_set_here: bool = True) -> None:
        """Put back what has changed; a process that a unit has forked ends.

        Args:
            handlers_set_here: put back also signal handlers that were set through Python, as by a unit that is a Python
                block; else only those that were set behind its back.
        """
        exit_if_forked()
        if self._directory is not None and _directory() != self._directory:
            with contextlib.suppress(OSError):
                os.chdir(self._directory)
        for number, copy in self._streams.items():
            if opened_file(number) != opened_file(copy) and opened_file(copy) is not None:
                os.dup2(copy, number)
        for number, (handler, known) in self._handlers.items():
            if _significant(self._handler(number)) != _significant(handler) and (
                handlers_set_here or signal.getsignal(number) == known
            ):
                self._libc.sigaction(number, handler, None)
        self.restore_limits()
        self.restore_arithmetic()

    def restore_limits(self) -> None:
        """Raise limits of resources again that were lowered, as of files' sizes and number, as far as that is allowed.

        A process may lower its hard limits, but only a privileged one may raise them again.
        """
        for limited, now in _limits().items():
            before = self._limits[limited]
            if all(map(_is_within, before, now)):
                continue
            for limits in (before, (now[1], now[1])):
                with contextlib.suppress(OSError, ValueError):
                    resource.setrlimit(limited, limits)
                    break

    def lowered_limits(self) -> str:
        """Return the hard limits that are below what they were at first; empty if there is none."""
        return lowered_limits(self._hard_limits)

    def restore_arithmetic(self) -> None:
        """Put back the floating-point environment of the calling thread; a process that a unit has forked ends."""
        exit_if_forked()
        if self._libm is not None and self._arithmetic is not None:
            self._libm.fesetenv(self._arithmetic)

    def restore_if_due(self) -> None:
        """Do as `restore`, if that was not done in the last fifth of a second."""
        now = time.monotonic()
        if now - self._checked_at > _INTERVAL:
            self._checked_at = now
            self.restore(handlers_set_here=False)

    def close(self) -> None:
        """Put back all, and free what that took."""
        self.restore(handlers_set_here=False)
        self._close_copies()

    def _close_copies(self) -> None:
        for copy in self._streams.values():
            with contextlib.suppress(OSError):
                os.close(copy)
        self._streams = {}

    def _handler(self, number: int) -> bytes:
        buffer = ctypes.create_string_buffer(_SIZE)
        self._libc.sigaction(number, None, buffer)
        return buffer.raw

    def _environment(self) -> bytes | None:
        if self._libm is None:
            return None
        buffer = ctypes.create_string_buffer(_SIZE)
        self._libm.fegetenv(buffer)
        return buffer.raw


def hard_limits() -> dict[int, int]:
    """Return the hard limit of each resource that a host needs to write what it records."""
    return {n: hard for n, (_, hard) in _limits().items()}


def lowered_limits(before: Mapping[int, int]) -> str:
    """Return the hard limits that are below what they were, as in "RLIMIT_AS to 1000000"; empty if there is none."""
    lowered = [(n, now) for n, now in hard_limits().items() if not _is_within(before[n], now)]
    return ", ".join(f"{_LIMITED[n]} to {now}" for n, now in lowered)


def _limits() -> dict[int, tuple[int, int]]:
    """Return soft and hard limit of each resource that a host needs to write what it records."""
    return {n: resource.getrlimit(n) for n in _LIMITED}


def _is_within(before: int, now: int) -> bool:
    return now == resource.RLIM_INFINITY or (before != resource.RLIM_INFINITY and before <= now)


def _significant(handler: bytes) -> bytes:
    """Return what there is in a `struct sigaction`: the function, the mask of the first signals, and the flags.

    The rest of it is what happened to lie in the C library's memory.
    """
    return handler[:16] + (handler[136:140] if sys.platform == "linux" else b"")


def _library_with(function: str) -> Any:
    for name in (None, ctypes.util.find_library("m")):
        with contextlib.suppress(OSError):
            library = ctypes.CDLL(name)
            if hasattr(library, function):
                return library
    return None


def _directory() -> str | None:
    try:
        return os.getcwd()
    except OSError:  # it was removed
        return None


def copied(number: int) -> int | None:
    """Return a copy of a descriptor, out of the way; None where it is closed, or where there is no room for one."""
    if not _POSIX:
        return None
    import fcntl

    for least in _OUT_OF_THE_WAY:
        with contextlib.suppress(OSError, ValueError):
            return fcntl.fcntl(number, fcntl.F_DUPFD_CLOEXEC, least)
    return None


def opened_file(number: int) -> tuple[int, int, int] | None:
    """Return which file a descriptor is open for; None where it is closed.

    A unit may close a descriptor of the host, and open another file, which then gets its number.
    """
    try:
        found = os.fstat(number)
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_rdev
