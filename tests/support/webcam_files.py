"""What a webcam needs in tests: its files, with a stand-in for MediaPipe, and a video that Chromium's camera sees."""

import json
import math
import zipfile
from pathlib import Path

import numpy as np

from handover.plants.free_flyer.hand.hand_kinematics import CLOSED
from handover.scenarios.live.webcam import BUNDLE, LOADER, MODEL, MODEL_PARTS, WASM
from support.hand_points import landmarks_of_hand, turned

WIDTH, HEIGHT, RATE = 320, 240, 20
FOCAL = 0.5 / math.tan(math.radians(30.0))
"""Of the camera, widths of its picture."""
SIDE = 0.12
"""Of the square that stands for a hand, m."""
R_CH = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Fingers up in the picture, the back of the hand towards the camera: as of one who reaches towards the screen."""


def write_files(folder: Path, *, model: bytes = b"", makers: str = "http://127.0.0.1:1/") -> Path:
    """Write a folder of the files with the stand-in; `model` is a part of its model."""
    (folder / "wasm").mkdir(parents=True)

    def points(angles: tuple[float, ...]) -> list[list[float]]:
        hand = turned(landmarks_of_hand(angles), R_CH)
        return (hand - np.mean(hand[[0, 5, 9, 13, 17]], axis=0)).tolist()

    hands = {"open": points((0.0,) * 14), "fist": points(CLOSED), "focal": FOCAL, "side": SIDE, "makers": makers}
    stand_in = (Path(__file__).parent / "webcam_stand_in.mjs").read_text(encoding="utf-8")
    (folder / BUNDLE).write_text(stand_in.replace("HANDS", json.dumps(hands)), encoding="utf-8")
    (folder / LOADER).write_text("globalThis.ModuleFactory = async () => ({});", encoding="utf-8")
    (folder / WASM).write_bytes(b"\0asm\1\0\0\0")
    with zipfile.ZipFile(folder / MODEL, "w") as bundle:
        for name in MODEL_PARTS:
            bundle.writestr(name, b"\x1c\0\0\0TFL3" + model)
    (folder / "package.json").write_text("{}", encoding="utf-8")
    return folder


def write_video(path: Path) -> None:
    """Write what a camera sees: a hand at rest, that goes to its right, makes a fist, and leaves; then it comes back.

    In 0.6 m, 0.12 m to its right (left in the picture).
    """
    focal = FOCAL * WIDTH
    size = round(focal * SIDE / 0.6)
    places = [
        *[(0.0, 235)] * 40,
        *[(-0.12 * k / 10, 235) for k in range(10)],
        *[(-0.12, 235)] * 20,
        *[(-0.12, 150)] * 30,
    ]
    frames = [b"YUV4MPEG2 W%d H%d F%d:1 Ip A1:1 C420jpeg\n" % (WIDTH, HEIGHT, RATE)]
    grey = bytes([128]) * (WIDTH * HEIGHT // 2)
    for at in [*places, *[None] * 40]:
        picture = np.full((HEIGHT, WIDTH), 16, dtype=np.uint8)
        if at is not None:
            left, top = round(0.5 * WIDTH + focal * at[0] / 0.6 - 0.5 * size), (HEIGHT - size) // 2
            picture[top : top + size, left : left + size] = at[1]
        frames.append(b"FRAME\n" + picture.tobytes() + grey)
    path.write_bytes(b"".join(frames))


def camera_of(video: Path) -> tuple[str, ...]:
    """Return Chromium's flags by which a video is what its camera sees, without asking."""
    return (
        "--use-fake-ui-for-media-stream",
        "--use-fake-device-for-media-stream",
        f"--use-file-for-fake-video-capture={video}",
    )
