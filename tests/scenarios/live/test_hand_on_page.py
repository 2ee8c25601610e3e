"""The hand that a page leads, without a run: by touch, keys and a gamepad, and words that say how far off it is."""

from collections.abc import Generator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, CDPSession, Page

from handover.cosim.blocks.geometry import rotation_of
from handover.scenarios.runs.reporting.page import asset

SPEED, TURN, PINCH = 0.4, 1.2, 0.002
"""m/s and rad/s of a stick or key that is held, and m a pixel of two fingers."""
BLANK = """
<button id='b' onclick='window.pressed = 1'>pause</button>
<div style='width: 400px'><div id='e' style='height: 200px'></div></div>
"""
CLOCK = """
    window.now = 1000;
    window.pad = null;
    performance.now = () => window.now;
    window.setInterval = tick => (window.tick = tick, 0);
    Object.defineProperty(navigator, "getGamepads", {value: () => [null, window.pad]});
"""
"""The hand's clock goes as the test says, and its gamepad is what the test says."""
HAND = """() => {
    window.element = document.getElementById("e");
    window.camera = new THREE.PerspectiveCamera(36, 2, 0.01, 10);
    camera.up.set(0, 0, 1);
    camera.position.set(-1, 0, 0);
    camera.lookAt(0, 0, 0);
    const start = {p_WH: [0, 0, 0], q_WH: [1, 0, 0, 0], closed: false, centre: [0, 0, 0], radius: 1};
    window.samples = [];
    window.hand = handInput({element, camera, start, onSample: sample => samples.push(sample)});
    hand.choose("pointer");
}"""
SEEN = """(() => {
    camera.updateMatrixWorld();
    const box = element.getBoundingClientRect(), p = new THREE.Vector3(...hand.pose().p_WH);
    const depth = camera.position.clone().sub(p).dot(new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 2));
    const {x, y} = p.project(camera);
    return [box.left + (x + 1) / 2 * box.width, box.top + (1 - y) / 2 * box.height, depth];
})()"""
"""Where the hand is seen, in pixels, and how deep below the eye, m."""


@pytest.fixture
def page(browser: Browser) -> Generator[Page, None, None]:
    """Return a page with a hand before it, seen along x from behind: y points to the left."""
    page = browser.new_page(viewport={"width": 500, "height": 300}, has_touch=True)
    page.set_content(BLANK)
    page.evaluate(f"() => {{ {CLOCK} }}")
    for script in ("scene/three.min.js", "hand/hand_input.js", "live/hand_hints.js"):
        page.add_script_tag(content=asset(script))
    page.evaluate(HAND)
    yield page
    page.close()


def place(page: Page) -> NDArray[np.float64]:
    """Return where the hand is wanted along the view's right, up and back, m."""
    axes = np.array(page.evaluate("hand.axes()"))
    return axes @ np.array(page.evaluate("hand.pose().p_WH"))


def turned(page: Page) -> NDArray[np.float64]:
    """Return the sine of the angle by which the hand is turned times its axis, along the view's right, up and back."""
    R = rotation_of(np.array(page.evaluate("hand.pose().q_WH")))
    v = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return np.array(page.evaluate("hand.axes()")) @ v


def after(page: Page, milliseconds: int) -> None:
    """Let the hand's clock go on."""
    page.evaluate(f"(window.now += {milliseconds}, window.tick())")


def test_the_space_bar_is_the_hands_wherever_the_focus_is(page: Page):
    page.locator("#b").focus()
    page.keyboard.press("Space")
    assert page.evaluate("[hand.pose().closed, window.pressed ?? 0]") == [True, 0]
    page.evaluate("hand.end()")
    page.keyboard.press("Space")
    assert page.evaluate("[hand.pose().closed, window.pressed ?? 0]") == [True, 1]


def test_keys_move_and_turn_the_hand_as_they_lie_on_the_keyboard(page: Page):
    """Arrows move it to the right, up, and pages towards the eye; letters tilt, turn and roll it."""
    moves = ("ArrowRight", "ArrowLeft"), ("ArrowUp", "ArrowDown"), ("PageDown", "PageUp")
    turns = ("s", "w"), ("a", "d"), ("q", "e")
    for k, pair in enumerate((*moves, *turns)):
        for key, sign in zip(pair, (1.0, -1.0), strict=True):
            page.evaluate("hand.place({p_WH: [0, 0, 0], q_WH: [1, 0, 0, 0], closed: false})")
            page.keyboard.down(key)
            after(page, 100)
            page.keyboard.up(key)
            after(page, 100)
            way = np.concatenate([place(page), turned(page)])
            expected = np.zeros(6)
            expected[k] = sign * (SPEED * 0.1 if k < 3 else np.sin(TURN * 0.1))
            np.testing.assert_allclose(way, expected, atol=1e-9, err_msg=key)


def touch(screen: CDPSession, page: Page, kind: str, *fingers: tuple[float, float]) -> None:
    points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(fingers)]
    screen.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    page.evaluate("new Promise(requestAnimationFrame)")  # moves come with the next picture


