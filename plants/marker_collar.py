"""The octagonal collar at the wrist with a fiducial marker on each side."""

import cv2
import numpy as np

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.plants.light import Light
from handover.plants.sketch import Decal, Pixels, Sketch

_SIDES = 8
_CELL = 8  # texture px a marker cell
_MARKER = 6 * _CELL  # a marker's width: 4 bits and a border on either side
_PLASTIC = np.array([226.0, 230.0, 232.0])
_INK = 0.1  # brightness of black print over the plastic's
_CORNERS = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])  # in M: upper left first, clockwise


class MarkerCollar:
    """Eight square sides around z_R; the middle of side i lies at i * 45 degrees from x_R towards y_R.

    On side i sits ArUco marker i of DICT_4X4_50. Its frame M has z out of the face, y along z_R, that is towards the
    gripper, and x = y x z; the marker's printed top is at +y_M, so that a hanging arm's markers stand on their heads.

    Args:
        apothem: distance of the sides from the axis, in m.
        marker: side of a marker's black square, in m.
    """

    def __init__(self, apothem: float, marker: float) -> None:
        self.width = 2.0 * apothem * np.tan(np.pi / _SIDES)
        margin = max(1, round(_MARKER * 0.5 * (self.width / marker - 1.0)))
        self._faces = [_face(i, margin) for i in range(_SIDES)]
        printed = marker * (1.0 + 2.0 * margin / _MARKER)  # the texture's width
        angle = np.arange(_SIDES) * 2.0 * np.pi / _SIDES
        self._z_RM = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_SIDES)])
        x_RM = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(_SIDES)])
        square = _CORNERS[:, :1] * x_RM[:, None] + _CORNERS[:, 1:] * np.array([0.0, 0.0, 1.0])  # (8, 4, 3)
        middle = apothem * self._z_RM[:, None]
        self._corners = np.stack([middle + 0.5 * self.width * square, middle + 0.5 * printed * square])

    def sketched(self, p_WR: Floats, R_WR: Floats, camera: Pinhole, light: Light) -> tuple[Sketch, list[Decal]]:
        """Return the body with the sides and ends that face the camera, and the prints on these sides."""
        R_RW = np.transpose(R_WR)
        corners = p_WR + self._corners @ R_RW
        faces, prints = camera.project(corners)
        ends = [faces[:, 0], faces[:, 3]]
        quads = np.repeat(faces, 2, axis=1)  # as many corners as an end has
        z_R = R_WR[:, 2]
        normals = np.concatenate([[z_R, -z_R], self._z_RM @ R_RW])
        middles = np.concatenate([corners[0, :, [0, 3]].mean(axis=1), corners[0].mean(axis=1)])
        facing = np.einsum("ij,ij->i", camera.p_WC - middles, normals) > 0.0
        shades = light.shade(normals)
        shades[:2] *= 0.8
        depth = float(camera.depth(p_WR))
        outlines = np.concatenate([ends, quads])[facing]
        body = Sketch(np.array([depth]), outlines[None], (shades[facing, None] * _PLASTIC)[None])
        lit = np.flatnonzero(facing[2:])
        return body, [Decal(depth - 1e-6, _shaded(self._faces[i], float(shades[2 + i])), prints[i]) for i in lit]


def _face(i: int, margin: int) -> Pixels:
    """Return marker i in a margin of the collar's colour, as a decal's texture."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    white = np.asarray(cv2.aruco.generateImageMarker(dictionary, i, _MARKER), dtype=np.float64) / 255.0
    paper = np.pad(_INK + (1.0 - _INK) * white, margin, constant_values=1.0)
    face = np.full((*paper.shape, 4), 255, dtype=np.uint8)
    face[..., :3] = np.rint(paper[:, :, None] * _PLASTIC)
    return face


def _shaded(texture: Pixels, brightness: float) -> Pixels:
    return (texture * np.array([brightness, brightness, brightness, 1.0])).astype(np.uint8)
