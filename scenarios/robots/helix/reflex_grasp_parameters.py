"""Parameters of the Helix's grasp by infrared reflex."""

import enum
from dataclasses import dataclass
from typing import Any

from handover.controllers.helix.reflex.grasp_reflex import Params as ReflexParams
from handover.cosim.blocks.origins import assumed
from handover.cosim.blocks.units import Metre
from handover.plants.helix.finger_infrared import Params as FingerParams
from handover.scenarios.experiment.exposed import expose
from handover.scenarios.experiment.needs import any_of, being, parameter
from handover.scenarios.robots.helix.parameters import Parameters


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

    reflex: bool = expose(ReflexParams, "reflex.feels")
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
        needs=(any_of("cameras"),),
    )
    offer: Offer = parameter(
        Offer.DRAWN,
        "where the ball is offered: drawn by the seed, or as given",
        origin=assumed("evenly over reach and sight"),
    )
    azimuth: float = expose(
        Parameters,
        "azimuth",
        description="of a given place: its direction from the arm's axis",
        needs=(being("offer", Offer.GIVEN),),
    )
    radius: float = expose(
        Parameters,
        "radius",
        description="of a given place: its distance from the arm's axis",
        needs=(being("offer", Offer.GIVEN),),
    )
    height: float = expose(
        Parameters, "height", description="of a given place: its height in W", needs=(being("offer", Offer.GIVEN),)
    )
    alpha: float = expose(Parameters, "alpha")
    patience: float = expose(Parameters, "patience")
    tremor: float = expose(Parameters, "tremor")
    drift: float = expose(Parameters, "drift")
    click_noise: float = expose(Parameters, "click_noise")
    camera_turn: float = expose(Parameters, "camera_turn")
    reflectivity: float = expose(FingerParams, "fingers.ball_reflectivity", minimum=0.05)
    sensor_tolerance: float = expose(FingerParams, "fingers.tolerance")
    range_tolerance: float = expose(FingerParams, "fingers.range_tolerance")
    mounting_tolerance: float = expose(FingerParams, "fingers.mounting_tolerance")
    palm_reflectivity: float = expose(FingerParams, "fingers.palm_reflectivity")
    expected_radius: float = expose(ReflexParams, "reflex.ball_radius", minimum=0.005)

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
