"""Reads the zip archives of FMUs and SSPs, or folders that they were unpacked to, and writes archives.

An archive from elsewhere is checked before anything is unpacked: no member may lead out of the folder, fill the disk,
or be unreadable (`archive_faults`). Archives that are written have the same bytes for the same files (`write_archive`).
"""

import contextlib
import io
import os
import re
import shutil
import stat
import struct
import uuid
import zipfile
import zlib
from collections import defaultdict
from collections.abc import Collection, Generator, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate
from pathlib import Path, PurePosixPath
from typing import IO, ClassVar

from handover.cosim.exceptions import InvalidFmu, one_line
from handover.cosim.files import give_name

STANDARD_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""The compressions that the standards allow."""

_METHODS = (*STANDARD_METHODS, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
_MIB = 1 << 20
_MAX_FILES = 30_000
"""The list of so many members takes a second or two to read; an FMU with an interpreter has some thousands."""
_MAX_BYTES = 16 << 30
_SUSPECT_BYTES, _SUSPECT_RATIO = 256 * _MIB, 200  # libraries and tables shrink to a tenth, rarely to a hundredth
_MAX_REPORTED = 5
_TOP = "./"
"""The folder itself, which some tools pack, or put before each path; paths are without it."""


def archive_faults(members: Sequence[zipfile.ZipInfo], size: int) -> list[str]:
    """Return why an archive of `size` bytes must not be unpacked, as far as its list of members shows.

    There is a line for each kind of fault.
    """
    if faults := _file_faults(len(members)):
        return faults
    names = [m.orig_filename for m in members]
    plain = {path for n in names if not (path := _path(n)).endswith("/")}
    kinds: tuple[tuple[str, Iterable[str]], ...] = (
        ("paths that lead out of it; they must be relative", filter(_escapes_root, names)),
        ("symbolic links or devices; store the files themselves", (m.orig_filename for m in members if _special(m))),
        ("encrypted files; store them without a password", (m.orig_filename for m in members if m.flag_bits & 0x1)),
        (
            "files in a compression that cannot be read; use deflate",
            (m.orig_filename for m in members if m.compress_type not in _METHODS),
        ),
        ("files that are folders of other files", (n for n in plain if plain & _parents(n))),
    )
    faults = ((what, sorted(set(paths))) for what, paths in kinds)
    return [
        *(f"the archive holds {what}: {listed(paths)}" for what, paths in faults if paths),
        *_size_faults(members, size),
    ]


def _file_faults(count: int) -> list[str]:
    return [f"the archive holds {count} files; at most {_MAX_FILES} are unpacked"] if count > _MAX_FILES else []


def _size_faults(members: Sequence[zipfile.ZipInfo], size: int) -> list[str]:
    total = sum(m.file_size for m in members)
    if total > _MAX_BYTES:
        return [f"the archive would unpack to {total / 2**30:.0f} GiB; at most {_MAX_BYTES >> 30} GiB are unpacked"]
    if total > _SUSPECT_BYTES and total > _SUSPECT_RATIO * size:
        ratio = f"{size / _MIB:.1f} MiB would unpack to {total / _MIB:.0f} MiB"
        return [f"the archive looks like a zip bomb: {ratio}; at most {_SUSPECT_RATIO} times as much is accepted"]
    return []


def _escapes_root(name: str) -> bool:
    name = _with_slashes(name)
    is_nameless = name != _TOP and not name.strip("./")
    drive = ":" in name  # an ordinary character elsewhere; on Windows it leads to other folders
    return drive or name.startswith("/") or "\0" in name or ".." in name.split("/") or is_nameless


def _with_slashes(name: str) -> str:
    """Return a member's name with slashes between folders, where some tools of Windows write backslashes."""
    return name.replace("\\", "/")


def _path(name: str) -> str:
    """Return a member's path from the archive's top, with slashes; empty for the top itself."""
    name = _with_slashes(name)
    while name.startswith(_TOP):
        name = name[len(_TOP) :].lstrip("/")
    return name


