"""Parameters of the Helix's grasp by infrared reflex."""

import enum
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.cosim.blocks.origins import assumed, derived
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

    reflex: bool = parameter(
        True, "correct the gripper's goal by the fingers' sensors", origin=assumed("what the scenario is for")
    )
    cameras: LastStretch = parameter(
        LastStretch.FREE,
        "what the cameras see from the first time on that the gripper is near",
        origin=assumed("nothing is hidden: the paint shows fingers as thin as they are"),
    )
    near: Metre = parameter(
        0.05,
        "distance of gripper and ball that is near",
        minimum=0.0,
        maximum=0.15,
        origin=assumed("from there the fingers' sensors see the ball; a gripper with pads hides it"),
    )
    offer: Offer = parameter(
        Offer.DRAWN,
        "where the ball is offered: drawn by the seed, or as given",
        origin=assumed("evenly over reach and sight"),
    )
    azimuth: Radian = parameter(
        0.0,
        "of a given place: its direction from the arm's axis",
        minimum=-np.pi,
        maximum=np.pi,
        origin=assumed("of a given place: in front"),
    )
    radius: Metre = parameter(
        0.16,
        "of a given place: its distance from the arm's axis",
        minimum=0.0,
        maximum=2.0,
        origin=assumed(
            "distance of the offered ball from the arm's axis; fig. 9 has the gripper 0.16 m from its start at the end"
        ),
    )
    height: Metre = parameter(
        -0.6,
        "of a given place: its height in W",
        minimum=-1.1,
        maximum=0.0,
        origin=assumed(
            "height of the offered ball in W, 10 cm above the hanging gripper; figs. 4 and 6 show it "
            "between wrist and gripper"
        ),
    )
    alpha: Number = parameter(
        0.25,
        "step size of the Jacobian control, eq. (21)",
        minimum=0.01,
        maximum=1.0,
        origin=assumed("with control_period half of the way in a second: the averaged command trails by half a second"),
    )
    patience: Second = parameter(
        60.0,
        "time by which the gripper must begin to close",
        minimum=1.0,
        maximum=600.0,
        origin=assumed("own choice: of the thesis's runs with alpha 0.2 and 0.4 the slowest took 57.6 s (table 1)"),
    )
    tremor: Metre = parameter(
        0.001,
        "root mean square of the hand's tremor",
        minimum=0.0,
        maximum=0.05,
        origin=assumed("physiological tremor of an outstretched hand"),
    )
    drift: Metre = parameter(
        0.003,
        "root mean square of the hand's drift",
        minimum=0.0,
        maximum=0.1,
        origin=assumed("how still a hand is held"),
    )
    click_noise: Pixel = parameter(
        0.5,
        "standard deviation of the calibration's clicks",
        minimum=0.0,
        maximum=50.0,
        origin=assumed("own choice: a careful click; sec. 3.2.2 says only that corners are selected in the pictures"),
    )
    camera_turn: Radian = parameter(
        0.0,
        "angle by which the right camera was turned after calibration",
        minimum=-0.2,
        maximum=0.2,
        origin=derived("undisturbed: as calibrated"),
    )
    reflectivity: Number = parameter(
        1.0,
        "reflectivity of the ball over that of the surface the sensors were characterised with",
        minimum=0.05,
        maximum=2.0,
        origin=assumed("that of the surface the sensors were characterised with"),
    )
    sensor_tolerance: Number = parameter(
        0.05,
        "standard deviation of a sensor's gain from the characteristic's",
        minimum=0.0,
        maximum=0.5,
        origin=assumed("parts of one make differ by some percent after calibration of one of them"),
    )
    range_tolerance: Number = parameter(
        0.05,
        "standard deviation of a sensor's range from the characteristic's, as a part of it",
        minimum=0.0,
        maximum=0.3,
        origin=assumed("parts of one make differ by some percent after calibration of one of them"),
    )
    mounting_tolerance: Radian = parameter(
        0.03,
        "standard deviation of a sensor's direction from the design's, in each of two",
        minimum=0.0,
        maximum=0.3,
        origin=assumed("small parts that are glued into a printed finger are off by a degree or two"),
    )
    palm_reflectivity: Number = parameter(
        0.6,
        "reflectivity of the palm in infrared; the reflex expects 0.6",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("skin returns some six tenths of what a white card does in the near infrared"),
    )
    expected_radius: Metre = parameter(
        0.025,
        "radius of the ball that the reflex expects; it has 25 mm",
        minimum=0.005,
        maximum=0.1,
        origin=assumed("as the cameras see it"),
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
