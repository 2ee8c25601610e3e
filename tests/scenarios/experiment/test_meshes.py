"""Meshes are closed, look outwards and have the size that they were asked for."""

from collections import Counter

import numpy as np
import pytest

from handover.scenarios.experiment.replay import Mesh, ball, merged, prism, rod

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
ROUND_VOLUME = np.pi * 0.1**2 * 1.0 + 4.0 / 3.0 * np.pi * 0.1**3


def volume(mesh: Mesh) -> float:
    """Return what the triangles enclose, m3; positive only if they look outwards."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    ("mesh", "wanted", "short"),
    [
        (prism(SQUARE, 0.5, 1.0), 1.0, 0.0),
        (ball(0.5), 4.0 / 3.0 * np.pi * 0.125, 0.05),
        (rod(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([0.1, 0.1])), ROUND_VOLUME, 0.1),
    ],
    ids=["prism", "ball", "rod"],
)
def test_a_mesh_encloses_its_volume(mesh: Mesh, wanted: float, short: float):
    assert (1.0 - short) * wanted - 1e-9 <= volume(mesh) <= wanted + 1e-9


def test_every_edge_of_a_ball_is_between_two_triangles_and_sides_of_a_prism_share_no_vertices():
    edges = [(int(t[k]), int(t[(k + 1) % 3])) for t in ball(1.0).triangles for k in range(3)]
    assert Counter(edges) == Counter((b, a) for a, b in edges)
    assert len(prism(SQUARE, 0.0, 1.0).vertices) == 24, "so its edges look sharp"


def test_merged_meshes_keep_their_triangles_apart():
    both = merged([prism(SQUARE, 0.0, 1.0), prism(SQUARE, 0.0, 1.0).moved(np.array([5.0, 0.0, 0.0]))])
    assert volume(both) == pytest.approx(4.0)
    assert np.ptp(both.vertices[both.triangles][:, :, 0], axis=1).max() == pytest.approx(2.0)
