"""Parameters of the Helix handover; origins of the defaults are in `paper.toml`."""

import enum
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from handover.controllers.helix.vision.vision_parameters import Detector
from handover.cosim.blocks.ports import Floats, parameter
from handover.cosim.blocks.units import Metre, Number, Radian, Second
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.helix.cameras import CameraPlaces
from handover.scenarios.helix.disturbances import Disturbances

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


@dataclass(frozen=True, kw_only=True)
class Task:
    """Where the ball is offered, what the wrist carries, and how detector and controller are set."""

    alpha: Number = parameter(0.25, "step size of the Jacobian control, eq. (21)", minimum=0.01, maximum=1.0)
    place: HandPlace = parameter(HandPlace.FRONT, "where the hand offers the ball")
    azimuth: Radian = parameter(
        0.0, "turn of the offered ball about the arm's axis from that place, to the left", minimum=-np.pi, maximum=np.pi
    )
    radius: Metre = parameter(0.16, "distance of the offered ball from the arm's axis", minimum=0.0, maximum=2.0)
    height: Metre = parameter(-0.6, "height of the offered ball in W", minimum=-1.1, maximum=0.0)
    control_period: Second = parameter(0.5, "period of the controller", minimum=0.1, maximum=10.0)
    threshold: Metre = parameter(0.05, "error at which the arm descends onto the ball", minimum=0.001, maximum=0.08)
    tuning: Tuning = parameter(Tuning.OWN, "bounds and weights of the controller: ours, or the thesis's")
    filters: Filters = parameter(
        Filters.TUNED, "filters of the measurements: those of the tuning, the thesis's, or ours"
    )
    step_rule: StepRule = parameter(StepRule.CONSTANT, "step size: alpha, or growing from it with the error")
    bound_rule: BoundRule = parameter(
        BoundRule.CONSTANT,
        "bound of the estimate's pose: that of the tuning, or the filtered pose's deviation",
    )
    weight_rule: WeightRule = parameter(
        WeightRule.CONSTANT, "weights of the estimate: those of the tuning, or less where segments are long and bent"
    )
    cameras: CameraPlaces = parameter(
        CameraPlaces.BEHIND,
        "two behind the arm, the right one of them above or at the side instead, or a third one above",
    )
    detector: Detector = parameter(
        Detector.JOINT, "how ball and wrist are found: one fit to all that the cameras see, or the thesis's averages"
    )
    marker: Metre = parameter(0.02, "side of the wrist's markers", minimum=0.005, maximum=0.05)
    rings: int = parameter(1, "rings of markers: a second one sits above the first", minimum=1, maximum=2)
    decimation: int = parameter(3, "of 30 pictures a second, every so many-th is taken", minimum=1, maximum=30)
    patience: Second = parameter(60.0, "time by which the gripper must begin to close", minimum=1.0, maximum=600.0)


@dataclass(frozen=True, kw_only=True)
class Parameters(Disturbances, Task):
    """One handover, and what is amiss in it."""

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
        values = dict(paper_values("helix", self.tuning.name.lower()))
        if self.filters is not Filters.TUNED:
            values |= {name: paper_values("helix", self.filters.name.lower())[name] for name in _FILTERS}
        if self.bound_rule is BoundRule.BY_COVARIANCE:
            values["bound_by_covariance"] = True
        if self.weight_rule is WeightRule.BY_STATE:
            values["weight_fall"] = paper_values("helix", "experiment")["weight_fall"]
        return values

    @property
    def picture_period(self) -> Fraction:
        """Time between two pictures that are taken, s."""
        return self.decimation * CAMERA_PERIOD
