"""What follows from the arm's parameters: discs, stiffnesses, masses, and where all hangs at rest.

Parameters of the tendon-driven arm, and what is wrong with them.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.ports import Floats, Vector3, parameter
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import (
    Hertz,
    Kilogram,
    Metre,
    MetrePerSecond2,
    Newton,
    NewtonMetre2,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    Number,
    Second,
)


class InvalidArmParameters(InvalidParameters):
    """Values of which no arm can be built; `faults` lists all of them."""

    block = "TendonArm"


@dataclass(frozen=True, kw_only=True)
class Params:
    """The arm as built; three entries are of the three segments from the mount down.

    [Vervloet2025] states `tendon_length` (sec. 3.1), `d_gripper` (appendix A) and `closing_time` (sec. 3.5). The rest
    is assumed, such that the sagged arm is as far from the constant-curvature model as in fig. 9.
    """

    discs_1: int = parameter(4, "discs in the first segment", minimum=1, maximum=64)
    discs_2: int = parameter(8, "discs in the second segment", minimum=1, maximum=64)
    discs_3: int = parameter(8, "discs in the third segment", minimum=1, maximum=64)
    tendon_length: Vector3[Metre] = parameter(
        np.array([0.12, 0.24, 0.24]), "lengths of the segments as calibrated, hanging", minimum=0.01, maximum=2.0
    )
    natural_length: Vector3[Metre] = parameter(
        np.array([0.14, 0.262, 0.262]),
        "lengths of the segments without tendons and weight: the excess tightens the tendons",
        minimum=0.01,
        maximum=2.0,
    )
    d_gripper: Metre = parameter(0.10, "distance of wrist and gripper", minimum=0.0, maximum=1.0)
    d: Metre = parameter(0.035, "distance of the tendons from the axis", minimum=0.001, maximum=0.5)
    EA: Newton = parameter(100.0, "axial stiffness of the segments", minimum=1.0, maximum=1e5)
    EI: NewtonMetre2 = parameter(0.0267, "bending stiffness of the segments", minimum=1e-4, maximum=1e2)
    shear_ratio: Number = parameter(0.35, "shear stiffness over axial stiffness, GA / EA", minimum=0.01, maximum=10.0)
    twist_ratio: Number = parameter(2.0, "twisting over bending stiffness, GJ / EI", minimum=0.01, maximum=100.0)
    damping: Second = parameter(
        0.03, "damping over stiffness, in axial strain, bending and twist", minimum=0.0, maximum=10.0
    )
    segment_mass: Vector3[Kilogram] = parameter(
        np.array([0.10, 0.16, 0.13]), "masses of the segments, spread over their lengths", minimum=0.001, maximum=10.0
    )
    plate_mass: Vector3[Kilogram] = parameter(
        np.array([0.03, 0.03, 0.05]), "masses of the plates that end the segments", minimum=0.0, maximum=10.0
    )
    shortest: Number = parameter(
        0.4, "lower end stop of a motor: tendon length over calibrated length", minimum=0.1, maximum=1.0
    )
    longest: Number = parameter(
        2.0, "upper end stop of a motor: tendon length over calibrated length", minimum=1.0, maximum=10.0
    )
    gripper_mass: Kilogram = parameter(0.10, "mass of the gripper", minimum=0.0, maximum=10.0)
    gravity: MetrePerSecond2 = parameter(9.81, "gravity, along -z of the world", minimum=0.0, maximum=30.0)
    tendon_stiffness: NewtonPerMetre = parameter(
        1e4, "stiffness of a tendon of its calibrated length", minimum=100.0, maximum=1e6
    )
    tendon_damping: NewtonSecondPerMetre = parameter(10.0, "damping of a tendon likewise", minimum=0.0, maximum=1e4)
    slack_force: Newton = parameter(
        0.005, "what a slack tendon pushes at most, for the solver's sake", minimum=1e-4, maximum=1.0
    )
    motor_frequency: Hertz = parameter(
        4.0, "natural frequency of the motors, critically damped", minimum=0.1, maximum=50.0
    )
    closing_time: Second = parameter(10.0, "time of the gripper's full travel", minimum=0.01, maximum=100.0)
    internal_step: Second = parameter(0.005, "time step of the integrator", minimum=1e-4, maximum=0.01)

    def check(self) -> None:
        """Raise InvalidArmParameters, with all faults, if a value lies outside its range."""
        faults = parameter_faults(self)
        if faults:
            raise InvalidArmParameters(faults)


_MOTOR_MASS = 1e3  # kg: a servo that a tendon's pull hardly moves (5 N: 8 um)


class TendonDesign:
    """A chain of discs, node 0 the mount, in the base frame B (z down along the hanging arm).

    Element e joins nodes e and e + 1; `segment[e]` says whose it is. Each element's mass is shared by the discs at its
    ends, so the chain converges with the square of the disc counts. Tendon k of segment i is number 3 i + k, at the
    angle s_k = 0, 120, 240 degrees from x of B towards y; it runs through the discs of its own segment only, since
    farther tendons are sheathed.

    Raises:
        InvalidArmParameters: a parameter is out of range, or the tendons of a segment would hang slack.
    """

    def __init__(self, params: Params) -> None:
        params.check()
        self.params = params
        counts = np.array([params.discs_1, params.discs_2, params.discs_3])
        self.count = int(counts.sum())
        self.ends = np.concatenate([[0], np.cumsum(counts)])
        self.segment = np.repeat(np.arange(3), counts)
        self.natural = (params.natural_length / counts)[self.segment]
        self.mass, self.transverse_inertia, self.axial_inertia, self.centre = self._masses(counts)
        self.rest_tension, self.rest_z = self._hang(counts)
        angles = np.deg2rad([0.0, 120.0, 240.0])
        self.holes = params.d * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])

    @property
    def motor_mass(self) -> float:
        """Inertia of a motor, referred to its tendon's length, in kg."""
        return _MOTOR_MASS

    @property
    def motor_stiffness(self) -> float:
        """Stiffness of a motor's control, in N/m."""
        return _MOTOR_MASS * (2.0 * np.pi * self.params.motor_frequency) ** 2

    @property
    def tendon_EA(self) -> Floats:
        """Stiffness times length of the nine tendons, in N."""
        return np.repeat(self.params.tendon_stiffness * self.params.tendon_length, 3)

    @property
    def tendon_DA(self) -> Floats:
        """Damping times length of the nine tendons, in N s."""
        return np.repeat(self.params.tendon_damping * self.params.tendon_length, 3)

    @property
    def rest_motor(self) -> Floats:
        """How far the resting motors yield to the nine tendons, in m."""
        return np.repeat(self.rest_tension, 3) / self.motor_stiffness

    @property
    def reference_length(self) -> Floats:
        """Lengths of the nine tendons free of force with their motors at 0, such that the arm hangs as calibrated."""
        loaded = np.repeat(self.params.tendon_length, 3)
        return loaded * self.tendon_EA / (self.tendon_EA + np.repeat(self.rest_tension, 3)) - self.rest_motor

    def poses(self, q: Floats) -> tuple[Floats, Rotation]:
        """Return the n + 1 nodes' positions, (n + 1, 3), and rotations in B from the discs' coordinates.

        Args:
            q: six a disc: displacement from rest and rotation vector; what follows them is ignored.
        """
        coordinates = np.zeros((self.count + 1, 6))
        coordinates[1:] = q[: 6 * self.count].reshape(self.count, 6)
        p = coordinates[:, :3]
        p[:, 2] += self.rest_z
        return p, Rotation.from_rotvec(coordinates[:, 3:])

    def _masses(self, counts: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return mass, inertia about the node across and along the axis, and centre's z of each node.

        Discs and plates are thin, of radius d; halves of the elements beside them are rods; the gripper is a cylinder.
        """
        half = (self.params.segment_mass / counts / 2.0)[self.segment]
        halves = np.append(0.0, half) + np.append(half, 0.0)
        rods = half * (self.natural / 2.0) ** 2 / 3.0
        transverse = np.append(0.0, rods) + np.append(rods, 0.0)
        mass = halves
        mass[self.ends[1:]] += self.params.plate_mass
        centre = np.zeros_like(mass)
        gripper, length = self.params.gripper_mass, self.params.d_gripper
        mass[-1] += gripper
        centre[-1] = gripper * length / 2.0 / mass[-1]
        transverse[-1] += gripper * length**2 / 3.0
        transverse += mass * self.params.d**2 / 4.0
        return mass, transverse, mass * self.params.d**2 / 2.0, centre

    def _hang(self, counts: Floats) -> tuple[Floats, Floats]:
        """Return a tendon's tension in each segment, (3,), and the nodes' z in B, (n + 1,), at rest.

        Straight, an element carries the weight w below it and is pressed by its segment's three tendons:
        l_e = l0 (1 + (w_e - 3 T) / EA), and the elements of a segment make up its calibrated length.
        """
        EA = self.params.EA
        weight = self.params.gravity * np.cumsum(self.mass[::-1])[::-1][1:]
        weights = np.array([weight[self.segment == i].sum() for i in range(3)])
        l0 = self.params.natural_length / counts
        tension = ((self.params.natural_length - self.params.tendon_length) * EA / l0 + weights) / counts / 3.0
        if np.any(tension <= 0.0):
            raise InvalidArmParameters(
                [
                    f"the tendons of segment {i + 1} would hang slack ({tension[i]:.3g} N): natural_length "
                    f"{self.params.natural_length[i]:g} m must exceed tendon_length {self.params.tendon_length[i]:g} m"
                    for i in np.flatnonzero(tension <= 0.0)
                ]
            )
        lengths = self.natural * (1.0 + (weight - 3.0 * tension[self.segment]) / EA)
        if np.any(lengths <= 0.0):
            raise InvalidArmParameters(["the arm would be pressed to nothing: natural_length is too long for EA"])
        return tension, np.append(0.0, np.cumsum(lengths))
