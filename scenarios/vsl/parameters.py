"""Parameters of the paths of the arm with variable-stiffness links; origins of the defaults are in `paper.toml`."""

from dataclasses import dataclass

import numpy as np

from handover.controllers.vsl.kinematics import format_point
from handover.controllers.vsl.learned_model import Learned
from handover.controllers.vsl.paths import segments_of
from handover.controllers.vsl.trajectory_planner import Elbow, Path
from handover.cosim.blocks.ports import Floats, Vector3, parameter
from handover.cosim.blocks.units import Kilogram, Metre, MetrePerSecond, Number, Pascal, Second
from handover.plants.vsl.parameters import MAX_PRESSURE, Link, Motion


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """One run along a path, controlled by rigid-link kinematics."""

    path: Path = parameter(Path.CURVE, "path of the tip; custom is a straight line from x_0 to x_g")
    load: Kilogram = parameter(
        0.075, "mass that hangs at the gripper; the paper's are 0 to 0.1 kg", minimum=0.0, maximum=0.3
    )
    pressure: Pascal = parameter(
        5e4,
        "pressure inside both links: 5e4 Pa is 0.5 bar; the paper's are 0.5 to 2 bar",
        minimum=0.0,
        maximum=MAX_PRESSURE,
    )
    links: Link = parameter(Link.VSL, "links of variable stiffness, or the printed rigid ones of the same length")
    motion: Motion = parameter(Motion.QUASI_STATIC, "arm in equilibrium at every instant, or with its oscillations")
    speed: MetrePerSecond = parameter(0.05, "speed of the tip along the path, V", minimum=0.001, maximum=0.5)
    points: int = parameter(100, "points of each segment of the path, N", minimum=1, maximum=10000)
    settle: Second = parameter(
        5.0, "time before the path, for getting to its start and calming down", minimum=0.0, maximum=600.0
    )
    elbow: Elbow = parameter(Elbow.UP, "which way it points; down, it is below the ground on the paper's paths")
    x_0: Vector3[Metre] = parameter(
        np.array([0.30, 0.0, 0.05]), "start of a custom path in W, z at least 0", minimum=-1.0, maximum=1.0
    )
    x_g: Vector3[Metre] = parameter(
        np.array([0.40, 0.0, 0.15]), "end of a custom path in W, z at least 0", minimum=-1.0, maximum=1.0
    )
    EI_factor: Number = parameter(
        1.0, "bending stiffness of both links over that of the arm that was trained on", minimum=0.1, maximum=10.0
    )
    mass_factor: Number = parameter(1.0, "mass of both links likewise", minimum=0.0, maximum=10.0)
    friction_factor: Number = parameter(1.0, "friction of all gears likewise", minimum=0.0, maximum=100.0)
    joint_factor: Number = parameter(
        1.0, "stiffness of J2 and J3 behind their encoders likewise", minimum=0.01, maximum=1e3
    )
    arm_scatter: Number = parameter(
        0.0,
        "relative standard deviation by which each link's stiffness and mass, each gear's friction and each joint's "
        "stiffness differ besides",
        minimum=0.0,
        maximum=0.5,
    )
    length_scatter: Metre = parameter(
        0.0, "standard deviation by which the length of each link differs", minimum=0.0, maximum=0.01
    )
    arm_seed: int = parameter(0, "which arm of those that scatter; apart from the run's seed", minimum=0)
    tolerance: Metre = parameter(
        0.06, "largest mean error of the tip for which the run counts as a success", minimum=0.0, maximum=1.0
    )

    @property
    def pressures(self) -> Floats:
        """Pressures of the second and the third link, shape (2,), Pa."""
        return np.array([self.pressure, self.pressure])

    @property
    def q_0(self) -> Floats:
        """Joint angles at the start, with the tip 0.3 m from the base, level with the shoulder, shape (3,), rad."""
        sign = 1.0 if self.elbow is Elbow.UP else -1.0
        return sign * np.array([0.0, 0.8411, -1.6821])

    @property
    def points_in_all(self) -> int:
        """Points of all segments of the path together."""
        return self.points * len(segments_of(self.path, self.x_0, self.x_g))

    def path_faults(self) -> list[str]:
        """Return faults of the path's ends: below the ground, or given for a path that has ends of its own."""
        default, faults = type(self)(), list[str]()
        for name, p_WG, p_WG_default in (("x_0", self.x_0, default.x_0), ("x_g", self.x_g, default.x_g)):
            if self.path is not Path.CUSTOM and not np.array_equal(p_WG, p_WG_default):
                path = self.path.name.lower()
                faults.append(f"{name}: the path {path} has ends of its own; {name} is for path=custom only")
            elif self.path is Path.CUSTOM and p_WG[2] < 0.0:
                faults.append(f"{name}: {format_point(p_WG)} is below the ground, z = 0 in W; its z must be at least 0")
        return faults

    @property
    def length(self) -> float:
        """Length of the path, m."""
        return sum(segment.length for segment in segments_of(self.path, self.x_0, self.x_g))


@dataclass(frozen=True, kw_only=True)
class HybridParameters(Parameters):
    """One run along a path, controlled by rigid-link kinematics with learned corrections."""

    links: Link = parameter(
        Link.VSL, "links of variable stiffness, or rigid ones, of which the model that ships knows nothing"
    )
    tolerance: Metre = parameter(
        0.005, "largest mean error of the tip for which the run counts as a success", minimum=0.0, maximum=1.0
    )
    learned: Learned = parameter(
        Learned.CUBIC, "what corrects: polynomials, a small network, the paper's, which needs a model, or a beam"
    )
    model: str = parameter("", "file of a trained model; empty: the one that ships")
    window: bool = parameter(False, "whether the direction of motion tells the gears' friction from the load")
    closed_loop: bool = parameter(False, "whether the tracker, too, tells the controller where the tip is")
    swing: bool = parameter(False, "whether joints are turned against swings that changes of speed excite")
