"""The arithmetic from landmarks to a hand, in Chromium: hands are made, turned, moved, projected, and found again."""

import json
import math
from collections.abc import Generator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page
from support.hand_points import landmarks_of_hand, turned

from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.hand_kinematics import CLOSED, STRAIGHT
from handover.scenarios.runs.reporting.page import asset

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
    u, v = (focal * in_camera[:, k] / in_camera[:, 2] / size + 0.5 for k, size in enumerate((WIDTH, HEIGHT)))
    world = scale * (in_camera - in_camera.mean(axis=0))
    picture = [{"x": float(a), "y": float(b), "z": 0.0} for a, b in zip(u, v, strict=True)]
    return picture, [{"x": float(x), "y": float(y), "z": float(z)} for x, y, z in world]


def pose(page: Page, picture: list[Any], world: list[Any], right: bool = True) -> dict[str, Any]:
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


def shown_at(t: float, p_CH: Any, R_CH: Any = AXES, angles: tuple[float, ...] = STRAIGHT) -> list[Any]:
    """Return a sample (t, picture, world)."""
    return [t, *seen(landmarks_of_hand(angles), np.array(R_CH), np.array(p_CH))]


@pytest.mark.parametrize(
    ("axis", "angle", "scale", "right"),
    [
        ((0, 0, 1), 0.0, 1.0, True),
        ((1, 0, 0), 2.0, 1.17, False),
        ((0, 1, 0), -1.2, 1.17, True),
        ((1, -2, 3), 2.9, 1.0, False),
        ((0, 1, 1), math.pi, 1.17, True),
    ],
)
def test_a_hand_that_was_projected_is_found_where_it_is(
    page: Page, axis: tuple[float, float, float], angle: float, scale: float, right: bool
):
    R_CH, p_CH, further = rotation(axis, angle), np.array([0.08, -0.05, 0.45]), np.array([0.1, 0.03, 0.2])
    bent = tuple(0.1 + 0.09 * k for k in range(14))
    found, moved, turned_over, of_bent = (
        pose(page, *seen(landmarks_of_hand(angles, right=right), R_CH, p, scale), taken_for)
        for angles, p, taken_for in (
            (STRAIGHT, p_CH, right),
            (STRAIGHT, p_CH + further, right),
            (STRAIGHT, p_CH, not right),
            (bent, p_CH, right),
        )
    )
    assert np.transpose(found["R_CH"]) == pytest.approx(R_CH, abs=1e-9)
    assert found["p_CH"] == pytest.approx(p_CH, abs=0.004)  # the wrist is 3 mm from the palm's middle line
    assert np.subtract(moved["p_CH"], found["p_CH"]) == pytest.approx(further, abs=1e-9)
    assert turned_over["R_CH"][2] == pytest.approx(-R_CH[:, 2]), "the other hand's palm is where this one's back is"
    assert of_bent["angles"] == pytest.approx(bent, abs=1e-9)


def test_noise_of_a_pixel_moves_the_palm_by_a_millimetre_and_its_depth_by_a_centimetre_at_most(page: Page):
    rng = np.random.default_rng(1)
    p_CH, found = np.array([0.0, 0.0, 0.5]), list[Any]()
    for _ in range(60):
        picture, world = seen(landmarks_of_hand(), rotation((0, 1, 0), -0.6), p_CH)
        for point in picture:
            point["x"] += float(rng.normal(0.0, 1.0 / WIDTH))
            point["y"] += float(rng.normal(0.0, 1.0 / HEIGHT))
        found.append(pose(page, picture, world)["p_CH"])
    error = np.std(found, axis=0)
    assert error[:2] == pytest.approx([0.0005, 0.0005], abs=0.0005)
    assert 0.0 < error[2] < 0.01


