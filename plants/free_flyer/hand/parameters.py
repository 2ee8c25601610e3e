"""Parameters of the person, the object and the gripper that meet in microgravity, and what is wrong with them."""

import enum
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import NOT_GIVEN, assumed, derived, stated
from handover.cosim.blocks.plain_rotation import column, normalize, quaternion, rotation_matrix
from handover.cosim.blocks.ports import Vector3, Vector4, parameter
from handover.cosim.blocks.units import (
    Hertz,
    Kilogram,
    Metre,
    MetrePerSecond,
    MetrePerSecond2,
    Newton,
    NewtonMetre,
    NewtonMetrePerRadian,
    NewtonMetreSecondPerRadian,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    Number,
    PerSecond,
    Radian,
    RadianPerSecond,
    RadianPerSecond2,
    Second,
)
from handover.plants.free_flyer.rigid_body import unit_faults

MIN_ROOM = 0.05
"""Metres that must lie between the gripper's and the hand's place on an object for both to hold it (assumed)."""

OF_PERSON = (
    *("reaction_time", "reaction_spread", "reach_speed", "grasp_time", "attempts", "patience"),
    *("pull_direction", "pull_speed", "pull_ramp", "pull_distance", "push_speed", "push_ramp", "push_distance"),
    *("effort", "effort_spread", "push_share", "arm_mass", "offer_gap", "fist_offset"),
    *("line_of_sight", "sight_error", "depth_error", "interface_delay", "timing_error", "haste"),
    *("tremor_rms", "tremor_frequency", "tremor_bandwidth", "drift_rms", "drift_time"),
)
"""Parameters that only a simulated person has: a hand that is driven by anything else ignores them."""


class InvalidHandParameters(InvalidParameters):
    """Parameters, or a start, that contradict each other; `faults` lists all of them."""

    block = "HandAndObject"


class Motion(enum.IntEnum):
    """What the person does at the robot's signal."""

    NONE = 0
    TAKE = 1
    GIVE = 2
    PUSH = 3


class Driver(enum.IntEnum):
    """Who moves the hand."""

    PERSON = 0
    TRACK = 1
    OUTSIDE = 2


class StartHolder(enum.IntEnum):
    """Who has the object at the start."""

    FREE = 0
    HAND = 1


