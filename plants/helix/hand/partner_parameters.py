"""Parameters and ports of the person who offers a ball, apart from the model, so that a reader loads no kernels."""

import enum
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, derived
from handover.cosim.blocks.ports import Floats, Vector3, Vector4, output, parameter, port
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import (
    Hertz,
    Kilogram,
    Metre,
    MetrePerSecond,
    MetrePerSecond2,
    Newton,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    Number,
    Radian,
    Second,
    SecondPerMetre,
)
from handover.plants.helix.hand.bowl import BowlParameters


class InvalidPartnerParameters(InvalidParameters):
    """Parameters out of range, or that contradict each other; `faults` lists all of them."""

    block = "HandoverPartner"


class Holder(enum.IntEnum):
    """Who holds the ball."""

    HAND = 0
    GRIPPER = 1
    FREE = 2


@dataclass(frozen=True, kw_only=True)
class Params(BowlParameters):
    """Where the ball is offered and how still, how hand, ball and fingers touch, and the bowl; all assumed."""

    p_WO_0: Vector3[Metre] = parameter(
        np.array([0.18, 0.0, -0.60]),
        "where the ball is offered, in the world",
        minimum=-2.0,
        maximum=2.0,
        origin=assumed("own choice for the unit by itself; scenarios set it"),
    )
    p_WO_1: Vector3[Metre] = parameter(
        np.array([0.18, 0.0, -0.60]),
        "where the hand moves with it, if it does, in the world",
        minimum=-2.0,
        maximum=2.0,
        origin=assumed("p_WO_0: the hand stays"),
    )
    room: Metre = parameter(
        0.12,
        "distance from the hanging arm's axis at which the person waits with a ball that goes nearer, until the "
        "gripper is higher",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("open fingers reach 5 cm from the gripper's axis, the palm 4.5 cm from the ball's middle"),
    )
    move_from: Second = parameter(
        0.0,
        "time at which the hand begins to move to p_WO_1",
        minimum=0.0,
        origin=assumed("own choice: of no effect while move_for is 0"),
    )
    move_for: Second = parameter(
        0.0,
        "how long the hand moves; 0: it stays at p_WO_0",
        minimum=0.0,
        maximum=600.0,
        origin=derived("sec. 3.5.1: the hand holds the ball at one place"),
    )
    p_OH: Vector3[Metre] = parameter(
        np.array([0.0, 0.0, -0.04]),
        "middle of the palm seen from the ball, in the world",
        minimum=-0.2,
        maximum=0.2,
        origin=assumed("own choice: the ball's radius and half of a hand's thickness below its middle"),
    )
    ball_mass: Kilogram = parameter(
        0.02, "mass of the ball", minimum=0.001, maximum=1.0, origin=assumed("a light ball of 25 mm radius")
    )
    gravity: MetrePerSecond2 = parameter(
        9.81, "gravity, along -z of the world", minimum=0.0, maximum=30.0, origin=assumed("standard")
    )
    tremor_rms: Metre = parameter(
        0.001,
        "root mean square length of the hand's tremor",
        minimum=0.0,
        maximum=0.05,
        origin=assumed("physiological tremor of an outstretched hand"),
    )
    tremor_frequency: Hertz = parameter(
        8.0,
        "middle of the tremor's band",
        minimum=0.1,
        maximum=50.0,
        origin=assumed("physiological tremor, 8 to 12 Hz"),
    )
    tremor_bandwidth: Hertz = parameter(
        2.0,
        "width of the tremor's band at half power",
        minimum=0.01,
        maximum=50.0,
        origin=assumed("own choice: physiological tremor is a narrow band"),
    )
    drift_rms: Metre = parameter(
        0.003,
        "root mean square length of the hand's drift",
        minimum=0.0,
        maximum=0.1,
        origin=assumed("how still a hand is held"),
    )
    drift_time: Second = parameter(
        5.0, "correlation time of the drift", minimum=0.1, maximum=1000.0, origin=assumed("how still a hand is held")
    )
    finger_stiffness: NewtonPerMetre = parameter(
        300.0,
        "stiffness of a finger of the gripper where the ball presses on it",
        minimum=1.0,
        maximum=1e4,
        origin=assumed("a soft finger pulled by a tendon: three hold a ball of 20 g with about 0.4 N each"),
    )
    finger_friction: Number = parameter(
        0.8, "friction between fingers and ball", minimum=0.0, maximum=3.0, origin=assumed("rubber on a smooth ball")
    )
    palm_stiffness: NewtonPerMetre = parameter(
        1000.0,
        "stiffness of the hand's skin where something presses on it",
        minimum=1.0,
        maximum=1e4,
        origin=assumed("skin and flesh of a palm under some newtons"),
    )
    palm_friction: Number = parameter(
        0.5, "friction between hand and ball", minimum=0.0, maximum=3.0, origin=assumed("dry skin")
    )
    palm_rolling_friction: Number = parameter(
        0.2,
        "how far, in radii of the ball, the hand's pressure shifts before the ball rolls in it",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("the ball sinks into the palm and does not roll freely in it"),
    )
    dissipation: SecondPerMetre = parameter(
        4.0,
        "damping of contacts: part by which a speed raises their force",
        minimum=0.0,
        maximum=50.0,
        origin=assumed("contacts that bounce little at 0.1 m/s"),
    )
    cup_radius: Metre = parameter(
        0.1,
        "radius of the cup that the palm makes",
        minimum=0.03,
        maximum=10.0,
        origin=assumed("a palm that is held nearly flat: the finger tips pass beside the ball"),
    )
    cup_angle: Radian = parameter(
        0.25,
        "half angle of that cup; its rim is flat",
        minimum=0.05,
        maximum=1.5,
        origin=assumed("a palm that is held nearly flat: the cup is 5 cm wide and 3 mm deep"),
    )
    palm_radius: Metre = parameter(
        0.045,
        "how far the palm reaches from its middle",
        minimum=0.0,
        maximum=0.2,
        origin=assumed("half the width of a palm"),
    )
    hand_mass: Kilogram = parameter(
        0.5,
        "mass of the hand as it gives way",
        minimum=0.05,
        maximum=5.0,
        origin=assumed("a hand, as light as it gives way"),
    )
    hold_stiffness: NewtonPerMetre = parameter(
        300.0,
        "stiffness with which the hand is held where it is",
        minimum=10.0,
        maximum=1e4,
        origin=assumed("a relaxed arm at the hand: some hundred N/m"),
    )
    hold_damping: NewtonSecondPerMetre = parameter(
        17.0,
        "damping of that",
        minimum=0.0,
        maximum=200.0,
        origin=assumed("0.7 of critical, with hand_mass and hold_stiffness"),
    )
    hold_force: Newton = parameter(
        1.0,
        "force with which thumb and fingers press the ball to the palm",
        minimum=0.0,
        maximum=50.0,
        origin=assumed("a ball that is held lightly: half a newton beside it moves it"),
    )
    help_speed: MetrePerSecond = parameter(
        0.0,
        "how fast the person brings the ball between the fingers of a gripper that closes beside it; 0: not at all",
        minimum=0.0,
        maximum=1.0,
        origin=derived("secs. 3.5 and 3.5.1 say only that the hand holds the ball; see experiment.help_speed"),
    )
    help_within: Metre = parameter(
        0.08,
        "how near the gripper must be for that",
        minimum=0.0,
        maximum=0.5,
        origin=assumed("own choice: a hand's width"),
    )
    closed_grip: Number = parameter(
        0.95, "closure at which the gripper looks closed", minimum=0.0, maximum=1.0, origin=assumed("what looks closed")
    )
    felt_grasp: Newton = parameter(
        0.1,
        "sum of the fingers' pressures on the ball by which the person feels the grasp",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("half the weight of the ball"),
    )
    reaction_time: Second = parameter(
        0.3,
        "how long both hold until the person lets go",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("what a person needs to let go"),
    )
    release_time: Second = parameter(
        0.2,
        "time in which the person stops pressing, before the hand withdraws",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("how fast fingers open"),
    )
    force_max: Newton = parameter(
        5.0,
        "force on the hand at which the person draws it back",
        minimum=0.1,
        maximum=1000.0,
        origin=assumed("what a person who holds a hand out lets an arm press"),
    )
    withdrawal: Metre = parameter(
        0.15,
        "how far the hand withdraws",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("own choice: so far that the hand is not in the arm's way"),
    )
    withdrawal_time: Second = parameter(
        1.0,
        "how long that takes",
        minimum=0.01,
        maximum=60.0,
        origin=assumed("own choice: an unhurried motion of a hand"),
    )
    floor: Metre = parameter(
        -1.2,
        "height at which a fallen ball rests",
        minimum=-100.0,
        maximum=2.0,
        origin=assumed("own choice: half a metre below the hanging gripper"),
    )
    ball_radius: Metre = parameter(
        0.025, "radius of the ball", minimum=0.001, origin=assumed("figs. 4 and 6, as the cameras see it")
    )
    guide_stiffness: NewtonPerMetre = parameter(
        0.0,
        "stiffness with which a person leads the gripper to the ball",
        minimum=0.0,
        maximum=1000.0,
        origin=derived("secs. 3.5.1 and 3.5.2: only in the second experiment a person leads the arm"),
    )
    guide_damping: NewtonSecondPerMetre = parameter(
        2.0,
        "damping of the guided gripper, where there is guidance",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("own choice"),
    )
    guide_height: Metre = parameter(
        0.025,
        "height over the ball's middle to which the gripper is led",
        minimum=-0.2,
        maximum=0.2,
        origin=assumed("where the person leads the gripper to, over the ball's middle: its top"),
    )
    guide_speed: MetrePerSecond = parameter(
        0.1,
        "speed with which the person leads the gripper there",
        minimum=0.001,
        maximum=1000.0,
        origin=assumed("how fast the person leads"),
    )
    guide_force_max: Newton = parameter(
        5.0, "largest force of guidance", minimum=0.0, maximum=50.0, origin=assumed("own choice: as force_max")
    )
    seed: int = parameter(0, "seed of the random numbers", minimum=0)

    def check(self) -> None:
        """Raise InvalidPartnerParameters, with all faults, if values are out of range or contradict each other."""
        faults = parameter_faults(self) or self._contradictions()
        if faults:
            raise InvalidPartnerParameters(faults)

    def _contradictions(self) -> list[str]:
        faults: list[str] = []
        if not self.tremor_bandwidth < 2.0 * self.tremor_frequency:
            faults.append(
                f"tremor_bandwidth {self.tremor_bandwidth:g} Hz must be less than twice tremor_frequency "
                f"{self.tremor_frequency:g} Hz"
            )
        if not self.cup_radius > self.ball_radius:
            faults.append(
                f"cup_radius {self.cup_radius:g} m must exceed ball_radius {self.ball_radius:g} m, or the ball does "
                "not lie in the hand"
            )
        if not self.ball_mass * self.gravity < self.force_max:
            faults.append(
                f"force_max {self.force_max:g} N must exceed the ball's weight, {self.ball_mass * self.gravity:g} N, "
                "or the person never holds it out"
            )
        lowest = min(self.p_WO_0[2], self.p_WO_1[2]) if self.move_for > 0.0 else self.p_WO_0[2]
        if not self.floor < lowest:
            faults.append(f"floor {self.floor:g} m must lie below the offered ball, {lowest:g} m")
        if self.bowl_radius > 0.0:
            faults += self._bowl_faults()
        return faults

    def _bowl_faults(self) -> list[str]:
        faults: list[str] = []
        if not self.bowl_radius > self.ball_radius:
            faults.append(
                f"bowl_radius {self.bowl_radius:g} m must exceed ball_radius {self.ball_radius:g} m, or the ball does "
                "not go in"
            )
        if not self.bowl_depth <= self.bowl_radius:
            faults.append(
                f"bowl_depth {self.bowl_depth:g} m must not exceed bowl_radius {self.bowl_radius:g} m: the bowl is a "
                "half of a hollow sphere at most"
            )
        if not self.p_WD[2] - self.bowl_depth + self.ball_radius >= self.floor:
            faults.append(
                f"p_WD: the bowl reaches {self.bowl_depth:g} m below {self.p_WD[2]:g} m, into the floor; a ball on the "
                f"floor has its middle at {self.floor:g} m"
            )
        return faults


