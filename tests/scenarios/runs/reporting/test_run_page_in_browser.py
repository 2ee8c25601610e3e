"""The replay of a run's page in a browser: the slider moves what was recorded, play goes on, a video is saved."""

from collections.abc import Generator
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page
from scipy.spatial.transform import Rotation
from support.opened_page import opened, overflow, wait_until

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.robots.ir_grasp.parameters import Parameters
from handover.scenarios.robots.ir_grasp.plots import phases_of_grasp
from handover.scenarios.runs.reporting.replay_section import frame_rows, phase_changes

SCENE = "document.querySelector('.replay-scene')"
EXACT = 1e-5
"""How far from the record what is drawn may lie, m: the scene is 0.4 m long."""
RINGS, SIDES = 3, 16
"""Rings that round off an end of a tube, and corners of a ring."""


@pytest.fixture(scope="module")
def page(browser: Browser, grasp: Path) -> Generator[Page, None, None]:
    with opened(browser, grasp / "report.html") as page:
        wait_until(page, f"{SCENE}.dataset.frame === '0'")
        page.get_by_label("speed").select_option("0.5")
        yield page


@pytest.fixture(scope="module")
def record(grasp: Path) -> Record:
    return Record(grasp / "signals.parquet")


TEXT_COLOURS = "[...document.querySelectorAll('.plot .xtitle')].map(t => getComputedStyle(t).fill)"


LOOKS = """(() => {
    const style = getComputedStyle(document.documentElement), names = [0, 1, 2, 3].map(k => `--c${k}`);
    const named = new Map(names.map(name => [style.getPropertyValue(name).trim(), `var(${name})`]));
    return document.querySelector('.explorer .plot').data.map(t => [named.get(t.line.color), t.line.dash]);
})()"""


def move(page: Page, frame: int) -> None:
    page.locator(".replay-time").fill(str(frame))
    wait_until(page, f"{SCENE}.dataset.frame === '{frame}'")


def points(page: Page, name: str) -> Floats:
    """Return where what is called so is drawn in W, shape (n, 3), m."""
    return np.array(page.evaluate("name => replays[0].scene.points(name)", name), dtype=np.float64)


