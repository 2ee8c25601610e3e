"""The section of a page that shows camera pictures of a run, with detections drawn over them."""

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
from markupsafe import Markup

from handover.scenarios.experiment.pictures import CameraPicture, Mark
from handover.scenarios.runs.reporting.page import Section, template
from handover.scenarios.runs.results.pictures import read_picture_files
from handover.scenarios.runs.results.run_folder import RunFolder

_WIDTHS = (960, 800, 640, 480, 360)
"""Widths to choose from, px: the greatest at which all pictures have room in the page."""

_QUALITY = 80
_MAX_BYTES = 1_200_000
"""Size of all pictures in a page together, in base64."""


@dataclass(frozen=True, kw_only=True)
class _DisplayedPicture:
    """A picture in the page: its source, its data in base64, and a caption for screen readers."""

    picture: CameraPicture
    data: str

    @property
    def caption(self) -> str:
        p = self.picture
        marked = ", ".join(mark.label for mark in p.marks)
        return f"{p.camera} camera at {p.t:.1f} s, {p.role}" + (f"; marked: {marked}" if marked else "; nothing marked")


def pictures_section(folder: RunFolder) -> Section | None:
    """Return the pictures in a run's folder, those of one moment side by side; None where there are none.

    Raises:
        InvalidRunFolder: they are damaged.
    """
    pictures = read_picture_files(folder.pictures)
    if not pictures:
        return None
    moments: dict[tuple[float, str], list[_DisplayedPicture]] = {}
    for picture, data in zip(pictures, _inline(pictures), strict=True):
        moments.setdefault((picture.t, picture.role), []).append(_DisplayedPicture(picture=picture, data=data))
    marks = {mark.label: mark for picture in pictures for mark in picture.marks}
    html = template("pictures.html").render(moments=moments, legend=list(marks.values()), place=_mark_style)
    return Section(anchor="pictures", title="What the cameras saw", html=Markup(html))


def _inline(pictures: Sequence[CameraPicture]) -> list[str]:
    """Return the pictures in base64, at the greatest width at which all have room."""
    encoded: list[str] = []
    for width in _WIDTHS:
        encoded = [base64.b64encode(_scaled_down(p, width)).decode() for p in pictures]
        if sum(map(len, encoded)) <= _MAX_BYTES:
            break
    return encoded


def _scaled_down(picture: CameraPicture, width: int) -> bytes:
    if picture.width <= width:
        return picture.jpeg
    height = math.ceil(picture.height * width / picture.width)
    pixels = cv2.resize(picture.pixels, (width, height), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()


def _mark_style(mark: Mark, picture: CameraPicture) -> str:
    """Return the CSS that puts a mark at its position in a picture shown at any size."""
    left, top = 100.0 * (mark.u + 0.5) / picture.width, 100.0 * (mark.v + 0.5) / picture.height
    wide = 100.0 * 2.0 * mark.radius / picture.width
    return f"left:{left:.3f}%;top:{top:.3f}%;width:{wide:.3f}%;color:{mark.colour}"
