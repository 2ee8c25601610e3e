"""A run that a live page shows: its folder, its controls, what is seen of it, and what a page does in it."""

import base64
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.live.commands import Push
from handover.scenarios.live.hand_seat import HandSeat
from handover.scenarios.live.live_scene import LiveScene
from handover.scenarios.live.process import PICTURE_FILE, PageInputs
from handover.scenarios.live.shared_pictures import PictureReader, Pixels
from handover.scenarios.live.watched_run import WatchedRun


@dataclass
class ShownRun:
    """A run that a page shows.

    Attributes:
        run: its folder.
        control: of its pace; it is paused until a page shows it.
        controls: folder of the controls, and of the inputs that a page sets, once the run has made them.
        scene: its scene and plots, None until its first row.
        inputs: these inputs, likewise.
        seat: of the device that leads a hand, likewise; None where none is led.
        webcam: hashes of the files by which a webcam leads it; empty where it is not offered.
    """

    run: WatchedRun
    control: LiveControl
    controls: Path
    scene: LiveScene | None = None
    inputs: PageInputs = field(default_factory=PageInputs)
    seat: HandSeat | None = None
    webcam: Mapping[str, str] = field(default_factory=dict[str, str])

    def __post_init__(self) -> None:
        self._pictures = PictureReader(self.controls / PICTURE_FILE)
        self._not_black = set[str]()

    def pictures(self) -> dict[str, Any] | None:
        """Return the newest pictures of its cameras for a page, and ask the run for the next; None without new ones.

        A camera that has shown nothing but black, as the one that a robot lacks, is left out.
        """
        seen = self._pictures.take()
        if seen is None:
            return None
        self._not_black |= {name for name, pixels in seen.pictures.items() if pixels.any()}
        shown = {name: _jpeg(seen.t, name, pixels) for name, pixels in seen.pictures.items() if name in self._not_black}
        return {"time": seen.t, "cameras": shown} if shown else None

    def begin(self, scene: LiveScene) -> None:
        """Take in the run's scene, and let pages set its inputs."""
        self.scene, self.inputs = scene, PageInputs.open(self.controls)
        led = None if self.inputs.hand is None else self.run.led_hand()
        if self.inputs.hand is not None and led is not None:
            self.seat = HandSeat(led, self.inputs.hand, lambda: scene.wanted_hand(led), self.webcam)

    def end(self) -> None:
        """Leave in the run's folder what led its hand."""
        if self.seat is not None:
            self.seat.write_report(self.run.folder.path)

    @property
    def pushes(self) -> Sequence[Pushable]:
        """What can be pushed in it."""
        inputs = self.inputs.pushes
        if inputs is None or self.scene is None:
            return ()
        return [push for push in self.scene.pushes if f"{push.unit}.{push.force}" in inputs.sizes]

    def push(self, asked: Push) -> None:
        """Push a body."""
        assert self.inputs.pushes is not None
        given = zip(asked.body.inputs, (asked.force, asked.point), strict=False)  # some bodies have no input of a point
        values = {f"{end.unit}.{end.port}": value for end, value in given}
        self.inputs.pushes.set(values, time.monotonic())


def _jpeg(t: float, camera: str, pixels: Pixels) -> str:
    """Return a picture as JPEG in base64, as wide as a page shows it."""
    import cv2  # no part of what a page without pictures needs

    fewer: Any = cv2.resize(pixels, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return base64.b64encode(CameraPicture.take(t=t, camera=camera, role="", pixels=fewer).jpeg).decode()
