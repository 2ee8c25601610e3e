"""Infrared reflex of the Helix's gripper: fingers correct where the servo takes the ball to be, after [Luberto]."""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from handover.controllers.helix.reflex.finger_model import FingerModel
from handover.controllers.helix.reflex.offset_filter import Doubts, OffsetFilter
from handover.controllers.helix.servo.arm_motion import FirstOrderLag, Response
from handover.controllers.helix.servo.constant_curvature import W_FROM_B, linearise, orientation, state_of
from handover.controllers.helix.servo.servo_parameters import Inputs as Measurements
from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, stated
from handover.cosim.blocks.ports import Floats, Matrix3, Vector3, Vector6, Vector9, output, parameter, port
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, Number, PerTick, Radian, Second, SquareMetre, Tick

_CHARACTERISED = assumed("what the sensors were characterised with")

__all__ = ["GraspReflex", "Inputs", "InvalidGraspReflexParameters", "Outputs", "Params", "Source"]

_RESPONSE_MEMORY = 1.5  # s; as the servo's (assumed)
_RECKONED = 1e-6
"""Variance of wrist and gripper by dead reckoning, m2 (assumed): what is not known of them is the ball's, which is
found from them."""
_LEVEL = np.array([1.0, 1.0, 0.0])
"""Directions in W in which the arm makes a part of its commanded motion alone, as it gives way in bending. In depth,
which its tendons' lengths set, it makes all of it: of 45 mm down 44 to 48, of as much across 18 to 30."""
_Q_CALIB = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.24, 0.0, 0.0, 0.24])


class InvalidGraspReflexParameters(InvalidParameters):
    """Values out of range, or a characteristic that does not fall; `faults` lists all of them."""

    block = "GraspReflex"


class InvalidReading(InvalidParameters):
    """An input that is not a number; `faults` names all of them."""

    block = "GraspReflex"


class Source(enum.IntEnum):
    """By what the ball is known: nothing, cameras, cameras and fingers, motors alone, motors and fingers."""

    NONE = 0
    CAMERAS = 1
    CAMERAS_AND_FINGERS = 2
    MOTORS = 3
    MOTORS_AND_FINGERS = 4


