"""An FMU's zip archive, looked through before anything is taken out of it."""

import zipfile
import zlib
from pathlib import Path
from typing import ClassVar

from handover.cosim.archive_faults import STANDARD_METHODS, archive_faults, listed
from handover.cosim.exceptions import InvalidFmu, one_line

DESCRIPTION = "modelDescription.xml"
NO_FILE_FAULT = "not a regular file"

_DAMAGE = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OSError, EOFError, ValueError)
_MIB = 1 << 20
_MOST_TEXT = 512 * _MIB  # of one XML file


class FmuArchive:
    """A zip archive whose members may be read and unpacked: nothing in it leads out of a folder or fills the disk.

    Attributes:
        names: paths of all members, folders with a slash at the end.

    Raises:
        InvalidFmu: no such file, not a zip archive, or with members that are not to be unpacked; all of them are told.
    """

    kind: ClassVar[str] = "FMU"
    description_name: ClassVar[str] = DESCRIPTION
    """Where at the top of the archive it is told what it holds."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._members = _members(path, self.kind, self.description_name)
        faults = archive_faults(self._members, path.stat().st_size)
        if faults:
            raise InvalidFmu(path, "; ".join(faults))
        self.names = tuple(m.orig_filename for m in self._members)

    @property
    def outdated_methods(self) -> tuple[str, ...]:
        """Members in a compression that the standards do not know: they want stored or deflated ones."""
        return tuple(m.orig_filename for m in self._members if m.compress_type not in STANDARD_METHODS)

    def description(self) -> bytes:
        """Return modelDescription.xml, or what stands in its place in another kind of archive.

        Raises:
            InvalidFmu: it is missing, perhaps one folder too deep, or damaged.
        """
        wanted = self.description_name
        if wanted in self.names:
            return self.read(wanted)
        deeper = [n for n in self.names if n.endswith(f"/{wanted}")]
        like = [n for n in self.names if n.lower() == wanted.lower()]
        if deeper:
            why = f"it is at {deeper[0]}; zip what is in that folder, not the folder"
        elif like:
            why = f"there is {like[0]}; upper and lower case count"
        else:
            why = f"the archive holds {listed(self.names) or 'nothing'}"
        raise InvalidFmu(self.path, f"no {wanted} at the top of the archive: {why}")

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
            raise InvalidFmu(self.path, f"the archive is damaged: {name}: {one_line(e)}") from e

    def size(self, name: str) -> int:
        """Return the number of bytes of a member, unpacked."""
        return next(m.file_size for m in self._members if m.orig_filename == name)

    def head(self, name: str, size: int) -> bytes:
        """Return the first bytes of a member.

        Raises:
            InvalidFmu: it is damaged.
        """
        try:
            with zipfile.ZipFile(self.path) as z, z.open(name) as file:
                return file.read(size)
        except _DAMAGE as e:
            raise InvalidFmu(self.path, f"the archive is damaged: {name}: {one_line(e)}") from e

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
            raise InvalidFmu(self.path, f"the archive is damaged: {where}{one_line(e)}") from e

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
            raise InvalidFmu(self.path, f"cannot be unpacked: {one_line(e)}") from e


def folder_fault(wanted: str = DESCRIPTION) -> str:
    """Return what is wrong with a folder in the place of an archive that has a file `wanted` at its top."""
    return f"a folder, not a file; zip what is in it, with {wanted} at the top"


def _members(path: Path, kind: str, wanted: str) -> list[zipfile.ZipInfo]:
    if path.is_dir():
        raise InvalidFmu(path, folder_fault(wanted))
    if not path.is_file():
        raise InvalidFmu(path, NO_FILE_FAULT if path.exists() else "there is no such file")
    try:
        with path.open("rb") as file:
            begin = file.read(4)
        if not zipfile.is_zipfile(path):
            raise InvalidFmu(path, _no_zip(begin, kind))
        with zipfile.ZipFile(path) as z:
            return z.infolist()
    except PermissionError as e:
        raise InvalidFmu(path, "cannot be read: permission denied") from e
    except _DAMAGE as e:
        raise InvalidFmu(path, f"the archive is damaged: {one_line(e)}") from e


def _no_zip(begin: bytes, kind: str) -> str:
    if not begin:
        return f"not an {kind}: the file is empty"
    if begin.startswith(b"PK\x03\x04"):
        return "the archive is damaged: it begins as a zip archive, but its end is missing; copy or fetch it again"
    return f"not an {kind}: an {kind} is a zip archive, and this file is not one"
