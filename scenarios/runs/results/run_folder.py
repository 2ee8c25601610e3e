"""A run's output folder: checked before the run, written to during and after it.

Files are replaced as a whole (`write_whole`), so that a process may end at any time and leave no half-written JSON.
A lock on the folder (`folder_held`) keeps two processes from working in it.
"""

import contextlib
import errno
import hashlib
import importlib.metadata
import itertools
import json
import os
import platform
import secrets
import shutil
import time
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from handover.cosim.exceptions import RecordNotWritten
from handover.cosim.files import FileLocked, check_regular, folder_locked, give_name, holder_of, open_regular
from handover.cosim.typed_data import InvalidData, read_typed
from handover.scenarios.runs.results.folder_data import RunData, Summary

T = TypeVar("T")

_PACKAGES = ("handover-cosim", "fmpy", "exudyn", "numpy", "scipy", "opencv-python-headless", "pyarrow")


class InvalidRunFolder(ValueError):
    """A folder that cannot take a run's files, or be read as a run's."""

    def __init__(self, path: Path, fault: str) -> None:
        super().__init__(f"folder {path}: {fault}")
        self.path, self.fault = path, fault


def check_place(path: Path) -> None:
    """Check that files can be written to a folder, which need not exist yet.

    Raises:
        InvalidRunFolder: they cannot.
    """
    existing = next(p for p in (path.absolute(), *path.absolute().parents) if os.path.exists(p))
    if not existing.is_dir():
        raise InvalidRunFolder(path, f"{existing} is a file, so no folder can be made in it")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InvalidRunFolder(path, f"no permission to write to {existing}")


def check_no_links(path: Path, *patterns: str) -> None:
    """Check that what is in a folder by these patterns is there itself.

    Raises:
        InvalidRunFolder: something is a link: what is written or deleted there may be somebody else's.
    """
    if links := [p for pattern in patterns for p in path.glob(pattern) if p.is_symlink()]:
        fault = f"{links[0].relative_to(path)} is a link, which may lead anywhere; put its folder here"
        raise InvalidRunFolder(path, fault)


class RunFolder:
    """Paths of a run's files: `summary.json`, `signals.parquet`, `run.json`, `report.html`, `pictures/`, `figures/`.

    During the run there are also the files of a `Recorder`, and `checkpoint.zip` if checkpoints were requested.

    Attributes:
        path: absolute, so that a unit which changes the working directory does not move it.
        shown: as the user named it.

    Raises:
        InvalidRunFolder: it is not empty, not a folder, or cannot be written to. Nothing is made until `claim`.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.shown = path.absolute(), path
        self._claim = contextlib.ExitStack()
        if os.path.exists(path) and not path.is_dir():
            raise InvalidRunFolder(path, "there is a file of that name; choose a new or empty folder")
        self._check_empty()
        check_place(path)

    def _check_empty(self) -> None:
        if os.path.isdir(self.path) and any(self.path.iterdir()):
            raise InvalidRunFolder(self.shown, "it is not empty; choose a new or empty folder")

    @classmethod
    def of_run(cls, path: Path, shown: Path | None = None) -> "RunFolder":
        """Return the existing folder of a run, which is not checked."""
        folder = cls.__new__(cls)
        folder.path, folder.shown, folder._claim = path.absolute(), shown or path, contextlib.ExitStack()
        return folder

    @property
    def signals(self) -> Path:
        """The record."""
        return self.path / "signals.parquet"

    @property
    def checkpoint(self) -> Path:
        """The last checkpoint of a run that is not complete."""
        return self.path / "checkpoint.zip"

    @property
    def figures(self) -> Path:
        """The folder of figures."""
        return self.path / "figures"

    @property
    def pictures(self) -> Path:
        """The folder of camera pictures, if there are any."""
        return self.path / "pictures"

    @property
    def report(self) -> Path:
        """The report page."""
        return self.path / "report.html"

    @property
    def is_there(self) -> bool:
        """Whether a run was started in it."""
        return (self.path / "run.json").is_file()

    def claim(self, opened: contextlib.ExitStack) -> "RunFolder":
        """Make the folder and keep other runs from it until it has a file; `opened` removes what is still empty.

        Raises:
            InvalidRunFolder: another run has claimed it, or it cannot be made.
        """
        self._claim.enter_context(folder_claimed(self.path, "another command is about to write into it"))
        opened.push(self._claim)
        self._check_empty()
        return self

    def make(self) -> None:
        """Make the folder, if it is not claimed, and that of its figures.

        Raises:
            InvalidRunFolder: it cannot be made.
        """
        try:
            self.figures.mkdir(parents=True)
        except OSError as e:
            raise InvalidRunFolder(self.path, f"it cannot be made: {e.strerror}") from e

    def begin(self, run: Mapping[str, Any]) -> None:
        """Write `run.json`, by which the folder belongs to this run; the claim ends.

        Raises:
            RecordNotWritten: the disk does not take it.
        """
        self.write_run(run)
        self._claim.close()

    def remove_presentation(self) -> None:
        """Remove page and figures, which show less than the run that is resumed.

        Raises:
            RecordNotWritten: they cannot be removed.
        """
        with disk_errors_reported(self.report):
            self.report.unlink(missing_ok=True)
            shutil.rmtree(self.figures, ignore_errors=True)
            folder_within(self.figures)

    @contextlib.contextmanager
    def held(self) -> Generator[None, None, None]:
        """Lock the folder of a run against other processes that call this.

        Raises:
            InvalidRunFolder: another process holds it, or it does not exist.
        """
        with folder_held(self.path, "the run still goes on"):
            yield

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write `summary.json`; this and the next two raise `RecordNotWritten` if the disk does not take it."""
        _write_json(self.path / "summary.json", summary)

    def write_run(self, run: Mapping[str, Any]) -> None:
        """Write `run.json`."""
        _write_json(self.path / "run.json", run)

    def add_to_run(self, **entries: Any) -> None:
        """Add entries to `run.json`.

        Raises:
            InvalidRunFolder: there is none.
        """
        _write_json(self.path / "run.json", {**self.read_run(), **entries})

    def read_run(self) -> dict[str, Any]:
        """Return what `write_run` wrote.

        Raises:
            InvalidRunFolder: it is missing or damaged.
        """
        return read_object(self.path / "run.json", "it is not the folder of a run: it has no run.json", RunData)

    def read_summary(self) -> dict[str, Any]:
        """Return what `write_summary` wrote; an empty dict if the run has not written it.

        Raises:
            InvalidRunFolder: it is damaged.
        """
        file = self.path / "summary.json"
        return read_object(file, "it has no summary.json", Summary) if file.exists() else {}


