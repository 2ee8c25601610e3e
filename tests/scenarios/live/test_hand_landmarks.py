"""The arithmetic from landmarks to a hand, in Chromium: hands are made, turned, moved, projected, and found again."""

import json
import math
from collections.abc import Generator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page
from support.hand_points import landmarks_of_hand, turned

from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.hand_kinematics import CLOSED, STRAIGHT
from handover.scenarios.reporting.page import asset

pytestmark = pytest.mark.slow

WIDTH, HEIGHT, FIELD = 640, 480, math.radians(60.0)
TURNED = np.diag([-1.0, -1.0, 1.0])
"""From the camera's frame to the view's: the camera on a screen faces who looks at the screen."""
CENTRE, RADIUS = (-0.4, 0.1, -0.05), 0.9
START = {"p_WH": CENTRE, "centre": CENTRE, "radius": RADIUS, "closed": False}
AXES = np.eye(3).tolist()


@pytest.fixture(scope="module")
def page(browser: Browser) -> Generator[Page, None, None]:
    made = browser.new_page()
    made.add_script_tag(content=asset("hand/hand_landmarks.js") + ";window.handLandmarks = handLandmarks;")
    yield made
    made.close()


def rotation(axis: tuple[float, float, float], angle: float) -> Floats:
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)


def seen(points: Floats, R_CH: Floats, p_CH: Floats, scale: float = 1.0) -> tuple[list[Any], list[Any]]:
    """Return a hand's landmarks in a pinhole camera's picture, and in space about their middle, as MediaPipe does."""
    in_camera = turned(points, R_CH) + p_CH
    focal = 0.5 * WIDTH / math.tan(0.5 * FIELD)
    u, v = (
        focal * in_camera[:, 0] / in_camera[:, 2] / WIDTH + 0.5,
        focal * in_camera[:, 1] / in_camera[:, 2] / HEIGHT + 0.5,
    )
    world = scale * (in_camera - in_camera.mean(axis=0))
    picture = [{"x": float(a), "y": float(b), "z": 0.0} for a, b in zip(u, v, strict=True)]
    return picture, [{"x": float(x), "y": float(y), "z": float(z)} for x, y, z in world]


def pose(page: Page, picture: list[Any], world: list[Any], right: bool = True) -> dict[str, Any] | None:
    size = {"width": WIDTH, "height": HEIGHT, "right": right}
    return page.evaluate("([picture, world, size]) => handLandmarks.pose(picture, world, size)", [picture, world, size])


def guided(page: Page, samples: list[Any], start: dict[str, Any], axes: Any = AXES) -> list[Any]:
    """Return what a new guide makes of samples (t, picture, world)."""
    return page.evaluate(
        """([samples, start, axes, size]) => {
            const guide = handLandmarks.guide({start});
            return samples.map(([t, picture, world]) => guide.take(t, picture, world, size, axes));
        }""",
        [samples, start, axes, {"width": WIDTH, "height": HEIGHT}],
    )


def matrix(q: list[float]) -> NDArray[np.float64]:
    w, *v = q
    return (
        rotation((v[0], v[1], v[2]), 2.0 * math.atan2(np.linalg.norm(v), w)) if np.linalg.norm(v) > 1e-12 else np.eye(3)
    )


@pytest.mark.parametrize("right", [True, False])
@pytest.mark.parametrize("scale", [1.0, 1.17])
@pytest.mark.parametrize(
    ("axis", "angle"), [((0, 0, 1), 0.0), ((1, 0, 0), 2.0), ((0, 1, 0), -1.2), ((1, -2, 3), 2.9), ((0, 1, 1), math.pi)]
)
def test_a_hand_that_was_projected_is_found_where_it_is(
    page: Page, axis: tuple[float, float, float], angle: float, scale: float, right: bool
):
    R_CH, p_CH = rotation(axis, angle), np.array([0.08, -0.05, 0.45])
    picture, world = seen(landmarks_of_hand(right=right), R_CH, p_CH, scale)
    found = pose(page, picture, world, right)
    assert found is not None
    R_found: Floats = np.transpose(found["R_CH"])
    assert R_found == pytest.approx(R_CH, abs=1e-9)
    assert found["p_CH"] == pytest.approx(p_CH, abs=0.004)  # the wrist is 3 mm from the palm's middle line
    further = p_CH + np.array([0.1, 0.03, 0.2])
    moved = pose(page, *seen(landmarks_of_hand(right=right), R_CH, further, scale), right)
    assert moved is not None
    assert np.subtract(moved["p_CH"], found["p_CH"]) == pytest.approx(further - p_CH, abs=1e-9)


