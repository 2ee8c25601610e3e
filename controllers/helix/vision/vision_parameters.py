"""Parameters of the Helix's vision; apart from its detectors, which take OpenCV, so that they are listed at once."""

import enum
from dataclasses import dataclass

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.cameras import CamerasAndMarkers
from handover.cosim.blocks.origins import assumed, derived, stated
from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import Metre, MetrePerSecond, Pixel, RadianPerSecond


class InvalidVisionParameters(InvalidParameters):
    """Parameters out of range; `faults` lists all of them."""

    block = "HandoverVision"


class Detector(enum.IntEnum):
    """How ball and wrist are found."""

    JOINT = 0
    PUBLISHED = 1


@dataclass(frozen=True, kw_only=True)
class Params(CamerasAndMarkers):
    """Calibration of the cameras, sizes of what is looked for, and noise."""

    detector: Detector = parameter(
        Detector.JOINT,
        "how ball and wrist are found: one fit to all that the cameras see, or the thesis's averages",
        origin=assumed(
            "one fit to all that both cameras see; the thesis's own (sec. 3.2.3 and 3.2.4) is detector=published"
        ),
    )
    d_gripper: Metre = parameter(
        0.10,
        "distance of the gripper from the wrist, eq. (13)",
        minimum=0.0,
        maximum=0.5,
        origin=stated("sec. 3.2.4, appendix A"),
    )
    corner_noise: Pixel = parameter(
        0.2,
        "standard deviation of a marker's corners",
        minimum=0.001,
        maximum=5.0,
        origin=assumed("own choice: of refined corners in pictures with such noise and blur"),
    )
    corner_shift: Pixel = parameter(
        0.24,
        "how far refined corners lie inside of the printed ones, along the diagonal",
        minimum=-2.0,
        maximum=2.0,
        origin=derived("python -m handover.scenarios.robots.helix.calibrate_detector"),
    )
    outline_noise: Pixel = parameter(
        0.08,
        "standard deviation of the ball's outline",
        minimum=0.001,
        maximum=10.0,
        origin=assumed("own choice: of the ball's outline in pictures with such noise and blur"),
    )
    edge_shift: Pixel = parameter(
        -0.005,
        "mean shift of the ball's edge outwards",
        minimum=-3.0,
        maximum=3.0,
        origin=derived("python -m handover.scenarios.robots.helix.calibrate_detector"),
    )
    edge_doubt: Pixel = parameter(
        0.04,
        "standard deviation of the edge's shift",
        minimum=0.001,
        maximum=3.0,
        origin=assumed("own choice: by light and surroundings the edge's shift differs so much"),
    )
    corner_tolerance: Pixel = parameter(
        1.2,
        "RMS misfit beyond which a marker is left out",
        minimum=0.1,
        maximum=20.0,
        origin=assumed("own choice: six times corner_noise"),
    )
    ray_tolerance: Metre = parameter(
        0.012,
        "largest distance between the cameras' rays to the ball",
        minimum=0.0,
        origin=assumed("own choice: half of the ball's radius"),
    )
    largest_speed: MetrePerSecond = parameter(
        0.5,
        "speed of the wrist beyond which a pose contradicts the last one",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("own choice: faster than the arm swings"),
    )
    largest_turn: RadianPerSecond = parameter(
        2.0,
        "rate of turn of the wrist beyond which a pose contradicts the last one",
        minimum=0.0,
        maximum=1000.0,
        origin=assumed("own choice: faster than the arm turns the wrist"),
    )
    largest_deviation: Metre = parameter(
        0.005,
        "expected error of the wrist beyond which a pose is worth nothing",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("own choice: a fifth of the ball's radius"),
    )
    decimation: int = parameter(
        1,
        "use every n-th of the 30 pairs of pictures a second",
        minimum=1,
        maximum=300,
        origin=assumed("every picture is taken; scenarios set it"),
    )

    def check(self) -> None:
        """Raise InvalidVisionParameters, with all faults, if values are out of range."""
        faults = parameter_faults(self)
        if faults:
            raise InvalidVisionParameters(faults)