def _special(member: zipfile.ZipInfo) -> bool:
    kind = stat.S_IFMT(member.external_attr >> 16)
    return kind not in (0, stat.S_IFREG, stat.S_IFDIR)


def _parents(name: str) -> set[str]:
    parts = name.split("/")
    if "" in parts or "." in parts:
        return {str(p) for p in PurePosixPath(name).parents}
    # of the hundreds of members of an FMU; paths cost ten times as much
    return {".", *accumulate(parts[:-1], "{}/{}".format)}


def listed(names: Iterable[str]) -> str:
    """Return the first of some paths, shortened, with control characters escaped."""
    shown = [_shown(n) for n in names]
    more = f", and {len(shown) - _MAX_REPORTED} more" if len(shown) > _MAX_REPORTED else ""
    return ", ".join(shown[:_MAX_REPORTED]) + more


def _shown(name: str) -> str:
    shown = re.sub(r"[^\x20-\x7e]", lambda m: m[0].encode("unicode_escape").decode(), name)
    return shown if len(shown) <= 100 else shown[:97] + "..."


DESCRIPTION = "modelDescription.xml"
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
NO_FILE_FAULT = "not a regular file"

_DAMAGE = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OSError, EOFError, ValueError)

_MAX_TEXT = 512 * _MIB  # of one XML file


class _Zip:
    """The members of a zip archive, which may be read and unpacked: nothing in it leads out of a folder."""

    def __init__(self, path: Path, kind: str) -> None:
        self.path = path
        self._members = _members(path, kind)
        faults = archive_faults(self._members, path.stat().st_size)
        if faults:
            raise InvalidFmu(path, "; ".join(faults))
        self._check_copies()
        by_name = {_path(m.orig_filename): m for m in self._members}
        self._by_name = {name: m for name, m in by_name.items() if name}
        self.names = tuple(self._by_name)
        self.outdated_methods = tuple(m.orig_filename for m in self._members if m.compress_type not in STANDARD_METHODS)
        self.with_backslashes = tuple(n for m in self._members if "\\" in (n := m.orig_filename))
        self.as_named = all(name == m.orig_filename for name, m in self._by_name.items())
        self._opened: zipfile.ZipFile | None = None

    @contextlib.contextmanager
    def opened(self) -> Generator[None, None, None]:
        """Keep the file open for many calls of `open`, as opening it reads its list of members each time."""
        self._opened = zipfile.ZipFile(self.path)
        try:
            yield
        finally:
            self._opened.close()
            self._opened = None

    def size(self, name: str) -> int:
        """Return a member's unpacked size in bytes."""
        return self._by_name[name].file_size

    @contextlib.contextmanager
    def open(self, name: str) -> Generator[IO[bytes], None, None]:
        """Open a member."""
        with (
            contextlib.nullcontext(self._opened) if self._opened else zipfile.ZipFile(self.path) as z,
            z.open(self._by_name[name]) as file,
        ):
            yield file

    def unpack(self, folder: Path, _names: Iterable[str]) -> None:
        """Unpack everything into a folder."""
        with zipfile.ZipFile(self.path) as z:
            for member in z.infolist():
                member.filename = _path(member.orig_filename)
                if not member.filename:
                    continue
                z.extract(member, folder)
                if (member.external_attr >> 16) & stat.S_IXUSR and not member.is_dir():
                    _make_executable(folder / member.filename)

    def _check_copies(self) -> None:
        """Check that members of one path have one content."""
        by_name: dict[str, list[zipfile.ZipInfo]] = defaultdict(list)
        for member in self._members:
            by_name[_path(member.orig_filename)].append(member)
        different = [n for n, copies in by_name.items() if len(copies) > 1 and not self._are_alike(copies)]
        if different:
            raise InvalidFmu(
                self.path,
                f"the archive holds the same path twice, with different contents: {listed(sorted(different))}",
            )

    def _are_alike(self, copies: Sequence[zipfile.ZipInfo]) -> bool:
        first, *others = copies
        return all(self._same(first, other) for other in others)

    def _same(self, one: zipfile.ZipInfo, other: zipfile.ZipInfo) -> bool:
        try:
            with zipfile.ZipFile(self.path) as z, z.open(one) as a, z.open(other) as b:
                while block := a.read(_MIB):
                    if block != b.read(_MIB):
                        return False
                return not b.read(1)
        except _DAMAGE as e:
            raise InvalidFmu(self.path, f"the archive is damaged: {one.filename}: {one_line(e)}") from e


