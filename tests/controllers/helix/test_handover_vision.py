import math
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.controllers.helix.handover_vision import HandoverVision, Inputs, Outputs, Params
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.geometry import InvalidCalibration, quaternion_of
from handover.cosim.blocks.ports import BLACK_1280X720, Floats
from handover.plants.helix.stereo_camera import Inputs as Scene
from handover.plants.helix.stereo_camera import Params as CameraParams
from handover.plants.helix.stereo_camera import StereoCamera

R_WB = np.diag([1.0, -1.0, -1.0])
PLACES = {"front": 0.0, "front-left": 45.0, "left": 90.0, "back-left": 135.0}  # deg from +x to +y
AWAY = np.array([0.3, 1.5, -1.2])


@pytest.fixture(scope="module")
def camera() -> StereoCamera:
    return StereoCamera(CameraParams())


@pytest.fixture(scope="module")
def one_eyed() -> StereoCamera:
    return StereoCamera(CameraParams(cover_right_until=1e9))


def scene(p_WR: Floats, tilt: float, azimuth: float, p_WO: Floats, grip: float = 0.0) -> Scene:
    """An arm whose end leans by tilt towards azimuth, and a ball on a hand."""
    turn = Rotation.from_rotvec(tilt * np.array([np.sin(azimuth), -np.cos(azimuth), 0.0]))
    R_WR = turn.as_matrix() @ R_WB
    z_R, length, s = R_WR[:, 2], 1.1 * float(np.linalg.norm(p_WR)), np.linspace(0.0, 1.0, 25)[:, None]
    mount, wrist = (s**3 - 2 * s**2 + s) * np.array([0.0, 0.0, -1.0]), (s**3 - s**2) * z_R  # Hermite
    backbone = length * (mount + wrist) + (3 * s**2 - 2 * s**3) * p_WR
    q = quaternion_of(R_WR)
    p_WH = p_WO + np.array([0.0, 0.0, -0.04])
    return Scene(
        backbone=backbone, p_WR=p_WR, q_WR=q, p_WG=p_WR + 0.1 * z_R, q_WG=q, grip=grip, p_WO=p_WO, p_WH=p_WH
    )  # fmt: skip


def hanging(place: str) -> Scene:
    angle = np.radians(PLACES[place])
    p_WO = np.array([0.18 * np.cos(angle), 0.18 * np.sin(angle), -0.6])
    return scene(np.array([0.0, 0.0, -0.6]), 0.0, 0.0, p_WO)


def reaching(place: str, grip: float) -> Scene:
    angle = np.radians(PLACES[place])
    p_WO = np.array([0.18 * np.cos(angle), 0.18 * np.sin(angle), -0.62])
    tilt = math.radians(25.0)
    z_R = np.array([np.sin(tilt) * np.cos(angle), np.sin(tilt) * np.sin(angle), -np.cos(tilt)])
    return scene(p_WO - 0.1 * z_R, tilt, angle, p_WO, grip)


def anywhere(rng: np.random.Generator) -> Scene:
    r, a, b = rng.uniform(0.0, 0.15), rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi)
    p_WR = np.array([r * np.cos(a), r * np.sin(a), rng.uniform(-0.62, -0.5)])
    angle = np.radians(rng.choice(list(PLACES.values()))) + rng.uniform(-0.2, 0.2)
    reach = rng.uniform(0.14, 0.22)
    p_WO = np.array([reach * np.cos(angle), reach * np.sin(angle), rng.uniform(-0.7, -0.55)])
    return scene(p_WR, float(rng.uniform(0.0, 0.7)), b, p_WO, rng.uniform())


def look(camera: StereoCamera, vision: HandoverVision, u: Scene) -> Outputs:
    y = camera.step(0.0, 1 / 30, u)
    return vision.step(0.0, 1 / 30, Inputs(left=y.left, right=y.right))


def distances(y: Outputs, u: Scene) -> Floats:
    """Errors of ball, wrist and gripper, in m."""
    pairs = [(y.p_WO_meas, u.p_WO), (y.p_WR_meas, u.p_WR), (y.p_WG_meas, u.p_WG)]
    return np.array([float(np.linalg.norm(a - b)) for a, b in pairs])


def test_calibration_is_the_camera_s():
    ours, theirs = Params(), CameraParams()
    names = [f.name for f in fields(Params) if f.name.endswith(("_left", "_right"))]
    assert len(names) == 8
    for name in [*names, "apothem", "marker", "ball_radius"]:
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))


def test_every_output_feeds_through_from_both_pictures():
    d = describe(HandoverVision)
    assert d.feedthrough == {v.name: ("left", "right") for v in d.outputs}


def test_accuracy_over_many_poses(camera: StereoCamera):
    rng = np.random.default_rng(7)
    errors: list[Floats] = []
    both: list[bool] = []
    for _ in range(30):
        u, vision = anywhere(rng), HandoverVision(Params())
        look(camera, vision, u)
        y = look(camera, vision, u)
        assert y.seen_O
        if y.seen_R:  # a hand may hide the ring
            errors.append(distances(y, u))
            both.append(bool(np.trace(y.cov_O) < 0.002**2))  # the arm may hide the ball from one camera
    _, wrist, gripper = 1e3 * np.sqrt(np.mean(np.square(errors), axis=0))
    balls = np.array(errors)[:, 0]
    ball = 1e3 * np.sqrt(np.mean(balls[both] ** 2))
    print(f"\nRMS error over {len(errors)} poses: ball {ball:.2f} mm ({sum(both)} seen by both cameras), "
          f"wrist {wrist:.2f} mm, gripper {gripper:.2f} mm")  # fmt: skip
    assert len(errors) >= 28
    assert sum(both) >= 24
    assert ball < 0.4
    assert balls.max() < 0.02
    assert wrist < 0.6
    assert gripper < 1.25


