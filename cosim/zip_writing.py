"""Writes the zip files of FMUs and SSPs."""

import os
import tempfile
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
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, part = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
    try:
        with os.fdopen(handle, "wb") as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(files):
                member = zipfile.ZipInfo(name, DATE)
                member.compress_type = zipfile.ZIP_DEFLATED
                member.create_system = UNIX
                member.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
                archive.writestr(member, files[name])
        Path(part).chmod(0o644)
        os.replace(part, path)
    except BaseException:
        Path(part).unlink(missing_ok=True)
        raise
    return path