def test_a_finger_takes_the_hand_along_and_two_change_its_depth(page: Page):
    screen, x, y = page.context.new_cdp_session(page), 150.0, 130.0
    before = np.array(page.evaluate(SEEN))
    touch(screen, page, "touchStart", (x, y))
    for k in range(1, 6):
        touch(screen, page, "touchMove", (x + 10.0 * k, y - 4.0 * k))
    along = np.array(page.evaluate(SEEN))
    assert (along - before)[:2] == pytest.approx([50.0, -20.0], abs=1.0)
    assert along[2] == pytest.approx(before[2], abs=1e-6)
    touch(screen, page, "touchStart", (x + 50.0, y - 20.0), (x + 150.0, y - 20.0))
    for k in range(1, 6):
        touch(screen, page, "touchMove", (x + 50.0, y - 20.0), (x + 150.0 + 10.0 * k, y - 20.0))
    near = np.array(page.evaluate(SEEN))
    assert along[2] - near[2] == pytest.approx(50.0 * PINCH, abs=0.005)
    touch(screen, page, "touchEnd")
    touch(screen, page, "touchStart", (x, y))  # where a finger comes down is nothing to the hand
    touch(screen, page, "touchEnd")
    assert page.evaluate(SEEN) == pytest.approx(near.tolist(), abs=1e-6)
    assert not page.evaluate("hand.pose().closed")
    assert set(page.evaluate("samples.map(sample => sample.device)")) == {"touch"}


def test_a_gamepads_sticks_triggers_and_button_lead_the_hand(page: Page):
    def hold(axes: tuple[float, ...] = (0.0,) * 4, **buttons: float) -> None:
        values = [buttons.get(f"b{i}", 0.0) for i in range(17)]
        pad = {"axes": list(axes), "buttons": [{"value": v, "pressed": v > 0.5} for v in values]}
        page.evaluate("pad => { window.pad = pad; }", pad)
        after(page, 100)

    page.evaluate("hand.choose('gamepad')")
    after(page, 100)
    assert page.evaluate("samples") == []  # without a gamepad there is no sample, and the hand stays
    hold((0.1, -0.1, 0.1, 0.1))  # sticks that are not quite in their middle
    np.testing.assert_array_equal(place(page), np.zeros(3))
    hold((0.5, 0.0, 0.0, 0.0))
    hold((0.0, -0.25, 0.0, 0.0))
    hold(b7=0.75)
    np.testing.assert_allclose(place(page), SPEED * 0.1 * np.array([0.5, 0.25, 0.75]), atol=1e-9)
    hold(b6=0.75)
    np.testing.assert_allclose(place(page), SPEED * 0.1 * np.array([0.5, 0.25, 0.0]), atol=1e-9)
    hold((0.0, 0.0, 0.5, 0.0))
    np.testing.assert_allclose(turned(page), [0.0, -np.sin(TURN * 0.05), 0.0], atol=1e-9)  # to the right, from above
    hold(b0=1.0)
    hold(b0=1.0)
    assert page.evaluate("hand.pose().closed")  # once, however long it is held
    hold()
    hold(b0=1.0)
    assert not page.evaluate("hand.pose().closed")
    assert set(page.evaluate("samples.map(sample => sample.device)")) == {"gamepad"}


def test_words_say_how_far_and_in_which_direction_of_the_view_the_hand_is_off(page: Page):
    shown: dict[str, Any] = {"p_WH": [0, 0.054, -0.02], "goal": [0.005, 0, 0], "within_reach": False, "holds": False}
    page.evaluate(
        """shown => {
        const scene = {camera, toPixels: p => [100 * p[1], 100 * p[2]], acrossView: (right, up) => [0, -right, up]};
        createHandHints({scene, element}, -1).show(shown);
        }""",
        {**shown, "advice": "Go."},
    )
    page.wait_for_function("document.querySelector('.hand-words').textContent")
    assert page.locator(".hand-words").inner_text() == "Go. 54 mm too far left, 20 mm too low"


def test_the_view_from_the_side_grows_to_hold_a_hand_that_leaves_it(page: Page):
    page.add_script_tag(content=asset("scene/side_view.js"))
    held = page.evaluate(
        """() => {
            const where = {hand: [[0, 0, 0]], object: [[0.5, 0.1, 0.1]]}, held = [];
            const first = {points: label => where[label], spherical: () => ({azimuth: 0}), onBeforeRender() {}};
            window.createScene = (_, content) => (held.push(content.held), {
                hold(corners) { held.push(corners); }, lookFrom() {}, show() {}, dispose() {},
            });
            const content = {traces: [{label: "hand"}, {label: "object"}]};
            const side = createSideView(document.getElementById("e"), first, content, ["hand", "object"]);
            for (const x of [0.1, -2]) {
                where.hand = [[x, 0, 0]];
                window.now += 1200;
                side.show();
            }
            return held;
        }"""
    )
    assert len(held) == 2, "it stays as it is while all is in it"
    before, after = (np.array(corners) for corners in held)
    assert before.min(axis=0)[0] < 0.0
    assert before.max(axis=0)[0] > 0.5
    assert after.min(axis=0)[0] < -2.0
    assert np.all(after.max(axis=0) >= before.max(axis=0))
