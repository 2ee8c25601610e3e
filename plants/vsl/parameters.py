"""Parameters of the VSL arm: links, motors, air and sensors, and what is wrong with them. [Gandarias2020] sec. II."""

import enum
import math
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, derived, stated
from handover.cosim.blocks.ports import Vector2, Vector3, parameter
from handover.cosim.blocks.schedule import InvalidSchedule, Schedule
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import (
    Ampere,
    Kilogram,
    Metre,
    MetrePerSecond2,
    Newton,
    NewtonMetre,
    NewtonMetre2,
    NewtonMetre2PerPascal,
    NewtonMetrePerAmpere,
    NewtonMetrePerRadian,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    Number,
    Pascal,
    Radian,
    RadianPerSecond,
    Second,
)

MAX_ANGLE = 2.0 * math.pi
"""Largest angle of a joint either way, rad (assumed)."""

NO_FACE = -10.0
"""Height that stands for no face, m."""

MAX_PRESSURE = 3.0e5
"""Highest pressure, Pa (assumed: half as much again as the 2 bar of the published experiments)."""

MAX_LOAD = 0.5
"""Largest load, kg (assumed: five times the 0.1 kg of the published experiments)."""


class InvalidVslArmParameters(InvalidParameters):
    """Parameters of which no arm can be built; `faults` lists all of them."""

    block = "VslArm"


class Motion(enum.IntEnum):
    """Whether the arm swings."""

    QUASI_STATIC = 0
    DYNAMIC = 1


class Link(enum.IntEnum):
    """What a link is made of: an inflated sleeve of silicone and fabric, or a printed part of the same weight."""

    VSL = 0
    RIGID = 1