@dataclass(frozen=True, kw_only=True)
class Params:
    """The controller's own model of arm, fingers and sensors, and its doubts; all assumed."""

    feels: bool = parameter(
        True,
        "correct the goal by what the fingers read; false: cameras and motors alone",
        origin=assumed("what the scenario is for"),
    )
    a: Metre = parameter(
        0.062, "a of the characteristic y = a exp(b x) + c exp(d x)", minimum=1e-6, maximum=1.0, origin=_CHARACTERISED
    )
    b: PerTick = parameter(-0.0030, "b of the characteristic", minimum=-0.1, maximum=-1e-9, origin=_CHARACTERISED)
    c: Metre = parameter(0.022, "c of the characteristic", minimum=1e-6, maximum=1.0, origin=_CHARACTERISED)
    d: PerTick = parameter(-0.00043, "d of the characteristic", minimum=-0.1, maximum=-1e-9, origin=_CHARACTERISED)
    nearest: Metre = parameter(
        0.004,
        "distance of the largest reading",
        minimum=1e-4,
        maximum=0.1,
        origin=stated("[Luberto] sec. V-B: 4 to 65 mm"),
    )
    farthest: Metre = parameter(
        0.065,
        "distance beyond which nothing is seen",
        minimum=1e-3,
        maximum=0.15,
        origin=stated("[Luberto] sec. V-B: 4 to 65 mm"),
    )
    contact: Number = parameter(
        0.4,
        "share of the largest reading that is left at contact",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("own: such sensors' readings fall below their operating range; how far is assumed"),
    )
    beam: Radian = parameter(
        0.35, "half the opening angle of a sensor's beam", minimum=0.0, maximum=0.7, origin=assumed("own, assumed")
    )
    across: Radian = parameter(
        -0.23,
        "angle of the first sensor's beam from the normal of the finger's last link, towards its tip",
        minimum=-1.5,
        maximum=1.5,
        origin=assumed("as built"),
    )
    ahead: Radian = parameter(
        0.47,
        "angle of the second sensor's beam from that normal",
        minimum=-1.5,
        maximum=1.5,
        origin=assumed("as built"),
    )
    ball_radius: Metre = parameter(
        0.025, "expected radius of the ball", minimum=0.001, maximum=0.1, origin=assumed("known, as to the cameras")
    )
    palm_radius: Metre = parameter(
        0.045,
        "how far the palm under the ball is expected to reach",
        minimum=0.0,
        maximum=0.2,
        origin=assumed("an open hand's"),
    )
    palm_reflectivity: Number = parameter(
        0.6,
        "expected reflectivity of the palm over the reference's; 0: there is none",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("skin, in the near infrared"),
    )
    ticks_min: Tick = parameter(
        20.0,
        "reading from which on a sensor sees",
        minimum=1.0,
        maximum=4095.0,
        origin=assumed("five standard deviations of a reading's noise"),
    )
    sensors_min: int = parameter(
        2,
        "sensors that must see before readings are taken in",
        minimum=1,
        maximum=6,
        origin=assumed("of one sensor's reading no direction follows"),
    )
    near: Metre = parameter(
        0.12,
        "distance of ball and gripper within which it is reckoned on where cameras fail",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("the gripper's fingers reach the ball from there, as its hand's model has it"),
    )
    lost: Metre = parameter(
        0.04,
        "standard deviation of the offset at which a ball that cameras do not see is lost",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("more than open fingers leave room for"),
    )
    slip: Number = parameter(
        0.3,
        "doubt of the gripper's motion, as a part of the commanded one",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("by what the arm makes of commands far out, where tendons are slack: 0.3 to 1"),
    )
    wander: Metre = parameter(
        0.003,
        "doubt of the offset after a second in which nothing is commanded",
        minimum=1e-6,
        maximum=0.1,
        origin=assumed("the hand's drift, and the arm's sway"),
    )
    bias: Metre = parameter(
        0.002,
        "doubt of the cameras' offset of ball and gripper",
        minimum=1e-6,
        maximum=0.1,
        origin=assumed("calibration by clicks of half a pixel"),
    )
    brightness: Number = parameter(
        0.3,
        "doubt of the logarithms of the reflectivities of ball and palm",
        minimum=1e-6,
        maximum=3.0,
        origin=assumed("a factor of 1.35 either way"),
    )
    reading: Number = parameter(
        0.1,
        "doubt of a reading, as a part of it",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("gains, incidence, and what else returns light"),
    )
    noise: Tick = parameter(
        4.0, "standard deviation of a reading", minimum=0.1, maximum=1000.0, origin=assumed("as the converter's")
    )
    memory: Second = parameter(
        0.5,
        "time for which errors of readings stay alike",
        minimum=0.0,
        maximum=60.0,
        origin=assumed("of gains for good, of the rest as long as the arm's half swing"),
    )
    d_gripper: Metre = parameter(
        0.10, "distance of wrist and gripper", minimum=1e-3, maximum=1.0, origin=stated("sec. 3.2.4, appendix A")
    )
    d_tendon: Metre = parameter(
        0.035,
        "distance of the tendons from the arm's axis",
        minimum=1e-3,
        maximum=0.5,
        origin=assumed("not given: radius on which the tendons lie"),
    )
    l_calib: Vector3[Metre] = parameter(
        np.array([0.12, 0.24, 0.24]),
        "segment lengths after calibration",
        minimum=1e-3,
        maximum=2.0,
        origin=stated("sec. 3.1"),
    )
    response_time: Second = parameter(
        0.15,
        "time in which most of a commanded motion comes",
        minimum=0.001,
        origin=assumed("own choice: about the lag of motors and arm"),
    )
    least_response: Number = parameter(
        0.3,
        "least part of the commanded motion that the arm is taken to make",
        minimum=0.01,
        maximum=1.0,
        origin=assumed("an arm with slack tendons makes a tenth to a half of what it is commanded to"),
    )

    def check(self) -> None:
        """Raise InvalidGraspReflexParameters, with all faults."""
        faults = parameter_faults(self)
        if not faults and not self.nearest < self.farthest:
            faults.append(f"nearest {self.nearest:g} m must be less than farthest {self.farthest:g} m")
        if faults:
            raise InvalidGraspReflexParameters(faults)

    @property
    def model(self) -> FingerModel:
        """The fingers as they are expected to be."""
        names = (
            "a",
            "b",
            "c",
            "d",
            "nearest",
            "farthest",
            "contact",
            "beam",
            "across",
            "ahead",
            "ball_radius",
            "palm_radius",
        )
        return FingerModel(**{name: getattr(self, name) for name in names})

    @property
    def doubts(self) -> Doubts:
        """What is believed of errors."""
        names = ("wander", "bias", "brightness", "reading", "noise", "memory")
        return Doubts(**{name: getattr(self, name) for name in names})