@pytest.mark.parametrize("place", PLACES)
def test_ball_and_ring_are_seen_at_every_place(camera: StereoCamera, place: str):
    for u in (hanging(place), reaching(place, 0.0), reaching(place, 1.0)):
        y = look(camera, HandoverVision(Params()), u)
        assert (y.seen_O, y.seen_R) == (True, True)
        assert np.all(distances(y, u) < [0.0015, 0.0015, 0.0025])


def test_covariances_tell_the_errors(camera: StereoCamera):
    rng = np.random.default_rng(11)
    squares: list[list[float]] = []
    for _ in range(20):
        u = anywhere(rng)
        y = look(camera, HandoverVision(Params()), u)
        if y.seen_O and y.seen_R:
            pairs = [(y.p_WO_meas - u.p_WO, y.cov_O), (y.p_WR_meas - u.p_WR, y.cov_R), (y.p_WG_meas - u.p_WG, y.cov_G)]
            squares.append([float(e @ np.linalg.solve(cov, e)) for e, cov in pairs])
    mean = np.mean(squares, axis=0)  # 3 where the covariances were exact
    assert np.all(mean > 0.2)
    assert np.all(mean < 9.0)


def test_one_camera_is_enough_but_says_that_it_knows_depth_less(camera: StereoCamera, one_eyed: StereoCamera):
    for place in ("front-left", "left"):
        u, vision = hanging(place), HandoverVision(Params())
        y, both = look(one_eyed, vision, u), look(camera, HandoverVision(Params()), u)
        assert (y.seen_O, y.seen_R) == (True, True)
        assert np.all(distances(y, u) < 0.02)
        away = u.p_WO - CameraParams().p_WC_left
        away = away / np.linalg.norm(away)
        assert away @ y.cov_O @ away > 50.0 * (away @ both.cov_O @ away)
        assert np.trace(y.cov_R) > 4.0 * np.trace(both.cov_R)


def test_a_ball_out_of_view_is_not_seen_and_its_place_repeated(camera: StereoCamera):
    vision, u = HandoverVision(Params()), hanging("left")
    first = look(camera, vision, u)
    y = look(camera, vision, replace(u, p_WO=AWAY, p_WH=AWAY))
    assert (first.seen_O, y.seen_O, y.seen_R) == (True, False, True)
    np.testing.assert_array_equal(y.p_WO_meas, first.p_WO_meas)
    assert y.cov_O[0, 0] >= 1.0


def test_without_markers_the_ring_is_not_seen_and_its_place_repeated(camera: StereoCamera):
    vision, u = HandoverVision(Params()), hanging("left")
    first = look(camera, vision, u)
    y = look(camera, vision, replace(u, p_WR=AWAY))
    assert (first.seen_R, y.seen_R, y.seen_O) == (True, False, True)
    np.testing.assert_array_equal(y.p_WR_meas, first.p_WR_meas)
    np.testing.assert_array_equal(y.p_WG_meas, first.p_WG_meas)
    assert y.cov_R[0, 0] >= 1.0
    assert y.cov_G[0, 0] >= 1.0


def test_finds_again_what_jumped_out_of_its_region(camera: StereoCamera):
    vision = HandoverVision(Params())
    look(camera, vision, hanging("front-left"))
    u = reaching("back-left", 0.0)
    y = look(camera, vision, u)
    assert (y.seen_O, y.seen_R) == (True, True)
    assert np.all(distances(y, u) < 0.0025)


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
    a, b = (camera.step(0.0, 1 / 30, replace(hanging("left"), p_WO=p)) for p in ([0, 0.3, -0.5], [0, 0.3, -0.62]))
    y = HandoverVision(Params()).step(0.0, 1 / 30, Inputs(left=a.left, right=b.right))
    near = [np.linalg.norm(y.p_WO_meas - p) for p in ([0, 0.3, -0.5], [0, 0.3, -0.62])]
    assert not y.seen_O or min(near) < 0.03


def test_continues_bit_identically_from_a_state(camera: StereoCamera):
    vision = HandoverVision(Params())
    look(camera, vision, hanging("left"))
    state = vision.get_state()
    pictures = [camera.step(0.0, 1 / 30, u) for u in (hanging("left"), reaching("left", 0.0), hanging("front"))]
    other = HandoverVision(Params())
    other.set_state(state)
    for y in pictures:
        a, b = (v.step(0.0, 1 / 30, Inputs(left=y.left, right=y.right)) for v in (vision, other))
        for f in fields(Outputs):
            np.testing.assert_array_equal(getattr(a, f.name), getattr(b, f.name))
    assert vision.get_state() == other.get_state()


def test_outputs_leave_the_state_alone(camera: StereoCamera):
    vision = HandoverVision(Params())
    state, y = vision.get_state(), camera.outputs(0.0, hanging("left"))
    assert vision.outputs(0.0, Inputs(left=y.left, right=y.right)).seen_O
    assert vision.get_state() == state


def test_bad_calibration_is_refused():
    with pytest.raises(InvalidCalibration, match="'right': q_WC"):
        HandoverVision(Params(q_WC_right=np.array([0.5, 0.0, 0.0, 0.0])))
    with pytest.raises(InvalidCalibration, match="'left': intrinsics"):
        HandoverVision(Params(intrinsics_left=np.array([-907.0, 907.0, 640.0, 360.0])))
