"""The hand that a page leads: keys that press no button, and words that say how far off it is."""

from playwright.sync_api import Browser, Page

from handover.scenarios.reporting.page import asset


def page_with(browser: Browser, *scripts: str) -> Page:
    page = browser.new_page(viewport={"width": 400, "height": 300})
    page.set_content(
        "<button id='b' onclick='window.pressed = 1'>pause</button><div><div id='e' style='height:200px'></div></div>"
    )
    for script in ("scene/three.min.js", *scripts):
        page.add_script_tag(content=asset(script))
    page.evaluate(
        """() => {
        window.element = document.getElementById("e");
        window.camera = new THREE.PerspectiveCamera(36, 2, 0.01, 10);
        camera.up.set(0, 0, 1);
        camera.position.set(-1, 0, 0);
        camera.lookAt(0, 0, 0);
        }"""
    )
    return page


def test_the_space_bar_is_the_hands_wherever_the_focus_is(browser: Browser):
    page = page_with(browser, "hand/hand_input.js")
    page.evaluate(
        """() => {
        const start = {p_WH: [0, 0, 0], q_WH: [1, 0, 0, 0], closed: false, centre: [0, 0, 0], radius: 1};
        window.hand = handInput({element, camera, start, onSample() {}});
        hand.choose("pointer");
        }"""
    )
    page.locator("#b").focus()
    page.keyboard.press("Space")
    assert page.evaluate("[hand.pose().closed, window.pressed ?? 0]") == [True, 0]
    page.evaluate("hand.end()")
    page.keyboard.press("Space")
    assert page.evaluate("[hand.pose().closed, window.pressed ?? 0]") == [True, 1]
    page.close()


def test_words_say_how_far_and_in_which_direction_of_the_view_the_hand_is_off(browser: Browser):
    page = page_with(browser, "live/hand_hints.js")
    page.evaluate(
        """() => {
        const scene = {camera, toPixels: p => [100 * p[1], 100 * p[2]], acrossView: (right, up) => [0, -right, up]};
        const hints = createHandHints({scene, element}, -1);
        hints.show({p_WH: [0, 0.054, -0.02], goal: [0.005, 0, 0], within_reach: false, holds: false, advice: "Go."});
        }"""
    )  # seen along x from behind, y points to the left
    page.wait_for_function("document.querySelector('.hand-words').textContent")
    assert page.locator(".hand-words").inner_text() == "Go. 54 mm too far left, 20 mm too low"
    page.close()
