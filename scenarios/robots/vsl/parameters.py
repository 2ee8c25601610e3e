"""Parameters of the paths of the arm with variable-stiffness links."""

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handover.controllers.vsl.hybrid_kinematics import Imu
from handover.controllers.vsl.hybrid_kinematics import Params as Kinematics
from handover.controllers.vsl.kinematics import format_point
from handover.controllers.vsl.learned_model import Learned
from handover.controllers.vsl.paths import Segment
from handover.controllers.vsl.trajectory_planner import Elbow, Path, segments_by
from handover.controllers.vsl.trajectory_planner import Params as Planner
from handover.controllers.vsl.waypoints import InvalidWaypoints
from handover.cosim.blocks.origins import assumed, stated
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.schedule import InvalidSchedule, Schedule
from handover.cosim.blocks.units import Kilogram, Metre, Number, Pascal
from handover.plants.vsl.parameters import MAX_PRESSURE, Link, Motion
from handover.plants.vsl.parameters import Params as ArmParams
from handover.scenarios.experiment.exposed import expose
from handover.scenarios.experiment.needs import any_of, being, parameter

_ONE_ARM = assumed("one arm was built; others are of one's own")

BAR = 1e5
"""Pa."""

_MAX_LOAD = 0.3  # kg (assumed)
_SAMPLES = 100  # of a segment, to find where it is below the ground


class Links(enum.IntEnum):
    """What link 2 and link 3 are made of."""

    VSL = 0
    RIGID = 1
    VSL_RIGID = 2
    RIGID_VSL = 3

    @property
    def kinds(self) -> tuple[Link, Link]:
        """Of link 2 and of link 3."""
        return (
            Link.RIGID if self in (Links.RIGID, Links.RIGID_VSL) else Link.VSL,
            Link.RIGID if self in (Links.RIGID, Links.VSL_RIGID) else Link.VSL,
        )


class Resolution(enum.IntEnum):
    """Whether angles and pressures are ideal, or as the published robot's electronics can."""

    IDEAL = 0
    ELECTRONICS = 1


BASE_STEP = math.radians(1.8) / 16.0
"""Angle of a microstep of the base's stepper motor, rad (assumed)."""

ENCODER_STEP = 2.0 * math.pi / 4096.0
"""Angle of a count of a Dynamixel XM430's encoder, rad."""

TRANSDUCER_STEP = 18.75
"""What an ADS1115 resolves of a transducer of 1 bar/V, at its range of 6.144 V and 16 bits, Pa (assumed)."""

