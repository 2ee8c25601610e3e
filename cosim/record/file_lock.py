"""Locks a file or folder for as long as a process lives.

Windows, where a mapped file cannot be changed by others anyway, needs none.
"""

import contextlib
import os
from collections.abc import Generator
from pathlib import Path
from typing import IO

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


class FileLocked(OSError):
    """Another running process holds the lock of the file or folder."""


def lock_file(file: IO[bytes]) -> None:
    """Lock an open file; the lock ends with the process, in whatever way that ends.

    Raises:
        FileLocked: it is locked already.
    """
    if fcntl is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as e:
        raise FileLocked(f"{file.name} belongs to a run that is still going on") from e


def unlock_file(file: IO[bytes]) -> None:
    """Unlock it, also for a child process that has inherited it."""
    if fcntl is not None:
        with contextlib.suppress(OSError):  # a unit has closed it, which has unlocked it
            fcntl.flock(file, fcntl.LOCK_UN)


def holder_of(path: Path) -> int | None:
    """Return the process that holds a folder by `folder_locked`, from Linux's list of locks; None where not known."""
    try:
        folder = path.stat()
        locks = Path("/proc/locks").read_text(encoding="ascii")
    except (OSError, ValueError):
        return None
    inode = f"{os.major(folder.st_dev):02x}:{os.minor(folder.st_dev):02x}:{folder.st_ino}"
    for line in locks.splitlines():
        words = line.split()  # 1: FLOCK ADVISORY WRITE 4711 fe:01:123456 0 EOF
        if "FLOCK" in words[:2] and inode in words:
            process = int(words[words.index(inode) - 1])
            return process if process > 0 else None
    return None


@contextlib.contextmanager
def folder_locked(path: Path) -> Generator[None, None, None]:
    """Lock a folder against others that would change its content, without a lock file that could be left behind.

    Raises:
        FileLocked: it is locked already. OSError: it cannot be opened.
    """
    if fcntl is None:
        yield
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as e:
            raise FileLocked(f"{path} belongs to a run that is still going on") from e
        except OSError:  # some network file systems lock only what can be written to
            pass
        yield
    finally:
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_UN)  # also for a child process that has inherited it
        os.close(handle)