class _Folder:
    """The files of an unpacked archive. Nothing is written to it."""

    outdated_methods: tuple[str, ...] = ()
    with_backslashes: tuple[str, ...] = ()
    as_named = True

    def __init__(self, path: Path) -> None:
        self.path = path
        self.names = tuple(_files_in(path))

    def opened(self) -> contextlib.AbstractContextManager[None]:
        """Do nothing: files are opened one by one."""
        return contextlib.nullcontext()

    def size(self, name: str) -> int:
        """Return a file's size in bytes."""
        return (self.path / name).stat().st_size

    @contextlib.contextmanager
    def open(self, name: str) -> Generator[IO[bytes], None, None]:
        """Open a file."""
        with (self.path / name).open("rb") as file:
            yield file

    def unpack(self, folder: Path, names: Iterable[str]) -> None:
        """Copy files into a folder."""
        for name in names:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(self.path / name, folder / name)


def _files_in(folder: Path) -> Iterator[str]:
    """Yield the paths of a folder's files, with slashes, in the order of their names."""
    count = 0
    for here, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            count += 1
            if count > _MAX_FILES:
                raise InvalidFmu(folder, f"the folder holds over {_MAX_FILES} files")
            if (file := Path(here) / name).is_file():
                yield file.relative_to(folder).as_posix()


def description_state(path: Path) -> tuple[int, int]:
    """Return when the file that has an FMU's description was written, in ns, and its size.

    What was made of it holds as long as these are the same.
    """
    status = (path / DESCRIPTION if path.is_dir() else path).stat()
    return status.st_mtime_ns, status.st_size


