"""Writes the zip files of FMUs and SSPs."""

import io
import os
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path

DATE = (1980, 1, 1, 0, 0, 0)
UNIX = 3
"""Who made the members, so that their permissions count."""


def write_archive(path: Path, files: Mapping[str, bytes]) -> Path:
    """Write a zip file whose bytes depend on the files' names and contents alone.

    It appears complete or not at all, so two processes may write the same one at once.
    """
    content = _packed(files)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}-{uuid.uuid4().hex}")
    try:
        part.write_bytes(content)
        part.chmod(0o644)
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    return path


def _packed(files: Mapping[str, bytes]) -> bytes:
    memory = io.BytesIO()
    archive = _Archive(memory, "w", zipfile.ZIP_DEFLATED)
    for name in sorted(files):
        member = zipfile.ZipInfo(name, DATE)
        member.compress_type = zipfile.ZIP_DEFLATED
        member.create_system = UNIX
        member.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
        archive.writestr(member, files[name])
    archive.close()
    return memory.getvalue()


class _Archive(zipfile.ZipFile):
    """Dropped as it is where an exception, such as Ctrl-C, leaves it: to close it then fails amid a member."""

    def __del__(self) -> None:
        pass
