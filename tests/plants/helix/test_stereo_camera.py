import hashlib
import itertools
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from support.restored_states import flat
from support.wording import Wording

from handover.cosim.blocks.geometry import InvalidCalibration, Pinhole
from handover.plants.helix.cameras.shapes import Pixels
from handover.plants.helix.cameras.stereo_camera import Inputs, InvalidCameraParameters, Params, StereoCamera

HOUSE = Path(__file__).parents[3]
FAR = np.array([0.3, 1.5, -1.2])  # out of both pictures


@pytest.fixture(scope="module")
def clean() -> StereoCamera:
    return StereoCamera(Params(noise=0.0))


def left_pinhole() -> Pinhole:
    p = Params()
    return Pinhole("left", p.p_WC_left, p.q_WC_left, p.intrinsics_left, p.distortion_left)


def green(picture: Pixels) -> int:
    levels = picture.astype(int)
    return int(np.count_nonzero(levels[..., 1] - np.maximum(levels[..., 0], levels[..., 2]) > 30))


def digest() -> str:
    camera = StereoCamera(Params(seed=3))
    y = camera.step(0.0, 1 / 30, Inputs())
    return hashlib.sha256(y.left.tobytes() + y.right.tobytes()).hexdigest()


@pytest.mark.slow
@pytest.mark.parametrize("compiled", ["0", "1"])
def test_pictures_are_the_same_in_another_process_without_compiled_kernels_or_before_they_are_loaded(compiled: str):
    code = f"import sys; sys.path[:0] = {[str(HOUSE), str(HOUSE / 'tests'), str(Path(__file__).parent)]}\n"
    code += "import test_stereo_camera as t; print(t.digest(), 'numba' in sys.modules)"
    environment = {**os.environ, "HANDOVER_COMPILE": compiled}
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert other.stdout.split() == [digest(), "False"]


def test_seeds_differ_only_in_noise_which_is_independent_and_drawn_by_steps(clean: StereoCamera):
    camera, other, truth = StereoCamera(Params()), StereoCamera(Params(seed=1)), clean.outputs(0.0, Inputs())
    np.testing.assert_array_equal(camera.outputs(0.0, Inputs()).left, camera.outputs(0.0, Inputs()).left)
    first, second = (camera.step(0.0, 1 / 30, Inputs()) for _ in range(2))
    pictures = first.left, second.left, other.step(0.0, 1 / 30, Inputs()).left
    noise = [p.astype(float) - truth.left for p in pictures] + [first.right.astype(float) - truth.right]
    for a, b in (*((noise[0], n) for n in noise[1:]), (noise[0][:, 1:], noise[0][:, :-1])):
        assert abs(float(np.mean(a * b))) < 0.01 * 2.2**2
    assert abs(noise[0].mean()) < 0.02
    assert noise[0].std() == pytest.approx(2.2, rel=0.03)


def test_the_ball_is_painted_where_rays_meet_it(clean: StereoCamera):
    p_WO = np.array([0.05, 0.3, -0.45])  # towards a corner, where a sphere's picture is an oval
    picture = clean.outputs(0.0, Inputs(p_WO=p_WO, p_WH=FAR)).left.astype(int)
    camera = left_pinhole()
    u0, v0 = np.rint(camera.project(p_WO)).astype(int)
    part = picture[v0 - 40 : v0 + 40, u0 - 40 : u0 + 40]
    painted = part[..., 1] - np.maximum(part[..., 0], part[..., 2]) > 30
    v, u = np.indices(painted.shape).reshape(2, -1)
    rays = camera.rays(np.column_stack([u + u0 - 40, v + v0 - 40]).astype(float))
    met = (np.linalg.norm(np.cross(rays, p_WO - camera.p_WC), axis=1) < 0.025).reshape(painted.shape)
    assert np.count_nonzero(met) > 1500
    assert np.count_nonzero(painted != met) < 0.5 * 2 * np.pi * 25  # less than half a pixel along the edge
    np.testing.assert_allclose(np.argwhere(painted).mean(axis=0), np.argwhere(met).mean(axis=0), atol=0.5)


def test_the_arm_hides_a_ball_behind_it(clean: StereoCamera):
    p_WC = Params().p_WC_left
    p_WO = p_WC + 1.25 * (np.array([0.0, 0.0, -0.42]) - p_WC)
    y = clean.outputs(0.0, Inputs(p_WO=p_WO, p_WH=FAR))
    assert green(y.left) == 0
    assert green(y.right) > 500


