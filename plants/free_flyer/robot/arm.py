"""A serial arm of revolute joints on a free-flying base: its dimensions and its postures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    IDENTITY,
    ZERO,
    Matrix,
    Quaternion,
    Vector,
    add,
    add_scaled,
    cross,
    quaternion_multiply,
    rotate,
    rotation_matrix,
    scale,
    subtract,
    vector,
)
from handover.cosim.blocks.ports import Floats

JOINTS_MAX = 3

Joints = tuple[float, ...]
"""A number a joint, from the base outwards."""


@dataclass(frozen=True)
class Arm:
    """An arm of n joints, n from 1 to 3; joint j turns link j, the last link ends in the gripper G.

    All vectors are in the axes of B with all angles zero, when every link's axes are those of B.

    Attributes:
        root: of the first joint, seen from B, m.
        axes: unit vectors of the joints.
        links: from a link's joint to the next one's, or to G, m.
        centres: where along a link its centre of mass is, as a share of it.
        masses: of the links, kg.
        inertias: principal moments of the links about their centres of mass, kg m^2.
        rotors: inertia of the drives' rotors about the joints, as seen behind their gears, kg m^2.
    """

    root: Vector
    axes: tuple[Vector, ...]
    links: tuple[Vector, ...]
    centres: Joints
    masses: Joints
    inertias: tuple[Vector, ...]
    rotors: Joints

    @classmethod
    def of(
        cls,
        n: int,
        p_BG: Floats,
        axes: Floats,
        links: Floats,
        centres: Floats,
        masses: Floats,
        inertias: Floats,
        rotors: Floats,
    ) -> "Arm":
        """Return the arm of the first n rows or entries, whose gripper is at p_BG (3,) with all angles zero."""
        rows = tuple(vector(link) for link in links[:n])
        root = vector(p_BG)
        for link in rows:
            root = subtract(root, link)
        return cls(
            root=root,
            axes=tuple(vector(axis / np.linalg.norm(axis)) for axis in axes[:n]),
            links=rows,
            centres=tuple(centres[:n].tolist()),
            masses=tuple(masses[:n].tolist()),
            inertias=tuple(vector(row) for row in inertias[:n]),
            rotors=tuple(rotors[:n].tolist()),
        )


class Posture:
    """An arm at angles q_J in rad, seen from B in its axes.

    Attributes:
        axes, origins: of the joints.
        centres: of mass of the links.
        columns: J_ij = a_j x (r_i - o_j), for each joint j a list over the links i, zero for links before the joint.
        turns: matrices R_BL of the links.
        p_BG, q_BG: pose of the gripper.
        p_BC: centre of mass C of base and links.
        shifts: dp_BC/dq_j.

    Args:
        arm: its dimensions.
        q_J: a joint's angle each, rad.
        mass: of base and links, kg.
    """

    def __init__(self, arm: Arm, q_J: Sequence[float], mass: float) -> None:
        p, q = arm.root, IDENTITY
        axes, origins, centres, turns = list[Vector](), list[Vector](), list[Vector](), list[Matrix]()
        for axis, link, share, angle in zip(arm.axes, arm.links, arm.centres, q_J, strict=True):
            axes.append(rotate(rotation_matrix(q), axis))
            origins.append(p)
            q = quaternion_multiply(q, (math.cos(0.5 * angle), *scale(math.sin(0.5 * angle), axis)))
            turns.append(rotation_matrix(q))
            along = rotate(turns[-1], link)
            centres.append(add_scaled(p, share, along))
            p = add(p, along)
        self.axes, self.origins, self.centres, self.turns = axes, origins, centres, turns
        self.columns: list[list[Vector]] = [
            [cross(a, subtract(r, o)) if j <= i else ZERO for i, r in enumerate(centres)]
            for j, (a, o) in enumerate(zip(axes, origins, strict=True))
        ]
        self.p_BG: Vector = p
        self.q_BG: Quaternion = q
        self.p_BC, *self.shifts = (_mean(arm.masses, mass, places) for places in (centres, *self.columns))


def _mean(masses: Joints, mass: float, of_links: Sequence[Vector]) -> Vector:
    """Return the sum of masses times vectors, over a mass."""
    total = ZERO
    for m, x in zip(masses, of_links, strict=True):
        total = add_scaled(total, m, x)
    return scale(1.0 / mass, total)
