"""Both detectors of the unit on the same pictures: how exact each is, and what the joint one refuses."""

from dataclasses import replace

import numpy as np
import pytest
from support.controllers.vision_scenes import AWAY, anywhere, distances, hanging, look, rising, scene, squared
from support.restored_states import assert_outputs_change_nothing, assert_passed_on

from handover.controllers.helix.vision.handover_vision import Detector, HandoverVision, Inputs, Params
from handover.controllers.helix.vision.published_detector import green_middle
from handover.cosim.blocks.ports import BLACK_1280X720, Floats
from handover.plants.helix.cameras.stereo_camera import Params as CameraParams
from handover.plants.helix.cameras.stereo_camera import StereoCamera

PUBLISHED = Params(detector=Detector.PUBLISHED)


@pytest.fixture(scope="module")
def camera() -> StereoCamera:
    return StereoCamera(CameraParams())


def test_the_published_detector_averages_what_the_joint_one_fits_and_its_covariances_tell_the_errors(
    camera: StereoCamera,
):
    rng, errors, squares = np.random.default_rng(3), list[tuple[Floats, Floats]](), list[Floats]()
    for _ in range(8):
        u = anywhere(rng)
        shown = camera.step(0.0, 1 / 30, u)
        pair = Inputs(left=shown.left, right=shown.right)
        joint, published = (HandoverVision(p).step(0.0, 1 / 30, pair) for p in (Params(), PUBLISHED))
        if all(y.seen_O and y.seen_R for y in (joint, published)):
            errors.append((distances(joint, u), distances(published, u)))
        if published.seen_O and published.seen_R:
            squares.append(squared(published, u))
    assert len(errors) >= 6
    joint, published = 1e3 * np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all(joint < [1.0, 1.0, 2.0])  # mm RMS of ball, wrist and gripper
    assert np.all(published < [15.0, 80.0, 90.0])
    assert np.all(published > 5.0 * joint)
    ball, wrist, gripper = np.transpose(squares)
    assert np.median(ball) < 3.0  # few are far off, by half-hidden discs
    for square in (wrist, gripper):
        assert 0.3 < np.mean(square) < 9.0  # 3 where they were exact


def test_what_the_published_detector_sees(camera: StereoCamera):
    u = hanging("left")
    pictures = camera.step(0.0, 1 / 30, u)
    y = HandoverVision(PUBLISHED).step(0.0, 1 / 30, Inputs(left=pictures.left, right=pictures.right))
    assert np.linalg.norm(y.p_WG_meas - y.p_WR_meas) == pytest.approx(0.1)  # eq. (13)
    one = HandoverVision(PUBLISHED).step(0.0, 1 / 30, Inputs(left=pictures.left, right=BLACK_1280X720))
    assert (one.seen_O, one.seen_R) == (False, True)
    assert np.linalg.norm(one.p_WR_meas - u.p_WR) < 0.1
    nothing = look(camera, HandoverVision(PUBLISHED), replace(u, p_WR=AWAY, p_WO=AWAY, p_WH=AWAY))
    assert (nothing.seen_O, nothing.seen_R) == (False, False)
    assert np.all(np.diagonal(nothing.cov_R) >= 1.0)


def test_the_published_middle_of_a_half_hidden_disc_shifts():
    picture = np.full((240, 320, 3), 150, dtype=np.uint8)
    v, u = np.indices((240, 320))
    picture[np.hypot(u - 160, v - 120) < 24.0] = (45, 170, 50)
    middle = green_middle(picture)
    assert middle is not None
    np.testing.assert_allclose(middle, [160.0, 120.0], atol=0.6)
    picture[:, 150:] = 150
    shifted = green_middle(picture)
    assert shifted is not None
    assert shifted[0] < 149.0  # the smallest circle around less than half a disc has the chord for its diameter
    assert green_middle(np.full((240, 320, 3), 150, dtype=np.uint8)) is None


@pytest.mark.parametrize("detector", Detector)
def test_either_detector_continues_bit_identically_from_a_state(camera: StereoCamera, detector: Detector):
    shown = [camera.step(0.1 * i, 0.1, hanging(place)) for i, place in enumerate(("left", "left", "front"))]
    given = [Inputs(left=y.left, right=y.right) for y in shown]

    def make() -> HandoverVision:
        return HandoverVision(Params(detector=detector))

    assert_passed_on(make, given, 1, 0.1)
    assert_outputs_change_nothing(make, given[0], 0.1)


@pytest.mark.parametrize(("beside", "tilt"), [(0.1, 0.0), (0.0, 0.4)])
def test_a_pose_that_contradicts_the_last_one_is_refused_until_the_arm_may_have_come_there(
    camera: StereoCamera, beside: float, tilt: float
):
    """By 0.5 m/s and 2 rad/s."""
    near, far = (scene(np.array([0.0, y, -0.6]), turn, 1.5, AWAY) for y, turn in ((0.0, 0.0), (beside, tilt)))
    vision = HandoverVision(Params())
    assert look(camera, vision, near, t=0.0).seen_R
    early = look(camera, vision, far, t=0.1)
    assert not early.seen_R
    assert np.linalg.norm(early.p_WR_meas - near.p_WR) < 0.001
    late = look(camera, vision, far, t=0.25)
    assert late.seen_R
    assert np.linalg.norm(late.p_WR_meas - far.p_WR) < 0.002


def test_an_arm_as_fast_as_the_bounds_is_followed(camera: StereoCamera):
    vision = HandoverVision(Params())
    for i in range(5):
        u = scene(np.array([0.0, 0.045 * i - 0.1, -0.58]), 0.0, 0.0, AWAY)  # 0.45 m/s
        y = look(camera, vision, u, t=0.1 * i)
        assert y.seen_R
        assert distances(y, u)[1] < 0.0015


@pytest.mark.slow
def test_what_is_seen_high_up_is_where_it_is(camera: StereoCamera):
    rng, errors = np.random.default_rng(3), list[float]()
    for _ in range(3):
        vision = HandoverVision(Params())
        for i, u in enumerate(rising(rng, 20)):
            y = look(camera, vision, u, t=0.125 * i)
            if y.seen_R and u.p_WR[2] > -0.5:
                errors.append(float(distances(y, u)[1]))
    assert len(errors) > 8
    assert max(errors) < 0.02
    assert np.sqrt(np.mean(np.square(errors))) < 0.004


def test_a_pose_that_is_worth_little_is_refused(camera: StereoCamera):
    u = hanging("left")
    loose, tight = (look(camera, HandoverVision(Params(largest_deviation=d)), u) for d in (0.005, 1e-5))
    assert (loose.seen_R, tight.seen_R) == (True, False)
    assert 1e-5 < np.sqrt(np.trace(loose.cov_R)) < 0.005


def test_two_rings_are_found_where_one_is_too_little(camera: StereoCamera):
    two_rings = StereoCamera(CameraParams(rings=2))
    raised = scene(np.array([-0.1, 0.05, -0.45]), 0.9, 2.8, np.array([0.2, 0.1, -0.7]))
    assert not look(camera, HandoverVision(Params()), raised).seen_R
    for detector, u, bound in (
        (Detector.JOINT, raised, 0.006),
        (Detector.JOINT, hanging("left"), 0.0012),
        (Detector.PUBLISHED, hanging("left"), 0.08),
    ):
        y = look(two_rings, HandoverVision(Params(rings=2, detector=detector)), u)
        assert y.seen_R
        assert distances(y, u)[1] < bound
