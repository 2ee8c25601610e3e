"""Fingers of a person against the free-flyer's gripper: phalanges are kept off its palm and its jaws by springs."""

from collections.abc import Sequence

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Vector,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    inverse_rotate,
    norm,
    relative_quaternion,
    rotate,
    rotation_matrix,
    scale,
    subtract,
)
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.hand.box import Box
from handover.plants.free_flyer.hand.hand_kinematics import RADIUS, REACH, Ball, Segment
from handover.plants.free_flyer.hand.parameters import ContactParams

PALM_THICKNESS, JAW_SIDES = 0.012, (0.06, 0.04, 0.008)
"""Thickness of the palm, and sides of a jaw, m, assumed."""
_NEAR = RADIUS + 1e-9
"""Metres from the gripper within which a ball around bones may have one whose phalanx touches it."""


class GripperSolids:
    """Palm and jaws as boxes along the axes of G, and what each phalanx that touches them presses with.

    That is stiffness times depth plus damping times speed, and it only pushes. The hand is not deflected by it: its arm
    presses with at most arm_force_max in all.
    """

    def __init__(self, params: ContactParams) -> None:
        self._p = p = params
        self._palm = Box((0.5 * PALM_THICKNESS, p.palm_width, p.palm_width))
        self._jaw = Box(scale(0.5, JAW_SIDES))
        deep, wide = p.palm_depth + PALM_THICKNESS, max(p.palm_width, 0.5 * JAW_SIDES[1])
        self._around = Box((max(deep, 0.5 * JAW_SIDES[0]), wide, max(p.palm_width, 0.5 * p.aperture + JAW_SIDES[2])))
        """A box about G that has the others in it, whatever the angle."""
        self._far = norm(self._around.half) + REACH

    def press(
        self, fingers: Sequence[tuple[Sequence[Segment], Ball]], H: Frame, G: Frame, angle: float
    ) -> tuple[Vector, Vector]:
        """Return force and torque about G of phalanges on the gripper, N, N m, in W.

        Args:
            fingers: the lines in the middle of each finger's phalanges, and a ball that these are in, in H.
            H: the hand, with its velocity.
            G: the gripper, with its velocity.
            angle: between the gripper's fingers, rad.
        """
        if norm(subtract(H.p, G.p)) > self._far:
            return ZERO, ZERO
        p = self._p
        gap = max(0.0, p.aperture * (angle - p.angle_empty) / (p.angle_open - p.angle_empty))
        aside = 0.5 * (gap + JAW_SIDES[2])
        solids = [
            (self._palm, (p.palm_depth + 0.5 * PALM_THICKNESS, 0.0, 0.0)),
            (self._jaw, (0.0, 0.0, aside)),
            (self._jaw, (0.0, 0.0, -aside)),
        ]
        f, tau = ZERO, ZERO
        p_GH, R_GH = inverse_rotate(G.R, subtract(H.p, G.p)), rotation_matrix(relative_quaternion(G.q, H.q))
        near = [bones for bones, (c, r) in fingers if self._around.distance(add(p_GH, rotate(R_GH, c))) < r + _NEAR]
        for bone in (bone for bones in near for bone in bones):
            a, b = add(p_GH, rotate(R_GH, bone[0])), add(p_GH, rotate(R_GH, bone[1]))
            if self._around.least_room((a, b)) >= RADIUS:
                continue
            for solid, place in solids:
                line = subtract(a, place), subtract(b, place)
                if solid.least_room(line) >= RADIUS:
                    continue
                away, c = solid.nearest(line)
                if away < RADIUS:
                    f_W, arm = self._pushed(RADIUS - away, scale(-1.0, solid.normal(c)), add(c, place), H, G)
                    f, tau = add(f, f_W), add_cross(tau, arm, f_W)
        most = norm(f) / p.arm_force_max
        return (f, tau) if most <= 1.0 else (scale(1.0 / most, f), scale(1.0 / most, tau))

    def _pushed(self, depth: float, n: Vector, p_GC: Vector, H: Frame, G: Frame) -> tuple[Vector, Vector]:
        """Return the force of a phalanx along n of G, and where it acts, seen from G, both in W."""
        p = self._p
        n_W, arm = rotate(G.R, n), rotate(G.R, add_scaled(p_GC, RADIUS - depth, n))
        v_H = add_cross(H.v, H.w, subtract(add(G.p, arm), H.p))
        v = subtract(v_H, add(G.v, cross(G.w, arm)))
        return scale(max(0.0, p.finger_stiffness * depth + p.finger_damping * dot(v, n_W)), n_W), arm
