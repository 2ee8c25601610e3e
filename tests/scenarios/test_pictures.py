"""The README's pictures are made by a command, and show what figures look like today."""

import colorsys
import importlib.util
import re
from pathlib import Path
from typing import get_args, get_type_hints

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.pictures import CameraPicture, Mark
from handover.scenarios.helix import marked_pictures, plots
from handover.scenarios.helix.cameras import pinholes
from handover.scenarios.ir_grasp.plots import FINGER_COLOURS, FINGER_NAMES

ROOT = Path(__file__).parent.parent.parent
DOCS = ROOT / "docs"


def test_every_picture_of_the_readme_is_made_by_the_command():
    spec = importlib.util.spec_from_file_location("pictures", DOCS / "pictures.py")
    assert spec is not None
    assert spec.loader is not None
    pictures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pictures)
    made = {*pictures.FIGURES, *pictures.EXPERIMENTS, pictures.REPORT}
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"docs/(\w+\.(?:png|jpg))", readme)) == made
    assert {p.name for p in DOCS.iterdir() if p.suffix in (".png", ".jpg")} == made
    assert "\t$(BIN)/python docs/pictures.py" in (ROOT / "Makefile").read_text(encoding="utf-8")


def centre(file: Path, colour: str) -> Floats:
    """Return the middle of a picture's pixels of a colour, from the left and from the top."""
    pixels = cv2.imread(str(file))
    assert pixels is not None, file
    blue_green_red = [int(colour[k : k + 2], 16) for k in (5, 3, 1)]
    return np.mean(np.argwhere((np.abs(pixels.astype(int) - blue_green_red) < 4).all(axis=2)), axis=0)[::-1]


@pytest.mark.parametrize(("finger", "colour"), list(zip(FINGER_NAMES, FINGER_COLOURS, strict=True)))
def test_the_fingers_in_the_picture_are_as_in_the_figure_of_today(grasp: Path, finger: str, colour: str):
    kept, drawn = centre(DOCS / "ir_grasp.png", colour), centre(grasp / "figures" / "scene.png", colour)
    assert kept == pytest.approx(drawn, abs=10.0), f"{finger}: run `make pictures`, look at docs/ and commit it"


def test_every_shape_of_a_mark_is_drawn():
    axes = Canvas().subplots()
    shapes = get_args(get_type_hints(Mark)["shape"])
    marks = [Mark(label="ball", shape=shape, u=20.0, v=20.0) for shape in shapes]
    pixels = np.zeros((40, 40, 3), np.uint8)
    plots._show(axes, CameraPicture.take(t=0.0, camera="left", role="", pixels=pixels, marks=marks), (40, 0))  # type: ignore
    assert [patch.get_linestyle() for patch in axes.patches] == ["-", "--"]
    assert [line.get_marker() for line in axes.lines] == ["x", "+"]


def test_the_caption_of_marked_pictures_says_their_colours_and_shapes(tmp_path: Path):
    camera, pixels = pinholes()["left"], np.zeros((720, 1280, 3), np.uint8)
    signals = {"vision.seen_O": True, "vision.seen_R": True} | {
        of: np.array([0.1, 0.0, -0.5])
        for name in ("p_WO", "p_WR", "p_WG")
        for of in (f"vision.{name}_meas", f"servo.{name}_est")
    }
    marks = [mark for by in ("_measured", "_estimated") for mark in getattr(marked_pictures, by)(camera, signals)]
    picture = CameraPicture.take(t=0.0, camera="left", role="", pixels=pixels, marks=marks)
    caption = plots.draw_pictures([picture], (), tmp_path).caption
    assert len(marks) == 6
    for mark in marks:
        what, _, source = mark.label.partition(", ")
        hue, _, _ = colorsys.rgb_to_hsv(*(int(mark.colour[k : k + 2], 16) / 255 for k in (1, 3, 5)))
        colour = next(name for least, name in ((0.75, "pink"), (0.45, "blue"), (0.1, "yellow")) if hue > least)
        assert f"{what} {colour}" in caption
        assert re.search(rf"{mark.shape}[^,]* {source}", caption)
