"""Files and folders of this machine: locked, temporary, and read as what they should be.

Locks end with the process that holds them. Windows, where a mapped file cannot be changed by others anyway, needs none.
"""

import contextlib
import csv
import errno
import io
import math
import os
import shutil
import stat
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import IO

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


class FileLocked(OSError):
    """Another running process holds the lock of the file or folder."""


class FileTaken(Exception):
    """There is a file already of the name that a finished one should have."""


def give_name(unfinished: Path, path: Path, *, replace: bool = True) -> None:
    """Give a finished file its name, at once; it lies in the same folder.

    Raises:
        FileTaken: there is a file of that name, which is not to be replaced. OSError: it cannot have the name.
    """
    if replace:
        os.replace(unfinished, path)
        return
    try:
        _take_name(unfinished, path)
    except FileExistsError as e:
        raise FileTaken(f"{path} is there already") from e


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
def folder_locked(path: Path) -> Generator[bool, None, None]:
    """Lock a folder against others that would change its content, without a lock file that could be left behind.

    Yields:
        Whether it is locked: neither on Windows nor on some network file systems.

    Raises:
        FileLocked: it is locked already, or was until it was removed. OSError: it cannot be opened.
    """
    if fcntl is None:
        yield False
        return
    handle, locked = os.open(path, os.O_RDONLY | os.O_DIRECTORY), True
    status = os.fstat(handle)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as e:
            raise FileLocked(f"{path} belongs to a run that is still going on") from e
        except OSError:  # some network file systems lock only what can be written to
            locked = False
        if not path.exists() or not os.path.samestat(status, path.stat()):
            raise FileLocked(f"{path} belonged to another process, which has removed it")
        yield locked
    finally:
        with contextlib.suppress(OSError):  # a unit has closed it, which has unlocked it
            if os.path.samestat(status, os.fstat(handle)):
                fcntl.flock(handle, fcntl.LOCK_UN)  # also for a child process that has inherited it
                os.close(handle)


_SCRATCH = "handover-scratch-"


@contextlib.contextmanager
def scratch_folder(purpose: str) -> Generator[Path, None, None]:
    """Give a temporary folder, locked as long as it is in use; those of processes that were killed are removed first.

    Raises:
        OSError: it cannot be made.
    """
    remove_abandoned()
    while True:
        with contextlib.ExitStack() as made:
            prefix = f"{_SCRATCH}{purpose}-"
            folder = Path(made.enter_context(tempfile.TemporaryDirectory(prefix=prefix, ignore_cleanup_errors=True)))
            try:
                made.enter_context(folder_locked(folder))
            except (FileLocked, FileNotFoundError):  # another process took it for abandoned before it was locked
                continue
            yield folder
            return


def remove_abandoned() -> None:
    """Remove this user's scratch folders that no process holds."""
    for path in Path(tempfile.gettempdir()).glob(f"{_SCRATCH}*"):
        with contextlib.suppress(OSError):
            if fcntl is not None and path.lstat().st_uid == os.geteuid():
                with folder_locked(path) as locked:
                    if locked:
                        shutil.rmtree(path, ignore_errors=True)


_MIB = 1 << 20
MOST = 64 * _MIB
"""Bytes of a file that is read as a whole, unless it is another number."""
_MOST_CSV, _MOST_CELLS = 512 * _MIB, 20_000_000


def check_regular(path: Path, most: float = math.inf) -> None:
    """Check that there is a regular file of a sane size, before others open it: devices and pipes hang, or never end.

    Raises:
        OSError: it is none, or longer than `most` bytes.
    """
    _check_status(path, path.stat(), most)


def reading_fault(error: OSError) -> str:
    """Return why a file could not be read, in words that follow its name: `there is no such file`."""
    if isinstance(error, FileNotFoundError):
        return "there is no such file"
    return f"it cannot be read: {(error.strerror or str(error)).lower()}"


def read_regular(path: Path, most: float = MOST) -> bytes:
    """Return the content of a regular file.

    Raises:
        OSError: it cannot be read, is not a regular file, or longer than `most` bytes.
    """
    with open_regular(path, most) as file:
        return file.read()


def open_regular(path: Path, most: float = math.inf) -> IO[bytes]:
    """Open a regular file to be read; raises as `read_regular`."""
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        _check_status(path, os.fstat(handle), most)
    except OSError:
        os.close(handle)
        raise
    return open(handle, "rb")


def read_csv(path: Path) -> list[tuple[int, list[str]]]:
    """Return the rows of a CSV file, each with the number of the line on which it ends.

    Raises:
        OSError: as by `read_regular`. ValueError: it is not CSV in UTF-8, or would take gigabytes.
    """
    text = io.StringIO(read_regular(path, _MOST_CSV).decode("utf-8-sig"), newline="")
    reader = csv.reader(text, strict=True, skipinitialspace=True)
    rows, cells = list[tuple[int, list[str]]](), 0
    try:
        for row in reader:
            rows.append((reader.line_num, row))
            cells += 1 + len(row)
            if cells > _MOST_CELLS:
                raise ValueError(f"line {reader.line_num}: over {_MOST_CELLS / 1e6:g} million cells and lines")
    except csv.Error as e:
        raise ValueError(f"line {reader.line_num}: {e}") from e
    return rows


def _take_name(unfinished: Path, path: Path) -> None:
    try:
        os.link(unfinished, path)
    except FileExistsError:
        raise
    except OSError:  # the file system has no links
        path.open("xb").close()
        os.replace(unfinished, path)
    else:
        unfinished.unlink()


def _check_status(path: Path, status: os.stat_result, most: float) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder, not a file", str(path))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is a device or a pipe, not a file", str(path))
    if status.st_size > most:
        fault = f"it has {status.st_size / _MIB:.0f} MiB; at most {most / _MIB:.0f} MiB are read"
        raise OSError(errno.EINVAL, fault, str(path))
