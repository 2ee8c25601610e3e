"""What both cameras saw at one moment, with what vision found in it and where the controller took things to be."""

from collections.abc import Iterator
from fractions import Fraction
from functools import cache

import numpy as np

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.scenarios.experiment.pictures import CameraPicture, Mark
from handover.scenarios.helix_handover.parameters import Cover, Parameters
from handover.scenarios.helix_handover.rig import camera_of

MEASURED, ESTIMATED = "#ffd23f", "#4fe3ff"
_PERIOD = Fraction(1, 30)
"""Of camera and vision, s."""

_SHAPE = (720, 1280, 3)
_SHAPES = {"p_WO": ("ball", "circle"), "p_WR": ("wrist", "cross"), "p_WG": ("gripper", "plus")}
_SEEN_BY = {"p_WO": "vision.seen_O", "p_WR": "vision.seen_R", "p_WG": "vision.seen_R"}


def take_pictures(t: float, role: str, parameters: Parameters, signals: Signals) -> list[CameraPicture]:
    """Return the pictures of both cameras that hold at a time, with marks.

    Vision looks at a picture at the instant at which it is taken, so what it says is of the pictures that hold with it.
    The controller's estimates are those of its last period.
    """
    return [
        CameraPicture.take(
            t=t,
            camera=side.name.lower(),
            role=role,
            pixels=signals[f"camera.{side.name.lower()}"].reshape(_SHAPE),
            marks=[*_estimated(side, signals), *([] if is_covered(t, side, parameters) else _measured(side, signals))],
        )
        for side in (Cover.LEFT, Cover.RIGHT)
    ]


def is_covered(t: float, side: Cover, parameters: Parameters) -> bool:
    """Return whether a lens was covered when the picture that holds at time t was taken."""
    begin, end = parameters.covered(side)
    taken = float(int(t / float(_PERIOD) + 1e-6) * _PERIOD)
    return begin <= taken < end


def _measured(side: Cover, signals: Signals) -> Iterator[Mark]:
    for name in _SHAPES:
        if signals[_SEEN_BY[name]]:
            yield from _mark(side, name, signals[f"vision.{name}_meas"], "as measured", MEASURED)


def _estimated(side: Cover, signals: Signals) -> Iterator[Mark]:
    if not np.any(signals["servo.p_WG_est"]):  # the controller has seen nothing yet
        return
    for name in _SHAPES:
        yield from _mark(side, name, signals[f"servo.{name}_est"], "as the controller has it", ESTIMATED)


def _mark(side: Cover, name: str, p_WP: Floats, source: str, colour: str) -> Iterator[Mark]:
    """Yield the mark of a point, unless it is behind the camera."""
    from handover.controllers.helix.handover_vision import (
        Params as Vision,  # long to load for who only lists parameters
    )

    camera = _camera(side)
    u, v = camera.project(p_WP).tolist()
    if np.isfinite(u) and np.isfinite(v):
        what, shape = _SHAPES[name]
        ball = float(camera.f[0]) * Vision().ball_radius / float(camera.depth(p_WP))
        radius = ball if shape == "circle" else 9.0
        yield Mark(label=f"{what}, {source}", shape=shape, u=u, v=v, radius=radius, colour=colour)


@cache
def _camera(side: Cover) -> Pinhole:
    return camera_of(side.name.lower())