@dataclass(kw_only=True)
class Inputs(Measurements):
    """What vision, fingers and encoders measure, and what the servo believes of the arm; positions in W."""

    ticks: Vector6[Tick] = port(np.zeros(6), "readings: of the sensors that look across, then of those that look ahead")
    grip: Number = port(0.0, "closure of the gripper by its encoder: 0 open, 1 closed")
    dl_t: Vector9[Metre] = port(np.zeros(9), "tendon length change from calibration that is in force")
    q_est: Vector9[Number] = port(
        _Q_CALIB, "state that explains the measured pose: Dx, Dy (rad), l (m) of each segment"
    )


@dataclass(kw_only=True)
class Outputs:
    """Measurements for the servo, corrected, and what they rest on; positions in W."""

    p_WO: Vector3[Metre] = output("position of the ball that the servo is to go by")
    p_WR: Vector3[Metre] = output("position of the wrist, measured or reckoned")
    p_WG: Vector3[Metre] = output("position of the gripper, measured or reckoned")
    P_O: Matrix3[SquareMetre] = output("covariance of p_WO")
    P_R: Matrix3[SquareMetre] = output("covariance of p_WR")
    P_G: Matrix3[SquareMetre] = output("covariance of p_WG")
    known_O: bool = output("the ball is known")
    known_R: bool = output("wrist and gripper are known")
    source: Source = output("by what the ball is known")
    p_GO_est: Vector3[Metre] = output("estimated place of the ball from the gripper, in its frame; z to its tip")
    deviation: Metre = output("standard deviation of that place")
    reflectivity: Number = output("estimated reflectivity of the ball over the reference's")
    sensors: int = output("sensors that see something")


