"""What follows from the parameters of the tendon-driven arm: discs, stiffnesses, masses, and the arm at rest."""

from typing import TYPE_CHECKING

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.tendon_parameters import InvalidArmParameters, Params

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_MOTOR_MASS = 1e3  # kg; a servo that a tendon's pull hardly moves (5 N: 8 um)


class TendonDesign:
    """A chain of discs, node 0 the mount, in the base frame B (z down along the hanging arm).

    Element e joins nodes e and e + 1; `segment[e]` is the segment that it belongs to. Each element's mass is shared by
    the discs at its ends, so the chain converges with the square of the disc counts. Tendon k of segment i is number 3
    i + k, at the angle s_k = 0, 120, 240 degrees from x of B towards y; it runs through the discs of its own segment
    only, since farther tendons are sheathed.

    Args:
        params: of the arm.
        block: whose arm it is, for errors.

    Raises:
        InvalidArmParameters: a parameter is out of range, or the tendons of a segment would hang slack.
    """

    def __init__(self, params: Params, block: str) -> None:
        params.check(block)
        self.params = params
        counts = np.array([params.discs_1, params.discs_2, params.discs_3])
        self.count = int(counts.sum())
        self.ends = np.concatenate([[0], np.cumsum(counts)])
        self.segment = np.repeat(np.arange(3), counts)
        self.natural = (params.natural_length / counts)[self.segment]
        self.mass, self.transverse_inertia, self.axial_inertia, self.centre = self._masses(counts)
        self.rest_tension, self.rest_z = self._hang(counts, block)
        angles = np.deg2rad([0.0, 120.0, 240.0])
        self.holes = params.d * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])

    @property
    def section_stiffness(self) -> Floats:
        """Stiffness of an element over its length: GA, GA and EA, in N, EI, EI and GJ, in N m2, (6,)."""
        p = self.params
        GA, GJ = p.shear_ratio * p.EA, p.twist_ratio * p.EI
        return np.array([GA, GA, p.EA, p.EI, p.EI, GJ])

    @property
    def damping_times(self) -> Floats:
        """Damping over stiffness in each strain, (6,), in s.

        None in shear: translational damping across would also damp the arm's turning as a whole.
        """
        return self.params.damping * np.array([0.0, 0.0, 1.0, 1.0, 1.0, 1.0])

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

    def poses(self, q: Floats) -> "tuple[Floats, Rotation]":
        """Return the n + 1 nodes' positions, (n + 1, 3), and rotations in B from the discs' coordinates.

        Args:
            q: six a disc: displacement from rest and rotation vector; what follows them is ignored.
        """
        from scipy.spatial.transform import Rotation  # slow to import, and TendonArmFast does without

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

    def _hang(self, counts: Floats, block: str) -> tuple[Floats, Floats]:
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
                ],
                block,
            )
        lengths = self.natural * (1.0 + (weight - 3.0 * tension[self.segment]) / EA)
        if np.any(lengths <= 0.0):
            raise InvalidArmParameters(
                ["the arm would be pressed to nothing: natural_length is too long for EA"], block
            )
        return tension, np.append(0.0, np.cumsum(lengths))