def read_object(file: Path, missing: str, declared: Any = dict[str, Any]) -> dict[str, Any]:
    """Return the JSON object in a file of a folder, of a declared type.

    Raises:
        InvalidRunFolder: it is damaged, cannot be read, or is not there, with the message `missing`.
    """
    return read_file(file, missing, declared)


def read_file(file: Path, missing: str, declared: type[T]) -> T:
    """Return what a JSON file of a folder holds, likewise."""
    try:
        return read_typed(file, declared)
    except FileNotFoundError as e:
        raise InvalidRunFolder(file.parent, missing) from e
    except OSError as e:
        raise InvalidRunFolder(file.parent, f"its {file.name} cannot be read: {e.strerror}") from e
    except InvalidData as e:
        raise InvalidRunFolder(file.parent, f"its {file.name} is damaged: {e}") from e


@contextlib.contextmanager
def folder_held(path: Path, by_another: str) -> Generator[None, None, None]:
    """Lock a folder against other processes that call this.

    Raises:
        InvalidRunFolder: another process holds it, with the message `by_another`, or it does not exist.
    """
    with contextlib.ExitStack() as held:
        try:
            held.enter_context(folder_locked(path))
        except FileLocked as e:
            holder = holder_of(path)
            raise InvalidRunFolder(path, by_another + (f" (process {holder})" if holder else "")) from e
        except OSError as e:
            raise InvalidRunFolder(path, f"it cannot be opened: {e.strerror}") from e
        yield


@contextlib.contextmanager
def disk_errors_reported(path: Path) -> Generator[None, None, None]:
    """Raise RecordNotWritten for a file where the system raises OSError."""
    try:
        yield
    except OSError as e:
        raise RecordNotWritten(path, e.strerror or str(e)) from e


def is_full(e: OSError) -> bool:
    """Return whether space ran out: the disk is full, a quota is used up, or a file has its maximum size."""
    return e.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def make_folder_of(path: Path) -> None:
    """Make the folder of a file that is to be written where a user has named it.

    Raises:
        RecordNotWritten: it cannot be made.
    """
    with disk_errors_reported(path):
        path.parent.mkdir(parents=True, exist_ok=True)


def write_whole(path: Path, text: str, *, replace: bool = True) -> None:
    """Write a file atomically: it has the old or the new content, whenever the process ends.

    Raises:
        FileTaken: there is a file of that name, which is not to be replaced.
        RecordNotWritten: it cannot be written.
    """
    with disk_errors_reported(path), replacing(path, replace=replace) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


UNFINISHED = f".{'[0-9a-f]' * 16}.part"
"""The pattern of `unfinished_place`, of which killed processes may leave files."""


def unfinished_place(path: Path) -> Path:
    """Return where a file is written before it takes its name: beside it, hidden, by a name that nothing has.

    A name that could be foretold may be a file of somebody's, a link to one, or what another process is writing.
    """
    return path.with_name(f".{secrets.token_hex(8)}.part")