def test_the_other_hand_shows_its_palm_where_this_one_shows_its_back(page: Page):
    picture, world = seen(landmarks_of_hand(right=False), np.eye(3), np.array([0.0, 0.0, 0.5]))
    left, taken_for_right = pose(page, picture, world, right=False), pose(page, picture, world, right=True)
    assert left is not None
    assert taken_for_right is not None
    assert left["R_CH"][2] == pytest.approx([0.0, 0.0, 1.0])
    assert taken_for_right["R_CH"][2] == pytest.approx([0.0, 0.0, -1.0])


@pytest.mark.parametrize("right", [True, False])
def test_joints_are_those_of_the_hand(page: Page, right: bool):
    angles = tuple(0.1 + 0.09 * k for k in range(14))
    found = pose(
        page, *seen(landmarks_of_hand(angles, right=right), rotation((1, 2, 0), 0.7), np.array([0.0, 0.1, 0.5])), right
    )
    assert found is not None
    assert found["angles"] == pytest.approx(angles, abs=1e-9)


def test_noise_of_a_pixel_moves_the_palm_by_a_millimetre_and_its_depth_by_a_centimetre_at_most(page: Page):
    rng = np.random.default_rng(1)
    p_CH, found = np.array([0.0, 0.0, 0.5]), list[Any]()
    for _ in range(200):
        picture, world = seen(landmarks_of_hand(), rotation((0, 1, 0), -0.6), p_CH)
        for point in picture:
            point["x"] += float(rng.normal(0.0, 1.0 / WIDTH))
            point["y"] += float(rng.normal(0.0, 1.0 / HEIGHT))
        sample = pose(page, picture, world)
        assert sample is not None
        found.append(sample["p_CH"])
    error = np.std(found, axis=0)
    assert error[:2] == pytest.approx([0.0005, 0.0005], abs=0.0005)
    assert 0.0 < error[2] < 0.01


def test_a_hand_closes_and_opens_with_hysteresis(page: Page):
    def sample(k: int, part: float) -> Any:
        points = landmarks_of_hand(tuple(part * angle for angle in CLOSED))
        return [0.03 * k, *seen(points, np.eye(3), np.array([0.0, 0.0, 0.5]))]

    parts = [*np.linspace(0.0, 1.0, 41), *np.linspace(1.0, 0.0, 41)]
    closed = [s["closed"] for s in guided(page, [sample(k, part) for k, part in enumerate(parts)], START)]
    assert not closed[0]
    assert closed[40]
    assert not closed[-1]
    assert np.count_nonzero(np.diff(closed)) == 2
    closes, opens = parts[closed.index(True)], parts[closed.index(False, closed.index(True))]
    assert closes > opens + 0.1


def test_what_a_hand_holds_at_the_start_it_keeps_until_a_fist_was_opened(page: Page):
    open_hand, fist = (
        seen(landmarks_of_hand(angles), np.eye(3), np.array([0.0, 0.0, 0.5])) for angles in (STRAIGHT, CLOSED)
    )
    shown = [open_hand] * 3 + [fist] * 3 + [open_hand]
    samples = [[0.1 * k, *picture_and_world] for k, picture_and_world in enumerate(shown)]
    found = guided(page, samples, {**START, "closed": True})
    assert [s["closed"] for s in found] == [True] * 6 + [False]
    assert ["angles" in s for s in found] == [False] * 3 + [True] * 4


