import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.controllers.helix.vision.markers import MarkerRing, Markers
from handover.controllers.helix.vision.ring_fit import RingFit
from handover.controllers.helix.vision.stereo import covariance
from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of
from handover.cosim.blocks.ports import Floats

RING = MarkerRing(0.034, 0.020)
R_WB = np.diag([1.0, -1.0, -1.0])
P_WR = np.array([0.03, -0.05, -0.58])
R_WR = Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix() @ R_WB


def camera(name: str, y: float) -> Pinhole:
    p_WC = np.array([-0.95, y, -0.6])
    q_WC = quaternion_of(looking_at(p_WC, np.array([0.0, 0.0, -0.6])))
    return Pinhole(name, p_WC, q_WC, np.array([907.0, 907.0, 640.0, 360.0]), np.array([0.1, -0.2, 0.001, 0.0, 0.0]))


CAMERAS = (camera("left", 0.25), camera("right", -0.25))


def seen(noise: float = 0.0, seed: int = 0) -> list[Markers]:
    """Markers that face each camera by 60 degrees or less."""
    rng = np.random.default_rng(seed)
    pictures: list[Markers] = []
    for c in CAMERAS:
        middles = P_WR + RING.corners.mean(axis=1) @ np.transpose(R_WR)
        to_camera = c.p_WC - middles
        normals = (middles - P_WR) / np.linalg.norm(middles - P_WR, axis=1, keepdims=True)
        facing = np.einsum("ij,ij->i", to_camera, normals) > 0.5 * np.linalg.norm(to_camera, axis=1)
        ids = np.flatnonzero(facing)
        pixels = c.project(P_WR + RING.corners[ids] @ np.transpose(R_WR))
        pictures.append(Markers(ids, pixels + rng.normal(0.0, noise, pixels.shape)))
    return pictures


def with_ids(markers: Markers, ids: list[int]) -> Markers:
    return Markers(np.array(ids), markers.corners)


NONE = Markers(np.empty(0, dtype=np.int64), np.empty((0, 4, 2)))


def angle(R: Floats) -> float:
    return float(Rotation.from_matrix(np.transpose(R) @ R_WR).magnitude())


def test_finds_the_exact_pose_from_exact_corners():
    pose = RingFit(RING, CAMERAS, 1.2).fit(seen(), None)
    assert pose is not None
    np.testing.assert_allclose(pose.p_WR, P_WR, atol=1e-9)
    assert angle(pose.R_WR) < 1e-7


def test_one_camera_does():
    pose = RingFit(RING, CAMERAS, 1.2).fit([NONE, seen()[1]], None)
    assert pose is not None
    np.testing.assert_allclose(pose.p_WR, P_WR, atol=1e-7)


def test_covariance_is_the_scatter():
    fit = RingFit(RING, CAMERAS, 1.2)
    errors: list[Floats] = []
    squares: list[float] = []
    for seed in range(60):
        pose = fit.fit(seen(0.2, seed), (P_WR, R_WR))
        assert pose is not None
        e = pose.p_WR - P_WR
        errors.append(e)
        squares.append(float(e @ np.linalg.solve(covariance(pose.information, 0.2)[:3, :3], e)))
    assert 2.0 < np.mean(squares) < 4.0
    assert np.linalg.norm(np.mean(errors, axis=0)) < 2e-4


def test_a_misread_marker_is_left_out():
    left, right = seen()
    wrong = with_ids(left, [(int(i) + (2 if k == 0 else 0)) % 8 for k, i in enumerate(left.ids)])
    pose = RingFit(RING, CAMERAS, 1.2).fit([wrong, right], None)
    assert pose is not None
    np.testing.assert_allclose(pose.p_WR, P_WR, atol=1e-7)


@pytest.mark.parametrize("near", [None, (P_WR + 0.003, R_WR)], ids=["anywhere", "near"])
def test_one_view_of_a_marker_does_not_carry_a_pose(near: tuple[Floats, Floats] | None):
    left, right = seen()
    fit = RingFit(RING, CAMERAS, 1.2)
    assert fit.fit([Markers(left.ids[:1], left.corners[:1]), NONE], near) is None
    assert fit.fit([NONE, Markers(right.ids[:1], right.corners[:1])], near) is None


def test_a_marker_that_both_cameras_see_carries_a_pose():
    left, right = seen()
    k, m = next((k, m) for k, i in enumerate(left.ids) for m, j in enumerate(right.ids) if i == j)
    views = [Markers(v.ids[n : n + 1], v.corners[n : n + 1]) for v, n in ((left, k), (right, m))]
    pose = RingFit(RING, CAMERAS, 1.2).fit(views, None)
    assert pose is not None
    np.testing.assert_allclose(pose.p_WR, P_WR, atol=1e-6)


def test_a_misread_marker_does_not_leave_one_view_that_carries_a_pose():
    left, _ = seen()
    two = Markers(np.array([left.ids[0], (left.ids[1] + 3) % 8]), left.corners[:2])
    assert RingFit(RING, CAMERAS, 1.2).fit([two, NONE], (P_WR, R_WR)) is None


def test_nothing_seen_is_no_pose():
    fit = RingFit(RING, CAMERAS, 1.2)
    assert fit.fit([NONE, NONE], None) is None
    assert fit.fit([NONE, NONE], (P_WR, R_WR)) is None


def test_corners_that_fit_no_ring_are_no_pose():
    rng = np.random.default_rng(1)
    scattered = [Markers(np.arange(3), rng.uniform(200.0, 500.0, (3, 4, 2))) for _ in CAMERAS]
    assert RingFit(RING, CAMERAS, 1.2).fit(scattered, None) is None