def test_a_hand_closes_and_opens_with_hysteresis_and_keeps_what_it_holds_at_the_start_until_a_fist_was_opened(
    page: Page,
):
    parts = [*np.linspace(0.0, 1.0, 41), *np.linspace(1.0, 0.0, 41)]
    bent = [tuple(part * angle for angle in CLOSED) for part in parts]
    samples = [shown_at(0.03 * k, [0.0, 0.0, 0.5], angles=angles) for k, angles in enumerate(bent)]
    closed = [s["closed"] for s in guided(page, samples, START)]
    assert not closed[0]
    assert closed[40]
    assert not closed[-1]
    assert np.count_nonzero(np.diff(closed)) == 2
    closes, opens = parts[closed.index(True)], parts[closed.index(False, closed.index(True))]
    assert closes > opens + 0.1
    shown = [STRAIGHT] * 3 + [CLOSED] * 3 + [STRAIGHT]
    samples = [shown_at(0.1 * k, [0.0, 0.0, 0.5], angles=angles) for k, angles in enumerate(shown)]
    found = guided(page, samples, {**START, "closed": True})
    assert [s["closed"] for s in found] == [True] * 6 + [False]
    assert ["angles" in s for s in found] == [False] * 3 + [True] * 4


def test_a_hand_moves_as_it_is_seen_from_where_it_was_and_within_reach(page: Page):
    """To the person's right, up and towards the screen is right, up and into the view, whatever the view."""
    R_WV = rotation((1, 1, 0), 0.8)
    R_CH, p_CH = rotation((0, 0, 1), 0.3), np.array([0.05, 0.0, 0.6])
    moved = p_CH + np.array([-0.1, -0.06, -0.15])
    places = [p_CH] * 3 + [moved] * 60 + [p_CH + np.array([-3.0, 0.0, 0.0])] * 60
    found = guided(page, [shown_at(0.033 * k, p, R_CH) for k, p in enumerate(places)], START, R_WV.T.tolist())
    assert found[0]["p_WH"] == pytest.approx(CENTRE, abs=1e-12)
    assert rotation_of(np.array(found[0]["q_WH"])) == pytest.approx(R_WV @ TURNED @ R_CH, abs=1e-9)
    assert np.subtract(found[62]["p_WH"], CENTRE) == pytest.approx(R_WV @ [0.1, 0.06, -0.15], abs=0.002)
    assert math.dist(found[-1]["p_WH"], CENTRE) == pytest.approx(RADIUS, abs=1e-9)


def test_the_filter_stills_a_resting_hand_and_lags_little_behind_a_quick_one(page: Page):
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 3.0, 1.0 / 30.0).tolist()
    still = guided(page, [shown_at(s, rng.normal([0.0, 0.0, 0.5], 0.004)) for s in t], START)
    assert (np.std([s["p_WH"] for s in still[15:]], axis=0) < 0.6 * 0.004).all()
    quick = guided(page, [shown_at(s, [-0.5 * s, 0.0, 0.5]) for s in t[:45]], START)
    lag = 0.5 * t[44] - (quick[44]["p_WH"][0] - CENTRE[0])
    assert 0.0 < lag / 0.5 < 0.04  # seconds behind


def test_landmarks_that_tell_no_hand_give_no_sample_and_leave_the_next_as_it_were(page: Page):
    first, nan, flat, none, back, later, behind = (
        shown_at(t, [0.0, 0.0, 0.5]) for t in (0.0, 0.1, 0.13, 0.16, -0.03, 0.2, 0.3)
    )
    nan[2][5] = {"x": 0.1, "z": 0.0}  # y is NaN: JSON has no other way to say it
    flat[2] = [{"x": 0.01 * k, "y": 0.0, "z": 0.0} for k in range(21)]
    none[1:] = [None, None]
    found = guided(page, [first, nan, flat, none, back, later], START)
    assert [s is None for s in found] == [False, True, True, True, True, False]
    assert found[-1]["p_WH"] == pytest.approx(CENTRE, abs=1e-9)
    assert "null" not in json.dumps(found[-1])
    behind[1] = [{"x": 1.0 - p["x"], "y": 1.0 - p["y"]} for p in behind[1]]  # upside down: only behind the camera
    assert guided(page, [behind], START) == [None]


def test_a_hand_that_comes_back_elsewhere_goes_on_from_where_it_was(page: Page):
    for gap, moved in ((0.4, True), (0.6, False)):
        places = (0.0, 0.0), (0.03, 0.0), (0.03 + gap, -0.2)
        found = guided(page, [shown_at(t, [x, 0.0, 0.5]) for t, x in places], START)
        assert (found[2]["p_WH"][0] - CENTRE[0] > 0.05) is moved