@dataclass(kw_only=True)
class Inputs:
    """What the gripper does."""

    p_WG: Vector3[Metre] = port(np.zeros(3), "position of the gripper in the world")
    q_WG: Vector4[Number] = port(np.array([0.0, 1.0, 0.0, 0.0]), "orientation of the gripper in the world")
    grip: Number = port(0.0, "closure of the gripper: 0 open, 1 closed", minimum=0.0, maximum=1.0)


@dataclass(kw_only=True)
class Outputs:
    """Where ball and hand are, in the world, and what gripper and hand feel."""

    p_WO: Vector3[Metre] = output("position of the ball")
    p_WH: Vector3[Metre] = output("position of the middle of the palm")
    f_G: Vector3[Newton] = output("force on the gripper, in the world: guidance and contact, mean over the step")
    f_H: Vector3[Newton] = output("force on the hand, in the world: ball and finger tips, mean over the step")
    holder: Holder = output("who holds the ball")


def place_aside(p_WO: Floats, room: float) -> Floats:
    """Return the way outwards from the arm's axis, or away from the cameras on it, that leaves room for it, m."""
    beside = float(np.hypot(p_WO[0], p_WO[1]))
    outwards = np.array([p_WO[0], p_WO[1], 0.0]) / beside if beside > 0.0 else np.array([1.0, 0.0, 0.0])
    return max(0.0, room - beside) * outwards
