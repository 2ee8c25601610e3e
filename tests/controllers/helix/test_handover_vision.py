from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.controllers.vision_scenes import (
    AWAY,
    anywhere,
    distances,
    hanging,
    look,
    over_ball,
    reaching,
    squared,
)
from support.wording import Wording

from handover.controllers.helix.vision.handover_vision import HandoverVision, Inputs, Params
from handover.controllers.helix.vision.vision_parameters import InvalidVisionParameters
from handover.cosim.blocks.geometry import InvalidCalibration
from handover.cosim.blocks.ports import BLACK_1280X720, Floats
from handover.plants.helix.cameras.stereo_camera import Params as CameraParams
from handover.plants.helix.cameras.stereo_camera import StereoCamera


@pytest.fixture(scope="module")
def camera() -> StereoCamera:
    return StereoCamera(CameraParams())


def test_accuracy_over_many_poses_and_covariances_that_tell_the_errors(camera: StereoCamera):
    rng, errors, squares, both = np.random.default_rng(7), list[Floats](), list[Floats](), list[bool]()
    for _ in range(8):
        u, vision = anywhere(rng), HandoverVision(Params())
        look(camera, vision, u)
        y = look(camera, vision, u)
        assert y.seen_O
        if y.seen_R:  # a hand may hide the ring
            errors.append(distances(y, u))
            squares.append(squared(y, u))
            both.append(bool(np.trace(y.cov_O) < 0.002**2))  # the arm may hide the ball from one camera
    _, wrist, gripper = 1e3 * np.sqrt(np.mean(np.square(errors), axis=0))
    balls = np.array(errors)[:, 0]
    assert len(errors) >= 7
    assert sum(both) >= 6
    assert 1e3 * np.sqrt(np.mean(balls[both] ** 2)) < 0.15
    assert balls.max() < 0.01
    assert wrist < 0.6
    assert gripper < 1.25
    mean = np.mean(squares, axis=0)  # 3 where the covariances were exact
    assert np.all((mean > 0.2) & (mean < 9.0))


def seen_with(covered: tuple[str, ...], has_third: bool) -> Floats:
    """Return errors of ball and wrist in 6 scenes, shape (6, 2), m; NaN where one is not seen."""
    until = [1e9 if side in covered else 0.0 for side in ("left", "right")]
    camera = StereoCamera(CameraParams(has_third=has_third, cover_left_until=until[0], cover_right_until=until[1]))
    rng, errors = np.random.default_rng(5), np.full((6, 2), np.nan)
    for e in errors:
        u = anywhere(rng)
        y = look(camera, HandoverVision(Params(has_third=has_third)), u)
        ball, wrist, _ = distances(y, u)
        e[:] = ball if y.seen_O else np.nan, wrist if y.seen_R else np.nan
    return errors


def test_a_third_camera_makes_up_for_a_covered_one():
    alone, beside = seen_with(("left",), has_third=False), seen_with(("left",), has_third=True)
    assert np.count_nonzero(np.isfinite(beside).all(axis=1)) >= 5
    ball, wrist = np.nanmedian(beside, axis=0)
    ball_alone, wrist_alone = np.nanmedian(alone, axis=0)
    assert ball < min(0.3 * ball_alone, 0.0002)
    assert wrist < min(0.6 * wrist_alone, 0.0006)


def test_a_third_camera_alone_sees_ball_and_ring_where_the_arm_does_not_hide_them():
    errors = seen_with(("left", "right"), has_third=True)
    seen = np.isfinite(errors)
    assert np.all(np.count_nonzero(seen, axis=0) >= [4, 2])
    assert np.nanmax(errors) < 0.015


def test_without_a_third_camera_its_picture_does_not_count():
    y = StereoCamera(CameraParams(has_third=True)).step(0.0, 1 / 30, hanging("front"))
    with_third, pair = Inputs(left=y.left, right=y.right, third=y.third), Inputs(left=y.left, right=y.right)
    a, b = (HandoverVision(Params()).step(0.0, 1 / 30, u) for u in (with_third, pair))
    assert a.p_WR_meas.tobytes() == b.p_WR_meas.tobytes()


@pytest.mark.parametrize("place", ["front", "back-left"])
def test_ball_and_ring_are_seen_near_and_far(place: str):
    camera = StereoCamera(CameraParams(seed=1))
    for u in (hanging(place), reaching(place, 1.0)):
        y = look(camera, HandoverVision(Params()), u)
        assert (y.seen_O, y.seen_R) == (True, True)
        assert np.all(distances(y, u) < [0.0005, 0.0015, 0.0025])


def test_one_camera_is_enough_but_says_that_it_knows_depth_less(camera: StereoCamera):
    u = hanging("front-left")
    one_eyed = StereoCamera(CameraParams(cover_right_until=1e9))
    y, both = (look(c, HandoverVision(Params()), u) for c in (one_eyed, camera))
    assert (y.seen_O, y.seen_R) == (True, True)
    assert np.all(distances(y, u) < 0.02)
    away = u.p_WO - CameraParams().p_WC_left
    away = away / np.linalg.norm(away)
    assert away @ y.cov_O @ away > 50.0 * (away @ both.cov_O @ away)
    assert np.trace(y.cov_R) > 4.0 * np.trace(both.cov_R)