@dataclass(frozen=True, kw_only=True)
class Params:
    """Dimensions, stiffness, weights and sensors; assumed, but for the kinds of motor, sensor and link.

    The values are chosen so that the error of the arm's tip is about what [Gandarias2020] fig. 5 shows.
    """

    motion: Motion = parameter(
        Motion.QUASI_STATIC,
        "whether the arm swings, or is at rest at every instant",
        origin=assumed("slow point-to-point motion; the paper's figures show no oscillation"),
    )
    link_2: Link = parameter(Link.VSL, "what the link from shoulder to elbow is made of")
    link_3: Link = parameter(Link.VSL, "what the link behind the elbow is made of")
    link_4: Link = parameter(
        Link.VSL,
        "what the third of three links is made of",
        origin=stated("sec. II-A, fig. 2: up to three links of variable stiffness"),
    )
    links: int = parameter(
        2,
        "how many links: two; one, with the gripper in place of the elbow and no J3; or a third, fixed to link 3",
        minimum=1,
        maximum=3,
        origin=stated("sec. II-A, fig. 1: two in series; up to three can be built"),
    )
    L_1: Metre = parameter(
        0.150,
        "height of the shoulder J2 above the base",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("not given; puts the shoulder between the heights of the paths of sec. V-A"),
    )
    L_2: Metre = parameter(
        0.225,
        "length from shoulder to elbow",
        minimum=0.01,
        maximum=2.0,
        origin=assumed("not given; L_2 + L_3 must be 0.42 m or more, or the curve of sec. V-A is out of reach"),
    )
    L_3: Metre = parameter(
        0.225,
        "length of the link behind the elbow",
        minimum=0.01,
        maximum=2.0,
        origin=assumed("not given; links are alike (fig. 2)"),
    )
    L_4: Metre = parameter(
        0.225,
        "length of the third of three links",
        minimum=0.01,
        maximum=2.0,
        origin=assumed("not given; links are alike (fig. 2)"),
    )
    cap: Metre = parameter(
        0.030,
        "length of the rigid cap at each end of a link",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("printed caps seal each end (sec. II-A, fig. 2); length not given"),
    )
    EI_0: NewtonMetre2 = parameter(
        0.55,
        "bending stiffness of a link without pressure",
        minimum=1e-3,
        maximum=1e6,
        origin=assumed("not given; such that the error of the tip is about what fig. 5 shows"),
    )
    EI_p: NewtonMetre2PerPascal = parameter(
        1.05e-5,
        "what pressure adds to it",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given; 1.05 N m2 per bar, such that the error falls with pressure about as in fig. 5"),
    )
    shear_0: Newton = parameter(
        60.0,
        "shear stiffness of a link without pressure",
        minimum=1.0,
        maximum=1e9,
        origin=assumed("not given; a soft sleeve shears"),
    )
    R_link: Metre = parameter(
        0.022,
        "radius of the air in a link: p pi R^2 is added",
        minimum=0.0,
        maximum=0.2,
        origin=assumed("not given; radius of the pressurised space"),
    )
    EI_rigid: NewtonMetre2 = parameter(
        150.0,
        "bending stiffness of a printed link, which does not shear",
        minimum=1.0,
        maximum=1e9,
        origin=assumed("not given; a printed tube"),
    )
    link_mass: Kilogram = parameter(
        0.140,
        "mass of a link, evenly spread",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("not given; rigid and soft links weigh the same (fig. 1)"),
    )
    EI_factor: Vector3[Number] = parameter(
        np.ones(3),
        "bending stiffness of links 2, 3 and 4 over that of such a link",
        minimum=1e-3,
        maximum=1e3,
        origin=assumed("links are alike (fig. 2); other values are arms of one's own"),
    )
    mass_factor: Vector3[Number] = parameter(
        np.ones(3),
        "mass of links 2, 3 and 4 over link_mass",
        minimum=0.0,
        maximum=1e3,
        origin=assumed("links are alike (fig. 2); other values are arms of one's own"),
    )
    servo_mass: Kilogram = parameter(
        0.125,
        "mass of the servo J3, at the elbow",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("Dynamixel XM430-W350-T (sec. II-A) weighs 82 g; with bracket and cables"),
    )
    gripper_mass: Kilogram = parameter(
        0.035,
        "mass of the gripper, at the tip",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("a light vacuum gripper (sec. II-A); mass not given"),
    )
    gravity: MetrePerSecond2 = parameter(
        9.81, "gravity, along -z of the world", minimum=0.0, maximum=30.0, origin=assumed("on the ground")
    )
    joint_stiffness: NewtonMetrePerRadian = parameter(
        140.0,
        "stiffness of gear and bracket of J2 and J3, behind the encoder",
        minimum=1.0,
        maximum=1e12,
        origin=assumed(
            "gear and bracket behind the encoder; such that the rigid arm has errors of some mm, as in fig. 5"
        ),
    )
    servo_stiffness: NewtonMetrePerRadian = parameter(
        260.0,
        "torque by the servo's droop, which the encoder sees",
        minimum=1.0,
        maximum=1e12,
        origin=assumed("droop of a servo under load; such that the servo path is near the desired one, as in fig. 5"),
    )
    joint_factor: Vector2[Number] = parameter(
        np.ones(2),
        "stiffness of J2 and J3 over joint_stiffness",
        minimum=1e-3,
        maximum=1e3,
        origin=assumed("J2 and J3 have servos of one kind (sec. II-A); other values are arms of one's own"),
    )
    droop_time: Second = parameter(
        0.1,
        "time constant of the droop of an arm that swings: the gear holds it longer",
        minimum=1e-3,
        maximum=10.0,
        origin=assumed("how fast a servo's control loop yields, not given"),
    )
    servo_speed: RadianPerSecond = parameter(
        4.8,
        "fastest turn of a joint",
        minimum=0.01,
        maximum=100.0,
        origin=derived("about the no-load speed of a Dynamixel XM430-W350-T (46 rev/min at 12 V)"),
    )
    kt: NewtonMetrePerAmpere = parameter(
        1.78,
        "torque by current of a servo",
        minimum=1e-3,
        maximum=100.0,
        origin=derived("Dynamixel XM430-W350-T: 4.1 N m at 2.3 A of stall current"),
    )
    gear_friction: NewtonMetre = parameter(
        0.06,
        "friction of a gear, in the current",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("not given; hides small torques from the current"),
    )
    friction_factor: Vector3[Number] = parameter(
        np.ones(3),
        "friction of the gears of J1, J2 and J3 over gear_friction",
        minimum=0.0,
        maximum=1e3,
        origin=assumed("gears are taken to be alike; other values are arms of one's own"),
    )
    sliding: Radian = parameter(
        0.002,
        "turn that reverses all the friction",
        minimum=1e-6,
        maximum=1.0,
        origin=assumed("play within which a gear's friction turns round"),
    )
    servo_noise: Radian = parameter(
        math.radians(0.06),
        "standard deviation of an encoder's reading",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("0.06 degrees, about a step of the servo's encoder of 4096 steps (0.088 degrees)"),
    )
    current_noise: Ampere = parameter(
        0.003,
        "standard deviation of a current's reading",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("about a step of the servo's current reading (2.69 mA)"),
    )
    tracker_noise: Metre = parameter(
        0.0005,
        "standard deviation of the tracker's reading, each axis",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("NDI Aurora (sec. IV-A); its maker states about 0.5 mm"),
    )
    pressure_noise: Pascal = parameter(
        200.0,
        "standard deviation of a transducer's reading",
        minimum=0.0,
        maximum=1e5,
        origin=assumed("analogue transducer read with 16 bits (sec. II-B); noise not given"),
    )
    imu_noise: MetrePerSecond2 = parameter(
        0.03,
        "standard deviation of an accelerometer's reading, each axis",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("sec. VI names IMUs as future work; 3 mg, of a small accelerometer at some 50 Hz"),
    )
    base_step: Radian = parameter(
        0.0,
        "step of the motor J1, with its microsteps; 0: a servo with an encoder",
        minimum=0.0,
        maximum=0.5,
        origin=assumed(
            "J1 is a stepper motor with an A4988 (sec. II-B), whose steps are not given; 0: a servo like the others"
        ),
    )
    encoder_step: Radian = parameter(
        0.0,
        "what a servo's encoder resolves, and its commands; 0: anything",
        minimum=0.0,
        maximum=0.5,
        origin=assumed(
            "the servos' 4096 counts a turn (the motor's data sheet) are left out: their noise is about as large"
        ),
    )
    transducer_step: Pascal = parameter(
        0.0,
        "what the converter of the transducers' signals resolves; 0: anything",
        minimum=0.0,
        maximum=1e5,
        origin=assumed("the converter's 16 bits (sec. II-B) are finer than the noise"),
    )
    regulator_step: Pascal = parameter(
        0.0,
        "what the signal to the pressure regulators resolves; 0: anything",
        minimum=0.0,
        maximum=1e5,
        origin=assumed("PWM of an Arduino Uno (sec. II-B), smoothed; its resolution is left out"),
    )
    pressure_time: Second = parameter(
        0.25,
        "time constant of regulator and hose, valve open",
        minimum=1e-3,
        maximum=100.0,
        origin=assumed("regulator and hose, not given"),
    )
    leak_time: Second = parameter(
        600.0,
        "time constant of the leak, valve closed",
        minimum=1.0,
        maximum=1e9,
        origin=assumed("the valve keeps the pressure (sec. II-A); leak not given"),
    )
    valve_tolerance: Pascal = parameter(
        500.0,
        "deviation at which the valve closes",
        minimum=1.0,
        maximum=1e5,
        origin=assumed("the valve closes at the wanted pressure (sec. II-A); how near is not given"),
    )
    valve_band: Pascal = parameter(
        2000.0,
        "deviation at which it opens again",
        minimum=1.0,
        maximum=1e5,
        origin=assumed("the valve opens if the pressure drops (sec. II-A); how far is not given"),
    )
    q_0: Vector3[Radian] = parameter(
        np.array([0.0, 0.8411, -1.6821]),
        "where the joints start, in rest",
        minimum=-MAX_ANGLE,
        maximum=MAX_ANGLE,
        origin=assumed("rest before a run; tip at (0.3, 0, 0.15) m, level with the shoulder"),
    )
    p_0: Vector2[Pascal] = parameter(
        np.array([1.0e5, 1.0e5]),
        "pressures of links 2 and 3 at the start",
        minimum=0.0,
        maximum=MAX_PRESSURE,
        origin=assumed("rest before a run; within the pressures of sec. V-C"),
    )
    p_4_0: Pascal = parameter(
        1.0e5,
        "pressure of the third of three links at the start",
        minimum=0.0,
        maximum=MAX_PRESSURE,
        origin=assumed("rest before a run; as of the other links"),
    )
    load_steps: str = parameter(
        "",
        "masses on the gripper, kg, and from when on, s, in place of the input load: `8:0.05 12:0`; empty: none",
        origin=assumed("the paper's loads hang throughout a path"),
    )
    hinges: int = parameter(6, "hinges of a flexible link, quasi-statically", minimum=1, maximum=100)
    hinges_dynamic: int = parameter(2, "hinges of a flexible link that swings", minimum=1, maximum=12)
    face: Metre = parameter(
        NO_FACE,
        "height of a level face that stops the gripper of an arm that swings; -10: none",
        minimum=NO_FACE,
        maximum=10.0,
        origin=assumed("nothing stops the gripper in the paper's experiments"),
    )
    face_stiffness: NewtonPerMetre = parameter(
        1000.0,
        "stiffness of face and cup against each other",
        minimum=1.0,
        maximum=1e5,
        origin=assumed("a silicone cup of some centimetres yields by 1 mm a newton; not given"),
    )
    face_damping: NewtonSecondPerMetre = parameter(
        3.0,
        "damping of face and cup against each other",
        minimum=0.0,
        maximum=1e4,
        origin=assumed("a tenth of critical against an arm whose tip moves some 0.2 kg; not given"),
    )
    damping_time: Second = parameter(
        0.005,
        "damping by stiffness of all springs of an arm that swings",
        minimum=0.0,
        maximum=1.0,
        origin=assumed(
            "damping of an arm that swings, by stiffness: 5.5 to 8 % of critical at its first mode of 3.5 "
            "to 5.1 Hz; not given"
        ),
    )
    substep: Second = parameter(0.005, "longest internal time step of an arm that swings", minimum=1e-5, maximum=0.01)
    high_frequency_damping: Number = parameter(
        0.8, "spectral radius of the time integration at high frequency", minimum=0.0, maximum=1.0
    )
    seed: int = parameter(0, "seed of the random numbers", minimum=0)

    @property
    def kinds(self) -> tuple[Link, ...]:
        """What the links are made of, from the shoulder outwards."""
        return (self.link_2, self.link_3, self.link_4)[: self.links]

    @property
    def lengths(self) -> tuple[float, ...]:
        """Lengths of the links, m."""
        return (self.L_2, self.L_3, self.L_4)[: self.links]

    def loads(self) -> Schedule:
        """Return the masses of load_steps.

        Raises:
            InvalidSchedule: it has another form, or a mass is out of range.
        """
        return Schedule.parse(self.load_steps, (1,), 0.0, MAX_LOAD)

    def check(self) -> None:
        """Raise InvalidVslArmParameters, with all faults, for values out of range or that contradict each other."""
        faults = parameter_faults(self) or self._contradictions()
        if faults:
            raise InvalidVslArmParameters(faults)

    def _contradictions(self) -> list[str]:
        faults: list[str] = []
        try:
            self.loads()
        except InvalidSchedule as e:
            faults.append(f"load_steps: {e.fault}")
        for name, length in zip(("L_2", "L_3", "L_4"), self.lengths, strict=False):
            if not 2.0 * self.cap < length:
                faults.append(
                    f"two caps of {self.cap:g} m leave nothing flexible of {name} {length:g} m: cap must be less than "
                    f"{length / 2.0:g} m"
                )
        if not self.valve_tolerance < self.valve_band:
            faults.append(
                f"valve_tolerance {self.valve_tolerance:g} Pa must be less than valve_band {self.valve_band:g} Pa, or "
                "the valve chatters"
            )
        if self.motion is Motion.QUASI_STATIC and self.face > NO_FACE:
            faults.append(
                f"a face at {self.face:g} m does not stop an arm that is at rest at every instant: motion DYNAMIC"
            )
        masses = (self.link_mass, self.gripper_mass, *self.mass_factor[: self.links])
        if self.motion is Motion.DYNAMIC and not min(masses) > 0.0:
            faults.append("link_mass, mass_factor and gripper_mass must be greater than 0 for an arm that swings")
        return faults
