"""An SSP's zip archive, which is checked before anything is unpacked, or its unpacked folder, or that by its `.ssd`."""

import posixpath
from collections.abc import Collection, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar
from urllib.parse import unquote, urlsplit

from handover.cosim.exceptions import InvalidFmu, InvalidSsp, nearest
from handover.cosim.fmu.file.archive import DESCRIPTION, FmuArchive
from handover.cosim.ssp.xml import STRUCTURE


class _Packed(FmuArchive):
    kind: ClassVar[str] = "SSP"
    description_name: ClassVar[str] = STRUCTURE


def ssp_root(path: Path) -> Path:
    """Return the file or the folder that holds all of an SSP: of an `.ssd` the folder that it is in."""
    return path.parent if path.suffix.lower() == ".ssd" else path


class SspArchive:
    """A zip archive with SystemStructure.ssd at its top, and the files that it refers to by relative URIs.

    Or a folder with all that; or an `.ssd` of any name in a folder.

    Attributes:
        structure_name: name of the `.ssd`.

    Raises:
        InvalidSsp: no such file, not a zip archive, or with members that must not be unpacked.
    """

    def __init__(self, path: Path) -> None:
        self.path, root = path, ssp_root(path)
        self.structure_name = STRUCTURE if root == path else path.name
        with _ssp_errors(path):
            if root != path and not path.is_file():
                raise InvalidFmu(path, "there is no such file")
            self._packed = _Packed(root)
        self._files = frozenset(n for n in self._packed.names if not n.endswith("/"))

    @contextmanager
    def opened(self) -> Generator[None, None, None]:
        """Keep the file open while many members are read.

        Raises:
            InvalidSsp: it is damaged.
        """
        with _ssp_errors(self.path), self._packed.opened():
            yield

    def structure(self) -> bytes:
        """Return SystemStructure.ssd.

        Raises:
            InvalidSsp: it is missing or damaged.
        """
        if self.structure_name != STRUCTURE:
            return self.read(self.structure_name)
        with _ssp_errors(self.path):
            return self._packed.description()

    def read(self, member: str) -> bytes:
        """Return a text member's content.

        Raises:
            InvalidSsp: it is damaged.
        """
        with _ssp_errors(self.path):
            return self._packed.read(member)

    def unpack(self, folder: Path, members: Collection[str]) -> None:
        """Unpack FMUs into a folder, after all of them have been verified; of an archive, all that is in it.

        Raises:
            InvalidSsp: a member is damaged, or cannot be written to the folder.
        """
        with _ssp_errors(self.path):
            self._packed.unpack(folder, None if self._packed.what == "archive" else members)

    def member(self, uri: str) -> str:
        """Return the member that a URI refers to from SystemStructure.ssd.

        Raises:
            ValueError: it is not a relative URI, leads out of the archive, or there is no such member.
        """
        parts = urlsplit(uri)
        if parts.scheme or parts.netloc or parts.path.startswith("/"):
            raise ValueError(f"{uri!r} lies outside of the SSP; expected a relative URI, such as 'resources/unit.fmu'")
        if parts.fragment or parts.query or not parts.path:
            raise ValueError(f"{uri!r} names no file of the SSP; 'resources/unit.fmu' is a valid one")
        member = posixpath.normpath(unquote(parts.path))
        if member.split("/")[0] == "..":
            raise ValueError(f"{uri!r} leads out of the SSP")
        if member not in self._files and f"{member}/{DESCRIPTION}" not in self._files:
            raise ValueError(f"there is no {member!r} in the SSP; {nearest(member, self._files)}")
        return member


@contextmanager
def _ssp_errors(path: Path) -> Generator[None, None, None]:
    try:
        yield
    except InvalidFmu as e:
        raise InvalidSsp(path, [e.fault]) from e