@dataclass(frozen=True, kw_only=True)
class PersonParams:
    """What the person does, with what arm, and the object: [Fernandes2020] sec. 4.1.2, its sides in metres."""

    motion: Motion = parameter(
        Motion.TAKE, "what the person does at the robot's first signal", origin=stated("sec. 5.5")
    )
    motion_again: Motion = parameter(
        Motion.GIVE, "what the person does at each later signal", origin=stated("sec. 5.5, T3")
    )
    object_with: StartHolder = parameter(
        StartHolder.FREE, "who has the object at the start", origin=stated("sec. 4.3.1")
    )
    p_WO_0: Vector3[Metre] = parameter(
        np.array([-0.10, -0.57, 0.0]), "where a free object is at the start", origin=NOT_GIVEN
    )
    q_WO_0: Vector4[Number] = parameter(
        np.array([1.0, 0.0, 0.0, 0.0]), "orientation of a free object at the start", origin=NOT_GIVEN
    )
    p_WH_0: Vector3[Metre] = parameter(np.array([-0.40, 0.10, -0.05]), "where the hand rests", origin=NOT_GIVEN)
    q_WH_0: Vector4[Number] = parameter(
        np.array([1.0, 0.0, 0.0, 0.0]), "orientation of the hand where it rests", origin=NOT_GIVEN
    )
    arm_reach: Metre = parameter(
        0.90, "how far from its rest the hand goes", minimum=0.05, maximum=5.0, origin=NOT_GIVEN
    )

    object_mass: Kilogram = parameter(
        0.1, "mass of the object", minimum=0.001, maximum=100.0, origin=stated("sec. 4.1.2")
    )
    object_size: Vector3[Metre] = parameter(
        np.array([0.021, 0.195, 0.017]),
        "sides of the object, a box",
        minimum=0.001,
        maximum=1.0,
        origin=derived("sec. 4.1.2 prints mm; they are metres"),
    )
    p_OG: Vector3[Metre] = parameter(
        np.array([0.0, -0.07, 0.0]),
        "where the person offers the object to the gripper",
        origin=derived("as handover_place.p_OG"),
    )
    p_OH: Vector3[Metre] = parameter(
        np.array([0.0, 0.07, 0.0]),
        "where the hand takes hold of the object",
        origin=derived("sec. 3.1.1: the other end of the object"),
    )

    reaction_time: Second = parameter(
        0.35, "mean time from seeing to acting", minimum=0.0, maximum=10.0, origin=NOT_GIVEN
    )
    reaction_spread: Number = parameter(0.15, "its deviation, relative", minimum=0.0, maximum=0.3, origin=NOT_GIVEN)
    reach_speed: MetrePerSecond = parameter(
        0.40, "highest speed of a reach", minimum=0.01, maximum=3.0, origin=NOT_GIVEN
    )
    grasp_time: Second = parameter(
        0.40, "how long the fingers close or open", minimum=0.01, maximum=10.0, origin=NOT_GIVEN
    )
    pull_direction: Vector3[Number] = parameter(
        np.array([-0.25, 0.0, 1.0]),
        "direction of a pull, in the world",
        origin=assumed("sec. 4.3.1: the gripper is moved mostly along z; how far along x is not given"),
    )
    pull_speed: MetrePerSecond = parameter(
        0.35,
        "speed of a pull that nothing resists",
        minimum=0.001,
        maximum=3.0,
        origin=assumed("not given: that of a hand which nothing resists"),
    )
    pull_ramp: Second = parameter(
        0.30, "how long its effort takes to rise", minimum=0.01, maximum=10.0, origin=NOT_GIVEN
    )
    pull_distance: Metre = parameter(0.30, "longest pull", minimum=0.0, maximum=2.0, origin=NOT_GIVEN)
    push_speed: MetrePerSecond = parameter(
        0.15,
        "speed of a push that nothing resists",
        minimum=0.001,
        maximum=3.0,
        origin=assumed("not given: that of a hand which nothing resists"),
    )
    push_ramp: Second = parameter(
        0.30, "how long its effort takes to rise", minimum=0.01, maximum=10.0, origin=NOT_GIVEN
    )
    push_distance: Metre = parameter(
        0.30, "longest push, including the gap to the palm", minimum=0.0, maximum=2.0, origin=NOT_GIVEN
    )
    effort: Newton = parameter(
        2.0,
        "force of a pull at rest",
        minimum=0.05,
        maximum=100.0,
        origin=assumed("not given; the scenario's is its parameter strength"),
    )
    push_share: Number = parameter(
        0.5,
        "force of a push, relative to a pull's",
        minimum=0.05,
        maximum=2.0,
        origin=assumed("not given: more tilts the object in the hand"),
    )
    arm_mass: Kilogram = parameter(
        1.0, "mass of the arm, as the hand feels it", minimum=0.05, maximum=50.0, origin=NOT_GIVEN
    )
    offer_gap: Metre = parameter(
        0.04, "how far before the palm a push begins", minimum=0.0, maximum=0.5, origin=NOT_GIVEN
    )
    patience: Second = parameter(
        10.0, "how long the person pulls or pushes in vain", minimum=0.1, maximum=1e4, origin=NOT_GIVEN
    )

    arm_stiffness: NewtonPerMetre = parameter(
        120.0, "stiffness of the arm", minimum=1.0, maximum=5000.0, origin=NOT_GIVEN
    )
    arm_damping: NewtonSecondPerMetre = parameter(
        12.0, "damping of the arm", minimum=0.0, maximum=200.0, origin=NOT_GIVEN
    )
    arm_force_max: Newton = parameter(
        3.0, "force at which the arm yields", minimum=0.1, maximum=200.0, origin=NOT_GIVEN
    )
    wrist_stiffness: NewtonMetrePerRadian = parameter(
        2.5, "stiffness of the wrist", minimum=0.01, maximum=200.0, origin=NOT_GIVEN
    )
    wrist_damping: NewtonMetreSecondPerRadian = parameter(
        0.20, "damping of the wrist", minimum=0.0, maximum=10.0, origin=NOT_GIVEN
    )
    wrist_torque_max: NewtonMetre = parameter(
        0.6, "torque at which the wrist yields", minimum=0.01, maximum=50.0, origin=NOT_GIVEN
    )
    recovery_time: Second = parameter(
        1.0, "how long an arm takes to recover from yielding", minimum=0.05, maximum=1e6, origin=NOT_GIVEN
    )
    fist_radius: Metre = parameter(0.035, "radius of a fist", minimum=0.005, maximum=0.2, origin=NOT_GIVEN)
    fist_offset: Metre = parameter(
        -0.07, "where along y of G a fist pushes", minimum=-0.3, maximum=0.3, origin=NOT_GIVEN
    )


