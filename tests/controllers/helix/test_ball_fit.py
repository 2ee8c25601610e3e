import numpy as np
import pytest

from handover.controllers.helix.ball import BallFit, BallOutline
from handover.controllers.helix.stereo import StereoRig
from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of
from handover.cosim.blocks.ports import Floats

RADIUS = 0.025
P_WO = np.array([0.12, 0.1, -0.63])


def camera(name: str, y: float) -> Pinhole:
    p_WC = np.array([-0.95, y, -0.6])
    q_WC = quaternion_of(looking_at(p_WC, np.array([0.0, 0.0, -0.6])))
    return Pinhole(name, p_WC, q_WC, np.array([907.0, 907.0, 640.0, 360.0]), np.array([0.1, -0.2, 0.001, 0.0, 0.0]))


RIG = StereoRig(camera("left", 0.25), camera("right", -0.25))


def outline(c: Pinhole, p_WO: Floats, shift: float = 0.0, share: float = 1.0) -> BallOutline:
    """Where rays touch the sphere, moved outwards by shift, in px; share of the circle from its top."""
    to_ball = p_WO - c.p_WC
    sine2 = RADIUS**2 / (to_ball @ to_ball)
    z = to_ball / np.linalg.norm(to_ball)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x = x / np.linalg.norm(x)
    a = np.pi * share * np.linspace(-1.0, 1.0, 120, endpoint=False)[:, None] - 0.5 * np.pi
    touching = (
        c.p_WC + (1 - sine2) * to_ball + RADIUS * np.sqrt(1 - sine2) * (np.cos(a) * x + np.sin(a) * np.cross(z, x))
    )
    pixels, centre = c.project(touching), c.project(p_WO)
    outwards = pixels - centre
    size = np.linalg.norm(outwards, axis=1, keepdims=True)
    return BallOutline(pixels + shift * outwards / size, centre, float(size.mean()) + shift, share)


def fit(shift: tuple[float, float] = (0.0, 0.12)) -> BallFit:
    return BallFit(RIG, RADIUS, 0.6, shift, 0.012)


def test_meeting_point_of_two_rays_is_the_point_they_come_from():
    p, gap = RIG.triangulate(*(c.project(P_WO) for c in RIG.cameras))
    np.testing.assert_allclose(p, P_WO, atol=1e-12)
    assert gap < 1e-12


def test_meeting_point_of_rays_that_miss_is_halfway():
    (a, b) = (c.project(P_WO + d) for c, d in zip(RIG.cameras, ([0, 0, 0.004], [0, 0, -0.004]), strict=True))
    p, gap = RIG.triangulate(a, b)
    np.testing.assert_allclose(p, P_WO, atol=4e-4)
    assert gap == pytest.approx(0.008, rel=0.02)


def test_exact_outlines_give_the_exact_position():
    found = fit().fit(outline(RIG.left, P_WO), outline(RIG.right, P_WO))
    assert found is not None
    np.testing.assert_allclose(found.p_WO, P_WO, atol=1e-8)


def test_two_cameras_see_past_a_shifted_edge_and_half_hidden_discs():
    found = fit().fit(outline(RIG.left, P_WO, 0.3, 0.5), outline(RIG.right, P_WO, 0.3, 0.6))
    assert found is not None
    assert np.linalg.norm(found.p_WO - P_WO) < 3e-4


@pytest.mark.parametrize("side", [0, 1])
def test_one_camera_finds_depth_by_the_ball_s_size(side: int):
    c = RIG.cameras[side]
    seen = [outline(c, P_WO) if i == side else None for i in range(2)]
    found = fit().fit(*seen)
    assert found is not None
    np.testing.assert_allclose(found.p_WO, P_WO, atol=1e-6)
    axis = (P_WO - c.p_WC) / np.linalg.norm(P_WO - c.p_WC)
    depth = np.sqrt(axis @ found.covariance @ axis)
    assert depth == pytest.approx(0.12 * float(c.depth(P_WO)) ** 2 / (RADIUS * 907.0), rel=0.6)  # dz = z^2 / (r f) dr
    assert depth > 10.0 * np.sqrt(np.linalg.eigvalsh(found.covariance)[0])


def test_pictures_that_contradict_each_other_leave_the_fuller_one():
    found = fit().fit(outline(RIG.left, P_WO), outline(RIG.right, P_WO + np.array([0.0, 0.0, 0.05]), 0.0, 0.5))
    assert found is not None
    np.testing.assert_allclose(found.p_WO, P_WO, atol=1e-6)


def test_something_twice_as_large_is_not_the_ball():
    large = [outline(c, P_WO, 20.0) for c in RIG.cameras]
    assert fit().fit(large[0], large[1]) is None


def test_nothing_seen_is_no_position():
    assert fit().fit(None, None) is None
