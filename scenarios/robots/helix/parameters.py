"""Parameters of the Helix handover."""

import enum
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.controllers.helix.vision.vision_parameters import Detector
from handover.controllers.helix.vision.vision_parameters import Params as VisionParams
from handover.cosim.blocks.cameras import CamerasAndMarkers
from handover.cosim.blocks.origins import assumed, derived, stated
from handover.cosim.blocks.ports import Floats, parameter
from handover.cosim.blocks.units import Metre, Radian, Second
from handover.plants.helix.cameras.camera_parameters import Params as CameraParams
from handover.scenarios.experiment.exposed import expose
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.robots.helix.cameras import CameraPlaces
from handover.scenarios.robots.helix.disturbances import Disturbances

PUSHES = (Pushable(labels=("gripper",), unit="arm", force="f_P", point=None, greatest=0.5),)
"""A person may push the gripper; the soft arm yields some centimetres to the greatest force (assumed)."""
CAMERA_PERIOD = Fraction(1, 30)
"""Period of the cameras, s."""


class HandPlace(enum.IntEnum):
    """Where the hand is, seen from the cameras behind the arm. [Vervloet2025] sec. 3.5.1."""

    FRONT = 0
    FRONT_LEFT = 1
    LEFT = 2
    BACK_LEFT = 3

    @property
    def azimuth(self) -> float:
        """Direction from the arm's axis in W, rad, from +x (away from the cameras) towards +y (their left)."""
        return float(np.pi / 4 * self)


class Tuning(enum.IntEnum):
    """Sets of the controller's parameters; `paper.toml` lists their values."""

    OWN = 0
    THESIS = 1


class Filters(enum.IntEnum):
    """Whose filters of the measurements the controller has."""

    TUNED = 0
    THESIS = 1
    OWN = 2


class StepRule(enum.IntEnum):
    """How large a control step is. [Vervloet2025] sec. 5.4.4."""

    CONSTANT = 0
    BY_ERROR = 1


class BoundRule(enum.IntEnum):
    """How far the estimated state's pose may be from the measured one. [Vervloet2025] sec. 5.4.3."""

    CONSTANT = 0
    BY_COVARIANCE = 1


class WeightRule(enum.IntEnum):
    """How much the estimated state is held to the commanded one. [Vervloet2025] sec. 5.4.3."""

    CONSTANT = 0
    BY_STATE = 1


_FILTERS = ("filter_pictures", "use_covariance", "predict_motion", "gate", "Q_ball", "Q_wrist", "Q_direction")


def settings_of(tuning: Tuning) -> dict[str, Any]:
    """Return the controller's parameters of a tuning: what the thesis has, and for ours the defaults."""
    thesis = paper_values("helix", "thesis")
    return thesis if tuning is Tuning.THESIS else {name: getattr(ServoParams(), name) for name in thesis}


@dataclass(frozen=True, kw_only=True)
class Task:
    """Where the ball is offered, what the wrist carries, and how detector and controller are set."""

    alpha: float = expose(ServoParams, "servo.alpha", minimum=0.01)
    place: HandPlace = parameter(
        HandPlace.FRONT, "where the hand offers the ball", origin=assumed("sec. 3.5.1: the first of its places")
    )
    azimuth: Radian = parameter(
        0.0,
        "turn of the offered ball about the arm's axis from that place, to the left",
        minimum=-np.pi,
        maximum=np.pi,
        origin=derived("sec. 3.5.1: at the place itself"),
    )
    radius: Metre = parameter(
        0.16,
        "distance of the offered ball from the arm's axis",
        minimum=0.0,
        maximum=2.0,
        origin=assumed(
            "distance of the offered ball from the arm's axis; fig. 9 has the gripper 0.16 m from its start at the end"
        ),
    )
    height: Metre = parameter(
        -0.6,
        "height of the offered ball in W",
        minimum=-1.1,
        maximum=0.0,
        origin=assumed(
            "height of the offered ball in W, 10 cm above the hanging gripper; figs. 4 and 6 show it "
            "between wrist and gripper"
        ),
    )
    control_period: float = expose(ServoParams, "servo.control_period", minimum=0.1, maximum=10.0)
    threshold: float = expose(ServoParams, "servo.threshold", minimum=0.001, maximum=0.08)
    tuning: Tuning = parameter(
        Tuning.OWN,
        "bounds and weights of the controller: ours, or the thesis's",
        origin=assumed("own choice: our settings; the thesis's are tuning=thesis"),
    )
    filters: Filters = parameter(
        Filters.TUNED,
        "filters of the measurements: those of the tuning, the thesis's, or ours",
        origin=assumed("own choice: the filters of the tuning"),
    )
    step_rule: StepRule = parameter(
        StepRule.CONSTANT,
        "step size: alpha, or growing from it with the error",
        origin=stated("sec. 5.4.4: the step sizes were constant"),
    )
    bound_rule: BoundRule = parameter(
        BoundRule.CONSTANT,
        "bound of the estimate's pose: that of the tuning, or the filtered pose's deviation",
        origin=stated("sec. 5.4.3: epsilon_pose_bound is a fixed value"),
    )
    weight_rule: WeightRule = parameter(
        WeightRule.CONSTANT,
        "weights of the estimate: those of the tuning, or less where segments are long and bent",
        origin=stated("sec. 5.4.3: A_pose_upd is fixed"),
    )
    cameras: CameraPlaces = parameter(
        CameraPlaces.BEHIND,
        "two behind the arm, the right one of them above or at the side instead, or a third one above",
        origin=stated("sec. 3.2.1: beside each other, behind the arm"),
    )
    detector: Detector = expose(VisionParams, "vision.detector")
    marker: float = expose(CamerasAndMarkers, "camera.marker", "vision.marker")
    rings: int = expose(CamerasAndMarkers, "camera.rings", "vision.rings")
    decimation: int = expose(
        CameraParams,
        "camera.decimation",
        "vision.decimation",
        start=3,
        maximum=30,
        origin=assumed("own choice: ten pictures a second, five in a control period"),
    )
    patience: Second = parameter(
        60.0,
        "time by which the gripper must begin to close",
        minimum=1.0,
        maximum=600.0,
        origin=assumed("own choice: of the thesis's runs with alpha 0.2 and 0.4 the slowest took 57.6 s (table 1)"),
    )


@dataclass(frozen=True, kw_only=True)
class Parameters(Disturbances, Task):
    """One handover, and what is wrong in it."""

    @property
    def p_WO(self) -> Floats:
        """Position of the offered ball in W, shape (3,), m."""
        a = self.place.azimuth + self.azimuth
        return np.array([self.radius * np.cos(a), self.radius * np.sin(a), self.height])

    @property
    def period(self) -> Fraction:
        """The controller's period as an exact number of milliseconds."""
        return Fraction(round(self.control_period * 1000), 1000)

    @property
    def settings(self) -> dict[str, Any]:
        """The controller's parameters of the tuning and the filters."""
        values = settings_of(self.tuning)
        if self.filters is not Filters.TUNED:
            filters = settings_of(Tuning[self.filters.name])
            values |= {name: filters[name] for name in _FILTERS}
        if self.bound_rule is BoundRule.BY_COVARIANCE:
            values["bound_by_covariance"] = True
        if self.weight_rule is WeightRule.BY_STATE:
            values["weight_fall"] = paper_values("helix", "experiment")["weight_fall"]
        return values

    @property
    def picture_period(self) -> Fraction:
        """Time between two pictures that are taken, s."""
        return self.decimation * CAMERA_PERIOD
