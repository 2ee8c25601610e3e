"""Parameters of the infrared reflex. [Luberto] sec. IV and V."""

import enum
import math
from dataclasses import dataclass

import numpy as np

from handover.controllers.ir_grasp.sensor_geometry import LARGEST_CLOSURE, Calibration
from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import NOT_GIVEN, assumed, derived, stated
from handover.cosim.blocks.ports import Matrix3x4, Vector2, Vector3, Vector4, parameter
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import (
    Hertz,
    Metre,
    MetrePerSecond,
    Newton,
    NewtonMetre,
    Number,
    PerSecond,
    PerTick,
    Radian,
    Second,
    SquareMetre,
    Tick,
)

_CURVE = assumed(
    "eq. (11) states the form; coefficients such that 12 bits cover 4 to 65 mm (84 mm at 0 ticks, 3.8 mm at 4095)"
)
_TUNED = assumed("our own correction on the move; tuned on seeds below 1000")
_TUNED_ALONG = assumed("our own correction on the move; tuned on seeds 9100 to 9399")

_INPUTS = ("p_x", "p_y", "yaw", "sigma")


class InvalidReflexParameters(InvalidParameters):
    """Values with which the reflex cannot work; `faults` lists all of them."""

    block = "IrReflex"


class Strategy(enum.IntEnum):
    """What is done between the pre-grasp pose and closing.

    A correction by the sensors, nothing, a given way forward, or forward and slowly closing until contact.
    """

    REFLEX = 0
    BLIND = 1
    FORWARD = 2
    CONTACT = 3


class Correction(enum.IntEnum):
    """How REFLEX corrects: algorithm 1 as it stands, by moves and readings at rest, or continuously on the move."""

    PAPER = 0
    FAST = 1


