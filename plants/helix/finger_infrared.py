"""Infrared distance sensors in the fingertips of the Helix's gripper, after the hand of [Luberto] sec. III and V-B.

The thesis's gripper has none: where they sit, where they look and what they see besides the ball is assumed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.origins import assumed
from handover.cosim.blocks.ports import Floats, Vector3, Vector4, Vector6, output, parameter, port
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, Number, Radian, Tick
from handover.plants.helix.gripper_fingers import FINGERS, finger_joints
from handover.plants.infrared_sensor import InvalidSensorParameters, SensorParameters

_RINGS = ((0.0, 1), (0.5, 6), (0.9, 12))
"""Rays of a beam: part of its half angle, and how many rays lie there around its axis."""
_WINDOW = 0.0042
"""Distance of a sensor's window from the middle of the fingertip, m: the link's radius."""


class InvalidInfraredParameters(InvalidParameters):
    """Values out of range, or a characteristic that cannot be inverted; `faults` lists all of them."""

    block = "FingerInfrared"


@dataclass(frozen=True, kw_only=True)
class Params(SensorParameters):
    """Sensors, ball and palm.

    [Luberto] states the operating range of the sensors, their converter (sec. V-B) and the form of their
    characteristic, eq. (11). All else is assumed, the characteristic's coefficients too.
    """

    beam: Radian = parameter(
        0.35,
        "half the opening angle of a sensor's beam",
        minimum=0.0,
        maximum=0.7,
        origin=assumed(
            "small reflective sensors have half their intensity some 20 degrees off; one with less misses "
            "a ball beside the axis"
        ),
    )
    across: Radian = parameter(
        -0.23,
        "angle of the first sensor's beam from the normal of the finger's last link, towards its tip",
        minimum=-1.5,
        maximum=1.5,
        origin=assumed("of open fingers the beam then goes square across to the gripper's axis"),
    )
    ahead: Radian = parameter(
        0.47,
        "angle of the second sensor's beam from that normal",
        minimum=-1.5,
        maximum=1.5,
        origin=assumed(
            "of open fingers the beam then points 40 degrees ahead: to the middle of a ball that is 50 mm "
            "before the gripper"
        ),
    )
    ball_radius: Metre = parameter(
        0.025, "radius of the ball", minimum=0.001, maximum=0.1, origin=assumed("as the cameras see it")
    )
    ball_reflectivity: Number = parameter(
        1.0,
        "reflectivity of the ball over that of the surface the sensors were characterised with",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("that of the surface the sensors were characterised with"),
    )
    palm_radius: Metre = parameter(
        0.045,
        "how far the palm reaches from its middle",
        minimum=0.0,
        maximum=0.2,
        origin=assumed("as the hand touches"),
    )
    palm_height: Metre = parameter(
        0.015,
        "height of the palm's surface over its middle, as the input gives that",
        minimum=-0.1,
        maximum=0.1,
        origin=assumed("the ball, whose middle is 40 mm over the palm's middle, lies on it"),
    )
    palm_reflectivity: Number = parameter(
        0.6,
        "reflectivity of the palm over the reference's",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("skin returns some six tenths of what a white card does in the near infrared"),
    )
    tolerance: Number = parameter(
        0.05,
        "standard deviation of a sensor's gain from that of the characteristic",
        minimum=0.0,
        maximum=0.5,
        origin=assumed("parts of one make differ by some percent after calibration of one of them"),
    )
    range_tolerance: Number = parameter(
        0.05,
        "standard deviation of the distance at which a sensor reads what the characteristic says, as a part of it",
        minimum=0.0,
        maximum=0.3,
        origin=assumed("parts of one make differ by some percent after calibration of one of them"),
    )
    mounting_tolerance: Radian = parameter(
        0.03,
        "standard deviation of a beam's direction, along the finger and to its side",
        minimum=0.0,
        maximum=0.3,
        origin=assumed("small parts that are glued into a printed finger are off by a degree or two"),
    )
    noise: Tick = parameter(
        4.0,
        "standard deviation of a reading",
        minimum=0.0,
        maximum=1000.0,
        origin=assumed("as the infrared grasp's"),
    )
    seed: int = parameter(0, "seed of gains, ranges, mounting and noise", minimum=0)

    def check(self) -> None:
        """Raise InvalidInfraredParameters, with all faults."""
        faults = parameter_faults(self)
        if not faults:
            try:
                self.sensor()
            except InvalidSensorParameters as error:
                faults.extend(error.faults)
        if faults:
            raise InvalidInfraredParameters(faults)


@dataclass(kw_only=True)
class Inputs:
    """Where gripper, ball and palm are."""

    p_WG: Vector3[Metre] = port(np.array([0.0, 0.0, -0.7]), "position of the gripper in the world")
    q_WG: Vector4[Number] = port(np.array([0.0, 1.0, 0.0, 0.0]), "orientation of the gripper in the world")
    grip: Number = port(0.0, "closure of the gripper: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    p_WO: Vector3[Metre] = port(np.array([0.18, 0.0, -0.62]), "position of the ball in the world")
    p_WH: Vector3[Metre] = port(np.array([0.18, 0.0, -0.66]), "position of the middle of the palm in the world")


@dataclass(kw_only=True)
class Outputs:
    """What the converters read."""

    ticks: Vector6[Tick] = output(
        "reading of the sensors that look across, one a finger, then of those that look ahead"
    )


class FingerInfrared:
    """Two sensors in each of three fingertips: one looks across to the gripper's axis, one ahead to what it comes to.

    A sensor's beam is a bundle of rays about an axis that is fixed in the finger's last link, so that it turns as the
    finger closes. A ray meets the ball, the palm (a disc that faces up), or nothing; fingers do not see each other. The
    reading is the mean over the rays of `InfraredSensor.ticks`, since returned intensities add up, times the sensor's
    own gain, plus noise, rounded. Each sensor differs from the design by its gain, its range and the way it is mounted.
    With range s it reads at s y what the characteristic gives for y. All are read in one round, one being active at a
    time ([Luberto] sec. V-B); that gripper and ball move within the round, which takes 30 ms, is left out.

    Raises:
        InvalidInfraredParameters: by the constructor, for parameters out of range or a characteristic that does not
            fall strictly or does not cover the sensors' range.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"ticks": ("p_WG", "q_WG", "grip", "p_WO", "p_WH")}
    terminals: ClassVar[tuple[Terminal, ...]] = (terminal("gripper", TerminalKind.POSE, "p_WG", "q_WG"),)
    period: ClassVar[Fraction | None] = Fraction(3, 100)

    def __init__(self, params: Params) -> None:
        params.check()
        self._params = params
        self._sensor = params.sensor()
        self._rng = np.random.default_rng(params.seed)
        self._gain = np.maximum(1.0 + params.tolerance * self._rng.standard_normal(2 * FINGERS), 0.0)
        build = np.random.default_rng([params.seed, 0xB01D])
        self._range = np.maximum(1.0 + params.range_tolerance * build.standard_normal(2 * FINGERS), 0.1)
        self._turned = params.mounting_tolerance * build.standard_normal((2 * FINGERS, 2))
        self._noise = self._draw()

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return readings of this instant with the noise of the present round."""
        noisy = self._gain * self._ideal(u) + self._noise
        return Outputs(ticks=np.array([self._sensor.reading(x) for x in noisy.tolist()]))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Read all sensors once."""
        self._noise = self._draw()
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return the generator's state and the noise of the present round; gains follow from the seed."""
        return pack_state((self._rng.bit_generator, self._noise))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        saved: Any = unpack_state(state)
        self._rng.bit_generator.state, self._noise = saved

    def _draw(self) -> Floats:
        return self._params.noise * self._rng.standard_normal(2 * FINGERS)

    def _ideal(self, u: Inputs) -> Floats:
        """Return noise-free, unrounded ticks of sensors with the characteristic's gain, shape (6,)."""
        p = self._params
        window, rays = beams(u.p_WG, rotation_of(u.q_WG), u.grip, (p.across, p.ahead), p.beam, self._turned)
        ball, ball_cosine = _distance_of_ball(window, rays, u.p_WO, p.ball_radius)
        palm, palm_cosine = _distance_of_palm(window, rays, u.p_WH + np.array([0.0, 0.0, p.palm_height]), p.palm_radius)
        is_ball = ball <= palm
        met = (
            np.where(is_ball, ball, palm) / self._range[:, None],
            np.where(is_ball, ball_cosine, palm_cosine),
            np.where(is_ball, p.ball_reflectivity, p.palm_reflectivity),
        )
        ticks = np.zeros(rays.shape[:2])
        for i, j in np.argwhere(met[0] <= p.farthest).tolist():
            ticks[i, j] = self._sensor.ticks(*(float(x[i, j]) for x in met))
        return ticks.mean(axis=1)