def test_a_hand_moves_as_it_is_seen_from_where_it_was_and_within_reach(page: Page):
    """To the person's right, up and towards the screen is right, up and into the view, whatever the view."""
    R_WV = rotation((1, 1, 0), 0.8)
    R_CH, p_CH = rotation((0, 0, 1), 0.3), np.array([0.05, 0.0, 0.6])
    moved = p_CH + np.array([-0.1, -0.06, -0.15])
    places = [p_CH] * 3 + [moved] * 60 + [p_CH + np.array([-3.0, 0.0, 0.0])] * 60
    samples = [[0.033 * k, *seen(landmarks_of_hand(), R_CH, p)] for k, p in enumerate(places)]
    found = guided(page, samples, START, R_WV.T.tolist())
    assert found[0]["p_WH"] == pytest.approx(CENTRE, abs=1e-12)
    assert matrix(found[0]["q_WH"]) == pytest.approx(R_WV @ TURNED @ R_CH, abs=1e-9)
    assert np.subtract(found[62]["p_WH"], CENTRE) == pytest.approx(R_WV @ [0.1, 0.06, -0.15], abs=0.002)
    assert math.dist(found[-1]["p_WH"], CENTRE) == pytest.approx(RADIUS, abs=1e-9)


def test_the_filter_stills_a_resting_hand_and_lags_little_behind_a_quick_one(page: Page):
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 3.0, 1.0 / 30.0)
    rest = [p + rng.normal(0.0, 0.004, 3) for p in np.tile([0.0, 0.0, 0.5], (len(t), 1))]
    still = guided(
        page, [[s, *seen(landmarks_of_hand(), np.eye(3), p)] for s, p in zip(t.tolist(), rest, strict=True)], START
    )
    noise = np.std([s["p_WH"] for s in still[15:]], axis=0)
    assert (noise < 0.6 * 0.004).all()
    quick = np.column_stack([-0.5 * t, 0.0 * t, 0.0 * t + 0.5])[:45]
    samples = [[s, *seen(landmarks_of_hand(), np.eye(3), p)] for s, p in zip(t.tolist(), quick, strict=False)]
    lag = 0.5 * t[44] - (guided(page, samples, START)[44]["p_WH"][0] - CENTRE[0])
    assert 0.0 < lag / 0.5 < 0.04  # seconds behind


def test_landmarks_that_tell_no_hand_give_no_sample_and_leave_the_next_as_it_were(page: Page):
    def sample(t: float, x: float) -> Any:
        return [t, *seen(landmarks_of_hand(), np.eye(3), np.array([x, 0.0, 0.5]))]

    nan, flat, none, back = sample(0.1, 0.0), sample(0.13, 0.0), [0.16, None, None], sample(0.03, 0.0)
    nan[2][5] = {"x": 0.1, "z": 0.0}  # y is NaN: JSON has no other way to say it
    flat[2] = [{"x": 0.01 * k, "y": 0.0, "z": 0.0} for k in range(21)]
    found = guided(page, [sample(0.0, 0.0), sample(0.06, 0.0), nan, flat, none, back, sample(0.2, 0.0)], START)
    assert [s is None for s in found] == [False, False, True, True, True, True, False]
    assert found[-1]["p_WH"] == pytest.approx(CENTRE, abs=1e-9)
    assert json.dumps(found[-1]).find("null") < 0
    behind = sample(0.3, 0.0)
    behind[1] = [{"x": 1.0 - p["x"], "y": 1.0 - p["y"]} for p in behind[1]]  # upside down: only behind the camera
    assert guided(page, [behind], START) == [None]


def test_a_hand_that_comes_back_elsewhere_goes_on_from_where_it_was(page: Page):
    def sample(t: float, x: float) -> Any:
        return [t, *seen(landmarks_of_hand(), np.eye(3), np.array([x, 0.0, 0.5]))]

    for gap, moved in ((0.4, True), (0.6, False)):
        found = guided(page, [sample(0.0, 0.0), sample(0.03, 0.0), sample(0.03 + gap, -0.2)], START)
        assert (found[2]["p_WH"][0] - CENTRE[0] > 0.05) is moved
