"""Copies of FMUs of which a part is otherwise."""

import zipfile
from collections.abc import Callable
from pathlib import Path

DESCRIPTION = "modelDescription.xml"


def rewritten(archive: Path, file: Path, rewrite: Callable[[str, bytes], bytes | None]) -> Path:
    """Write a copy, in which parts have what `rewrite` returns for their names and contents; None leaves one out."""
    with zipfile.ZipFile(archive) as source, zipfile.ZipFile(file, "w") as target:
        for item in source.infolist():
            content = rewrite(item.filename, source.read(item))
            if content is not None:
                target.writestr(item, content)
    return file


def described_otherwise(fmu: Path, file: Path, change: Callable[[str], str]) -> Path:
    """Write a copy of an FMU whose description is changed."""
    return rewritten(fmu, file, lambda name, data: change(data.decode()).encode() if name == DESCRIPTION else data)
