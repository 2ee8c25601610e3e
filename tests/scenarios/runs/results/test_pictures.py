"""Camera pictures in a run's folder: they are read back as written, and none of an earlier run remain."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support.wording import Wording

from handover.scenarios.experiment.pictures import CameraPicture, Mark
from handover.scenarios.runs.results.pictures import read_picture_files, write_picture_files
from handover.scenarios.runs.results.run_folder import InvalidRunFolder

MARK = Mark(label="ball, as measured", shape="circle", u=30.5, v=20.0, radius=6.0, colour="#ffd23f")


def shaded() -> NDArray[np.uint8]:
    """Return a picture of 40 rows and 60 columns, bright and blue towards the right."""
    pixels = np.zeros((40, 60, 3), dtype=np.uint8)
    pixels[..., 0] = np.linspace(0, 250, 60, dtype=np.uint8)
    return pixels


def taken(role: str, t: float = 0.0, *marks: Mark) -> CameraPicture:
    return CameraPicture.take(t=t, camera="left", role=role, pixels=shaded(), marks=marks)


def test_pictures_are_read_back_as_they_were(tmp_path: Path):
    pictures = [taken("start"), taken("at the ball", 8.0, MARK)]
    write_picture_files(tmp_path / "pictures", pictures)
    assert read_picture_files(tmp_path / "pictures") == pictures
    data = json.loads((tmp_path / "pictures" / "pictures.json").read_text())
    assert {name: data[1][name] for name in ("t", "camera", "role", "file", "width", "height")} == {
        "t": 8.0, "camera": "left", "role": "at the ball", "file": "02_at_the_ball_left.jpg", "width": 60, "height": 40,
    }  # fmt: skip
    mark = {"label": "ball, as measured", "shape": "circle", "u": 30.5, "v": 20.0, "radius": 6.0, "colour": "#ffd23f"}
    assert data[1]["marks"] == [mark]
    assert np.max(np.abs(taken("start").pixels.astype(int) - shaded())) < 25, "but for JPEG's loss"


def test_pictures_of_an_earlier_end_do_not_stay(tmp_path: Path):
    write_picture_files(tmp_path / "pictures", [taken("start"), taken("end", 3.0)])
    write_picture_files(tmp_path / "pictures", [taken("start")])
    assert sorted(p.name for p in (tmp_path / "pictures").iterdir()) == ["01_start_left.jpg", "pictures.json"]
    write_picture_files(tmp_path / "pictures", [])
    assert not (tmp_path / "pictures").exists()
    assert read_picture_files(tmp_path / "pictures") == []


def test_a_damaged_list_and_a_picture_that_is_gone_are_reported(tmp_path: Path, wording: Wording):
    write_picture_files(tmp_path / "pictures", [taken("start")])
    (tmp_path / "pictures" / "01_start_left.jpg").unlink()
    for content in (None, "[{]", '[{"t": 0.0}]', "[1]", '{"a": 1}'):
        if content is not None:
            (tmp_path / "pictures" / "pictures.json").write_text(content)
        with pytest.raises(InvalidRunFolder) as refused:
            read_picture_files(tmp_path / "pictures")
        wording.check(refused.value)