def beams(
    p_WG: Floats,
    R_WG: Floats,
    grip: float,
    angles: tuple[float, float],
    half_angle: float,
    turned: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Return windows, shape (6, 1, 3), m, and rays, unit vectors of shape (6, rays, 3), of all sensors in W.

    Args:
        p_WG: position of the gripper, shape (3,), m.
        R_WG: its orientation, shape (3, 3).
        grip: its closure.
        angles: of the beams that look across and ahead, from the normal of the last link towards its tip, rad.
        half_angle: half the opening angle of a beam, rad.
        turned: how far each beam is turned from there, shape (6, 2), rad: towards the tip, then to the finger's side;
            None: not at all.
    """
    turned = np.zeros((2 * FINGERS, 2)) if turned is None else turned
    _, middle, tip = np.moveaxis(finger_joints(p_WG, R_WG, grip), 1, 0)
    along = _unit(tip - middle)
    z = R_WG[:, 2]
    outwards = _unit((tip - p_WG) - ((tip - p_WG) @ z)[:, None] * z)
    normal = -_unit(outwards - np.sum(outwards * along, axis=1, keepdims=True) * along)
    design = np.repeat(angles, FINGERS)
    c, s = np.cos(design + turned[:, 0])[:, None], np.sin(design + turned[:, 0])[:, None]
    axis = c * np.tile(normal, (2, 1)) + s * np.tile(along, (2, 1))
    side = np.tile(np.cross(along, normal), (2, 1))
    c, s = np.cos(turned[:, 1])[:, None], np.sin(turned[:, 1])[:, None]
    axis, side = c * axis + s * side, c * side - s * axis
    up = np.cross(axis, side)
    rays: list[Floats] = []
    for part, count in _RINGS:
        angle = part * half_angle
        for turn in (2.0 * np.pi * np.arange(count) / count).tolist():
            off = np.cos(turn) * side + np.sin(turn) * up
            rays.append(np.cos(angle) * axis + np.sin(angle) * off)
    return (np.tile(tip, (2, 1)) + _WINDOW * axis)[:, None], np.stack(rays, axis=1)


def _unit(v: Floats) -> Floats:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _distance_of_ball(window: Floats, rays: Floats, p_WO: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return where rays meet the ball, m from their windows (inf: nowhere), and the cosine of their incidence."""
    from_ball = window - p_WO
    ahead = -np.sum(rays * from_ball, axis=2)
    square = ahead**2 - np.sum(from_ball**2, axis=2) + radius**2
    meets = (ahead > 0.0) & (square > 0.0)
    half_chord = np.sqrt(np.where(meets, square, 0.0))
    return np.where(meets, np.maximum(ahead - half_chord, 0.0), np.inf), half_chord / radius


def _distance_of_palm(window: Floats, rays: Floats, p_WP: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return where rays that go down meet a disc about p_WP that faces up, likewise."""
    down = -rays[:, :, 2]
    goes_down = down > 1e-9
    distance = np.where(goes_down, (window[:, :, 2] - p_WP[2]) / np.where(goes_down, down, 1.0), np.inf)
    beside = window[:, :, :2] + np.where(goes_down, distance, 0.0)[:, :, None] * rays[:, :, :2] - p_WP[:2]
    meets = goes_down & (distance >= 0.0) & (np.sum(beside**2, axis=2) <= radius**2)
    return np.where(meets, distance, np.inf), np.where(meets, down, 0.0)