def test_the_slider_moves_the_hand_and_bends_a_finger_as_it_was(page: Page, record: Record):
    rows, replay, phases = frame_rows(record.time), IrGrasp().replay(Parameters(), record), phases_of_grasp(record)
    palm = next(b for b in replay.bodies if b.label == "palm")
    thumb = next(line for line in replay.lines if line.label == "thumb")
    assert palm.q_WB is not None
    assert thumb.radii is not None
    before = points(page, "palm")
    for frame in (len(rows) // 2, len(rows) - 1):
        move(page, frame)
        row = rows[frame]
        turned = Rotation.from_quat(palm.q_WB[row], scalar_first=True).apply(palm.mesh.vertices)
        np.testing.assert_allclose(points(page, "palm"), palm.p_WB[row] + turned, atol=EXACT)
        rings = points(page, "thumb").reshape(-1, SIDES, 3)[RINGS:-RINGS]
        np.testing.assert_allclose(rings.mean(axis=1), thumb.points[row], atol=EXACT)
        reach = np.linalg.norm(rings - rings.mean(axis=1, keepdims=True), axis=2)
        np.testing.assert_allclose(reach, np.broadcast_to(thumb.radii[:, None], reach.shape), atol=EXACT)
        phase = [name for begin, name in phase_changes(record, phases) if begin <= record.time[row]][-1]
        assert page.locator(".replay-told").inner_text() == f"{record.time[row]:.1f} s, {phase}"
    assert np.abs(points(page, "palm") - before).max() > 0.02


def test_play_goes_on_until_it_is_paused_and_leaves_the_view_as_it_is(page: Page):
    move(page, 0)
    page.get_by_role("button", name="side").click()
    before = view(page)
    page.get_by_label("play", exact=True).click()
    wait_until(page, f"{SCENE}.dataset.frame > 2")
    page.get_by_label("pause").click()
    page.get_by_label("play", exact=True).wait_for()
    assert float(page.locator(".replay-time").input_value()) > 0
    assert view(page) == before


def view(page: Page) -> dict[str, float]:
    """Return from where the scene is seen: azimuth and elevation (rad), and distance (m)."""
    return page.evaluate("replays[0].scene.spherical()")


@pytest.mark.parametrize(
    ("name", "azimuth", "elevation"),
    [
        ("start", np.arctan2(-0.7, -0.35), None),
        ("side", np.pi, np.arctan(0.12)),
        ("top", -np.pi / 2.0, np.pi / 2.0),
    ],
)
def test_a_view_looks_from_where_it_is_named_after_and_just_holds_what_is_drawn_at_any_time(
    page: Page, record: Record, name: str, azimuth: float, elevation: float | None
):
    shown = IrGrasp().replay(Parameters(), record)
    labels = {drawn.label for drawn in (*shown.bodies, *shown.lines)}
    page.get_by_role("button", name=name).click()
    seen_from = view(page)
    assert np.angle(np.exp(1j * (seen_from["azimuth"] - azimuth))) == pytest.approx(0.0, abs=1e-6)
    assert elevation is None or seen_from["elevation"] == pytest.approx(elevation, abs=2e-3)
    seen: list[list[float]] = []
    for frame in range(0, len(frame_rows(record.time)), 20):
        move(page, frame)
        for label in labels:
            script = "name => replays[0].scene.points(name).map(p => replays[0].scene.toPixels(p))"
            seen += page.evaluate(script, label)
    size = page.evaluate(f"[{SCENE}.clientWidth, {SCENE}.clientHeight]")
    low, high = np.min(seen, axis=0) / size, np.max(seen, axis=0) / size
    assert low.min() >= 0.0
    assert high.max() <= 1.0
    assert (high - low).max() > 0.85


def test_the_view_follows_the_palm_and_keeps_its_distance(page: Page):
    move(page, 0)
    button = page.get_by_role("button", name="follow palm")
    button.click()
    before = view(page), points(page, "palm").mean(axis=0)
    move(page, 120)
    assert np.linalg.norm(points(page, "palm").mean(axis=0) - before[1]) > 0.02
    assert view(page) == pytest.approx(before[0])
    looked_at = page.evaluate("replays[0].scene.viewpoint().target")
    np.testing.assert_allclose(looked_at, points(page, "palm").mean(axis=0), atol=EXACT)
    button.click()
    assert button.get_attribute("aria-pressed") == "false"


def test_plots_and_replay_share_a_cursor(page: Page, record: Record):
    rows = frame_rows(record.time)
    plot = page.locator("#time .plot").first
    line = plot.locator(".cursor")
    for frame in (20, 100):
        move(page, frame)
        drawn = plot.evaluate("div => ({x: div._fullLayout.xaxis.l2p(0), at: div._fullLayout.xaxis._offset})")
        per_second = plot.evaluate("div => div._fullLayout.xaxis.l2p(1) - div._fullLayout.xaxis.l2p(0)")
        left = float(line.evaluate("line => parseFloat(line.style.left)"))
        assert left == pytest.approx(drawn["at"] + drawn["x"] + per_second * record.time[rows[frame]], abs=0.05)
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"], steps=3)
    plot.locator(".hoverlayer .legend, .hoverlayer .hovertext").first.wait_for()
    page.mouse.click(box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"])
    wait_until(page, f"{SCENE}.dataset.frame !== '100'")
    shown = np.interp(float(page.evaluate(f"{SCENE}.dataset.frame")), np.arange(len(rows)), record.time[rows])
    at = (float(line.evaluate("line => parseFloat(line.style.left)")) - drawn["at"] - drawn["x"]) / per_second
    assert at == pytest.approx(shown, abs=1e-3)


@pytest.mark.parametrize("playing", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_scene_is_turned_by_all_of_the_mouses_way_and_stays_turned_while_it_plays(page: Page, playing: bool):
    page.get_by_role("button", name="start").click()
    page.locator(".replay-scene").scroll_into_view_if_needed()
    if playing:
        move(page, 0)
        page.get_by_label("play", exact=True).click()
    before = view(page)["azimuth"]
    box = page.locator(".replay-scene").bounding_box()
    assert box is not None
    x, y, way = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, 80
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + way, y, steps=8)
    page.mouse.up()
    if playing:
        wait_until(page, f"{SCENE}.dataset.frame > 0")
        if page.get_by_label("pause").count():  # else it has come to its end
            page.get_by_label("pause").click()
    turned = 2.0 * np.pi * way / box["height"]
    assert np.angle(np.exp(1j * (before - view(page)["azimuth"]))) == pytest.approx(turned, rel=0.05)


def test_a_name_in_the_legend_hides_what_is_called_so(page: Page):
    name = page.get_by_role("button", name="beams")
    for visible in ("false", "true"):
        name.click()
        wait_until(page, f"replays[0].scene.visible('beams').every(visible => visible === {visible})")
        assert name.get_attribute("aria-pressed") == visible


def test_the_bar_is_as_long_as_it_says(page: Page):
    pictures = page.evaluate(f"Number({SCENE}.dataset.pictures)")
    page.get_by_role("button", name="top").click()
    wait_until(page, f"{SCENE}.dataset.pictures > {pictures}")
    text = page.locator(".scene-scale text:not([class])").text_content()
    assert text == "5 cm"
    bar = page.locator(".scene-scale path").get_attribute("d")
    assert bar is not None
    pixels = float(bar.split("h")[1].split("v")[0])
    height = page.evaluate(f"{SCENE}.clientHeight")
    per_metre = height / (2.0 * np.tan(np.radians(18.0)) * view(page)["distance"])
    assert pixels / per_metre == pytest.approx(0.05, rel=0.01)


def test_a_body_turns_as_its_quaternion_says_and_vanishes_without_a_place(page: Page):
    rng = np.random.default_rng(0)
    vertices, p_WB, q_WB = rng.normal(size=(5, 3)), rng.normal(size=(3, 3)), rng.normal(size=(3, 4))
    q_WB /= np.linalg.norm(q_WB, axis=1, keepdims=True)
    q_WB[1] *= np.sign(q_WB[0] @ q_WB[1])
    p_WB[2] = np.nan
    part = {"vertices": vertices.ravel().tolist(), "triangles": [0, 1, 2], "q": q_WB.ravel().tolist()}
    numbers = ", ".join("NaN" if np.isnan(x) else repr(x) for x in p_WB.ravel().tolist())
    page.evaluate(
        f"""part => {{
            const element = document.createElement("div");
            document.body.append(element);
            const trace = {{label: "b", colour: "#123456", opacity: 1, parts: [{{...part, p: [{numbers}]}}]}};
            const box = {{low: [-1, -1, -1], high: [1, 1, 1], eye: [1, 1, 1]}};
            window.tumbling = createScene(element, {{traces: [trace], ...box}});
        }}""",
        part,
    )

    def seen(u: float) -> Floats:
        return np.array(page.evaluate(f"(tumbling.show({u}), tumbling.points('b'))"))

    turned = Rotation.from_quat(q_WB[1], scalar_first=True).apply(vertices)
    np.testing.assert_allclose(seen(1), p_WB[1] + turned, atol=1e-6)
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    np.testing.assert_allclose(np.linalg.norm(np.diff(seen(0.4), axis=0), axis=1), lengths, atol=1e-6)
    assert np.ptp(seen(2), axis=0) == pytest.approx(0.0, abs=1e-12)


def frames(file: Path) -> list[NDArray[np.uint8]]:
    video = cv2.VideoCapture(str(file))
    found: list[NDArray[np.uint8]] = []
    while True:
        there, frame = video.read()
        if not there:
            return found
        found.append(np.asarray(frame, np.uint8))


@pytest.mark.slow
def test_a_video_is_saved_from_beginning_to_end_or_until_it_is_ended_and_another_can_begin(
    page: Page, record: Record, tmp_path: Path
):
    page.locator(".replay-time").fill("100")
    for early in (True, False):
        page.locator(".replay-speed").select_option("0.5" if early else "5")
        with page.expect_download() as saved:
            page.get_by_role("button", name="record a video").click()
            if early:
                wait_until(page, "replays[0].element.dataset.frame > 10")
                page.get_by_role("button", name="stop and save").click()
        assert saved.value.suggested_filename.split(".") in (["ir_grasp", "mp4"], ["ir_grasp", "webm"])
        saved.value.save_as(tmp_path / "video")
        shown = frames(tmp_path / "video")
        wide, high = page.evaluate("[replays[0].scene.canvas.width & ~1, replays[0].scene.canvas.height & ~1]")
        assert {p.shape for p in shown} == {(high, wide, 3)}
        assert (float(page.evaluate("replays[0].element.dataset.frame")) < 200) is early
        page.get_by_role("button", name="record a video").wait_for()
    assert page.locator(".replay-told").inner_text().startswith(f"{float(record.time[-1]):.1f} s")
    assert np.abs(shown[-1].astype(float) - shown[0]).max() > 100.0
    assert shown[0].mean() > 180.0  # it has the page's background


def test_the_page_is_drawn_follows_its_reader_and_asks_for_nothing(page: Page):
    assert page.inner_text("h1") == "ir_grasp: succeeded"
    assert page.locator(".plot").count() == page.locator(".plot:has(.main-svg)").count() > 0
    assert page.locator(".modebar-btn").count() > 0
    assert page.locator(".modebar-btn[data-title*=hare], .modebar-btn[data-title*=loud]").count() == 0
    page.fill(".explorer input", "range")
    page.select_option(".explorer select", ["scene.range"])
    wait_until(page, "document.querySelector('.explorer .plot').data[0].name === 'scene.range[1]'")
    names = page.evaluate("document.querySelector('.explorer .plot').data.map(trace => trace.name)")
    assert names == [f"scene.range[{i}]" for i in (1, 2, 3)]
    assert page.inner_text(".explorer .about").startswith("scene.range ")
    assert page.evaluate(LOOKS) == [["var(--c0)", "solid"], ["var(--c1)", "dash"], ["var(--c2)", "dot"]]
    page.fill(".explorer input", "scene.q")
    page.select_option(".explorer select", ["scene.q"])
    wait_until(page, "document.querySelector('.explorer .plot').data[0].name === 'scene.q[1]'")
    strokes, colours = ["solid", "dash", "dot"], [f"var(--c{k})" for k in range(3)]
    looks = page.evaluate(LOOKS)
    assert looks[:9] == [[colour, stroke] for colour in colours for stroke in strokes][: len(looks)]
    light = page.evaluate(TEXT_COLOURS)
    page.emulate_media(color_scheme="dark")
    wait_until(page, f"({TEXT_COLOURS}).every((c, k) => c !== {light}[k])")
    assert overflow(page) <= 0
    page.set_viewport_size({"width": 400, "height": 800})
    wait_until(page, "[...document.querySelectorAll('.plot svg.main-svg')].every(s => s.clientWidth < 400)")
    assert overflow(page) <= 0


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


def test_on_a_phone_in_the_dark_a_finger_scrolls_the_page_until_it_wakes_the_scene(browser: Browser, grasp: Path):
    context = browser.new_context(
        viewport={"width": 400, "height": 800}, has_touch=True, is_mobile=True, color_scheme="dark"
    )
    page = context.new_page()
    page.add_init_script("delete window.MediaRecorder")
    page.goto((grasp / "report.html").as_uri())
    wait_until(page, f"{SCENE}.dataset.frame === '0'")
    assert overflow(page) <= 0
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(18, 23, 30)"
    assert not page.locator(".replay-film").is_visible(), "there is no recorder"
    wake = page.get_by_role("button", name="Tap to turn")
    assert wake.evaluate("button => getComputedStyle(button).touchAction") == "pan-y"
    wake.tap()
    assert not wake.is_visible()
    page.locator("h1").tap()
    assert wake.is_visible()
    context.close()
