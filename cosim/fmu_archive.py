"""An FMU's zip archive, looked through before anything is taken out of it."""

import re
import stat
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePosixPath

from cosim.exceptions import InvalidFmu

DESCRIPTION = "modelDescription.xml"

_DAMAGE = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OSError, EOFError, ValueError)
_MIB = 1 << 20
_MOST_FILES = 100_000
_MOST_BYTES = 16 << 30
_MOST_TEXT = 512 * _MIB  # of one XML file
_SUSPECT_BYTES, _SUSPECT_RATIO = 256 * _MIB, 200  # libraries and tables shrink to a tenth, rarely to a hundredth
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
_MOST_TOLD = 5


class FmuArchive:
    """A zip archive whose members may be read and unpacked: nothing in it leads out of a folder or fills the disk.

    Attributes:
        names: paths of all members, folders with a slash at the end.

    Raises:
        InvalidFmu: no such file, not a zip archive, or with members that are not to be unpacked; all of them are told.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._members = _members(path)
        faults = archive_faults(self._members, path.stat().st_size)
        if faults:
            raise InvalidFmu(path, "; ".join(faults))
        self.names = tuple(m.orig_filename for m in self._members)

    @property
    def outdated_methods(self) -> tuple[str, ...]:
        """Members in a compression that the standards do not know: they want stored or deflated ones."""
        return tuple(m.orig_filename for m in self._members if m.compress_type not in _METHODS[:2])

    def description(self) -> bytes:
        """Return modelDescription.xml.

        Raises:
            InvalidFmu: it is missing, perhaps one folder too deep, or damaged.
        """
        if DESCRIPTION in self.names:
            return self.read(DESCRIPTION)
        deeper = [n for n in self.names if n.endswith(f"/{DESCRIPTION}")]
        like = [n for n in self.names if n.lower() == DESCRIPTION.lower()]
        if deeper:
            why = f"it is at {deeper[0]}; zip what is in that folder, not the folder"
        elif like:
            why = f"there is {like[0]}; upper and lower case count"
        else:
            why = f"the archive holds {_listed(self.names) or 'nothing'}"
        raise InvalidFmu(self.path, f"no {DESCRIPTION} at the top of the archive: {why}")

    def read(self, name: str) -> bytes:
        """Return a text member's content.

        Raises:
            InvalidFmu: it is damaged, or longer than any description.
        """
        try:
            with zipfile.ZipFile(self.path) as z:
                size = z.getinfo(name).file_size
                if size > _MOST_TEXT:
                    raise InvalidFmu(self.path, f"{name} is of {size / _MIB:.0f} MiB; at most 512 MiB are read")
                return z.read(name)
        except _DAMAGE as e:
            raise InvalidFmu(self.path, f"the archive is damaged: {name}: {_one_line(e)}") from e

    def head(self, name: str, size: int) -> bytes:
        """Return the first bytes of a member.

        Raises:
            InvalidFmu: it is damaged.
        """
        try:
            with zipfile.ZipFile(self.path) as z, z.open(name) as file:
                return file.read(size)
        except _DAMAGE as e:
            raise InvalidFmu(self.path, f"the archive is damaged: {name}: {_one_line(e)}") from e

    def verify(self) -> None:
        """Read every member to its end, against its checksum.

        Raises:
            InvalidFmu: a member is damaged.
        """
        name = ""
        try:
            with zipfile.ZipFile(self.path) as z:
                for member in z.infolist():
                    name = member.filename
                    with z.open(member) as file:
                        while file.read(_MIB):
                            pass
        except _DAMAGE as e:
            where = "" if name in str(e) else f"{name}: "
            raise InvalidFmu(self.path, f"the archive is damaged: {where}{_one_line(e)}") from e

    def unpack(self, folder: Path) -> None:
        """Unpack everything into a folder, after all of it has been verified.

        Raises:
            InvalidFmu: a member is damaged, or the folder does not take it.
        """
        self.verify()
        try:
            with zipfile.ZipFile(self.path) as z:
                z.extractall(folder)
        except _DAMAGE as e:
            raise InvalidFmu(self.path, f"cannot be unpacked: {_one_line(e)}") from e


def archive_faults(members: Sequence[zipfile.ZipInfo], size: int) -> list[str]:
    """Return why members of an archive of `size` bytes are not to be unpacked, a line for each kind of fault."""
    names = [m.orig_filename for m in members]
    plain = {n for n in names if not n.endswith("/")}
    kinds: tuple[tuple[str, Iterable[str]], ...] = (
        ("paths that lead out of it; they must be relative, with slashes", filter(_leads_out, names)),
        ("the same path twice", (n for n, count in Counter(names).items() if count > 1)),
        ("symbolic links or devices; store the files themselves", (m.orig_filename for m in members if _special(m))),
        ("encrypted files; store them without a password", (m.orig_filename for m in members if m.flag_bits & 0x1)),
        (
            "files in a compression that cannot be read; use deflate",
            (m.orig_filename for m in members if m.compress_type not in _METHODS),
        ),
        ("files that are folders of other files", (n for n in plain if plain & _parents(n))),
    )
    found = ((what, sorted(set(paths))) for what, paths in kinds)
    return [
        *(f"the archive holds {what}: {_listed(paths)}" for what, paths in found if paths),
        *_size_faults(members, size),
    ]


def _members(path: Path) -> list[zipfile.ZipInfo]:
    if not path.is_file():
        raise InvalidFmu(path, "there is no such file" if not path.exists() else "not a file but a folder")
    try:
        with path.open("rb") as file:
            begin = file.read(4)
        if not zipfile.is_zipfile(path):
            raise InvalidFmu(path, _no_zip(begin))
        with zipfile.ZipFile(path) as z:
            return z.infolist()
    except PermissionError as e:
        raise InvalidFmu(path, "cannot be read: permission denied") from e
    except _DAMAGE as e:
        raise InvalidFmu(path, f"the archive is damaged: {_one_line(e)}") from e


def _no_zip(begin: bytes) -> str:
    if not begin:
        return "not an FMU: the file is empty"
    if begin.startswith(b"PK\x03\x04"):
        return "the archive is damaged: it begins as a zip archive, but its end is missing; copy or fetch it again"
    return "not an FMU: an FMU is a zip archive, and this file is not one"


def _size_faults(members: Sequence[zipfile.ZipInfo], size: int) -> list[str]:
    if len(members) > _MOST_FILES:
        return [f"the archive holds {len(members)} files; at most {_MOST_FILES} are unpacked"]
    total = sum(m.file_size for m in members)
    if total > _MOST_BYTES:
        return [f"the archive would unpack to {total / 2**30:.0f} GiB; at most {_MOST_BYTES >> 30} GiB are unpacked"]
    if total > _SUSPECT_BYTES and total > _SUSPECT_RATIO * size:
        told = f"{size / _MIB:.1f} MiB would unpack to {total / _MIB:.0f} MiB"
        return [f"the archive looks like a zip bomb: {told}; at most {_SUSPECT_RATIO} times as much is believed"]
    return []


def _leads_out(name: str) -> bool:
    windows = "\\" in name or ":" in name  # other systems take these for letters; Windows goes elsewhere
    return windows or name.startswith("/") or "\0" in name or ".." in PurePosixPath(name).parts or not name.strip("./")


def _special(member: zipfile.ZipInfo) -> bool:
    kind = stat.S_IFMT(member.external_attr >> 16)
    return kind not in (0, stat.S_IFREG, stat.S_IFDIR)


def _parents(name: str) -> set[str]:
    return {str(p) for p in PurePosixPath(name).parents}


def _listed(names: Iterable[str]) -> str:
    listed = [_shown(n) for n in names]
    more = f", and {len(listed) - _MOST_TOLD} more" if len(listed) > _MOST_TOLD else ""
    return ", ".join(listed[:_MOST_TOLD]) + more


def _shown(name: str) -> str:
    shown = re.sub(r"[^\x20-\x7e]", lambda m: m[0].encode("unicode_escape").decode(), name)
    return shown if len(shown) <= 100 else shown[:97] + "..."


def _one_line(e: BaseException) -> str:
    return " ".join(str(e).split()) or type(e).__name__