class FmuArchive:
    """An FMU's zip archive, or the folder that it was unpacked to, whose files may be read and unpacked.

    Nothing in an archive leads out of a folder or fills the disk.

    Attributes:
        names: paths of all members, folders of an archive with a slash at the end.

    Raises:
        InvalidFmu: no such file, not a zip archive, or with members that must not be unpacked; the message lists them.
    """

    kind: ClassVar[str] = "FMU"
    description_name: ClassVar[str] = DESCRIPTION
    """Name of the description, which is at the top of the archive."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._files = _Folder(path) if path.is_dir() else _Zip(path, self.kind)
        self.names = self._files.names

    @property
    def outdated_methods(self) -> tuple[str, ...]:
        """Members in a compression that the standards do not allow: they must be stored or deflated."""
        return self._files.outdated_methods

    @property
    def with_backslashes(self) -> tuple[str, ...]:
        """Members whose names have backslashes between folders, which are read as slashes."""
        return self._files.with_backslashes

    @property
    def what(self) -> str:
        """What it is: `archive` or `folder`."""
        return "folder" if isinstance(self._files, _Folder) else "archive"

    def description(self) -> bytes:
        """Return the content of modelDescription.xml, or of another kind of archive's description.

        Raises:
            InvalidFmu: it is missing, perhaps one folder too deep, or damaged.
        """
        expected = self.description_name
        if expected in self.names:
            return self.read(expected)
        deeper = [n for n in self.names if n.endswith(f"/{expected}")]
        other_case = [n for n in self.names if n.lower() == expected.lower()]
        if deeper and self.what == "folder":
            reason = f"it is at {deeper[0]}; give that folder"
        elif deeper:
            reason = f"it is at {deeper[0]}; zip what is in that folder, not the folder"
        elif other_case:
            reason = f"there is {other_case[0]}; upper and lower case count"
        else:
            reason = f"the {self.what} holds {listed(self.names) or 'nothing'}"
        raise InvalidFmu(self.path, f"no {expected} at the top of the {self.what}: {reason}")

    @contextlib.contextmanager
    def opened(self) -> Generator[None, None, None]:
        """Keep the file open for many calls of `read`.

        Raises:
            InvalidFmu: it is damaged.
        """
        with contextlib.ExitStack() as stack:
            with self._damage_reported():
                stack.enter_context(self._files.opened())
            yield

    def read(self, name: str) -> bytes:
        """Return a text member's content.

        Raises:
            InvalidFmu: it is damaged, or longer than 512 MiB.
        """
        with self._damage_reported(name):
            size = self._files.size(name)
            if size > _MAX_TEXT:
                raise InvalidFmu(self.path, f"{name} has {size / _MIB:.0f} MiB; at most 512 MiB are read")
            with self._files.open(name) as file:
                return file.read()

    def xml_source(self) -> str | io.BytesIO:
        """Return what others, which know no `./` before a path, read the XML files from: the path, or a copy of those.

        Raises:
            InvalidFmu: one is damaged, or longer than 512 MiB.
        """
        if self._files.as_named:
            return str(self.path)
        copy = io.BytesIO()
        with zipfile.ZipFile(copy, "w") as z:
            for name in self.names:
                if name.endswith(".xml"):
                    z.writestr(name, self.read(name))
        copy.seek(0)
        return copy

    def size(self, name: str) -> int:
        """Return a member's unpacked size in bytes."""
        return self._files.size(name)

    def head(self, name: str, size: int) -> bytes:
        """Return the first bytes of a member.

        Raises:
            InvalidFmu: it is damaged.
        """
        with self._damage_reported(name), self._files.open(name) as file:
            return file.read(size)

    def verify(self) -> None:
        """Read every member to its end, an archive's against its checksum.

        Raises:
            InvalidFmu: a member is damaged.
        """
        self._verify(self.names)

    def _verify(self, names: Iterable[str]) -> None:
        with self.opened():
            for name in (n for n in names if not n.endswith("/")):
                with self._damage_reported(name), self._files.open(name) as file:
                    while file.read(_MIB):
                        pass

    def unpack(self, folder: Path, members: Collection[str] | None = None) -> None:
        """Unpack everything into a folder, after all of it has been verified.

        Of a folder, only these members are copied if some are given, which may be folders themselves.

        Raises:
            InvalidFmu: a member is damaged, or the folder does not take it.
        """
        names = self.names
        if members is not None:
            names = tuple(n for n in names if n in members or any(n.startswith(f"{m}/") for m in members))
        self._verify(names)
        try:
            self._files.unpack(folder, names)
        except _DAMAGE as e:
            raise InvalidFmu(self.path, f"cannot be unpacked: {one_line(e)}") from e

    @contextlib.contextmanager
    def _damage_reported(self, name: str = "") -> Generator[None, None, None]:
        try:
            yield
        except _DAMAGE as e:
            where = "" if name in str(e) else f"{name}: "
            raise InvalidFmu(self.path, f"the {self.what} is damaged: {where}{one_line(e)}") from e


def _make_executable(file: Path) -> None:
    """Let those execute a file who may read it; `zipfile` leaves that out."""
    mode = file.stat().st_mode
    file.chmod(mode | (mode & 0o444) >> 2)


def _members(path: Path, kind: str) -> list[zipfile.ZipInfo]:
    if not path.is_file():
        raise InvalidFmu(path, NO_FILE_FAULT if path.exists() else "there is no such file")
    try:
        with path.open("rb") as file:
            first_bytes = file.read(4)
            count = _declared_count(file)
        if not zipfile.is_zipfile(path):
            raise InvalidFmu(path, _no_zip(first_bytes, kind))
        if faults := _file_faults(count):  # before the list is read
            raise InvalidFmu(path, faults[0])
        with zipfile.ZipFile(path) as z:
            return z.infolist()
    except PermissionError as e:
        raise InvalidFmu(path, "cannot be read: permission denied") from e
    except _DAMAGE as e:
        raise InvalidFmu(path, f"the archive is damaged: {one_line(e)}") from e


