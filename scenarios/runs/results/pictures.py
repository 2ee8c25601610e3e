"""The camera pictures in a run's folder: JPEG files, and `pictures.json` that describes them."""

import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from handover.cosim.files import read_regular
from handover.cosim.typed_data import FilePath, InvalidData, read_typed
from handover.scenarios.experiment.pictures import CameraPicture, Mark
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, disk_errors_reported, write_whole

_KEYS = ("t", "camera", "role", "width", "height")


def write_picture_files(folder: Path, pictures: Sequence[CameraPicture]) -> None:
    """Write pictures into a folder, replacing those in it; without pictures there is no folder.

    Raises:
        RecordNotWritten: they cannot be written.
    """
    with disk_errors_reported(folder):
        if folder.exists():
            shutil.rmtree(folder)
        if not pictures:
            return
        folder.mkdir(parents=True)
        entries: list[dict[str, Any]] = []
        for number, picture in enumerate(pictures, start=1):
            file = f"{number:02}_{_plain(picture.role)}_{_plain(picture.camera)}.jpg"
            (folder / file).write_bytes(picture.jpeg)
            fields = {name: getattr(picture, name) for name in _KEYS}
            entries.append({**fields, "file": file, "marks": [asdict(mark) for mark in picture.marks]})
    write_whole(folder / "pictures.json", json.dumps(entries, indent=2, allow_nan=False) + "\n")


def read_picture_files(folder: Path) -> list[CameraPicture]:
    """Return the pictures in a folder, in the order in which they were written; none where it has no `pictures.json`.

    Raises:
        InvalidRunFolder: `pictures.json` or a picture is damaged.
    """
    index = folder / "pictures.json"
    if not index.exists():
        return []
    try:
        return [_picture(folder, entry) for entry in read_typed(index, list[_Entry])]
    except OSError as e:
        raise InvalidRunFolder(folder.parent, f"its picture {e.filename} cannot be read: {e.strerror}") from e
    except InvalidData as e:
        raise InvalidRunFolder(folder.parent, f"its pictures.json is damaged: {e}") from e


@dataclass(frozen=True, kw_only=True)
class _Entry:
    """A picture as `pictures.json` describes it."""

    t: float
    camera: str
    role: str
    width: Annotated[int, Meta(ge=1, le=100_000)]
    height: Annotated[int, Meta(ge=1, le=100_000)]
    file: FilePath
    marks: list[Mark]


def _picture(folder: Path, entry: _Entry) -> CameraPicture:
    jpeg = read_regular(folder / Path(entry.file).name)
    return CameraPicture(jpeg=jpeg, marks=tuple(entry.marks), **{name: getattr(entry, name) for name in _KEYS})


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