@dataclass(frozen=True, kw_only=True)
class TrackParams(PersonParams):
    """What may lead a hand in place of that person, and how it follows."""

    driven_by: Driver = parameter(
        Driver.PERSON, "who moves the hand: a simulated person, a file, or the inputs", origin=NOT_GIVEN
    )
    track: str = parameter("", "CSV file of a recorded track of a hand, of driven_by TRACK", origin=NOT_GIVEN)
    age_max: Second = parameter(
        0.2,
        "age from which tracking counts as lost; longest gap of a track",
        minimum=0.001,
        maximum=10.0,
        origin=NOT_GIVEN,
    )
    hand_bandwidth: PerSecond = parameter(
        20.0,
        "how fast a hand follows its track: it lags by the inverse",
        minimum=0.5,
        maximum=100.0,
        origin=assumed("sec. 4.2.3: the simulated hand follows in less than 0.1 s; here in 0.05 s"),
    )
    hand_speed_max: MetrePerSecond = parameter(
        2.0, "speed at which it follows", minimum=0.01, maximum=10.0, origin=NOT_GIVEN
    )
    hand_acceleration_max: MetrePerSecond2 = parameter(
        20.0, "its acceleration", minimum=0.1, maximum=200.0, origin=NOT_GIVEN
    )
    hand_turning_max: RadianPerSecond = parameter(
        8.0, "its angular velocity", minimum=0.1, maximum=50.0, origin=NOT_GIVEN
    )
    hand_turning_acceleration_max: RadianPerSecond2 = parameter(
        80.0, "its angular acceleration", minimum=1.0, maximum=1000.0, origin=NOT_GIVEN
    )
    finger_force: Newton = parameter(
        0.1,
        "force of a phalanx whose joint wants on, if the hand follows a track",
        minimum=0.0,
        maximum=20.0,
        origin=NOT_GIVEN,
    )


