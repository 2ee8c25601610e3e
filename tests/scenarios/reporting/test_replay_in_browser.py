"""The replay of a run in a browser: the slider moves what was recorded, play goes on, the legend hides."""

from collections.abc import Generator
from pathlib import Path

import numpy as np
import pytest
from opened_page import opened, wait_until
from playwright.sync_api import Browser, Page
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.ir_grasp.parameters import Parameters
from handover.scenarios.ir_grasp.plots import phases_of_grasp
from handover.scenarios.reporting.replay_section import frame_rows, phase_changes

SCENE = "document.querySelector('.replay-scene')"
POINTS = """name => {
    const trace = document.querySelector('.replay-scene').data.find(trace => trace.name === name);
    return ['x', 'y', 'z'].map(axis => Array.from(trace[axis]));
}"""


@pytest.fixture(scope="module")
def page(browser: Browser, grasp: Path) -> Generator[Page, None, None]:
    with opened(browser, grasp / "report.html") as page:
        wait_until(page, f"{SCENE}.dataset.frame === '0'")
        yield page


@pytest.fixture(scope="module")
def record(grasp: Path) -> Record:
    return Record(grasp / "signals.parquet")


def move(page: Page, frame: int) -> None:
    page.locator(".replay-time").fill(str(frame))
    wait_until(page, f"{SCENE}.dataset.frame === '{frame}'")


def points(page: Page, name: str) -> Floats:
    return np.transpose(np.array(page.evaluate(POINTS, name), dtype=np.float64))


def test_the_slider_moves_the_hand_to_where_it_was(page: Page, record: Record):
    rows = frame_rows(record.time)
    palm = next(b for b in IrGrasp().replay(Parameters(), record).bodies if b.label == "palm")
    assert palm.q_WB is not None
    before = points(page, "palm")
    for frame in (len(rows) // 2, len(rows) - 1):
        move(page, frame)
        row = rows[frame]
        turned = Rotation.from_quat(palm.q_WB[row], scalar_first=True).apply(palm.mesh.vertices)
        np.testing.assert_allclose(points(page, "palm"), palm.p_WB[row] + turned, atol=1e-6)
        value = page.locator(".replay-told").inner_text()
        phase = [name for begin, name in phase_changes(record, phases_of_grasp(record)) if begin <= record.time[row]][
            -1
        ]
        assert value == f"{record.time[row]:.1f} s, {phase}"
    assert np.abs(points(page, "palm") - before).max() > 0.02


def test_the_slider_bends_a_finger_as_it_was(page: Page, record: Record):
    rows = frame_rows(record.time)
    thumb = next(line for line in IrGrasp().replay(Parameters(), record).lines if line.label == "thumb")
    move(page, len(rows) - 2)
    rings = points(page, "thumb").reshape(-1, 12, 3)[2:-2]  # without those that round off its ends
    np.testing.assert_allclose(rings.mean(axis=1), thumb.points[rows[-2]], atol=1e-6)
    assert thumb.radii is not None
    reach = np.linalg.norm(rings - rings.mean(axis=1, keepdims=True), axis=2)
    np.testing.assert_allclose(reach, np.broadcast_to(thumb.radii[:, None], reach.shape), atol=1e-6)


def test_keys_move_the_slider(page: Page):
    move(page, 10)
    page.locator(".replay-time").press("ArrowRight")
    wait_until(page, f"{SCENE}.dataset.frame === '11'")


def test_play_goes_on_until_it_is_paused_and_leaves_the_view_as_it_is(page: Page):
    move(page, 0)
    page.evaluate(f"Plotly.relayout({SCENE}, {{'scene.camera.eye': {{x: 0.5, y: 0.6, z: 1.7}}}})")
    page.get_by_label("play", exact=True).click()
    wait_until(page, f"{SCENE}.dataset.frame > 2")
    page.get_by_label("pause").click()
    assert page.get_by_label("play", exact=True).is_visible()
    assert float(page.locator(".replay-time").input_value()) > 0
    assert page.evaluate(f"{SCENE}._fullLayout.scene.camera.eye") == {"x": 0.5, "y": 0.6, "z": 1.7}
    page.get_by_role("button", name="reset view").click()
    wait_until(page, f"{SCENE}._fullLayout.scene.camera.eye.x !== 0.5")


def azimuth(page: Page) -> float:
    """Return from which side the scene is seen, an angle about the vertical (rad)."""
    camera = page.evaluate(f"{SCENE}._fullLayout.scene.camera")
    return np.arctan2(*(camera["eye"][axis] - camera["center"][axis] for axis in "yx"))


def turn(page: Page, width: int) -> float:
    """Draw the mouse to the right over the scene and return the angle that it stands for (rad).

    Plotly turns further by what its camera coasts between two pictures.
    """
    page.locator(".replay-scene").scroll_into_view_if_needed()
    box = page.locator(".replay-scene").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + width, y, steps=8)
    page.mouse.up()
    return np.pi * width / box["height"]


