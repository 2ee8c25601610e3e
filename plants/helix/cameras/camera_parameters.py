"""Parameters of the Helix's cameras; apart from these, which take OpenCV, so that they are listed at once."""

from dataclasses import dataclass

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.cameras import CamerasAndMarkers
from handover.cosim.blocks.origins import assumed, derived
from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import Levels, Metre, Number, Pixel, Second
from handover.plants.helix.hand.bowl import BowlParameters

_UNCOVERED = derived("undisturbed: no lens is covered")


class InvalidCameraParameters(InvalidParameters):
    """Parameters out of range, or of what is taken away before it is there; `faults` lists all of them."""

    block = "StereoCamera"


@dataclass(frozen=True, kw_only=True)
class Params(CamerasAndMarkers, BowlParameters):
    """Calibration, optics and the visible things' sizes.

    [Vervloet2025] states where the cameras stand, about: side by side, behind the arm, at the gripper's height, and the
    markers' side. All other values are assumed.
    """

    arm_radius: Metre = parameter(
        0.030,
        "radius of the soft arm",
        minimum=0.001,
        maximum=0.1,
        origin=assumed("somewhat less than apothem: figs. 4 and 5 show an octagonal ring somewhat wider than the arm"),
    )
    blur: Pixel = parameter(
        0.7,
        "standard deviation of the lenses' blur",
        minimum=0.0,
        maximum=5.0,
        origin=assumed("own choice: a webcam's size of blur"),
    )
    noise: Levels = parameter(
        2.2,
        "standard deviation of the sensors' noise",
        minimum=0.0,
        maximum=60.0,
        origin=assumed("own choice: a webcam's size of noise, of 255 levels"),
    )
    gradient: Number = parameter(
        0.22,
        "relative brightness of lit corner over unlit one",
        minimum=0.0,
        maximum=0.5,
        origin=assumed("own choice: a room is not lit evenly"),
    )
    cover_left_from: Second = parameter(
        0.0, "time at which a cloth covers the left lens", minimum=0.0, origin=_UNCOVERED
    )
    cover_left_until: Second = parameter(
        0.0, "time at which the left lens is free again", minimum=0.0, origin=_UNCOVERED
    )
    cover_right_from: Second = parameter(
        0.0, "time at which a cloth covers the right lens", minimum=0.0, origin=_UNCOVERED
    )
    cover_right_until: Second = parameter(
        0.0, "time at which the right lens is free again", minimum=0.0, origin=_UNCOVERED
    )
    light: Number = parameter(
        1.0,
        "brightness of the scene over the usual one",
        minimum=0.0,
        maximum=5.0,
        origin=derived("the usual brightness, by definition"),
    )
    lost_pictures: Number = parameter(
        0.0,
        "part of the pictures that arrive black",
        minimum=0.0,
        maximum=1.0,
        origin=derived("undisturbed: every picture arrives"),
    )
    decimation: int = parameter(
        1,
        "take every n-th of the 30 pictures a second",
        minimum=1,
        maximum=300,
        origin=assumed("every picture is taken; scenarios set it"),
    )
    covered_markers: int = parameter(
        0,
        "markers of each ring with tape over them, those that face the cameras as the arm hangs first",
        minimum=0,
        maximum=8,
        origin=derived("undisturbed: no tape"),
    )
    hide_ball_from: Second = parameter(
        0.0,
        "time at which a card is held between the ball and the cameras",
        minimum=0.0,
        origin=derived("undisturbed: no card"),
    )
    hide_ball_until: Second = parameter(
        0.0, "time at which the card is taken away", minimum=0.0, origin=derived("undisturbed: no card")
    )
    cover_within: Metre = parameter(
        0.0,
        "distance of gripper and ball from which on, once it came so near, cloths cover all lenses; 0: never",
        minimum=0.0,
        maximum=1.0,
        origin=_UNCOVERED,
    )
    hide_ball_within: Metre = parameter(
        0.0,
        "distance of gripper and ball from which on a card hides the ball; 0: never",
        minimum=0.0,
        maximum=1.0,
        origin=derived("undisturbed: no card"),
    )
    seed: int = parameter(0, "seed of the noise", minimum=0)

    def check(self) -> None:
        """Raise InvalidCameraParameters, with all faults, if values are out of range or contradict each other."""
        faults = parameter_faults(self) or [
            f"{what}_until = {end:g} s must not be before {what}_from = {start:g} s"
            for what, (start, end) in self.covers.items()
            if end < start
        ]
        if faults:
            raise InvalidCameraParameters(faults)

    @property
    def covers(self) -> dict[str, tuple[float, float]]:
        """From when until when the left and the right lens are covered and the ball is hidden, s, by parameter."""
        return {
            "cover_left": (self.cover_left_from, self.cover_left_until),
            "cover_right": (self.cover_right_from, self.cover_right_until),
            "hide_ball": (self.hide_ball_from, self.hide_ball_until),
        }