@dataclass(frozen=True, kw_only=True)
class Params:
    """Vectors of four are in the order of the control inputs p_x (m), p_y (m), yaw (rad), sigma (1).

    All values but the sensors' range and the fingers in the cost are own choices: the source does not give them.
    `literal` takes eqs. (4) and (9) as printed: the residual is the distance itself, every step follows a probing,
    and threshold_literal ends it.
    """

    strategy: Strategy = parameter(
        Strategy.REFLEX,
        "correct the pre-grasp pose by the sensors, close there at once, or go forward and close",
        origin=stated("table I compares IR-guided and blind; closing after going forward is a control of our own"),
    )
    correction: Correction = parameter(
        Correction.PAPER,
        "correct by algorithm 1, moves and readings at rest, or continuously, on the move",
        origin=stated("algorithm 1; fast is our own"),
    )
    literal: bool = parameter(
        False,
        "eqs. (4) and (9) of [Luberto] as printed: no target distance, no scaling, no damping",
        origin=assumed("eq. (9) has no inverse with fewer residuals than inputs, and eq. (4) is least at contact"),
    )
    p_WH_pregrasp: Vector2[Metre] = parameter(
        np.array([-0.20, 0.0]),
        "wrist at the pre-grasp pose, in the world",
        minimum=-2.0,
        maximum=2.0,
        origin=assumed("not given; the scenario draws it"),
    )
    yaw_pregrasp: Radian = parameter(
        0.0,
        "heading of the hand there",
        minimum=-math.pi,
        maximum=math.pi,
        origin=assumed("not given; the scenario draws it"),
    )
    sigma_pregrasp: Number = parameter(
        0.0,
        "closure there",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given; wide open, where the sensors see most"),
    )
    forward_distance: Metre = parameter(
        0.035,
        "how far the strategy FORWARD goes before it closes",
        minimum=0.0,
        maximum=0.5,
        origin=assumed(
            "a control of our own: about as far forward as the reflex goes in nominal poses, 31 mm. It grasps as "
            "often as the reflex in nominal poses and less often in perturbed ones; with 55 mm nearly as often in both"
        ),
    )
    a: Metre = parameter(0.062, "constant of eq. (11)", minimum=0.0, maximum=1.0, origin=_CURVE)
    b: PerTick = parameter(-0.0030, "constant of eq. (11)", minimum=-1.0, maximum=0.0, origin=_CURVE)
    c: Metre = parameter(0.022, "constant of eq. (11)", minimum=0.0, maximum=1.0, origin=_CURVE)
    d: PerTick = parameter(-0.00043, "constant of eq. (11)", minimum=-1.0, maximum=0.0, origin=_CURVE)
    epsilon: Metre = parameter(
        0.060,
        "distance up to which a finger sees the object",
        minimum=0.0,
        maximum=1.0,
        origin=stated("fig. 9: the maximum operative range, 60 mm"),
    )
    distance_max: Metre = parameter(
        0.065,
        "distance that stands for seeing nothing",
        minimum=0.0,
        maximum=1.0,
        origin=stated("sec. V-B: operative range 4 to 65 mm"),
    )
    weight: Vector3[Number] = parameter(
        np.array([1.0, 0.0, 1.0]),
        "weight of thumb, index and ring in the cost; 0 leaves one out",
        minimum=0.0,
        origin=stated("sec. V-D: only thumb and ring enter the cost of the documented experiments"),
    )
    target: Metre = parameter(
        0.010,
        "distance that the fingers are brought to",
        minimum=0.0,
        maximum=0.06,
        origin=derived("not given; table II ends at about 10 mm of thumb and ring in nominal poses"),
    )
    threshold: SquareMetre = parameter(
        1.6e-5,
        "cost at which the hand closes",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given; both fingers 4 mm off the target"),
    )
    threshold_literal: SquareMetre = parameter(
        1.5e-4,
        "the same, of the literal variant",
        minimum=0.0,
        maximum=1.0,
        origin=derived(
            "not given; table II implies 1.1e-4 to 1.2e-4 m2 in nominal poses and 2.0e-4 to 3.4e-4 m2 in perturbed ones"
        ),
    )
    scale: Vector4[Number] = parameter(
        np.array([0.02, 0.02, 0.1, 0.1]),
        "what counts as one unit of each input in a step's length",
        minimum=0.0,
        origin=assumed("not given; 20 mm, 20 mm, 0.1 rad and 0.1 of closure count alike"),
    )
    damping: Metre = parameter(0.004, "lambda of the damped step", minimum=0.0, maximum=1.0, origin=NOT_GIVEN)
    alpha: Number = parameter(
        0.8,
        "step scaling, eq. (10)",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("sec. IV: in [0, 1], calibrated by workspace and joint velocities"),
    )
    max_step: Vector4[Number] = parameter(
        np.array([0.012, 0.012, 0.10, 0.10]),
        "largest step of each input, to which alpha is cut",
        minimum=0.0,
        origin=assumed("not given; what alpha is cut for"),
    )
    probe: Vector4[Number] = parameter(
        np.array([0.004, 0.004, 0.04, 0.03]),
        "probing move of each input",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given; well above the readings' noise"),
    )
    probe_every: int = parameter(
        4,
        "steps from one probing to the next; between, Broyden's update",
        minimum=1,
        origin=assumed("algorithm 1 probes at every step; between, Broyden's update saves moves"),
    )
    reach: Vector3[Number] = parameter(
        np.array([0.10, 0.10, 0.6]),
        "how far p_x, p_y, yaw may leave the pre-grasp pose",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("not given; the robot's workspace"),
    )
    sigma_limit: Number = parameter(
        0.6,
        "largest closure before the hand closes for good",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given; the fingers must not close before the object"),
    )
    recovery_step: Metre = parameter(
        0.010, "approaching and recovering motion", minimum=0.0, maximum=0.1, origin=NOT_GIVEN
    )
    recovery_closing: Number = parameter(
        0.05, "closing motion of a recovery", minimum=0.0, maximum=1.0, origin=NOT_GIVEN
    )
    recovery_least: Metre = parameter(
        0.002, "recovering motion that is not halved further", minimum=0.0, maximum=0.1, origin=NOT_GIVEN
    )
    max_recoveries: int = parameter(25, "approaching and recovering motions at most", minimum=0, origin=NOT_GIVEN)
    waited_closings: int = parameter(
        2,
        "closing motions made for a finger that is not in the cost to see",
        minimum=0,
        origin=assumed("not given; sec. V-D says that the index lags behind"),
    )
    max_steps: int = parameter(25, "Gauss-Newton steps at most", minimum=1, origin=NOT_GIVEN)
    progress: Number = parameter(
        0.05, "part of the cost that a step must take off", minimum=0.0, maximum=1.0, origin=NOT_GIVEN
    )
    stalled_steps: int = parameter(
        3, "steps in a row without progress before the hand closes", minimum=1, origin=NOT_GIVEN
    )
    scans: int = parameter(3, "scans that a reading is the mean of", minimum=1, maximum=100, origin=NOT_GIVEN)
    calm: Second = parameter(
        0.15,
        "rest before a reading",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("not given; the soft fingers swing for about so long"),
    )
    tolerance: Vector4[Number] = parameter(
        np.array([5e-4, 5e-4, 5e-3, 5e-3]),
        "distance of encoders and command that ends a move",
        minimum=0.0,
        origin=NOT_GIVEN,
    )
    move_time: Second = parameter(
        1.5, "time after which a correcting move counts as done", minimum=0.0, maximum=60.0, origin=NOT_GIVEN
    )
    travel_time: Second = parameter(
        10.0, "the same, for the travel to the pre-grasp pose and for the pull", minimum=0.0, origin=NOT_GIVEN
    )
    closing_time: Second = parameter(
        2.0, "time that the hand is given to close", minimum=0.0, maximum=60.0, origin=NOT_GIVEN
    )
    pull_distance: Metre = parameter(
        0.15,
        "how far the closed hand is pulled back",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given: what counts as a successful grasp is not stated; a pull stands for lifting"),
    )
    shake_amplitude: Metre = parameter(
        0.015, "amplitude of the shake, across the hand", minimum=0.0, maximum=0.2, origin=NOT_GIVEN
    )
    shake_frequency: Hertz = parameter(1.5, "frequency of the shake", minimum=0.01, maximum=10.0, origin=NOT_GIVEN)
    shake_cycles: int = parameter(3, "cycles of the shake", minimum=0, maximum=1000, origin=NOT_GIVEN)
    contact_speed: MetrePerSecond = parameter(
        0.04, "speed ahead of the strategy CONTACT", minimum=1e-3, maximum=0.3, origin=assumed("a control of our own")
    )
    contact_closing: PerSecond = parameter(
        0.05,
        "its rate of closing on the way",
        minimum=0.0,
        maximum=1.0,
        origin=assumed(
            "a control of our own; of 96 cups, boxes and cylinders in six places it held 96 with 0.02 and "
            "0.05, 94 with 0.1, 68 with 0.2"
        ),
    )
    contact_tension: Newton = parameter(
        0.5,
        "tension off that of the free hand that shows contact",
        minimum=1e-3,
        origin=assumed("a control of our own"),
    )
    free_tension: Newton = parameter(
        6.51,
        "tension of the free hand's tendon by closure, of its design",
        minimum=0.0,
        origin=derived("not given; of the hand's assumed tendon and joints"),
    )
    feed: MetrePerSecond = parameter(0.06, "speed ahead, of FAST", minimum=0.0, maximum=1.0, origin=_TUNED)
    rate: PerSecond = parameter(5.0, "rate at which FAST takes off residuals", minimum=0.0, maximum=50.0, origin=_TUNED)
    speed_limit: Vector4[Number] = parameter(
        np.array([0.10, 0.10, 0.6, 0.5]), "largest rate of each input, of FAST", minimum=0.0, origin=_TUNED
    )
    depth: Metre = parameter(
        0.092,
        "how far ahead of the wrist the object's front may be",
        minimum=0.0,
        maximum=0.3,
        origin=assumed("not given; 36 mm before the palm"),
    )
    sigma_before: Number = parameter(0.12, "largest closure until it is there", minimum=0.0, maximum=1.0, origin=_TUNED)
    one_sided: Vector3[Metre] = parameter(
        np.array([0.035, 0.060, 0.035]),
        "distance below which an object that one side sees is beside it",
        minimum=0.0,
        origin=_TUNED,
    )
    balance: Metre = parameter(
        0.006, "half the difference of the sides at which the object is centred", minimum=0.0, origin=_TUNED
    )
    settling: Second = parameter(
        0.5, "time given to the residuals once the object is deep enough", minimum=0.0, origin=_TUNED
    )
    lost_deep: Second = parameter(
        0.1, "time out of sight after which a hand that is deep enough closes", minimum=0.0, origin=_TUNED
    )
    lost_time: Second = parameter(
        1.0, "time after which an object that was in sight is no longer awaited", minimum=0.0, origin=_TUNED
    )
    fast_reach: Vector3[Number] = parameter(
        np.array([0.15, 0.15, 0.9]),
        "reach, of FAST",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("not given; the robot's workspace"),
    )
    search_width: Vector2[Metre] = parameter(
        np.array([0.045, 0.080]),
        "how far the search goes to the left and to the right",
        minimum=0.0,
        maximum=0.5,
        origin=_TUNED,
    )
    search_row: Metre = parameter(
        0.025, "how far ahead one crossing of the search is of the last", minimum=1e-3, origin=_TUNED
    )
    search_back: Metre = parameter(
        0.020, "how far the search begins behind the pre-grasp pose", minimum=0.0, origin=_TUNED
    )
    search_ahead: Metre = parameter(
        0.105, "how far the search goes ahead of it", minimum=0.001, maximum=0.5, origin=_TUNED
    )
    search_guess: Metre = parameter(
        0.055, "where the hand closes if nothing was found, ahead of it", minimum=0.0, origin=_TUNED
    )
    search_speed: MetrePerSecond = parameter(
        0.14,
        "speed of the search",
        minimum=1e-3,
        maximum=1.0,
        origin=assumed("our own correction on the move: an object that is met at this speed slides on by 3 mm"),
    )
    arrival_way: Metre = parameter(
        0.04,
        "last part of the way to the pre-grasp pose, of FAST",
        minimum=0.0,
        maximum=0.5,
        origin=assumed(
            "our own correction on the move: fingertips reach so far past the front of an object at the stand-off"
        ),
    )
    arrival_speed: MetrePerSecond = parameter(
        0.10,
        "speed there",
        minimum=1e-3,
        maximum=1.0,
        origin=assumed("our own correction on the move: an object that is met at this speed slides on by 2 mm"),
    )
    along_limit: Metre = parameter(
        0.010,
        "way ahead on which what one side alone sees stays as far off: it goes along",
        minimum=1e-3,
        origin=_TUNED_ALONG,
    )
    along_change: Metre = parameter(
        0.004,
        "change of its distance that shows that it does not",
        minimum=0.0,
        origin=assumed(
            "our own correction on the move: at the edge of sight, 60 mm, 4 ticks of noise are 0.5 mm, so "
            "far beyond noise"
        ),
    )
    along_back: Metre = parameter(
        0.025, "how far a hand that pushes it along goes back", minimum=0.0, origin=_TUNED_ALONG
    )
    along_across: Metre = parameter(
        0.025, "how far it then goes across, to the side that sees", minimum=0.0, origin=_TUNED_ALONG
    )
    along_most: int = parameter(
        3, "how often it does so at most", minimum=0, origin=assumed("our own correction on the move: a grasp must end")
    )
    touch_torque: NewtonMetre = parameter(
        3.4e-3,
        "unexplained torque on a joint that shows a contact",
        minimum=1e-6,
        origin=assumed(
            "our own correction on the move: a hand that touches nothing shows more in one round of a "
            "thousand; seeds 90000 to 93169"
        ),
    )
    touch_inertia: Number = parameter(
        0.3,
        "share of the joint's torque of inertia by which more is asked",
        minimum=0.0,
        origin=assumed(
            "our own correction on the move: a hand that touches nothing shows more in one round of a "
            "thousand; seeds 90000 to 93169"
        ),
    )
    touch_time: Second = parameter(
        0.12,
        "time over which that torque is averaged",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("our own correction on the move: the time in which a finger's joints come to rest"),
    )
    touch_back: Metre = parameter(
        0.025,
        "how far the hand goes back from what a finger met",
        minimum=0.0,
        maximum=0.1,
        origin=assumed("our own correction on the move; as along_back"),
    )
    touch_across: Metre = parameter(
        0.045,
        "how far it then goes across, to the side of that finger",
        minimum=0.0,
        origin=assumed("our own correction on the move: more than half an object's width and a finger"),
    )
    touch_most: int = parameter(
        3, "how often it does so at most", minimum=0, origin=assumed("our own correction on the move: a grasp must end")
    )
    push_depth: Metre = parameter(
        0.020, "how much too far ahead the front is when that counts", minimum=0.0, origin=_TUNED
    )
    push_limit: Metre = parameter(
        0.010, "way across that the hand may make without any effect", minimum=0.0, origin=_TUNED
    )
    path_limit: Metre = parameter(
        0.15, "way ahead that it may make once it has seen the object", minimum=0.0, origin=_TUNED
    )
    follow_speed: MetrePerSecond = parameter(
        0.06, "largest speed at which an object is followed", minimum=0.0, origin=_TUNED
    )
    rest_speed: MetrePerSecond = parameter(0.003, "estimated speed that is as good as rest", minimum=0.0, origin=_TUNED)
    ambient_rounds: int = parameter(
        8,
        "first rounds, far from the object, of which FAST takes the least finger's mean for ambient light",
        minimum=0,
        origin=assumed(
            "our own correction on the move: 0.12 s, in which the hand is still 0.15 m or more from an "
            "object; 0: ambient light is not taken off"
        ),
    )
    ambient_least: Tick = parameter(
        20.0,
        "mean reading that counts as ambient light",
        minimum=0.0,
        maximum=4095.0,
        origin=assumed(
            "our own correction on the move: five deviations of a reading, so that noise alone is never taken for light"
        ),
    )
    tick_noise: Tick = parameter(
        4.0, "standard deviation of a reading", minimum=0.0, origin=assumed("not given; the readings' noise")
    )
    jump: Metre = parameter(0.006, "change of a distance that no smooth surface explains", minimum=0.0, origin=_TUNED)
    distance_drift: Metre = parameter(3e-4, "random change of a distance in a round", minimum=0.0, origin=_TUNED)
    jacobian_offset_0: Matrix3x4[Number] = parameter(
        np.zeros((3, 4)),
        "what the Jacobian to begin with adds to the design's: output jacobian_offset of the last grasp; 0: the design",
        minimum=-10.0,
        maximum=10.0,
        origin=assumed("see scenario.last_grasp"),
    )
    jacobian_spread: Vector4[Number] = parameter(
        np.array([0.6, 0.2, 0.05, 0.06]),
        "how far off the Jacobian to begin with may be, by input",
        minimum=0.0,
        origin=_TUNED,
    )
    jacobian_drift: Vector4[Number] = parameter(
        np.array([0.05, 0.02, 0.004, 0.006]),
        "random change of the Jacobian in a round, by input",
        minimum=0.0,
        origin=_TUNED,
    )
    jacobian_memory: Second = parameter(
        0.5, "time in which what was learnt of it fades to that", minimum=0.1, origin=_TUNED
    )
    slope_spread: Number = parameter(
        0.1, "how far the middle moves across by way ahead, one deviation", minimum=0.0, origin=_TUNED
    )
    slope_drift: Number = parameter(0.01, "random change of that in a round", minimum=0.0, origin=_TUNED)
    velocity_spread: MetrePerSecond = parameter(
        0.012, "speed of an object, one standard deviation", minimum=0.0, origin=_TUNED
    )
    velocity_drift: MetrePerSecond = parameter(
        0.0006, "random change of its speed in a round", minimum=0.0, origin=_TUNED
    )
    velocity_after: Second = parameter(0.2, "time in sight before a velocity is believed", minimum=0.0, origin=_TUNED)

    @property
    def calibration(self) -> Calibration:
        """The sensors' characteristic, eq. (11)."""
        return Calibration(self.a, self.b, self.c, self.d)

    def check(self) -> None:
        """Raise InvalidReflexParameters, with all faults, if the reflex cannot work with these values."""
        faults = parameter_faults(self) or [*self.calibration.faults(), *self._input_faults(), *self._range_faults()]
        if not faults and self.strategy is Strategy.REFLEX and self.correction is Correction.FAST:
            faults = self._fast_faults()
        if faults:
            raise InvalidReflexParameters(faults)

    def _fast_faults(self) -> list[str]:
        """Return what the correction on the move cannot work with."""
        faults: list[str] = []
        if self.literal:
            faults.append("literal takes the equations of correction PAPER as printed: it contradicts FAST")
        if not self.feed > 0.0:
            faults.append("feed must be above 0, or the hand never gets as far as the object")
        if not (self.weight[0] > 0.0 and self.weight[2] > 0.0):
            faults.append("weight: thumb and ring must be in the cost of FAST, which centres the object between them")
        if self.sigma_limit > LARGEST_CLOSURE:
            faults.append(
                f"sigma_limit {self.sigma_limit:g} must not exceed {LARGEST_CLOSURE:g}, up to which FAST knows where "
                "the sensors are"
            )
        return faults

    def _input_faults(self) -> list[str]:
        faults: list[str] = []
        for j, name in enumerate(_INPUTS):
            vectors = ("scale", "max_step", "probe", "tolerance", "speed_limit")
            faults += [f"{v} of {name} must be above 0" for v in vectors if not getattr(self, v)[j] > 0.0]
            if not self.tolerance[j] < 0.5 * self.probe[j]:
                faults.append(
                    f"tolerance of {name}, {self.tolerance[j]:g}, must be less than half its probing move, "
                    f"{self.probe[j]:g}, or the move may go unnoticed"
                )
        if not self.damping > 0.0:
            faults.append("damping must be above 0, or the step of a singular Jacobian is not defined")
        if not self.alpha > 0.0:
            faults.append("alpha must be above 0, or no step is ever made")
        if not np.any(self.weight > 0.0):
            faults.append("weight: at least one finger must be in the cost")
        return faults

    def _range_faults(self) -> list[str]:
        faults: list[str] = []
        if not self.target < self.epsilon:
            faults.append(f"target {self.target:g} m must be less than epsilon {self.epsilon:g} m, the range of sight")
        if not self.epsilon < self.distance_max:
            faults.append(f"epsilon {self.epsilon:g} m must be less than distance_max {self.distance_max:g} m")
        nearest, farthest = (self.calibration.distance(x) for x in (4095.0, 0.0))
        if not nearest < self.target:
            faults.append(f"target {self.target:g} m must exceed {nearest:.4g} m, the smallest distance of eq. (11)")
        if not farthest >= self.distance_max:
            faults.append(f"distance_max {self.distance_max:g} m must not exceed {farthest:.4g} m, eq. (11) at 0 ticks")
        if not self.sigma_pregrasp <= self.sigma_limit:
            faults.append(f"sigma_pregrasp {self.sigma_pregrasp:g} must not exceed sigma_limit {self.sigma_limit:g}")
        if not self.sigma_before <= self.sigma_limit:
            faults.append(f"sigma_before {self.sigma_before:g} must not exceed sigma_limit {self.sigma_limit:g}")
        if not self.one_sided[0] > 0.0:
            faults.append("one_sided of the thumb must be above 0: the hand goes ahead by its share")
        if not 0.0 < self.recovery_least <= self.recovery_step:
            faults.append(
                f"recovery_least {self.recovery_least:g} m must be above 0 and at most recovery_step "
                f"{self.recovery_step:g} m"
            )
        return faults
