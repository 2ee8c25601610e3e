"""Locks a file for as long as a process lives; Windows, where a mapped file is protected anyway, needs none."""

from typing import IO

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


class FileLocked(OSError):
    """Another process that runs holds the file."""


def lock_file(file: IO[bytes]) -> None:
    """Lock an open file; the lock goes with the process, however it ends.

    Raises:
        FileLocked: it is locked already.
    """
    if fcntl is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as e:
        raise FileLocked(f"{file.name} belongs to a run that still goes on") from e


def unlock_file(file: IO[bytes]) -> None:
    """Unlock it, also for a child process that has inherited it."""
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_UN)
