"""The units' icons as pixels, rendered from their drawings; run as a program, writes them as PNG: `make icons`."""

from pathlib import Path

import cv2
import numpy as np
import resvg_py
from numpy.typing import NDArray

ICONS = Path(__file__).parents[3] / "fmus" / "icons"
SIZE = 128
"""Width and height of the PNGs, pixels."""

Pixels = NDArray[np.uint8]


def drawings() -> list[Path]:
    """Return the SVG files, of all robots."""
    return sorted(ICONS.rglob("*.svg"))


def rendered(svg: Path) -> Pixels:
    """Return a drawing's pixels, blue green red and opacity."""
    return pixels(bytes(resvg_py.svg_to_bytes(svg_string=svg.read_text(), width=SIZE, height=SIZE)))


def pixels(png: bytes) -> Pixels:
    """Return a PNG's pixels, blue green red and opacity."""
    return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED), np.uint8)


def difference(a: Pixels, b: Pixels) -> float:
    """Return the mean difference of two icons on black and white, 0 to 255."""
    return max(float(np.abs(_on(a, colour) - _on(b, colour)).mean()) for colour in (0.0, 255.0))


def _on(icon: Pixels, colour: float) -> NDArray[np.float64]:
    opacity = icon[..., 3:] / 255.0
    return icon[..., :3] * opacity + colour * (1.0 - opacity)


if __name__ == "__main__":
    for drawing in drawings():
        cv2.imwrite(str(drawing.with_suffix(".png")), rendered(drawing), (cv2.IMWRITE_PNG_COMPRESSION, 9))
