"""Marks in the cameras' pictures of a Helix handover: what is measured in them, and what the controller takes for true.

The marks are for those who look at a run; no unit gets them.
"""

from collections.abc import Iterator
from functools import cache

import numpy as np

from handover.controllers.helix.vision.vision_parameters import Params as VisionParams
from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.scenarios.experiment.pictures import CameraPicture, Mark, MarkShape
from handover.scenarios.robots.helix.cameras import pinholes
from handover.scenarios.robots.helix.disturbances import Cover
from handover.scenarios.robots.helix.parameters import Parameters

_SHAPE = (720, 1280, 3)
_POINTS = {
    "p_WO": ("ball", "#ffd23f", "yellow"),
    "p_WR": ("wrist", "#4fe3ff", "blue"),
    "p_WG": ("gripper", "#ff8ad8", "pink"),
}
"""What each point is, its colour, and that in words; how it is known is seen by the mark's shape."""
MEASURED, ESTIMATED = "as measured", "as the controller has it"
_SHAPES: dict[str, tuple[MarkShape, MarkShape]] = {MEASURED: ("circle", "cross"), ESTIMATED: ("dashed circle", "plus")}
"""Shapes of the mark of the ball, which has its size in the picture, and of the other points."""
LEGEND = (
    f"{', '.join(f'{what} {colour}' for what, _, colour in _POINTS.values())}; "
    f"{', '.join(f'{ball} and {other} {source}' for source, (ball, other) in _SHAPES.items())}"
)
"""What the marks say, in words for a caption."""
_SEEN_BY = {"p_WO": "vision.seen_O", "p_WR": "vision.seen_R", "p_WG": "vision.seen_R"}


def take_pictures(t: float, role: str, parameters: Parameters, signals: Signals) -> list[CameraPicture]:
    """Return the cameras' current pictures at a time, with marks.

    Vision processes a picture at the instant at which it is taken, so its measurements belong to the current pictures.
    The controller's estimates are those of its last period.
    """
    return [
        CameraPicture.take(
            t=t,
            camera=side,
            role=role,
            pixels=signals[f"camera.{side}"].reshape(_SHAPE),
            marks=[
                *_estimated(camera, signals),
                *([] if _is_covered(t, side, parameters) else _measured(camera, signals)),
            ],
        )
        for side, camera in _cameras(parameters.camera_turn, parameters.cameras).items()
    ]


def _is_covered(t: float, side: str, parameters: Parameters) -> bool:
    lens = {"left": Cover.LEFT, "right": Cover.RIGHT}.get(side)
    return lens is not None and is_covered(t, lens, parameters)


def is_covered(t: float, side: Cover, parameters: Parameters) -> bool:
    """Return whether a lens was covered when the picture that is current at time t was taken."""
    begin, end = parameters.covered(side)
    taken = float(int(t / float(parameters.picture_period) + 1e-6) * parameters.picture_period)
    return begin <= taken < end


def _measured(camera: Pinhole, signals: Signals) -> Iterator[Mark]:
    for name in _POINTS:
        if signals[_SEEN_BY[name]]:
            yield from _mark(camera, name, signals[f"vision.{name}_meas"], MEASURED)


def _estimated(camera: Pinhole, signals: Signals) -> Iterator[Mark]:
    given = [name for name in _POINTS if f"servo.{name}_est" in signals]
    if "servo.phase" in signals and signals.text("servo.phase") == "WAIT":  # the controller has not seen both yet
        return
    for name in given:
        yield from _mark(camera, name, signals[f"servo.{name}_est"], ESTIMATED)


def _mark(camera: Pinhole, name: str, p_WP: Floats, source: str) -> Iterator[Mark]:
    """Yield the mark of a point, unless it is behind the camera."""
    u, v = camera.project(p_WP).tolist()
    if np.isfinite(u) and np.isfinite(v):
        what, colour, _ = _POINTS[name]
        ball = float(camera.f[0]) * VisionParams().ball_radius / float(camera.depth(p_WP))
        shape, radius = (_SHAPES[source][0], ball) if what == "ball" else (_SHAPES[source][1], 9.0)
        yield Mark(label=f"{what}, {source}", shape=shape, u=u, v=v, radius=radius, colour=colour)


_cameras = cache(pinholes)