def test_the_ball_hides_markers_behind_it(clean: StereoCamera):
    p_WC = Params().p_WC_left
    p_WO = p_WC + 0.8 * (np.array([0.0, 0.0, -0.6]) - p_WC)
    at = left_pinhole().project(np.array([0.0, 0.0, -0.6]))
    u, v = np.rint(at).astype(int)
    blue, colour, red = clean.outputs(0.0, Inputs(p_WO=p_WO, p_WH=FAR)).left[v, u].astype(int)
    assert colour > max(blue, red) + 30


def test_closing_the_gripper_shows(clean: StereoCamera):
    opened, closed = (clean.outputs(0.0, Inputs(grip=grip)).left.astype(int) for grip in (0.0, 1.0))
    assert np.count_nonzero(np.abs(opened - closed).max(axis=2) > 20) > 300


def test_a_cover_darkens_one_picture_while_it_lasts():
    camera = StereoCamera(Params(cover_left_from=1.0, cover_left_until=2.0))
    for t, dark in ((0.99, False), (1.0, True), (1.99, True), (2.0, False)):
        y = camera.step(t, 1 / 30, Inputs())
        assert bool(y.left.mean() < 10.0) is dark
        assert y.right.mean() > 50.0
        assert y.left.std() > 1.0  # of noise at least


def test_a_scene_out_of_sight_leaves_the_backdrop(clean: StereoCamera):
    gone = Inputs(
        backbone=np.full((25, 3), -3.0), p_WR=np.full(3, -3.0), p_WG=np.full(3, -3.0), p_WO=np.full(3, -3.0),
        p_WH=np.full(3, -3.0),
    )  # fmt: skip
    assert green(clean.outputs(0.0, gone).left) == 0


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        (InvalidCalibration, {"q_WC_left": np.array([1.0, 1.0, 0.0, 0.0])}),
        (InvalidCalibration, {"q_WC_third": np.array([1.0, 1.0, 0.0, 0.0]), "has_third": True}),
        (InvalidCalibration, {"intrinsics_right": np.array([907.0, 0.0, 640.0, 360.0])}),
        (InvalidCameraParameters, {"cover_right_from": 3.0, "cover_right_until": 2.0, "hide_ball_until": -0.5}),
        (InvalidCameraParameters, {"noise": -1.0, "rings": 3}),
    ],
    ids=["attitude", "third", "focal length", "times", "ranges"],
)
def test_what_no_camera_has_is_refused_all_at_once(kind: type[ValueError], changes: dict[str, Any], wording: Wording):
    with pytest.raises(kind) as refused:
        StereoCamera(Params(**changes))
    wording.check(refused.value)


def test_light_scales_what_is_seen_until_the_sensor_is_full(clean: StereoCamera):
    cameras = clean, *(StereoCamera(Params(noise=0.0, light=light)) for light in (0.5, 4.0))
    usual, dim, bright = (c.outputs(0.0, Inputs()).left.astype(float) for c in cameras)
    np.testing.assert_allclose(dim, 0.5 * usual, atol=1.5)
    assert np.count_nonzero(bright == 255) > 0.5 * bright.size


@pytest.mark.slow
def test_a_lost_picture_is_black_and_the_other_camera_s_is_not():
    camera = StereoCamera(Params(lost_pictures=0.5, seed=2))
    lost = [(not y.left.any(), not y.right.any()) for y in (camera.step(k / 30, 1 / 30, Inputs()) for k in range(20))]
    assert all(5 < sum(side) < 15 for side in zip(*lost, strict=True))
    assert any(left != right for left, right in lost)


@pytest.mark.slow
def test_tape_hides_the_markers_that_face_the_cameras_first():
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    seen: list[set[int]] = []
    for covered in (0, 3, 8):
        y = StereoCamera(Params(covered_markers=covered)).outputs(0.0, Inputs())
        ids: list[Any] = [detector.detectMarkers(cv2.cvtColor(p, cv2.COLOR_BGR2GRAY))[1] for p in (y.left, y.right)]
        seen.append({int(i) for found in ids if found is not None for i in found.ravel()})
    assert {3, 4, 5} <= seen[0]
    assert seen[1] == seen[0] - {3, 4, 5}
    assert seen[2] == set()


