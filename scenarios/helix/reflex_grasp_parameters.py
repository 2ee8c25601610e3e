"""Parameters of the Helix's grasp by infrared reflex; origins of the defaults are in `paper.toml`."""

import enum
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.units import Metre, Number, Pixel, Radian, Second
from handover.scenarios.helix.parameters import Parameters


class Offer(enum.IntEnum):
    """Where the hand offers the ball: at a place that the seed draws within reach and sight, or at a given one."""

    DRAWN = 0
    GIVEN = 1


class LastStretch(enum.IntEnum):
    """What the cameras see once the gripper is near: all, all but the ball, or nothing."""

    FREE = 0
    BALL_HIDDEN = 1
    COVERED = 2


@dataclass(frozen=True, kw_only=True)
class ReflexGraspParameters:
    """One handover whose last stretch the fingers' sensors may guide."""

    reflex: bool = parameter(True, "correct the gripper's goal by the fingers' sensors")
    cameras: LastStretch = parameter(
        LastStretch.FREE, "what the cameras see from the first time on that the gripper is near"
    )
    near: Metre = parameter(0.05, "distance of gripper and ball that is near", minimum=0.0, maximum=0.15)
    offer: Offer = parameter(Offer.DRAWN, "where the ball is offered: drawn by the seed, or as given")
    azimuth: Radian = parameter(
        0.0, "of a given place: its direction from the arm's axis", minimum=-np.pi, maximum=np.pi
    )
    radius: Metre = parameter(0.16, "of a given place: its distance from the arm's axis", minimum=0.0, maximum=2.0)
    height: Metre = parameter(-0.6, "of a given place: its height in W", minimum=-1.1, maximum=0.0)
    alpha: Number = parameter(0.25, "step size of the Jacobian control, eq. (21)", minimum=0.01, maximum=1.0)
    patience: Second = parameter(60.0, "time by which the gripper must begin to close", minimum=1.0, maximum=600.0)
    tremor: Metre = parameter(0.001, "root mean square of the hand's tremor", minimum=0.0, maximum=0.05)
    drift: Metre = parameter(0.003, "root mean square of the hand's drift", minimum=0.0, maximum=0.1)
    click_noise: Pixel = parameter(0.5, "standard deviation of the calibration's clicks", minimum=0.0, maximum=50.0)
    camera_turn: Radian = parameter(
        0.0, "angle by which the right camera was turned after calibration", minimum=-0.2, maximum=0.2
    )
    reflectivity: Number = parameter(
        1.0,
        "reflectivity of the ball over that of the surface the sensors were characterised with",
        minimum=0.05,
        maximum=2.0,
    )
    sensor_tolerance: Number = parameter(
        0.05, "standard deviation of a sensor's gain from the characteristic's", minimum=0.0, maximum=0.5
    )
    range_tolerance: Number = parameter(
        0.05,
        "standard deviation of a sensor's range from the characteristic's, as a part of it",
        minimum=0.0,
        maximum=0.3,
    )
    mounting_tolerance: Radian = parameter(
        0.03, "standard deviation of a sensor's direction from the design's, in each of two", minimum=0.0, maximum=0.3
    )
    palm_reflectivity: Number = parameter(
        0.6, "reflectivity of the palm in infrared; the reflex expects 0.6", minimum=0.0, maximum=2.0
    )
    expected_radius: Metre = parameter(
        0.025, "radius of the ball that the reflex expects; it has 25 mm", minimum=0.005, maximum=0.1
    )

    @property
    def handover(self) -> Parameters:
        """The handover that it is, with the ball at the given place."""
        names = ("azimuth", "radius", "height", "alpha", "patience", "tremor", "drift", "click_noise", "camera_turn")
        return Parameters(**{name: getattr(self, name) for name in names})

    @property
    def covers(self) -> dict[str, Any]:
        """What is set on the cameras."""
        covered, hidden = self.cameras is LastStretch.COVERED, self.cameras is LastStretch.BALL_HIDDEN
        return {"cover_within": self.near if covered else 0.0, "hide_ball_within": self.near if hidden else 0.0}