@contextlib.contextmanager
def replacing(path: Path, *, replace: bool = True) -> Generator[Path, None, None]:
    """Give the place of an unfinished file, which takes that of `path` at the end, or goes away on any error.

    Raises:
        FileTaken: there is a file in the end, which is not to be replaced.
        RecordNotWritten: there is something else than a file, such as a device, or it cannot be replaced.
    """
    unfinished = unfinished_place(path)
    with disk_errors_reported(path):
        if path.exists():
            check_regular(path)
    try:
        yield unfinished
        give_name(unfinished, path, replace=replace)
    except BaseException:
        with contextlib.suppress(OSError):
            unfinished.unlink(missing_ok=True)
        raise


def folder_within(path: Path) -> Path:
    """Make a folder in that of a run or a campaign, unless it is there, and return it; a link there is replaced.

    A link in a folder of somebody else would have files written somewhere else.

    Raises:
        OSError: it cannot be made.
    """
    if path.is_symlink():
        path.unlink()
    path.mkdir(exist_ok=True)
    return path


@contextlib.contextmanager
def dated_folder(place: Path, stem: str) -> Generator[Path, None, None]:
    """Make a folder in `place` that was not there, named by date, time and `stem`; remove it at the end if it is empty.

    Raises:
        InvalidRunFolder: it cannot be made.
    """
    name = time.strftime(f"%Y-%m-%d_%H%M%S_{stem}")
    for number in itertools.count(1):
        path = place / (name if number == 1 else f"{name}_{number}")
        try:
            made = _make(path, exclusive=True)
        except FileExistsError:
            continue
        try:
            yield path
        finally:
            _remove_empty(made)
        return


@contextlib.contextmanager
def folder_claimed(path: Path, by_another: str) -> Generator[None, None, None]:
    """Make a folder unless it is there, and lock it; at the end remove what was made and is empty.

    Raises:
        InvalidRunFolder: another process holds it, with the message `by_another`, or it cannot be made.
    """
    made = _make(path, exclusive=False)
    with folder_held(path, by_another):
        try:
            yield
        finally:
            _remove_empty(made)


_ATTEMPTS = 100
"""How often a folder is made again in one that another process has just removed, as it was empty."""


def _make(path: Path, *, exclusive: bool) -> list[Path]:
    """Make a folder, and those in which it is to be; return those that were not there.

    Raises:
        FileExistsError: it is there, and is to be made exclusively. InvalidRunFolder: it cannot be made.
    """
    check_place(path)
    absolute = path.absolute()
    absent = [p for p in (absolute, *absolute.parents) if not os.path.exists(p)]
    for attempt in range(_ATTEMPTS):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.mkdir(exist_ok=not exclusive)
        except FileNotFoundError as e:
            if attempt == _ATTEMPTS - 1:
                raise InvalidRunFolder(path, f"it cannot be made: {e.strerror}") from e
        except OSError as e:
            if exclusive and isinstance(e, FileExistsError):
                raise
            raise InvalidRunFolder(path, f"it cannot be made: {e.strerror}") from e
        else:
            break
    return absent


def _remove_empty(folders: Sequence[Path]) -> None:
    """Remove folders, each of which is in the next one, as far as they are empty."""
    with contextlib.suppress(OSError):
        for folder in folders:
            folder.rmdir()


def sha256_of(file: Path) -> str:
    """Return a file's SHA-256 in hexadecimal; of a folder, that of the list of its files with theirs."""
    if not file.is_dir():
        digest = hashlib.sha256()
        with open_regular(file) as content:
            while block := content.read(1 << 20):
                digest.update(block)
        return digest.hexdigest()
    inside = sorted(path for path in file.rglob("*") if path.is_file())
    listed = "".join(f"{sha256_of(path)}  {path.relative_to(file).as_posix()}\n" for path in inside)
    return hashlib.sha256(listed.encode()).hexdigest()


def hashes_of_files(files: Mapping[str, Path]) -> dict[str, dict[str, str]]:
    """Return path and SHA-256 of files, by the given names; those that are not there are left out."""
    there = {name: file for name, file in files.items() if file.is_file()}
    return {name: {"file": str(file.absolute()), "sha256": sha256_of(file)} for name, file in there.items()}


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that a run's numbers depend on."""
    return {"python": platform.python_version(), **{p: _version(p) for p in _PACKAGES}}


def version_differences(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """Return which of the `versions` differ elsewhere, with both; "" if none does."""
    differing = [name for name, version in here.items() if there.get(name) != version]
    return ", ".join(f"{name} {there.get(name)} (here {here[name]})" for name in differing)


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    write_whole(path, json.dumps(content, indent=2, allow_nan=False) + "\n")