def test_a_card_hides_the_ball_from_both_cameras_while_it_is_held():
    camera = StereoCamera(Params(hide_ball_from=1.0, hide_ball_until=2.0))
    for t, seen in ((0.9, True), (1.0, False), (1.9, False), (2.0, True)):
        y = camera.outputs(t, Inputs())
        assert [green(p) > 500 for p in (y.left, y.right)] == [seen, seen]


def test_a_third_camera_leaves_the_others_pictures_as_they_are_and_sees_the_ball_from_above(clean: StereoCamera):
    u = Inputs(p_WO=np.array([0.0, 0.16, -0.62]))  # beside the arm, which hides nothing there
    two, three = clean.outputs(0.0, u), StereoCamera(Params(noise=0.0, has_third=True)).outputs(0.0, u)
    np.testing.assert_array_equal(three.left, two.left)
    np.testing.assert_array_equal(three.right, two.right)
    assert not two.third.any()
    p = Params()
    third = Pinhole("third", p.p_WC_third, p.q_WC_third, p.intrinsics_third, p.distortion_third)
    column, row = np.rint(third.project(u.p_WO)).astype(int)
    blue, green_level, red = three.third[row, column].astype(int)
    assert green_level > max(blue, red) + 30


def test_three_pictures_continue_bit_identically_from_a_state():
    camera, other = (StereoCamera(Params(has_third=True, lost_pictures=0.3, decimation=2, seed=1)) for _ in range(2))
    camera.step(0.0, 1 / 30, Inputs(grip=0.5))
    other.set_state(camera.get_state())
    for k in range(1, 4):
        a, b = (c.step(k / 30, 1 / 30, Inputs(grip=0.1 * k)) for c in (camera, other))
        np.testing.assert_array_equal(flat(a), flat(b))


def test_of_three_pictures_one_is_taken_and_handed_out_again_and_cannot_be_changed():
    camera = StereoCamera(Params(decimation=3))
    pairs = [camera.step(k / 30, 1 / 30, Inputs(grip=0.1 * k)) for k in range(7)]
    assert [b.left is a.left for a, b in itertools.pairwise(pairs)] == [True, True, False, True, True, False]
    assert pairs[1].right is pairs[0].right
    assert np.any(pairs[3].left != pairs[0].left)
    with pytest.raises(ValueError, match="read-only"):
        pairs[3].left[0, 0] = 0


def test_a_step_that_is_repeated_from_its_state_is_painted_once_unless_something_else_is_seen():
    camera = StereoCamera(Params())
    camera.step(0.0, 1 / 30, Inputs())
    state = camera.get_state()
    once = camera.step(1 / 30, 1 / 30, Inputs())
    camera.set_state(state)
    assert camera.step(1 / 30, 1 / 30, Inputs()).left is once.left
    camera.set_state(state)
    other = camera.step(1 / 30, 1 / 30, Inputs(grip=1.0))
    fresh = StereoCamera(Params())
    fresh.set_state(state)
    assert np.any(other.left != once.left)
    np.testing.assert_array_equal(other.left, fresh.step(1 / 30, 1 / 30, Inputs(grip=1.0)).left)


def test_cloths_cover_all_lenses_from_when_the_gripper_first_is_near():
    camera, other = (StereoCamera(Params(cover_within=0.05, has_third=True, noise=0.0)) for _ in range(2))
    above = [Inputs(p_WG=Inputs().p_WO + np.array([0.0, 0.0, h])) for h in (0.1, 0.06, 0.04, 0.1)]
    dark: list[list[bool]] = []
    for k, u in enumerate(above):
        y = camera.step(k / 30, 1 / 30, u)
        dark.append([p.max() < 20 for p in (y.left, y.right, y.third)])
    assert dark == [[False] * 3, [False] * 3, [True] * 3, [True] * 3]
    other.set_state(camera.get_state())
    assert other.step(4 / 30, 1 / 30, above[0]).left.max() < 20


def test_a_gripper_that_is_near_hides_the_ball_and_leaves_the_ring():
    camera = StereoCamera(Params(hide_ball_within=0.05))
    seen: list[tuple[bool, bool]] = []
    for k, h in enumerate((0.06, 0.04, 0.06)):
        y = camera.step(k / 30, 1 / 30, Inputs(p_WG=Inputs().p_WO + np.array([0.0, 0.0, h])))
        seen.append((green(y.left) > 500, bool(y.left.max() > 100)))
    assert seen == [(True, True), (False, True), (False, True)]
