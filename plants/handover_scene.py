"""Arm, gripper, ball and hand as one camera sees them."""

from typing import Protocol

import numpy as np

from handover.cosim.blocks.geometry import Pinhole, rotation_of
from handover.cosim.blocks.ports import Floats
from handover.plants.gripper_figure import gripper
from handover.plants.hand_figure import hand
from handover.plants.light import Light
from handover.plants.limb import sketched
from handover.plants.marker_collar import MarkerCollar
from handover.plants.shaded_ball import ShadedBall
from handover.plants.sketch import Decal, Sketch
from handover.plants.soft_tube import tube


class Postures(Protocol):
    """Where everything is, in W, in m; orientations as quaternions, scalar first; grip 0 (open) to 1 (closed)."""

    backbone: Floats
    p_WR: Floats
    q_WR: Floats
    p_WG: Floats
    q_WG: Floats
    grip: float
    p_WO: Floats
    p_WH: Floats


class HandoverScene:
    """The scene before one camera, as things whose depths give what hides what.

    Args:
        camera: that looks.
        arm_radius: of the soft arm's ribs, in m.
        ball_radius: in m.
        collar: with the markers, at the wrist.
    """

    def __init__(self, camera: Pinhole, arm_radius: float, ball_radius: float, collar: MarkerCollar) -> None:
        towards = np.array([-0.50, 0.34, 0.80])
        self._light = Light(towards / np.linalg.norm(towards), ambient=0.48)
        self._camera = camera
        self._arm_radius = arm_radius
        self._collar = collar
        self._ball = ShadedBall(ball_radius, camera, self._light)

    def seen(self, x: Postures) -> tuple[list[Sketch], list[Decal]]:
        """Return what there is to paint, in no order."""
        camera, light = self._camera, self._light
        arm = tube(x.backbone, self._arm_radius, 0.5 * self._collar.width, camera, light)
        body, prints = self._collar.sketched(x.p_WR, rotation_of(x.q_WR), camera, light)
        limbs = sketched(gripper(x.p_WR, x.p_WG, rotation_of(x.q_WG), x.grip) + hand(x.p_WH), camera, light)
        ball = self._ball.decal(x.p_WO)
        return [arm, body, limbs], prints if ball is None else [*prints, ball]