class GraspReflex:
    """Stands between vision and servo, and corrects the goal that the servo's Jacobian control goes to.

    `OffsetFilter` estimates where the ball is from the gripper. The cameras measure it while they see ball and ring,
    the fingers once `sensors_min` of them read something. Between measurements the gripper's own motion changes it, as
    the ring shows that motion, or else as the motors make it. The tendons' lengths give the commanded state, whose
    change moves the gripper by J dq. Of that it makes down all, and across the part that it made recently (`Response`).

    - While the cameras see both, their measurements go on to the servo, the ball's less what the fingers find the
      cameras to have wrong, beta.
    - Where they see one or none, and the gripper is near, wrist and gripper go on by dead reckoning from the motors.
      The ball is put where the filter has it from there: an error of reckoning is the ball's as well, and the servo
      centres the gripper by what the fingers feel. With `feels` false that is dead reckoning.
    - Else, or where the filter's deviation exceeds `lost`, what is not seen is not known (`known_O`, `known_R`).

    The gripper's orientation is that of the servo's estimated state, without twist. Nothing here closes the gripper:
    the servo does, when its error is small.

    `dl_t` and `q_est` are the servo's of its last period, so no output is declared to depend on them at once. The servo
    depends on this unit's outputs, and a host computes it after this unit.

    Raises:
        InvalidGraspReflexParameters: by the constructor, for values out of range or that contradict each other.
        InvalidReading: by `step`, for readings or encoders that are not finite; all are named.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        (
            *("p_WO", "p_WR", "p_WG", "P_O", "P_R", "P_G", "known_O", "known_R"),
            *("source", "p_GO_est", "deviation", "reflectivity", "sensors"),
        ),
        (
            *("p_WO_meas", "p_WR_meas", "p_WG_meas", "cov_O", "cov_R", "cov_G", "seen_O", "seen_R"),
            *("ticks", "grip"),
        ),
    )
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal(
            "measurements",
            TerminalKind.MEASUREMENTS,
            *("p_WO_meas", "p_WR_meas", "p_WG_meas"),
            *("cov_O", "cov_R", "cov_G", "seen_O", "seen_R"),
        ),
        terminal(
            "corrected",
            TerminalKind.MEASUREMENTS,
            p_WO_meas="p_WO",
            p_WR_meas="p_WR",
            p_WG_meas="p_WG",
            cov_O="P_O",
            cov_R="P_R",
            cov_G="P_G",
            seen_O="known_O",
            seen_R="known_R",
        ),
    )
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        params.check()
        self._params = p = params
        self._l_t_calib = np.repeat(p.l_calib, 3)
        self._filter = OffsetFilter(p.model, p.doubts, p.palm_reflectivity)
        self._lag = FirstOrderLag(6, p.response_time)
        self._response = Response(_RESPONSE_MEMORY, p.response_time, p.least_response)
        self._q: Floats | None = None  # commanded state at the last step
        self._t = -math.inf  # of that step
        self._t_felt = -math.inf  # of the last readings that were taken in
        self._orientation: Floats = np.diag([1.0, -1.0, -1.0])  # R_WG
        self._pose: Floats | None = None  # wrist and gripper in W, shape (6,), m, as measured or reckoned
        self._is_measured = False  # that pose
        self._source = Source.NONE

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return what follows from the present measurements and what is believed; no time passes."""
        f, sees, pose = self._filter, u.seen_O and u.seen_R, self._pose
        reckons = not sees and pose is not None and self._is_near
        p_WR, p_WG = (u.p_WR_meas, u.p_WG_meas) if pose is None or u.seen_R or not reckons else (pose[:3], pose[3:])
        p_WO = p_WG + f.offset if reckons else u.p_WO_meas - (f.bias if sees else 0.0)
        reckoned = _RECKONED * np.eye(3)
        return Outputs(
            p_WO=np.array(p_WO),
            p_WR=np.array(p_WR),
            p_WG=np.array(p_WG),
            P_O=np.array(f.offset_covariance if reckons else u.cov_O),
            P_R=np.array(u.cov_R if u.seen_R or not reckons else reckoned),
            P_G=np.array(u.cov_G if u.seen_R or not reckons else reckoned),
            known_O=u.seen_O or reckons,
            known_R=u.seen_R or reckons,
            source=self._source,
            p_GO_est=np.transpose(self._orientation) @ f.offset,
            deviation=f.deviation,
            reflectivity=f.reflectivity,
            sensors=int(np.count_nonzero(u.ticks >= self._params.ticks_min)),
        )

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Reckon on, then take in what cameras and fingers measure."""
        _check_inputs(u)
        self._follow_gripper(t, u)
        if u.seen_O and u.seen_R:
            self._filter.see(u.p_WO_meas - u.p_WG_meas, u.cov_O + u.cov_G)
        feels = self._feels(u)
        if feels:
            self._filter.feel(u.ticks, self._orientation, u.grip, t - self._t_felt)
            self._t_felt = t
        self._source = self._source_of(u.seen_O and u.seen_R, feels)
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return the complete state."""
        parts = (self._filter.get_state(), self._lag.pending, self._response.get_state())
        gripper = (self._orientation, self._pose, self._is_measured)
        return pack_state((parts, self._q, (self._t, self._t_felt), gripper, int(self._source)))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        saved: Any = unpack_state(state)
        (found, pending, response), self._q, (self._t, self._t_felt), gripper, source = saved
        self._orientation, self._pose, self._is_measured = gripper
        self._filter.set_state(found)
        self._lag.pending = pending
        self._response.set_state(response)
        self._source = Source(source)

    @property
    def _is_near(self) -> bool:
        """Whether the ball is near enough, and its place certain enough, to be reckoned on."""
        p, f = self._params, self._filter
        return f.known and float(np.linalg.norm(f.offset)) < p.near and f.deviation < p.lost

    def _follow_gripper(self, t: float, u: Inputs) -> None:
        """Let the offset change as the gripper has moved since the last step: as measured, or else as commanded."""
        elapsed = t - self._t if self._q is not None else 0.0
        commanded, before = self._commanded_motion(elapsed, u), self._pose
        if u.seen_R:
            self._pose = np.concatenate([u.p_WR_meas, u.p_WG_meas])
            self._response.observe(_LEVEL * u.p_WG_meas, t)
        elif before is not None:
            self._pose = self._rigid(before + commanded)
        if u.seen_R and self._is_measured and before is not None:
            self._filter.move(u.p_WG_meas - before[3:], elapsed, slip=0.0)
        else:
            self._filter.move(commanded[3:], elapsed, self._params.slip)
        self._is_measured = u.seen_R
        self._orientation = np.diag(W_FROM_B[:3]) @ orientation(u.q_est)
        self._t = t

    def _rigid(self, pose: Floats) -> Floats:
        """Return wrist and gripper at their distance, the gripper where it is: [Vervloet2025] eq. (13)."""
        p_WR, p_WG = pose[:3], pose[3:]
        away = p_WR - p_WG
        return np.concatenate([p_WG + self._params.d_gripper * away / float(np.linalg.norm(away)), p_WG])

    def _commanded_motion(self, elapsed: float, u: Inputs) -> Floats:
        """Return how the motors have moved wrist and gripper since the last step, in W, shape (6,), m."""
        q = state_of(self._l_t_calib + u.dl_t, self._params.d_tendon)
        if self._q is not None and not np.array_equal(q, self._q):
            motion = W_FROM_B * (linearise(u.q_est, self._params.d_gripper)[1] @ (q - self._q))
            self._response.command(_LEVEL * motion[3:])
            made = np.where(_LEVEL > 0.0, self._response.part, 1.0)
            self._lag.add(np.tile(made, 2) * motion)
        self._q = q
        return self._lag.advance(elapsed)

    def _feels(self, u: Inputs) -> bool:
        """Return whether enough fingers read something of a ball that is near."""
        p = self._params
        sees = int(np.count_nonzero(u.ticks >= p.ticks_min))
        return p.feels and self._is_near and sees >= p.sensors_min

    def _source_of(self, sees: bool, feels: bool) -> Source:
        if sees:
            return Source.CAMERAS_AND_FINGERS if feels else Source.CAMERAS
        if not self._is_near:
            return Source.NONE
        return Source.MOTORS_AND_FINGERS if feels else Source.MOTORS


def _check_inputs(u: Inputs) -> None:
    """Raise InvalidReading for what is not a number: it would stay in the filter for ever."""
    inputs = {"ticks": u.ticks, "grip": u.grip, "dl_t": u.dl_t, "q_est": u.q_est}
    inputs |= {"p_WO_meas": u.p_WO_meas, "cov_O": u.cov_O} if u.seen_O else {}
    inputs |= {"p_WR_meas": u.p_WR_meas, "p_WG_meas": u.p_WG_meas, "cov_G": u.cov_G} if u.seen_R else {}
    wrong = [name for name, value in inputs.items() if not np.all(np.isfinite(value))]
    if wrong:
        raise InvalidReading([f"{name} must be finite, not {np.asarray(inputs[name]).tolist()}" for name in wrong])
