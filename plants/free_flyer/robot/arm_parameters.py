"""Parameters of a free-flyer's arm: links, joints, drives and end stops, and what is wrong with them."""

import math
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.origins import NOT_GIVEN, assumed, derived, stated
from handover.cosim.blocks.ports import Floats, Matrix3, Vector3, parameter
from handover.cosim.blocks.units import (
    Kilogram,
    KilogramMetre2,
    Metre,
    NewtonMetre,
    NewtonMetreSecondPerRadian,
    Number,
    Radian,
    Second,
)
from handover.plants.free_flyer.robot.arm import Arm, Joints
from handover.plants.free_flyer.robot.stopping_joints import JointLimits

NEVER = 1e6
"""Seconds after the start at which what never happens does."""


@dataclass(frozen=True, kw_only=True)
class ArmParameters:
    """The arm's first `joints` rows and entries count. Astrobee's arm by NASA's description of it, else assumed.

    Its second link is the distal one with the gripper. Without joints the arm is a part of the one rigid body.
    """

    joints: int = parameter(
        0,
        "number of the arm's joints; 0: the arm is fixed",
        minimum=0,
        maximum=3,
        origin=stated("eq. (4.1): the joints are fixed"),
    )
    axis_J: Matrix3[Number] = parameter(
        np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
        "axes of the joints, a row each, in B with all angles zero, of any length",
        origin=derived(
            "Astrobee's description of its perching arm: stretched out, the proximal joint tilts, the "
            "distal one pans; a third joint is assumed"
        ),
    )
    link: Matrix3[Metre] = parameter(
        np.array([[-0.10, 0.0, 0.0], [-0.08, 0.0, 0.0], [-0.04, 0.0, 0.0]]),
        "links, a row each, from a joint to the next or to the gripper, in B with all angles zero",
        origin=assumed(
            "Astrobee's description of its perching arm: the proximal link; from the distal joint to "
            "where the fingers hold, and a third link, assumed"
        ),
    )
    centre_L: Vector3[Number] = parameter(
        np.full(3, 0.5),
        "where along its link a link's centre of mass is, as a share",
        origin=assumed("not given: the middles of the links"),
    )
    mass_L: Vector3[Kilogram] = parameter(
        np.array([0.1623, 0.2178, 0.1145]),
        "masses of the links",
        origin=derived(
            "Astrobee's description of its perching arm: the proximal link, the distal one with the "
            "fingers, and the fingers alone for a third"
        ),
    )
    I_L: Matrix3[KilogramMetre2] = parameter(
        np.array([[0.02705] * 3, [0.013525] * 3, [0.01082] * 3]),
        "principal moments of the links about their centres of mass, a row each, along the axes of B with angles zero",
        origin=derived("Astrobee's description of its perching arm: its links' moments of inertia, the fingers' added"),
    )
    rotor_J: Vector3[KilogramMetre2] = parameter(
        np.zeros(3),
        "inertia of the drives' rotors about the joints, behind their gears",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("not given: the links' moments in Astrobee's description are large enough to have them"),
    )
    q_J_0: Vector3[Radian] = parameter(
        np.zeros(3),
        "angles of the joints at the start, and goals of their drives",
        origin=assumed("not given: Astrobee's arm stretched out"),
    )
    lower_J: Vector3[Radian] = parameter(
        np.array([-2.0944, -1.5708, -1.5708]),
        "lower end stops of the joints",
        origin=derived("Astrobee's description of its perching arm; a third joint as the second"),
    )
    upper_J: Vector3[Radian] = parameter(
        np.array([1.5708, 1.5708, 1.5708]),
        "upper end stops of the joints",
        origin=derived("Astrobee's description of its perching arm; a third joint as the second"),
    )
    tolerance_J: Radian = parameter(
        10.0,
        "how far from their goals the drives let the joints go; 0 fixes them, as in the thesis",
        maximum=10.0,
        origin=assumed(
            'sec. 4.1.2: "considerably small" in the thesis, which fixed the joints; here they are free '
            "if they move at all"
        ),
    )
    torque_max_J: Vector3[NewtonMetre] = parameter(
        np.ones(3),
        "largest torque of a joint's drive",
        minimum=0.0,
        maximum=1000.0,
        origin=derived("Astrobee's description of its perching arm; a third joint the same"),
    )
    friction_J: Vector3[NewtonMetre] = parameter(
        np.zeros(3), "dry friction of the joints", minimum=0.0, maximum=1000.0, origin=NOT_GIVEN
    )
    drag_J: Vector3[NewtonMetreSecondPerRadian] = parameter(
        np.zeros(3), "viscous friction of the joints", minimum=0.0, maximum=1000.0, origin=NOT_GIVEN
    )
    lock_time: Second = parameter(
        NEVER, "when the joints lock where they are", minimum=0.0, maximum=NEVER, origin=assumed("never")
    )

    def arm(self, p_BG: Floats) -> Arm:
        """Return the arm, whose gripper is at p_BG (3,) with all angles zero."""
        n = self.joints
        return Arm.of(n, p_BG, self.axis_J, self.link, self.centre_L, self.mass_L, self.I_L, self.rotor_J)

    def limits(self) -> JointLimits:
        """Return what stops the joints: end stops, or drives that let a joint go no farther from its goal."""
        lower = np.maximum(self.lower_J, self.q_J_0 - self.tolerance_J)
        upper = np.minimum(self.upper_J, self.q_J_0 + self.tolerance_J)
        return JointLimits(*(self.of_joints(a) for a in (lower, upper, self.friction_J, self.drag_J)))

    def of_joints(self, values: Floats) -> Joints:
        """Return the joints' entries."""
        return tuple(values[: self.joints].tolist())

    def arm_faults(self) -> list[str]:
        """Return what no arm has, and joints that start outside of their range."""
        faults = [fault for j in range(self.joints) for fault in self._link_faults(j) + self._limit_faults(j)]
        if self.joints and not self.tolerance_J >= 0.0:
            faults.append(f"tolerance_J {self.tolerance_J:g} rad must not be negative")
        return faults

    def _link_faults(self, j: int) -> list[str]:
        faults: list[str] = []
        axis, link, mass = self.axis_J[j], self.link[j], float(self.mass_L[j])
        if not 0.0 < float(np.linalg.norm(axis)) < math.inf:
            faults.append(f"axis_J[{j + 1}] {axis.tolist()} must be finite and not zero")
        if not np.all(np.isfinite(link)):
            faults.append(f"link[{j + 1}] {link.tolist()} m must be finite")
        if not 0.0 < mass < math.inf:
            faults.append(f"mass_L[{j + 1}] {mass:g} kg must be positive and finite")
        moments: list[float] = sorted(self.I_L[j].tolist())
        small, middle, large = moments
        if not all(0.0 < moment < math.inf for moment in moments):
            faults.append(f"I_L[{j + 1}] {moments} kg m2 must be positive and finite, or it is not positive definite")
        elif large > (small + middle) * (1.0 + 1e-9):
            faults.append(f"no body has I_L[{j + 1}] {moments} kg m2: the largest may not exceed the sum of the others")
        return faults

    def _limit_faults(self, j: int) -> list[str]:
        low, high, start = float(self.lower_J[j]), float(self.upper_J[j]), float(self.q_J_0[j])
        if not low <= high:
            return [f"lower_J[{j + 1}] {low:g} rad must not exceed upper_J[{j + 1}] {high:g} rad"]
        if not low <= start <= high:
            return [f"q_J_0[{j + 1}] {start:g} rad must lie between lower_J {low:g} rad and upper_J {high:g} rad"]
        return []
