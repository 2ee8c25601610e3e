"""The pictures of README and site are made by a command, and show what figures look like today."""

import importlib.util
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.documentation import ROOT, TEXT

from handover.cosim.blocks.ports import Floats
from handover.scenarios.robots.ir_grasp.plots import FINGER_COLOURS, FINGER_NAMES

DOCS = ROOT / "docs"


def test_every_picture_is_shown_and_made_by_the_command():
    spec = importlib.util.spec_from_file_location("pictures", DOCS / "pictures.py")
    assert spec is not None
    assert spec.loader is not None
    pictures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pictures)
    made = {*pictures.FIGURES, *pictures.EXPERIMENTS, pictures.REPORT, pictures.FILM}
    assert set(re.findall(r"\]\([\w./]*?(\w+\.(?:png|jpg|gif))\)", TEXT)) == made
    assert {p.name for p in DOCS.iterdir() if p.suffix in (".png", ".jpg", ".gif")} == made
    assert " $(BIN)/python docs/pictures.py" in (ROOT / "Makefile").read_text(encoding="utf-8")


def centre(file: Path, colour: str) -> Floats:
    """Return the middle of a picture's pixels of a colour, from the left and from the top."""
    pixels = cv2.imread(str(file))
    assert pixels is not None, file
    blue_green_red = [int(colour[k : k + 2], 16) for k in (5, 3, 1)]
    return np.mean(np.argwhere((np.abs(pixels.astype(int) - blue_green_red) < 4).all(axis=2)), axis=0)[::-1]


def test_the_fingers_in_the_picture_are_as_in_the_figure_of_today(grasp: Path):
    for finger, colour in zip(FINGER_NAMES, FINGER_COLOURS, strict=True):
        kept, drawn = centre(DOCS / "ir_grasp.png", colour), centre(grasp / "figures" / "scene.png", colour)
        assert kept == pytest.approx(drawn, abs=10.0), f"{finger}: run `make pictures`, look at docs/ and commit it"
