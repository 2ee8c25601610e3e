"""Camera pictures of a run under way: those that are asked for, and none else, as the run has them."""

from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Raster
from handover.cosim.system.signals import Signals
from handover.scenarios.live.shared_pictures import PERIOD, PictureReader, PictureWriter


class Camera:
    """Signals of a run with a picture that is as bright as the time, and one that never came."""

    def __init__(self, rasters: dict[str, Raster]) -> None:
        self._rasters, self.level, self.read = rasters, 0, 0

    def rasters(self) -> dict[str, Raster]:
        return self._rasters

    def __getitem__(self, name: str) -> NDArray[np.uint8]:
        self.read += 1
        return np.full(self._rasters[name].size if name == "camera.left" else 0, self.level, dtype=np.uint8)


def test_pictures_are_written_where_they_are_asked_for_and_not_too_often(tmp_path: Path):
    now = [0.0]
    camera = Camera({"camera.left": Raster(8, 4), "camera.right": Raster(2, 2)})
    signals = cast(Signals, camera)
    writer, reader = PictureWriter(tmp_path / "pictures", lambda: now[0]), PictureReader(tmp_path / "pictures")
    assert reader.take() is None  # the run has not begun
    writer(0.0, signals)
    assert camera.read == 0  # nobody asks
    assert reader.take() is None  # asks
    camera.level = 7
    writer(1.0, signals)
    seen = reader.take()
    assert seen is not None
    assert seen.t == 1.0
    assert seen.pictures["camera.left"].shape == (4, 8, 3)
    assert (seen.pictures["camera.left"] == 7).all()
    assert not seen.pictures["camera.right"].any()
    camera.level, read = 9, camera.read
    now[0] = 0.5 * PERIOD
    writer(2.0, signals)
    assert camera.read == read  # too early
    assert reader.take() is None
    assert (seen.pictures["camera.left"] == 7).all()
    now[0] = 1.5 * PERIOD
    writer(3.0, signals)
    again = reader.take()
    assert again is not None
    assert again.t == 3.0
    assert (again.pictures["camera.left"] == 9).all()
    empty: Any = Camera({})
    PictureWriter(tmp_path / "none", lambda: now[0])(0.0, empty)
    assert not (tmp_path / "none").exists()


def test_a_raster_is_read_from_its_mime_type():
    assert Raster.of_mime(Raster(1280, 720).mime) == Raster(1280, 720)
    assert all(Raster.of_mime(mime) is None for mime in ("image/png", None, "image/x-raw-bgr; width=3"))