_END, _END_64, _LOCATOR_64 = b"PK\x05\x06", b"PK\x06\x06", b"PK\x06\x07"


def _declared_count(file: IO[bytes]) -> int:
    """Return how many members the end of a zip archive says that it has; 0 where it is none."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - 22 - 0xFFFF))  # with the longest comment
    tail = file.read()
    end = tail.rfind(_END)
    if end < 0 or len(tail) < end + 12:
        return 0
    count = int.from_bytes(tail[end + 10 : end + 12], "little")
    if count == 0xFFFF and tail[max(0, end - 20) : end - 16] == _LOCATOR_64:
        file.seek(min(size, int.from_bytes(tail[end - 12 : end - 4], "little")))
        record = file.read(40)
        count = int.from_bytes(record[32:40], "little") if record.startswith(_END_64) else count
    return count


def _no_zip(first_bytes: bytes, kind: str) -> str:
    if not first_bytes:
        return f"not an {kind}: the file is empty"
    if first_bytes.startswith(b"PK\x03\x04"):
        return "the archive is damaged: it begins as a zip archive, but its end is missing; copy or fetch it again"
    return f"not an {kind}: an {kind} is a zip archive, and this file is not one"


_DATE = (1 << 5) | 1
"""1 January 1980, as zip files have it."""
_VERSION = 20
_UNIX = 3
"""The system that created the members, so that their permissions count."""


def write_archive(
    path: Path, files: Mapping[str, bytes], programs: Collection[str] = (), *, replace: bool = True
) -> Path:
    """Write a zip file whose bytes depend on the files' names and contents alone.

    `programs` are those of the names that may be executed, besides all in `binaries`.

    It appears complete or not at all, also where the machine goes down, so two processes may write the same file at the
    same time. Unless it is to `replace` one of its name, it raises `FileTaken` where there is one in the end.
    """
    content = _packed(files, programs)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}-{uuid.uuid4().hex}")
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.chmod(0o644)
        give_name(part, path, replace=replace)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    return path


def _packed(files: Mapping[str, bytes], programs: Collection[str]) -> bytes:
    """Return a zip file: members, their directory, its end. It takes 65,535 files, and 4 GiB of each and in all.

    Not by `zipfile`: where an exception such as Ctrl-C drops its objects within a member, Python 3.13 reports that they
    cannot be closed.
    """
    members, directory = bytearray(), bytearray()
    for name in sorted(files):
        encoded, content = name.encode(), files[name]
        deflate = zlib.compressobj(wbits=-zlib.MAX_WBITS)
        packed = deflate.compress(content) + deflate.flush()
        flags = 0 if name.isascii() else 0x800  # UTF-8
        sizes = zlib.crc32(content), len(packed), len(content), len(encoded), 0
        facts = struct.pack("<5H3L2H", _VERSION, flags, zipfile.ZIP_DEFLATED, 0, _DATE, *sizes)
        mode = 0o755 if name.startswith("binaries/") or name in programs else 0o644
        place = struct.pack("<3H2L", 0, 0, 0, mode << 16, len(members))
        directory += b"PK\1\2" + bytes([_VERSION, _UNIX]) + facts + place + encoded
        members += b"PK\3\4" + facts + encoded + packed
    counts = struct.pack("<4H2LH", 0, 0, len(files), len(files), len(directory), len(members), 0)
    return bytes(members + directory + b"PK\5\6" + counts)


_OF_THIS_PROJECT = "resources/unit.json"
"""A file that every FMU built by this project has."""


def is_of_this_project(path: Path) -> bool:
    """Return whether this project built an FMU.

    Raises:
        InvalidFmu: it cannot be read.
    """
    return _OF_THIS_PROJECT in FmuArchive(path).names