@dataclass(frozen=True, kw_only=True)
class ContactParams(PersonParams):
    """Fingers, the gripper's hold, and a person's errors and tremor: all that does not depend on who leads a hand."""

    finger_rate: RadianPerSecond = parameter(
        12.0, "speed of the hand's joints", minimum=0.1, maximum=100.0, origin=NOT_GIVEN
    )
    finger_stiffness: NewtonPerMetre = parameter(
        300.0, "stiffness of a phalanx", minimum=1.0, maximum=1e5, origin=NOT_GIVEN
    )
    finger_damping: NewtonSecondPerMetre = parameter(
        3.0, "damping of a phalanx", minimum=0.0, maximum=1000.0, origin=NOT_GIVEN
    )

    grip_stiffness: NewtonPerMetre = parameter(
        800.0, "stiffness of the grip", minimum=1.0, maximum=1e5, origin=NOT_GIVEN
    )
    grip_damping: NewtonSecondPerMetre = parameter(
        8.0, "damping of the grip", minimum=0.0, maximum=1000.0, origin=NOT_GIVEN
    )
    grip_force_max: Newton = parameter(
        5.0, "force at which the object slides", minimum=0.01, maximum=1000.0, origin=NOT_GIVEN
    )
    grip_turn_stiffness: NewtonMetrePerRadian = parameter(
        4.0, "its turning stiffness", minimum=0.01, maximum=1e4, origin=NOT_GIVEN
    )
    grip_turn_damping: NewtonMetreSecondPerRadian = parameter(
        0.04, "its turning damping", minimum=0.0, maximum=100.0, origin=NOT_GIVEN
    )
    grip_torque_max: NewtonMetre = parameter(
        0.4, "torque at which it turns in the grip", minimum=0.001, maximum=100.0, origin=NOT_GIVEN
    )
    centring_time: Second = parameter(
        0.5, "how long the grip takes to centre", minimum=0.01, maximum=100.0, origin=NOT_GIVEN
    )
    palm_stiffness: NewtonPerMetre = parameter(
        600.0, "stiffness of the palm", minimum=1.0, maximum=1e5, origin=NOT_GIVEN
    )
    palm_damping: NewtonSecondPerMetre = parameter(
        6.0, "damping of the palm", minimum=0.0, maximum=1000.0, origin=NOT_GIVEN
    )
    palm_depth: Metre = parameter(0.03, "how far the palm lies behind G", minimum=0.001, maximum=0.5, origin=NOT_GIVEN)
    palm_width: Metre = parameter(0.04, "half the width of the palm", minimum=0.001, maximum=0.5, origin=NOT_GIVEN)
    capture_axial: Metre = parameter(
        0.03, "how far along x of G the fingers reach", minimum=0.001, maximum=0.2, origin=NOT_GIVEN
    )
    capture_lateral: Metre = parameter(
        0.02, "how far along z of G they reach", minimum=0.001, maximum=0.2, origin=NOT_GIVEN
    )
    capture_end: Metre = parameter(
        0.01, "how far beyond an object's end G may be", minimum=0.0, maximum=0.1, origin=NOT_GIVEN
    )
    angle_open: Radian = parameter(
        1.20, "angle of the open gripper", minimum=0.0, maximum=3.0, origin=assumed("above beta, sec. 4.1.2")
    )
    angle_empty: Radian = parameter(
        0.60,
        "angle of the gripper closed on nothing",
        minimum=0.0,
        maximum=3.0,
        origin=assumed("below beta, sec. 4.1.2"),
    )
    angle_0: Radian = parameter(
        1.20,
        "angle of the gripper at the start",
        minimum=0.0,
        maximum=3.0,
        origin=assumed("open, for trying the unit; the handovers begin with handover_place.angle_0"),
    )
    aperture: Metre = parameter(
        0.055, "thickness that the open gripper just takes", minimum=0.001, maximum=0.5, origin=NOT_GIVEN
    )
    release_angle: Radian = parameter(
        0.20, "how far the fingers open before the object comes free", minimum=0.0, maximum=3.0, origin=NOT_GIVEN
    )
    grip_fades: bool = parameter(
        False,
        "until then the force and torque that it holds fall, with how far they open",
        origin=assumed("not given: the grip is as firm as ever until it lets go"),
    )
    gripper_rate: RadianPerSecond = parameter(
        0.6, "speed of the gripper's angle", minimum=0.01, maximum=100.0, origin=NOT_GIVEN
    )

    line_of_sight: Vector3[Number] = parameter(
        np.array([1.0, 0.0, 0.0]),
        "where the person looks, in the world",
        origin=derived("sec. 5.7: the participants look at a screen before them, towards the robot"),
    )
    sight_error: Metre = parameter(
        0.002,
        "deviation of where things are seen, along each axis across the line of sight",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given: of a skilled person"),
    )
    depth_error: Metre = parameter(
        0.006,
        "the same along the line of sight",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given: of a skilled person; a screen shows depth worst"),
    )
    interface_delay: Second = parameter(
        0.05, "how old is what the person sees", minimum=0.0, maximum=5.0, origin=assumed("sec. 4.2.3: less than 0.1 s")
    )
    timing_error: Second = parameter(
        0.05,
        "deviation of how early fingers are taken for closed or opened",
        minimum=0.0,
        maximum=5.0,
        origin=assumed("not given: of a skilled person"),
    )
    effort_spread: Number = parameter(
        0.05, "deviation of the effort, relative", minimum=0.0, maximum=0.5, origin=NOT_GIVEN
    )
    haste: Number = parameter(
        0.0,
        "share of attempts in which the person does not wait for the gripper",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given: of a skilled person"),
    )
    finger_reach: Metre = parameter(
        0.04,
        "how far from the object's middle line the hand may be for its fingers to get it",
        minimum=0.001,
        maximum=0.2,
        origin=assumed("not given: half a finger's length"),
    )
    palm_back: Metre = parameter(
        0.03, "how far the palm of the hand lies behind its middle", minimum=0.001, maximum=0.2, origin=NOT_GIVEN
    )
    attempts: int = parameter(3, "how often the person tries at a signal", minimum=1, maximum=100, origin=NOT_GIVEN)

    tremor_rms: Metre = parameter(
        0.0005, "root mean square length of the tremor", minimum=0.0, maximum=0.05, origin=NOT_GIVEN
    )
    tremor_frequency: Hertz = parameter(8.0, "middle of the tremor's band", minimum=0.1, maximum=50.0, origin=NOT_GIVEN)
    tremor_bandwidth: Hertz = parameter(
        2.0, "width of the tremor's band at half power", minimum=0.01, maximum=50.0, origin=NOT_GIVEN
    )
    drift_rms: Metre = parameter(
        0.002, "root mean square length of the drift", minimum=0.0, maximum=0.1, origin=NOT_GIVEN
    )
    drift_time: Second = parameter(5.0, "correlation time of the drift", minimum=0.1, maximum=1000.0, origin=NOT_GIVEN)
    substep: Second = parameter(
        0.016, "longest step of the integration", minimum=1e-5, maximum=0.1, origin=assumed("numerical")
    )
    seed: int = parameter(0, "seed of the random numbers", minimum=0)

    @property
    def angle_object(self) -> float:
        """Angle of the gripper closed on the object, in rad; its fingers close along z."""
        return self.angle_empty + (self.angle_open - self.angle_empty) * float(self.object_size[2]) / self.aperture

    def gripper_faults(self) -> list[str]:
        """Return what is wrong with a gripper that is to hold and release an object of these sides."""
        faults: list[str] = []
        if not self.angle_empty < self.angle_open:
            faults.append(f"angle_empty {self.angle_empty:g} rad must be less than angle_open {self.angle_open:g} rad")
        if not self.angle_empty <= self.angle_0 <= self.angle_open:
            faults.append(
                f"angle_0 {self.angle_0:g} rad must lie between angle_empty {self.angle_empty:g} rad and angle_open "
                f"{self.angle_open:g} rad"
            )
        if self.angle_object + self.release_angle > self.angle_open:
            faults.append(
                f"the object never comes free: the fingers hold it at {self.angle_object:g} rad and must open by "
                f"release_angle {self.release_angle:g} rad, which is beyond angle_open {self.angle_open:g} rad; "
                "make release_angle less or angle_open more"
            )
        if not self.object_size[2] < self.aperture:
            faults.append(
                f"aperture {self.aperture:g} m must exceed the object's thickness, object_size[3] "
                f"{self.object_size[2]:g} m, or it does not fit into the gripper"
            )
        if not self.object_size[0] / 2.0 < self.palm_depth + self.capture_axial:
            faults.append(
                f"an object {self.object_size[0]:g} m wide against a palm at {self.palm_depth:g} m is out of the "
                f"fingers' reach, capture_axial {self.capture_axial:g} m: make that, or palm_depth, more"
            )
        return faults

    def person_faults(self) -> list[str]:
        """Return what is wrong with the person's motions and errors."""
        faults = unit_faults("q_WO_0", self.q_WO_0) + unit_faults("q_WH_0", self.q_WH_0)
        if not np.linalg.norm(self.pull_direction) > 0.0:
            faults.append("pull_direction must not be zero: give a vector of any other length")
        if not np.linalg.norm(self.line_of_sight) > 0.0:
            faults.append("line_of_sight must not be zero: give a vector of any other length")
        if not self.tremor_bandwidth < 2.0 * self.tremor_frequency:
            faults.append(
                f"tremor_bandwidth {self.tremor_bandwidth:g} Hz must be less than twice tremor_frequency "
                f"{self.tremor_frequency:g} Hz"
            )
        if self.motion is Motion.GIVE and self.object_with is StartHolder.FREE:
            faults.append("motion GIVE at the first signal needs the object in the hand: object_with HAND")
        if self.motion is Motion.TAKE and self.object_with is StartHolder.HAND:
            faults.append("motion TAKE at the first signal needs the object elsewhere: object_with FREE")
        return faults


