"""Camera pictures in a page: those of a moment beside each other, marked at their places, small enough."""

import base64
import re
from pathlib import Path

import cv2
import numpy as np

from handover.scenarios.experiment.pictures import CameraPicture, Mark
from handover.scenarios.runs.reporting.run_page import pictures_section
from handover.scenarios.runs.results.pictures import write_picture_files
from handover.scenarios.runs.results.run_folder import RunFolder

BALL = Mark(label="ball, as measured", shape="circle", u=319.5, v=359.5, radius=32.0, colour="#ffd23f")
GONE = Mark(label="wrist, as measured", shape="cross", u=2000.0, v=10.0)


def html_of(folder: Path, moments: int, noise: int) -> str:
    rng = np.random.default_rng(0)
    pictures = [
        CameraPicture.take(
            t=float(k),
            camera=camera,
            role="start" if k == 0 else f"moment {k}",
            pixels=rng.integers(0, noise + 1, (720, 1280, 3), dtype=np.uint8),
            marks=(BALL, GONE),
        )
        for k in range(moments)
        for camera in ("left", "right")
    ]
    write_picture_files(folder / "pictures", pictures)
    section = pictures_section(RunFolder.of_run(folder))
    assert section is not None
    return str(section.html)


def test_pictures_of_a_moment_stand_below_its_time_and_role(tmp_path: Path):
    html = html_of(tmp_path, 2, 40)
    assert re.findall(r"<h3>(.*?)</h3>", html) == ["0.0 s, start", "1.0 s, moment 1"]
    assert re.findall(r'alt="(\w+ camera at \d\.\d s)', html) == [
        "left camera at 0.0 s", "right camera at 0.0 s", "left camera at 1.0 s", "right camera at 1.0 s"
    ]  # fmt: skip
    assert "; marked: ball, as measured, wrist, as measured" in html


def test_marks_lie_at_their_share_of_the_picture_and_outside_of_it_are_none(tmp_path: Path):
    html = html_of(tmp_path, 1, 40)
    assert html.count("left:25.000%;top:50.000%;width:5.000%;color:#ffd23f") == 2
    assert html.count('<i class="mark cross"') == 1  # in the legend


def test_pictures_become_smaller_until_they_have_room(tmp_path: Path):
    html = html_of(tmp_path, 3, 255)
    data = re.findall(r'src="data:image/jpeg;base64,([^"]*)"', html)
    assert len(data) == 6
    assert sum(map(len, data)) <= 1_200_000
    pixels = cv2.imdecode(np.frombuffer(base64.b64decode(data[0]), dtype=np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    high, wide, _ = pixels.shape
    assert 360 <= wide < 960
    assert high * 16 == wide * 9


def test_without_pictures_there_is_no_section(tmp_path: Path):
    assert pictures_section(RunFolder.of_run(tmp_path)) is None
