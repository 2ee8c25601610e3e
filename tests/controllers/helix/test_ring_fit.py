import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.controllers.helix.vision.markers import MarkerReader, MarkerRing, Markers
from handover.controllers.helix.vision.ring_fit import RingFit
from handover.controllers.helix.vision.stereo import Pixels, Region, covariance
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


NONE = Markers(np.empty(0, dtype=np.int64), np.empty((0, 4, 2)))


def angle(R: Floats) -> float:
    return float(Rotation.from_matrix(np.transpose(R) @ R_WR).magnitude())


def some(markers: Markers, *which: int) -> Markers:
    return Markers(markers.ids[list(which)], markers.corners[list(which)])


def test_finds_the_exact_pose_from_exact_corners():
    """By all markers, those of one camera, one that both see, and all but one that was misread."""
    left, right = seen()
    k, m = next((k, m) for k, i in enumerate(left.ids) for m, j in enumerate(right.ids) if i == j)
    misread = Markers(np.array([(left.ids[0] + 2) % 8, *left.ids[1:]]), left.corners)
    for views in ([left, right], [NONE, right], [some(left, k), some(right, m)], [misread, right]):
        pose = RingFit(RING, CAMERAS, 1.2).fit(views, None)
        assert pose is not None
        np.testing.assert_allclose(pose.p_WR, P_WR, atol=1e-6)
        assert angle(pose.R_WR) < 1e-4


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


@pytest.mark.parametrize("near", [None, (P_WR + 0.003, R_WR)], ids=["anywhere", "near"])
def test_what_carries_no_pose(near: tuple[Floats, Floats] | None):
    """One view of a marker, also of two of which one was misread, nothing, and corners of no ring."""
    left, right = seen()
    misread = Markers(np.array([left.ids[0], (left.ids[1] + 3) % 8]), left.corners[:2])
    rng = np.random.default_rng(1)
    scattered = [Markers(np.arange(3), rng.uniform(200.0, 500.0, (3, 4, 2))) for _ in CAMERAS]
    no_ring = scattered if near is None else [misread, NONE]
    for views in ([some(left, 0), NONE], [NONE, some(right, 0)], [NONE, NONE], no_ring):
        assert RingFit(RING, CAMERAS, 1.2).fit(views, near) is None


H = np.array([[1.4, 0.12, 301.7], [-0.2, 1.35, 222.4], [0.0008, 0.0004, 1.0]])  # mm on the marker to px


def picture(i: int) -> Pixels:
    """Marker i, 20 mm wide, in 4 mm of white, warped by H at 8 times its size, averaged, and blurred."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    marker = np.asarray(cv2.aruco.generateImageMarker(dictionary, i, 120), dtype=np.uint8)
    face = cv2.cvtColor(np.pad(marker, 24, constant_values=255), cv2.COLOR_GRAY2BGR)
    texel = np.array([[1 / 6, 0, -4 + 1 / 12], [0, 1 / 6, -4 + 1 / 12], [0, 0, 1]])  # texture px to mm
    fine = np.array([[8, 0, 3.5], [0, 8, 3.5], [0, 0, 1]])  # px to fine px, middles to middles
    warped = cv2.warpPerspective(face, fine @ H @ texel, (640 * 8, 480 * 8), borderValue=(120, 120, 120))
    return np.asarray(
        cv2.GaussianBlur(cv2.resize(warped, (640, 480), interpolation=cv2.INTER_AREA), (5, 5), 0.7), np.uint8
    )


def corners() -> Floats:
    p = np.array([[0, 0, 1], [20, 0, 1], [20, 20, 1], [0, 20, 1]]) @ np.transpose(H)
    return p[:, :2] / p[:, 2:]


REGION = Region(270, 190, 350, 270)


@pytest.mark.parametrize("i", [0, 5])
def test_reads_number_and_corners_to_a_fraction_of_a_pixel(i: int):
    shown = picture(i)
    found = MarkerReader(0.21).read(shown, REGION)
    assert found.ids.tolist() == [i]
    np.testing.assert_allclose(found.corners[0], corners(), atol=0.2)
    np.testing.assert_allclose(found.corners[0].mean(axis=0), corners().mean(axis=0), atol=0.06)
    a, b = (MarkerReader(shift).read(shown, REGION).corners[0] for shift in (0.0, 0.5))
    np.testing.assert_allclose(np.linalg.norm(b - a, axis=1), 0.5)
    assert np.all(np.linalg.norm(b - b.mean(axis=0), axis=1) > np.linalg.norm(a - a.mean(axis=0), axis=1))
    r = MarkerReader(0.21).search(shown)
    low, high = corners().min(axis=0), corners().max(axis=0)
    assert (r.x0 < low[0], r.y0 < low[1], r.x1 > high[0], r.y1 > high[1]) == (True, True, True, True)
    assert MarkerReader(0.21).search(np.full((480, 640, 3), 90, dtype=np.uint8)).empty


@pytest.mark.parametrize(("i", "rings", "read"), [(9, 1, []), (9, 2, [9]), (16, 2, [])])
def test_other_numbers_are_not_of_the_ring(i: int, rings: int, read: list[int]):
    assert MarkerReader(0.21, rings=rings).read(picture(i), REGION).ids.tolist() == read


def test_the_second_ring_is_the_first_moved_by_a_side_of_the_collar_towards_the_mount():
    one, two = MarkerRing(0.034, 0.020), MarkerRing(0.034, 0.020, rings=2)
    side = 2.0 * 0.034 * np.tan(np.pi / 8)
    np.testing.assert_array_equal(two.corners[:8], one.corners)
    np.testing.assert_allclose(two.corners[8:], one.corners - [0.0, 0.0, side])
    assert one.outline[:, 2].max() == pytest.approx(0.5 * side)
    assert (two.outline[:, 2].min(), two.outline[:, 2].max()) == pytest.approx((-1.5 * side, 0.5 * side))
