"""Fingers on a screen and a gamepad lead the hand in a real browser, as the mouse does in `test_live_hand.py`."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_runs import live_run, shown
from numpy.typing import NDArray
from opened_page import wait_until
from playwright.sync_api import Browser, CDPSession, Page

from handover.cosim.blocks.geometry import rotation_of

pytestmark = pytest.mark.slow

SCENARIO = "flyer_robot_to_human"
GIVEN = ("-p", "hand=outside", "--pace", "0.5")
SEEN = """(() => {
    const {position, matrixWorld} = live.scene.camera, hand = new THREE.Vector3(...live.hand.pose().p_WH);
    const box = document.querySelector(".replay-scene").getBoundingClientRect();
    const [x, y] = live.scene.toPixels(hand.toArray());
    const back = new THREE.Vector3().setFromMatrixColumn(matrixWorld, 2);
    return [box.left + x, box.top + y, position.clone().sub(hand).dot(back)];
})()"""
"""Where the hand is seen, in pixels of the window, and how deep below the eye, m."""
SEEN_SHARE = """label => {
    const points = live.scene.points(label), few = points.filter((_, k) => k % Math.ceil(points.length / 40) === 0);
    const middle = [0, 1, 2].map(i => points.reduce((sum, p) => sum + p[i], 0) / points.length);
    const box = document.querySelector(".replay-scene canvas").getBoundingClientRect();
    return few.filter(p => {
        const [x, y] = live.scene.toPixels(p.map((at, i) => 0.9 * at + 0.1 * middle[i]));
        return live.scene.pick(box.left + x, box.top + y, [label]);
    }).length / few.length;
}"""
"""Which share of a label's points is seen at its pixel: nothing lies before it, and it is within the view."""
NO_PAD = """
    window.pad = null;
    Object.defineProperty(navigator, "getGamepads", {value: () => [null, window.pad]});
"""


def seen(page: Page) -> NDArray[np.float64]:
    return np.array(page.evaluate(SEEN))


def turned_about(page: Page, q_before: list[float], axis: int) -> float:
    """Return the sine of the angle by which it was turned about the view's right (0), up (1) or back (2)."""
    before, now = (rotation_of(np.array(q)) for q in (q_before, page.evaluate("live.hand.pose().q_WH")))
    R: NDArray[np.float64] = now @ np.transpose(before)
    v = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(v @ np.array(page.evaluate("live.hand.axes()")[axis], dtype=np.float64))


def touch(screen: CDPSession, kind: str, *fingers: tuple[float, float]) -> None:
    points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(fingers)]
    screen.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


def told(out: Path) -> dict[str, Any]:
    return json.loads((out / "inputs.json").read_text(encoding="utf-8"))


def end_run(page: Page) -> None:
    page.locator("#stop").click()
    wait_until(page, "document.querySelector('.live').dataset.ended")


def test_a_finger_takes_the_hand_along_and_two_change_its_depth(browser: Browser, tmp_path: Path):
    with live_run(tmp_path / "led", *GIVEN, scenario=SCENARIO) as (address, run):
        with shown(browser, address, has_touch=True) as page:
            wait_until(page, "live.hand")
            page.locator("[data-view=top]").click()
            screen = page.context.new_cdp_session(page)
            x, y = 500.0, 400.0
            before = seen(page)
            touch(screen, "touchStart", (x, y))
            for k in range(1, 6):
                touch(screen, "touchMove", (x + 10.0 * k, y - 4.0 * k))
            page.wait_for_timeout(500)  # moves come with the next picture
            along = seen(page)
            assert (along - before)[:2] == pytest.approx([50.0, -20.0], abs=1.0)
            assert along[2] == pytest.approx(before[2], abs=1e-6)
            touch(screen, "touchStart", (x + 50.0, y - 20.0), (x + 150.0, y - 20.0))
            for k in range(1, 6):
                touch(screen, "touchMove", (x + 50.0, y - 20.0), (x + 150.0 + 10.0 * k, y - 20.0))
            page.wait_for_timeout(500)
            near = seen(page)
            assert along[2] - near[2] == pytest.approx(0.1, abs=0.005)  # 2 mm a pixel
            touch(screen, "touchEnd")
            touch(screen, "touchStart", (x, y))  # where a finger comes down is nothing to the hand
            touch(screen, "touchEnd")
            page.wait_for_timeout(500)
            assert seen(page) == pytest.approx(near, abs=1e-6)
            assert not page.evaluate("live.hand.pose().closed")
            page.locator("#hand-grasp").click()
            assert page.evaluate("live.hand.pose().closed")
            end_run(page)
        run.wait(timeout=120)
    assert told(tmp_path / "led")["samples"]["touch"] > 5


