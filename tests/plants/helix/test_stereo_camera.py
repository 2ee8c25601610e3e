import hashlib
import itertools
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.geometry import InvalidCalibration, Pinhole
from handover.plants.helix.cameras.shapes import Pixels
from handover.plants.helix.cameras.stereo_camera import Inputs, InvalidCameraParameters, Params, StereoCamera

HOUSE = Path(__file__).parents[3]
FAR = np.array([0.3, 1.5, -1.2])  # out of both pictures


@pytest.fixture(scope="module")
def camera() -> StereoCamera:
    return StereoCamera(Params())


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


def test_declares_pictures_that_feed_through_at_30_hz():
    d = describe(StereoCamera)
    assert [(v.name, v.raster.mime if v.raster else "") for v in d.outputs] == [
        ("left", "image/x-raw-bgr; width=1280; height=720"),
        ("right", "image/x-raw-bgr; width=1280; height=720"),
        ("third", "image/x-raw-bgr; width=1280; height=720"),
    ]
    assert d.feedthrough == {side: tuple(v.name for v in d.inputs) for side in ("left", "right", "third")}
    assert d.period is not None
    assert float(d.period) == pytest.approx(1 / 30)


@pytest.mark.slow
@pytest.mark.parametrize("kernels", ["compiled", "not compiled", "not loaded"])
def test_pictures_are_the_same_in_another_process_with_compiled_kernels_and_without(kernels: str):
    code = f"import sys; sys.path[:0] = [{str(HOUSE)!r}, {str(Path(__file__).parent)!r}]\n"
    if kernels != "not loaded":
        pytest.importorskip("numba")
        code += "import numba\n"
    code += "import test_stereo_camera as t; print(t.digest(), 'numba' in sys.modules)"
    environment = {**os.environ, "HANDOVER_COMPILE": "0" if kernels == "not compiled" else "1"}
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert other.stdout.split() == [digest(), str(kernels != "not loaded")]


def test_seeds_differ_only_in_noise(camera: StereoCamera):
    a, b = camera.outputs(0.0, Inputs()).left, StereoCamera(Params(seed=1)).outputs(0.0, Inputs()).left
    difference = a.astype(float) - b
    assert np.count_nonzero(difference) > 0.7 * difference.size
    assert abs(difference.mean()) < 0.01
    assert difference.std() == pytest.approx(np.sqrt(2) * 2.2, rel=0.03)


def test_noise_of_pictures_and_pixels_is_independent(camera: StereoCamera, clean: StereoCamera):
    truth = clean.outputs(0.0, Inputs())
    first, second = (camera.step(0.0, 1 / 30, Inputs()) for _ in range(2))
    noise = [p.astype(float) - q for p, q in ((first.left, truth.left), (second.left, truth.left))]
    noise.append(first.right.astype(float) - truth.right)
    for a, b in ((noise[0], noise[1]), (noise[0], noise[2]), (noise[0][:, 1:], noise[0][:, :-1])):
        assert abs(float(np.mean(a * b))) < 0.01 * 2.2**2


def test_outputs_do_not_draw_noise(camera: StereoCamera):
    np.testing.assert_array_equal(camera.outputs(0.0, Inputs()).left, camera.outputs(0.0, Inputs()).left)


def test_continues_bit_identically_from_a_state(camera: StereoCamera):
    state = camera.get_state()
    expected = [camera.step(0.1 * i, 0.1, Inputs()) for i in range(3)]
    other = StereoCamera(Params())
    other.set_state(state)
    for i, y in enumerate(expected):
        again = other.step(0.1 * i, 0.1, Inputs())
        np.testing.assert_array_equal(again.left, y.left)
        np.testing.assert_array_equal(again.right, y.right)


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


@pytest.mark.parametrize("side", ["left", "right", "third"])
def test_a_quaternion_not_of_unit_length_is_refused(side: str):
    long: dict[str, Any] = {f"q_WC_{side}": np.array([1.0, 1.0, 0.0, 0.0])}
    with pytest.raises(InvalidCalibration, match=f"'{side}': q_WC"):
        StereoCamera(replace(Params(has_third=True), **long))


def test_a_focal_length_that_is_not_positive_is_refused():
    with pytest.raises(InvalidCalibration, match="fx and fy positive"):
        StereoCamera(Params(intrinsics_right=np.array([907.0, 0.0, 640.0, 360.0])))