REGULATOR_STEP = MAX_PRESSURE / 255.0
"""What PWM of 8 bits resolves of a regulator's range, Pa (assumed)."""


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """One run along a path, controlled by rigid-link kinematics."""

    path: Path = expose(Planner, "planner.path")
    waypoints: str = expose(Planner, "planner.waypoints", needs=(being("path", Path.CUSTOM),))
    load: Kilogram = parameter(
        0.075,
        "mass that hangs at the gripper; the paper's are 0 to 0.1 kg",
        minimum=0.0,
        maximum=_MAX_LOAD,
        origin=stated("sec. V-C: 75 g with 0.5 bar, the harder case of experiment 2"),
    )
    load_steps: str = expose(ArmParams, "arm.load_steps")
    pressure: Pascal = parameter(
        5e4,
        "pressure inside both links: 5e4 Pa is 0.5 bar; the paper's are 0.5 to 2 bar",
        minimum=0.0,
        maximum=MAX_PRESSURE,
        origin=stated("sec. V-C: 0.5 bar with 75 g, the harder case of experiment 2"),
    )
    pressure_difference: Pascal = parameter(
        0.0,
        "pressure inside link 3 less that inside link 2, which is then `pressure`",
        minimum=-MAX_PRESSURE,
        maximum=MAX_PRESSURE,
        origin=assumed("sec. V-C names one pressure for both links"),
    )
    pressure_steps: str = expose(Planner, "planner.pressure_steps")
    links: Links = parameter(
        Links.VSL,
        "links of variable stiffness, printed rigid ones of the same length, or one of each, link 2 first",
        origin=stated("sec. II-A: links can be exchanged with printed rigid ones of the same weight"),
    )
    motion: Motion = expose(ArmParams, "arm.motion")
    resolution: Resolution = parameter(
        Resolution.IDEAL,
        "ideal, or the robot's electronics: a stepper at the base, counts of encoders, 16 and 8 bits for pressures",
        origin=assumed("sec. II-B names converters, but neither ranges nor steps; errors of the figures are larger"),
    )
    speed: float = expose(Planner, "planner.V", minimum=0.001, maximum=0.5)
    points: int = expose(Planner, "planner.N")
    settle: float = expose(
        Planner,
        "planner.settle",
        start=5.0,
        origin=assumed(
            "half a turn of a joint at 0.8 rad/s, and a second; algorithms 1 and 2 begin with Move(q_k, dq_0)"
        ),
    )
    elbow: Elbow = expose(Planner, "planner.elbow", "kinematics.elbow")
    x_0: Floats = expose(
        Planner, "planner.x_0", minimum=-1.0, maximum=1.0, needs=(being("path", Path.CUSTOM), being("waypoints", ""))
    )
    x_g: Floats = expose(
        Planner,
        "planner.x_g",
        start=np.array([0.40, 0.0, 0.15]),
        minimum=-1.0,
        maximum=1.0,
        origin=assumed("end of a path of one's own; middle of the paper's curve"),
        needs=(being("path", Path.CUSTOM), being("waypoints", "")),
    )
    EI_factor: Number = parameter(
        1.0,
        "bending stiffness of both links over that of the arm that was trained on",
        minimum=0.1,
        maximum=10.0,
        origin=_ONE_ARM,
    )
    mass_factor: Number = parameter(
        1.0, "mass of both links over that of the trained arm", minimum=0.0, maximum=10.0, origin=_ONE_ARM
    )
    friction_factor: Number = parameter(
        1.0, "friction of all gears over that of the trained arm", minimum=0.0, maximum=100.0, origin=_ONE_ARM
    )
    joint_factor: Number = parameter(
        1.0,
        "stiffness of J2 and J3 behind their encoders over that of the trained arm",
        minimum=0.01,
        maximum=1e3,
        origin=_ONE_ARM,
    )
    arm_scatter: Number = parameter(
        0.0,
        "relative standard deviation by which each link's stiffness and mass, each gear's friction and each joint's "
        "stiffness differ besides",
        minimum=0.0,
        maximum=0.5,
        origin=assumed("one arm was built, whose scatter is not given"),
    )
    length_scatter: Metre = parameter(
        0.0,
        "standard deviation by which the length of each link differs",
        minimum=0.0,
        maximum=0.01,
        origin=assumed("one arm was built, whose scatter is not given"),
    )
    arm_seed: int = parameter(
        0,
        "which arm of those that scatter; apart from the run's seed",
        minimum=0,
        origin=assumed("own choice"),
        needs=(any_of("arm_scatter", "length_scatter"),),
    )
    tolerance: Metre = parameter(
        0.06,
        "largest mean error of the tip for which the run counts as a success",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("half more than the mean error of the default run, so that heavier loads are distinguished"),
    )

    @property
    def pressures(self) -> Floats:
        """Pressures of the second and the third link, shape (2,), Pa."""
        return np.array([self.pressure, self.pressure + self.pressure_difference])

    def loads(self) -> Schedule:
        """Return the masses of load_steps.

        Raises:
            InvalidSchedule: it has another form, or a mass is out of range.
        """
        return Schedule.parse(self.load_steps, (1,), 0.0, _MAX_LOAD)

    @property
    def masses(self) -> list[float]:
        """All masses that hang at the gripper at some time of a long run, the lightest first, kg."""
        return sorted({self.load, *(load for (load,) in self.loads().values)} - {0.0})

    def load_at(self, times: Floats) -> Floats:
        """Return what hangs at the gripper at some times, s, shape (n,), kg."""
        loads = self.loads()
        found = (loads.at(t) for t in times.tolist())
        return np.array([self.load if load is None else load[0] for load in found])

    def contradictions(self) -> list[str]:
        """Return everything that is wrong with values that are each in range."""
        faults = self.path_faults()
        if not 0.0 <= (p_3 := float(self.pressures[1])) <= MAX_PRESSURE:
            faults.append(
                f"pressure_difference: {self.pressure_difference:g} Pa makes the pressure inside link 3 {p_3:g} Pa; it "
                f"must be from 0 to {MAX_PRESSURE:g} Pa"
            )
        for name, parse in (
            ("load_steps", self.loads),
            ("pressure_steps", lambda: Schedule.parse(self.pressure_steps, (1, 2), 0.0, MAX_PRESSURE)),
        ):
            try:
                faults += self._steps_after_path(name, parse())
            except InvalidSchedule as e:
                faults.append(f"{name}: {e.fault}")
        return faults

    def _steps_after_path(self, name: str, schedule: Schedule) -> list[str]:
        """Return which steps are without effect, as the path has ended by then."""
        try:
            end = self.settle + self.length / self.speed
        except InvalidWaypoints:
            return []  # path_faults reports it
        late = [t for t in schedule.times if t >= end]
        return [f"{name}: nothing changes from {t:g} s on: the path ends at {end:.6g} s" for t in late]

    @property
    def q_0(self) -> Floats:
        """Joint angles at the start, with the tip 0.3 m from the base, level with the shoulder, shape (3,), rad."""
        sign = 1.0 if self.elbow is Elbow.UP else -1.0
        return sign * np.array([0.0, 0.8411, -1.6821])

    @property
    def points_in_all(self) -> int:
        """Points of all segments of the path together."""
        return self.points * len(self.segments())

    def segments(self) -> Sequence[Segment]:
        """Return the segments of the path.

        Raises:
            InvalidWaypoints: there is no file of that name, or it is not a list of waypoints.
        """
        return segments_by(self.path, self.x_0, self.x_g, self.waypoints)

    def path_faults(self) -> list[str]:
        """Return faults of a custom path: an end or a point below the ground, or what is wrong with its file."""
        if self.path is not Path.CUSTOM:
            return []
        if self.waypoints:
            return self._waypoint_faults()
        return [
            f"{name}: {format_point(p_WG)} is below the ground, z = 0 in W; its z must be at least 0"
            for name, p_WG in (("x_0", self.x_0), ("x_g", self.x_g))
            if p_WG[2] < 0.0
        ]

    def _waypoint_faults(self) -> list[str]:
        try:
            segments = self.segments()
        except InvalidWaypoints as e:
            return [f"waypoints: {e}"]
        ends = [segments[0].x_0, *(segment.x_g for segment in segments)]
        below = [
            f"waypoints: {self.waypoints}: waypoint {i}, {format_point(p_WG)}, is below the ground, z = 0 in W"
            for i, p_WG in enumerate(ends, 1)
            if p_WG[2] < 0.0
        ]
        lowest = [min(segment.sampled(_SAMPLES, 1.0)[0], key=lambda p_WG: p_WG[2]) for segment in segments]
        return below or [
            f"waypoints: {self.waypoints}: the way from waypoint {i} to {i + 1} goes through {format_point(p_WG)}, "
            "below the ground, z = 0 in W"
            for i, p_WG in enumerate(lowest, 1)
            if p_WG[2] < 0.0
        ]

    @property
    def length(self) -> float:
        """Length of the path, m."""
        return sum(segment.length for segment in self.segments())