def test_a_gamepads_sticks_triggers_and_button_lead_the_hand(browser: Browser, tmp_path: Path):
    def hold(page: Page, axes: tuple[float, ...] = (0.0,) * 4, **buttons: float) -> None:
        values = [buttons.get(f"b{i}", 0.0) for i in range(17)]
        pad = {"axes": list(axes), "buttons": [{"value": v, "pressed": v > 0.5} for v in values]}
        page.evaluate("pad => { window.pad = pad; }", pad)
        page.wait_for_timeout(400)

    with live_run(tmp_path / "led", *GIVEN, scenario=SCENARIO) as (address, run):
        with shown(browser, address, script=NO_PAD) as page:
            wait_until(page, "live.hand")
            page.locator("[data-view=top]").click()
            page.locator("#hand-device").select_option("gamepad")
            start = seen(page)
            page.wait_for_timeout(300)
            assert seen(page) == pytest.approx(start, abs=1e-9)  # without a gamepad the hand stays
            hold(page, (0.1, -0.1, 0.1, 0.1))
            assert seen(page) == pytest.approx(start, abs=1e-9)  # a stick that is not quite in its middle
            hold(page, (0.5, 0.0, 0.0, 0.0))
            hold(page)
            right = seen(page) - start
            assert right[0] > 5.0
            assert abs(right[1]) < 1.0
            hold(page, (0.0, -0.5, 0.0, 0.0))
            hold(page)
            up = seen(page) - start - right
            assert up[1] < -5.0
            before = seen(page)
            hold(page, b7=0.5)
            hold(page)
            assert seen(page)[2] < before[2] - 0.01  # towards the eye
            q = page.evaluate("live.hand.pose().q_WH")
            hold(page, (0.0, 0.0, 0.5, 0.0))
            hold(page)
            assert turned_about(page, q, 1) < -0.05  # to the right, seen from above
            hold(page, b0=1.0)
            assert page.evaluate("live.hand.pose().closed")  # once, however long it is held
            hold(page)
            hold(page, b0=1.0)
            assert not page.evaluate("live.hand.pose().closed")
            end_run(page)
        run.wait(timeout=120)
    assert told(tmp_path / "led")["samples"]["gamepad"] > 20


def test_keys_turn_the_hand_as_they_lie_on_the_keyboard(browser: Browser, tmp_path: Path):
    with live_run(tmp_path / "led", *GIVEN, scenario=SCENARIO) as (address, run):
        with shown(browser, address) as page:
            wait_until(page, "live.hand")
            for keys, axis in (
                ("sw", 0),
                ("ad", 1),
                ("qe", 2),
            ):  # tilts, turns, rolls
                for key, sign in zip(keys, (1.0, -1.0), strict=True):
                    q = page.evaluate("live.hand.pose().q_WH")
                    page.keyboard.down(key)
                    page.wait_for_timeout(200)
                    page.keyboard.up(key)
                    assert sign * turned_about(page, q, axis) > 0.02, key
            end_run(page)
        run.wait(timeout=120)


@pytest.mark.parametrize("size", [(1280, 800), (400, 800)])
def test_the_hand_is_seen_at_first_from_behind_it(browser: Browser, tmp_path: Path, size: tuple[int, int]):
    with live_run(tmp_path / "led", *GIVEN, scenario=SCENARIO) as (address, run):
        with shown(browser, address) as page:
            page.set_viewport_size({"width": size[0], "height": size[1]})
            wait_until(page, "live.hand")
            if size[0] < 1000:  # the page was opened as a wider one
                page.locator("[data-view=start]").click()
            assert page.evaluate(SEEN_SHARE, "hand") > 0.9
            assert abs(page.evaluate("live.scene.spherical().azimuth")) > 0.9 * np.pi  # the robot comes from +x
            end_run(page)
        run.wait(timeout=120)


def test_a_view_from_the_side_shows_depth_beside_the_first_view_and_on_a_phone_below_it(
    browser: Browser, tmp_path: Path
):
    with live_run(tmp_path / "led", *GIVEN, scenario=SCENARIO) as (address, run):
        with shown(browser, address) as page:
            wait_until(page, "live.hand")
            side, first = page.locator(".replay-inset"), page.locator(".replay-scene")
            wait_until(page, "document.querySelector('.replay-inset').dataset.pictures > 2")
            around, of_side = first.bounding_box(), side.bounding_box()
            assert around is not None
            assert of_side is not None
            assert of_side["y"] + of_side["height"] <= around["y"] + around["height"]
            page.set_viewport_size({"width": 390, "height": 844})
            around, of_side = first.bounding_box(), side.bounding_box()
            assert around is not None
            assert of_side is not None
            assert of_side["y"] >= around["y"] + around["height"]
            assert of_side["y"] + of_side["height"] <= 844.0
            page.get_by_label("view from the side").uncheck()
            assert side.count() == 0
            page.get_by_label("view from the side").check()
            wait_until(page, "document.querySelector('.replay-inset').dataset.pictures > 2")
            end_run(page)
        run.wait(timeout=120)