def test_what_is_taken_away_before_it_is_there_is_refused_all_at_once():
    with pytest.raises(InvalidCameraParameters) as caught:
        StereoCamera(Params(cover_right_from=3.0, cover_right_until=2.0, hide_ball_from=1.0, hide_ball_until=0.5))
    assert caught.value.faults == [
        "cover_right_until = 2 s must not be before cover_right_from = 3 s",
        "hide_ball_until = 0.5 s must not be before hide_ball_from = 1 s",
    ]


def test_parameters_out_of_range_are_refused_all_at_once():
    with pytest.raises(InvalidCameraParameters) as caught:
        StereoCamera(Params(noise=-1.0, rings=3))
    assert len(caught.value.faults) == 2
    assert "rings: 3 is out of range: from 1 to 2" in str(caught.value)


def test_light_scales_what_is_seen_until_the_sensor_is_full(clean: StereoCamera):
    cameras = [StereoCamera(Params(noise=0.0, light=light)) for light in (1.0, 0.5, 4.0)]
    usual, dim, bright = (c.outputs(0.0, Inputs()).left.astype(float) for c in cameras)
    np.testing.assert_allclose(dim, 0.5 * usual, atol=1.5)
    assert np.count_nonzero(bright == 255) > 0.5 * bright.size
    np.testing.assert_array_equal(usual, clean.outputs(0.0, Inputs()).left)


@pytest.mark.slow
def test_a_lost_picture_is_black_and_the_other_camera_s_is_not():
    camera = StereoCamera(Params(lost_pictures=0.5, seed=2))
    lost = [(not y.left.any(), not y.right.any()) for y in (camera.step(k / 30, 1 / 30, Inputs()) for k in range(40))]
    assert all(10 < sum(side) < 30 for side in zip(*lost, strict=True))
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
    pairs = [camera.outputs(t, Inputs()) for t in (0.9, 1.0, 1.9, 2.0)]
    seen = [[green(p) > 500 for p in (y.left, y.right)] for y in pairs]
    assert seen == [[True, True], [False, False], [False, False], [True, True]]


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


@pytest.mark.slow
def test_three_pictures_continue_bit_identically_from_a_state():
    camera, other = (StereoCamera(Params(has_third=True, lost_pictures=0.3, seed=1)) for _ in range(2))
    camera.step(0.0, 1 / 30, Inputs())
    other.set_state(camera.get_state())
    for k in range(1, 4):
        a, b = (c.step(k / 30, 1 / 30, Inputs(grip=0.1 * k)) for c in (camera, other))
        for side in ("left", "right", "third"):
            np.testing.assert_array_equal(getattr(a, side), getattr(b, side))


def test_of_three_pictures_one_is_taken_and_repeated():
    camera = StereoCamera(Params(decimation=3))
    scenes = [Inputs(p_WO=np.array([0.18, 0.0, -0.62 + 0.01 * k])) for k in range(7)]
    pictures = [camera.step(k / 30, 1 / 30, u).left for k, u in enumerate(scenes)]
    same = [bool(np.array_equal(a, b)) for a, b in itertools.pairwise(pictures)]
    assert same == [True, True, False, True, True, False]


@pytest.mark.slow
def test_a_repeated_picture_is_the_same_after_its_state_was_restored():
    camera, other = (StereoCamera(Params(decimation=3, lost_pictures=0.2, seed=4)) for _ in range(2))
    camera.step(0.0, 1 / 30, Inputs(grip=0.5))
    state = camera.get_state()
    other.set_state(state)
    for k in range(1, 5):
        a, b = (c.step(k / 30, 1 / 30, Inputs()) for c in (camera, other))
        np.testing.assert_array_equal(a.left, b.left)
        np.testing.assert_array_equal(a.right, b.right)


def test_a_pair_is_handed_out_again_until_the_next_is_taken_and_cannot_be_changed():
    camera = StereoCamera(Params(decimation=2))
    first, again, second = (camera.step(k / 30, 1 / 30, Inputs()) for k in range(3))
    assert again.left is first.left
    assert again.right is first.right
    assert second.left is not first.left
    with pytest.raises(ValueError, match="read-only"):
        second.left[0, 0] = 0


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