@dataclass(frozen=True, kw_only=True)
class HybridParameters(Parameters):
    """One run along a path, controlled by rigid-link kinematics with learned corrections."""

    links: Links = parameter(
        Links.VSL,
        "links of variable stiffness, or rigid ones, of which the model that ships knows nothing; or one of each",
        origin=stated("sec. II-A: links can be exchanged with printed rigid ones of the same weight"),
    )
    tolerance: Metre = parameter(
        0.005,
        "largest mean error of the tip for which the run counts as a success",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("about the mean error of the arm with rigid links, which the hybrid is to beat (sec. V-C)"),
    )
    learned: Learned = expose(Kinematics, "kinematics.learned")
    model: str = expose(Kinematics, "kinematics.model")
    friction_compensation: bool = expose(Kinematics, "kinematics.friction_compensation")
    closed_loop: bool = expose(Kinematics, "kinematics.closed_loop")
    imu: Imu = expose(Kinematics, "kinematics.imu")
    vibration_damping: bool = expose(Kinematics, "kinematics.vibration_damping")

    @property
    def is_monitored(self) -> bool:
        """Whether tracker or IMUs tell if the arm is the one that was learned from."""
        return self.closed_loop or self.imu is not Imu.NONE

    def contradictions(self) -> list[str]:
        """Return everything that is wrong with values that are each in range."""
        faults = super().contradictions()
        if self.closed_loop and self.imu is not Imu.NONE:
            faults.append("imu: with closed_loop=true the tracker sees the tip itself, and IMUs are without effect")
        return faults
