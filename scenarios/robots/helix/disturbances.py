"""What may be wrong in a Helix handover: parameters of the scenario, and what they set on the units.

The thesis has none of them as a variable: all are this project's own. At the defaults the plant is as its units have
it, but for the clicks of the calibration.
"""

import enum
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.cosim.blocks.origins import assumed, derived
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.units import Metre, Number, Pixel, Radian, Second
from handover.plants.helix.arm.tendon_parameters import Params as ArmParams
from handover.plants.helix.cameras.camera_parameters import Params as CameraParams
from handover.plants.helix.hand.partner_parameters import Params as HandParams
from handover.scenarios.experiment.exposed import expose
from handover.scenarios.experiment.needs import any_of, parameter


class Cover(enum.IntEnum):
    """Which camera's lens is covered for a while."""

    NONE = 0
    LEFT = 1
    RIGHT = 2


@dataclass(frozen=True, kw_only=True)
class Disturbances:
    """What may be wrong with arm, hand, cameras and controller, each by itself."""

    arm_stiffness: Number = parameter(
        1.0,
        "stiffness of the arm's material over the usual one",
        minimum=0.3,
        maximum=3.0,
        origin=derived("undisturbed: the arm as it is"),
    )
    gripper_load: Number = parameter(
        1.0,
        "mass of the gripper over the usual one",
        minimum=0.1,
        maximum=4.0,
        origin=derived("undisturbed: the arm as it is"),
    )
    tremor: float = expose(HandParams, "hand.tremor_rms")
    drift: float = expose(HandParams, "hand.drift_rms")
    ball_mass: float = expose(HandParams, "hand.ball_mass")
    finger_friction: float = expose(HandParams, "hand.finger_friction")
    hand_force_max: float = expose(HandParams, "hand.force_max")
    help_speed: float = expose(HandParams, "hand.help_speed")
    guidance: float = expose(HandParams, "hand.guide_stiffness")
    move_azimuth: Radian = parameter(
        0.0,
        "turn about the arm's axis by which the hand moves on",
        minimum=-np.pi,
        maximum=np.pi,
        origin=derived("sec. 3.5.1: the hand holds the ball at one place"),
    )
    move_height: Metre = parameter(
        0.0,
        "rise by which the hand moves on",
        minimum=-0.5,
        maximum=0.5,
        origin=derived("sec. 3.5.1: the hand holds the ball at one place"),
    )
    move_from: float = expose(
        HandParams,
        "hand.move_from",
        start=4.0,
        maximum=600.0,
        description="time at which the hand moves on, if it does",
        origin=assumed("own choice: while the arm approaches"),
        needs=(any_of("move_azimuth", "move_height"),),
    )
    move_for: Second = parameter(
        2.0,
        "how long that takes",
        minimum=0.1,
        maximum=600.0,
        origin=assumed("own choice: an unhurried motion of a hand"),
        needs=(any_of("move_azimuth", "move_height"),),
    )
    click_noise: Pixel = parameter(
        0.5,
        "standard deviation of the calibration's clicks",
        minimum=0.0,
        maximum=50.0,
        origin=assumed("own choice: a careful click; sec. 3.2.2 says only that corners are selected in the pictures"),
    )
    box_height: Metre = parameter(
        -0.8,
        "height of the calibration box's middle in W",
        minimum=-3.0,
        maximum=1.0,
        origin=assumed("height of the box's middle in W, which stands below the arm, in both pictures"),
    )
    camera_turn: Radian = parameter(
        0.0,
        "angle by which the right camera was turned after calibration",
        minimum=-0.2,
        maximum=0.2,
        origin=derived("undisturbed: as calibrated"),
    )
    light: float = expose(CameraParams, "camera.light")
    sensor_noise: float = expose(CameraParams, "camera.noise")
    lost_pictures: float = expose(CameraParams, "camera.lost_pictures")
    covered_markers: int = expose(CameraParams, "camera.covered_markers")
    hide_from: Second = parameter(
        4.0,
        "time at which a card hides the ball, if it does",
        minimum=0.0,
        maximum=600.0,
        origin=assumed("own choice: while the arm approaches"),
        needs=(any_of("hide_for"),),
    )
    hide_for: Second = parameter(
        0.0,
        "how long a card hides the ball from left and right camera",
        minimum=0.0,
        maximum=600.0,
        origin=derived("undisturbed: no card"),
    )
    cover: Cover = parameter(
        Cover.NONE, "camera whose lens is covered for a while", origin=derived("undisturbed: no lens is covered")
    )
    cover_from: Second = parameter(
        4.0,
        "time at which the lens is covered",
        minimum=0.0,
        maximum=600.0,
        origin=assumed("own choice: while the arm approaches"),
        needs=(any_of("cover"),),
    )
    cover_for: Second = parameter(
        2.0,
        "how long the lens is covered",
        minimum=0.0,
        maximum=600.0,
        origin=assumed("own choice"),
        needs=(any_of("cover"),),
    )
    jitter: float = expose(ServoParams, "servo.jitter")

    def covered(self, side: Cover) -> tuple[float, float]:
        """Return from when until when a lens is covered, in seconds; (0, 0) where it is not."""
        return (self.cover_from, self.cover_from + self.cover_for) if self.cover is side else (0.0, 0.0)

    @property
    def moves(self) -> bool:
        """Whether the hand moves on during the approach."""
        return self.move_azimuth != 0.0 or self.move_height != 0.0

    def camera_values(self) -> dict[str, Any]:
        """Return what follows from them for the camera unit."""
        hidden = (self.hide_from, self.hide_from + self.hide_for) if self.hide_for > 0.0 else (0.0, 0.0)
        values: dict[str, Any] = {"hide_ball_from": hidden[0], "hide_ball_until": hidden[1]}
        for side in (Cover.LEFT, Cover.RIGHT):
            name = f"cover_{side.name.lower()}"
            values[f"{name}_from"], values[f"{name}_until"] = self.covered(side)
        return values

    def arm_values(self) -> dict[str, Any]:
        """Return what follows from them for the arm."""
        arm = vars(ArmParams())
        return {
            "EA": self.arm_stiffness * arm["EA"],
            "EI": self.arm_stiffness * arm["EI"],
            "gripper_mass": self.gripper_load * arm["gripper_mass"],
        }

    def hand_values(self, p_WO: Floats) -> dict[str, Any]:
        """Return what follows from them for the hand that offers the ball at p_WO, shape (3,), m."""
        a = self.move_azimuth
        turn = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
        return {
            "p_WO_0": p_WO,
            "p_WO_1": turn @ p_WO + np.array([0.0, 0.0, self.move_height]),
            "move_for": self.move_for if self.moves else 0.0,
        }
