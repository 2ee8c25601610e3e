"""Where the corners of the wrist's markers are, after [Vervloet2025] sec. 3.2.4."""

import numpy as np

SIDES = 8


class MarkerRing:
    """Eight ArUco markers around z_R, number i at i * 45 degrees from x_R towards y_R, middles in the plane z_R = 0.

    Marker i's frame M has z out of its face, y along z_R (towards the gripper) and x = y x z; its printed top is at
    +y_M. Shifting a marker along -z_M by the apothem gives the wrist, and from there along y_M the gripper.

    Attributes:
        corners: shape (8, 4, 3), in R, in m: upper left, upper right, lower right, lower left as printed.
        outline: shape (16, 3), in R, in m: corners of the box around all markers, with the margin they are printed in.

    Args:
        apothem: distance of the markers from the axis, in m.
        marker: side of a marker, in m.
    """

    def __init__(self, apothem: float, marker: float) -> None:
        angle = np.arange(SIDES) * 2.0 * np.pi / SIDES
        z_RM = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)])
        x_RM = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(SIDES)])
        square = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
        flat = square[:, :1] * x_RM[:, None] + square[:, 1:] * np.array([0.0, 0.0, 1.0])
        self.corners = apothem * z_RM[:, None] + 0.5 * marker * flat
        half = apothem * np.tan(np.pi / SIDES)
        self.outline = (apothem * z_RM[:, None] + half * flat[:, [0, 3]]).reshape(-1, 3)