@dataclass(frozen=True, kw_only=True)
class Params(ContactParams, TrackParams):
    """Object: [Fernandes2020] sec. 4.1.2, its sides in metres. All other values are assumed.

    The object lies across the gripper, its long side along y: that makes the handover place (0, -0.07, 0) of
    [Fernandes2020] the position of an end of an object whose centre is in the world's origin.
    """

    def check(self) -> None:
        """Raise InvalidHandParameters, with all faults, if values contradict each other."""
        faults = self._object_faults() + self.gripper_faults() + self.person_faults()
        faults += self._track_faults() + self._start_faults()
        if faults:
            raise InvalidHandParameters(faults)

    def _object_faults(self) -> list[str]:
        faults: list[str] = []
        size = np.asarray(self.object_size)
        if not size[1] >= max(size[0], size[2]):
            faults.append(f"object_size {size.tolist()} m: the second side must be the longest, it is held at its ends")
        for name, place in (("p_OG", self.p_OG), ("p_OH", self.p_OH)):
            if np.any(np.abs(place) > size / 2.0):
                entries, half = np.asarray(place).tolist(), (size / 2.0).tolist()
                faults.append(f"{name} {entries} m must lie inside the object, within {half} m of its centre")
        room = float(np.linalg.norm(np.asarray(self.p_OG) - self.p_OH))
        if room < MIN_ROOM:
            faults.append(f"p_OG and p_OH are {room:g} m apart; gripper and hand need {MIN_ROOM:g} m; move one")
        return faults

    def _track_faults(self) -> list[str]:
        faults: list[str] = []
        if self.driven_by is Driver.TRACK and not self.track:
            faults.append("driven_by TRACK needs a file of a track: track")
        if self.track and self.driven_by is not Driver.TRACK:
            faults.append(f"track {self.track} is given, and driven_by is {self.driven_by.name}, not TRACK")
        return faults

    def _start_faults(self) -> list[str]:
        gap = self._start_gap() if self.object_with is StartHolder.FREE else 0.0
        fault = f"p_WH_0 and p_WO_0: the hand starts {-gap:.3g} m inside the object; move one away"
        return [fault] if gap < 0.0 else []

    def _start_gap(self) -> float:
        """Return the room between fist and object at the start, the object taken as a rod along its long side."""
        y = np.array(column(rotation_matrix(normalize(quaternion(np.asarray(self.q_WO_0)))), 1))
        apart = np.asarray(self.p_WH_0) - self.p_WO_0
        half = float(self.object_size[1]) / 2.0
        nearest = apart - y * min(max(float(apart @ y), -half), half)
        thick = max(float(self.object_size[0]), float(self.object_size[2])) / 2.0
        return float(np.linalg.norm(nearest)) - self.fist_radius - thick