def test_what_is_out_of_view_is_not_seen_and_its_place_repeated(camera: StereoCamera):
    u = hanging("left")
    cases: list[tuple[dict[str, Any], tuple[bool, bool], tuple[str, ...]]] = [
        ({"p_WO": AWAY, "p_WH": AWAY}, (False, True), ("p_WO_meas", "cov_O")),
        ({"p_WR": AWAY}, (True, False), ("p_WR_meas", "cov_R", "p_WG_meas", "cov_G")),
    ]
    for away, seen, names in cases:
        vision = HandoverVision(Params())
        first = look(camera, vision, u)
        assert (first.seen_O, first.seen_R) == (True, True)
        y = look(camera, vision, replace(u, **away))
        assert (y.seen_O, y.seen_R) == seen
        for place, covariance in zip(names[::2], names[1::2], strict=True):
            np.testing.assert_array_equal(getattr(y, place), getattr(first, place))
            assert getattr(y, covariance)[0, 0] >= 1.0


def test_fingers_before_the_ball_hardly_shift_it():
    """Over many looks, each at another pose and with other noise: single ones differ by the noise alone."""
    camera, rng, errors, squares = (
        StereoCamera(CameraParams(seed=1)),
        np.random.default_rng(1),
        list[float](),
        list[float](),
    )
    for _ in range(12):
        u = over_ball(rng)
        y = look(camera, HandoverVision(Params()), u)
        assert y.seen_O
        errors.append(1e3 * float(distances(y, u)[0]))
        squares.append(float(squared(y, u)[0]))
    assert np.sqrt(np.mean(np.square(errors))) < 0.15
    assert np.percentile(errors, 95) < 0.3
    assert max(errors) < 1.0
    assert 1.0 < np.mean(squares) < 4.5  # 3 where the covariances were exact


def test_finds_again_what_jumped_out_of_its_region():
    """The region around where the ball was may show a part of it, or one camera's may."""
    camera, u = StereoCamera(CameraParams(seed=2)), reaching("back-left", 0.0)
    for start in ("front", "front-left", "left"):
        vision = HandoverVision(Params())
        look(camera, vision, hanging(start))
        y = look(camera, vision, u, t=1.0)
        assert (y.seen_O, y.seen_R) == (True, True)
        assert np.all(distances(y, u) < [0.0005, 0.0015, 0.0025])


@pytest.mark.parametrize("kind", ["black", "white", "green", "noise", "stripes"])
def test_garbage_shows_nothing(kind: str):
    pictures = {
        "black": BLACK_1280X720,
        "white": np.full((720, 1280, 3), 255, dtype=np.uint8),
        "green": np.full((720, 1280, 3), (40, 180, 40), dtype=np.uint8),
        "noise": np.random.default_rng(0).integers(0, 256, (720, 1280, 3)).astype(np.uint8),
        "stripes": np.repeat(np.indices((720, 1280)).sum(axis=0)[..., None] // 9 % 2 * 255, 3, axis=2).astype(np.uint8),
    }
    y = HandoverVision(Params()).step(0.0, 1 / 30, Inputs(left=pictures[kind], right=pictures[kind]))
    assert (y.seen_O, y.seen_R) == (False, False)
    np.testing.assert_array_equal([y.p_WO_meas, y.p_WR_meas, y.p_WG_meas], np.zeros((3, 3)))


def test_pictures_of_different_scenes_do_not_give_a_ball_between_them(camera: StereoCamera):
    places = np.array([[0.0, 0.3, -0.5], [0.0, 0.3, -0.62]])
    a, b = (camera.step(0.0, 1 / 30, replace(hanging("left"), p_WO=p)) for p in places)
    y = HandoverVision(Params()).step(0.0, 1 / 30, Inputs(left=a.left, right=b.right))
    near = [np.linalg.norm(y.p_WO_meas - p) for p in places]
    assert not y.seen_O or min(near) < 0.03


def test_bad_calibration_and_parameters_out_of_range_are_refused(wording: Wording):
    bad: tuple[dict[str, Any], ...] = (
        {"q_WC_right": np.array([0.5, 0.0, 0.0, 0.0])},
        {"intrinsics_left": np.array([-907.0, 907.0, 640.0, 360.0])},
        {"rings": 3, "corner_noise": 0.0},
    )
    for values in bad:
        with pytest.raises((InvalidCalibration, InvalidVisionParameters)) as caught:
            HandoverVision(Params(**values))
        wording.check(caught.value)


def test_of_three_pairs_one_is_looked_at_and_its_measurement_repeated(camera: StereoCamera):
    vision = HandoverVision(Params(decimation=3))
    places = [hanging("front"), hanging("left"), hanging("left"), hanging("left")]
    seen = [look(camera, vision, u).p_WO_meas for u in places]
    np.testing.assert_array_equal(seen[0], seen[1])
    np.testing.assert_array_equal(seen[0], seen[2])
    assert np.linalg.norm(seen[3] - places[3].p_WO) < 0.005
