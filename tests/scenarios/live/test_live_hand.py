"""The hand of somebody who watches is led by a mouse or a gamepad in a real browser, or by a tracker."""

import json
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page
from support.live_pages import LIVE, frames_come, live_run, shown
from support.opened_page import wait_until
from support.wording import Wording

import handover
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.runs.execution.selection import find_scenario

SCENARIO = "flyer_robot_to_human"
PIXEL = """p => {
    const camera = live.scene.camera, box = document.querySelector(".replay-scene").getBoundingClientRect();
    camera.updateMatrixWorld();
    const {x, y} = new THREE.Vector3(...p).project(camera);
    return [box.left + (x + 1) / 2 * box.width, box.top + (1 - y) / 2 * box.height];
}"""
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
PAD = """
    window.pad = null;
    Object.defineProperty(navigator, "getGamepads", {value: () => [null, window.pad]});
"""
SIDE_PICTURES = "document.querySelector('.replay-inset').dataset.pictures > 2"


def wanted(page: Page) -> list[float]:
    return page.evaluate("live.hand.pose().p_WH")


def test_the_page_shows_the_hand_that_a_mouse_or_gamepad_leads_and_its_record_is_played_back(
    browser: Browser, tmp_path: Path
):
    out = tmp_path / "led"
    with (
        live_run(out, "-p", "hand=outside", "--pace", "0.2", scenario=SCENARIO) as (address, run),
        shown(browser, address, 1280, 800, script=PAD) as page,
    ):
        wait_until(page, "live.hand")
        assert "close your hand on the object" in page.locator("#task").inner_text()
        assert page.evaluate(SEEN_SHARE, "hand") > 0.9, "it is seen from behind at first"
        assert abs(page.evaluate("live.scene.spherical().azimuth")) > 0.9 * np.pi  # the robot comes from +x
        side = page.locator(".replay-inset")
        wait_until(page, SIDE_PICTURES)
        page.get_by_label("view from the side").uncheck()
        assert side.count() == 0
        page.get_by_label("view from the side").check()
        wait_until(page, SIDE_PICTURES)
        page.set_viewport_size({"width": 640, "height": 480})
        page.locator("[data-view=top]").click()
        page.locator(".replay-scene").scroll_into_view_if_needed()
        x, y = page.evaluate(f"({PIXEL})(live.hand.pose().p_WH)")
        page.mouse.move(x + 20, y - 10, steps=4)
        wait_until(
            page, f"Math.hypot(...({PIXEL})(live.hand.pose().p_WH).map((c, i) => c - {[x + 20, y - 10]}[i])) < 1"
        )
        depth = wanted(page)[2]
        page.mouse.wheel(0, -200)
        wait_until(page, f"Math.abs(live.hand.pose().p_WH[2] - {depth - 0.03}) < 1e-3")
        page.mouse.down()
        page.mouse.up()
        wait_until(page, "live.hand.pose().closed")
        frames_come(page, 5)
        page.locator("#hand-grasp").click()
        wait_until(page, "!live.hand.pose().closed")
        page.locator("#hand-device").select_option("gamepad")
        before = wanted(page)
        page.evaluate("window.pad = {axes: [0.5, 0, 0, 0], buttons: []}; 0")
        wait_until(page, f"Math.hypot(...live.hand.pose().p_WH.map((c, i) => c - {before}[i])) > 0.02")
        page.evaluate("window.pad = {axes: [0, 0, 0, 0], buttons: []}; 0")
        frames_come(page, 5)
        pose = page.evaluate("live.hand.pose()")
        page.locator("#stop").click()
        wait_until(page, f"{LIVE}.dataset.ended")
        assert page.locator("#task").is_hidden()
        run.wait()
    led = Record(out / "signals.parquet")
    assert led["person.p_WH_track"][-1] == pytest.approx(pose["p_WH"], abs=1e-9)
    assert set(led["person.closed_track"].tolist()) == {False, True}
    assert led["person.age"].min() < 60.0
    report = json.loads((out / "inputs.json").read_text(encoding="utf-8"))
    assert report["samples"].keys() == {"mouse", "gamepad"}
    assert report["age_at_use"]["uses"] > 10
    assert json.loads((out / "run.json").read_text(encoding="utf-8"))["inputs"] == {"from": "page"}
    stop = float(led.time[-1])
    handover.run(SCENARIO, hand="outside", inputs_from=out, stop=stop, out=tmp_path / "again", progress=False)
    again = Record(tmp_path / "again" / "signals.parquet")
    assert all(np.array_equal(again[name][: len(led.time)], led[name]) for name in led.signals)


def test_who_leads_a_hand_is_advised_and_one_that_the_person_leads_nobody_leads(wording: Wording):
    outside, to_robot = ("hand=outside",), "task=human_to_robot"
    for scenario, given in (
        (SCENARIO, outside),
        ("flyer_human_to_robot", outside),
        ("flyer_failed_reception", outside),
        ("flyer_collaborative", outside),
        ("flyer_handover", (*outside, to_robot)),
        ("handover.scenarios.robots.free_flyer.handover.hand_practice:HandPractice", ()),
    ):
        kind = find_scenario(scenario)
        led = kind().led_hand(parse_parameters(kind, given))
        assert led is not None
        wording.check(led.task)
    kind = find_scenario(SCENARIO)
    assert kind().led_hand(parse_parameters(kind, ())) is None