def test_a_scene_is_turned_by_all_of_the_mouses_way_right_after_a_picture(page: Page):
    page.get_by_role("button", name="reset view").click()
    move(page, 5)
    before = azimuth(page)
    turned = turn(page, 80)
    wait_until(page, f"{SCENE}.dataset.frame === '5'")
    assert abs(np.angle(np.exp(1j * (azimuth(page) - before)))) > 0.8 * turned


@pytest.mark.slow
def test_a_scene_that_is_turned_while_it_plays_stays_turned(page: Page):
    page.get_by_role("button", name="reset view").click()
    move(page, 0)
    page.get_by_label("speed").select_option("0.5")
    page.get_by_label("play", exact=True).click()
    before = azimuth(page)
    turned = turn(page, 80)
    seen = page.evaluate(f"{SCENE}.dataset.frame")
    wait_until(page, f"{SCENE}.dataset.frame !== '{seen}'")
    page.get_by_label("pause").click()
    assert abs(np.angle(np.exp(1j * (azimuth(page) - before)))) > 0.8 * turned
    page.get_by_role("button", name="reset view").click()


@pytest.mark.slow
def test_a_name_in_the_legend_hides_what_is_called_so(page: Page):
    shown = f"{SCENE}.data.filter(trace => trace.name === 'beams').map(trace => trace.visible ?? true)"
    name = page.get_by_role("button", name="beams")
    name.click()
    wait_until(page, f"({shown}).every(visible => visible === false)")
    assert name.get_attribute("aria-pressed") == "false"
    name.click()
    wait_until(page, f"({shown}).every(visible => visible === true)")


def test_axes_follow_the_page_into_the_dark_and_stay_as_they_are_in_space(page: Page):
    axis = f"{SCENE}._fullLayout.scene.xaxis"
    light, extent = page.evaluate(f"{axis}.gridcolor"), page.evaluate(f"{axis}.range")
    page.emulate_media(color_scheme="dark")
    wait_until(page, f"{axis}.gridcolor !== '{light}'")
    assert page.evaluate(f"{axis}.range") == extent
    page.emulate_media(color_scheme="light")
    wait_until(page, f"{axis}.gridcolor === '{light}'")


def test_a_body_turns_as_its_quaternion_says_and_vanishes_without_a_place(page: Page):
    rng = np.random.default_rng(0)
    vertices, p_WB, q_WB = rng.normal(size=(5, 3)), rng.normal(size=(3, 3)), rng.normal(size=(3, 4))
    q_WB /= np.linalg.norm(q_WB, axis=1, keepdims=True)
    p_WB[2] = np.nan
    part = {"vertices": vertices.ravel().tolist(), "q": q_WB.ravel().tolist()}
    numbers = ", ".join("NaN" if np.isnan(x) else repr(x) for x in p_WB.ravel().tolist())

    def seen(u: float) -> Floats:
        script = f"part => replayShapes.places({{parts: [{{...part, p: [{numbers}]}}]}}, {u}, [7, 8, 9])"
        found = page.evaluate(script, part)
        return np.column_stack([found[axis] for axis in "xyz"])

    turned = Rotation.from_quat(q_WB[1], scalar_first=True).apply(vertices)
    np.testing.assert_allclose(seen(1), p_WB[1] + turned, atol=1e-12)
    np.testing.assert_allclose(seen(2), np.broadcast_to([7.0, 8.0, 9.0], (5, 3)))
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    np.testing.assert_allclose(np.linalg.norm(np.diff(seen(0.4), axis=0), axis=1), lengths)


@pytest.mark.slow
def test_without_webgl_a_sentence_says_so(browser: Browser, grasp: Path):
    page = browser.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.add_init_script(
        """const get = HTMLCanvasElement.prototype.getContext;
        HTMLCanvasElement.prototype.getContext = function(kind, ...given) {
            return kind.includes("webgl") ? null : get.call(this, kind, ...given);
        };"""
    )
    page.goto((grasp / "report.html").as_uri())
    page.get_by_text("needs WebGL").wait_for()
    assert not page.locator(".replay-time").is_visible()
    assert errors == []
    page.close()


@pytest.mark.slow
def test_a_finger_scrolls_the_page_until_it_wakes_the_scene(browser: Browser, grasp: Path):
    context = browser.new_context(viewport={"width": 400, "height": 800}, has_touch=True, is_mobile=True)
    page = context.new_page()
    page.goto((grasp / "report.html").as_uri())
    wait_until(page, f"{SCENE}.dataset.frame === '0'")
    wake = page.get_by_role("button", name="Tap to turn")
    assert wake.evaluate("button => getComputedStyle(button).touchAction") == "pan-y"
    wake.tap()
    assert not wake.is_visible()
    page.locator("h1").tap()
    assert wake.is_visible()
    context.close()
