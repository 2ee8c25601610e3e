"""A run in a browser while it goes on: it is followed, paused, stepped, ended; its record is what it would be alone."""

import asyncio
import base64
import json
import re
import signal
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from playwright.sync_api import Browser, Page
from scipy.spatial.transform import Rotation
from support.kept_runs import kept_run
from support.live_pages import (
    LIVE,
    TOLD,
    connected,
    frame,
    frames_come,
    live_run,
    process_with,
    reported,
    shown,
)
from support.opened_page import wait_until
from support.processes import until
from support.wording import Wording

from handover.cosim.master.live_control import LiveControl
from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.shown_run import ShownRun
from handover.scenarios.live.watched_run import WatchedRun
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.robots.ir_grasp.parameters import Parameters
from handover.scenarios.runs.results.pictures import read_picture_files

TITLES = "[...document.querySelectorAll('#plots h3')].map(heading => heading.textContent)"
REACHED = "document.getElementById('reached').value"
SERVER = "handover.scenarios.live"


def test_a_run_waits_for_its_page_and_goes_on_without_it_if_the_pages_server_ends(tmp_path: Path):
    with live_run(tmp_path / "live", "--pace", "100", "--stop", "1", scenario=cached("Push", 3)) as (_, run):
        process_with(run, SERVER).kill()
        ended = run.wait()
    assert ended.status == 0
    assert "the run goes on without it" in ended.errors
    assert Record(tmp_path / "live" / "signals.parquet").time[-1] >= 1.0


def is_still(page: Page) -> str:
    """Return the time that the page shows, once it has shown no other one for a second."""
    return page.evaluate(
        f"""new Promise(done => {{
            let last = "", since = 0;
            const look = () => {{
                if ({TOLD} !== last) [last, since] = [{TOLD}, performance.now()];
                if (performance.now() > since + 1000) done(last);
                else requestAnimationFrame(look);
            }};
            look();
        }})"""
    )


def test_a_run_is_followed_plotted_filmed_paused_and_stepped_and_its_record_is_that_of_a_run_alone(
    browser: Browser, tmp_path: Path
):
    with live_run(tmp_path / "live", "--pace", "0.1") as (address, run), shown(browser, address) as page:
        frames_come(page)
        page.locator("#signal").fill("nonsense")
        page.locator("#signal").dispatch_event("change")
        assert page.locator("#told").inner_text().startswith("There is no signal nonsense;")
        wait_until(page, f"{TITLES}.length")
        own = page.evaluate(TITLES)
        for name in ("scene.p_WO", "reflex.cost"):
            page.locator("#signal").fill(name)
            page.locator("#signal").dispatch_event("change")
        wait_until(page, f"{TITLES}.includes('reflex.cost')")
        assert page.evaluate(TITLES) == ["reflex.cost", "scene.p_WO", *own], "the last chosen one is seen at once"

        page.get_by_role("button", name="record a video").click()
        frames_come(page, 10)
        with page.expect_download() as saved:
            page.get_by_role("button", name="stop and save").click()
        saved.value.save_as(tmp_path / "video")
        assert saved.value.suggested_filename.startswith("ir_grasp.")
        video = cv2.VideoCapture(str(tmp_path / "video"))
        assert sum(video.read()[0] for _ in range(10)) > 5

        assert page.evaluate(REACHED) == ""
        page.evaluate("""() => {
            const now = performance.now.bind(performance);
            performance.now = () => 2 * now();
        }""")
        wait_until(page, f"/^reached 0\\.0[345]\\d*\u00d7$/.test({REACHED})")
        page.get_by_label("pause").click()
        wait_until(page, f"{REACHED} === ''")
        page.get_by_label("go on").wait_for()
        paused = is_still(page)
        before = np.array(page.evaluate("live.scene.points('palm')"))
        for _ in range(3):
            page.locator("#step").click()
        wait_until(page, f"{TOLD} !== '{paused}'")
        page.locator("#pace").select_option("0")
        page.get_by_label("go on").click()
        wait_until(page, f"{LIVE}.dataset.ended")
        assert page.locator(".verdict").inner_text().startswith("Succeeded: ")
        after = np.array(page.evaluate("live.scene.points('palm')"))
        shown_at = page.evaluate(TOLD).partition(",")[0]
        assert run.wait().status == 0

    record = Record(tmp_path / "live" / "signals.parquet")
    assert shown_at == f"{record.time[-1]:.2f} s"
    palm = next(b for b in IrGrasp().replay(Parameters(), record.row(-1)).bodies if b.label == "palm")
    assert palm.q_WB is not None
    turned = Rotation.from_quat(palm.q_WB[0], scalar_first=True).apply(palm.mesh.vertices)
    np.testing.assert_allclose(after, palm.p_WB[0] + turned, atol=1e-4)
    assert np.linalg.norm(after.mean(axis=0) - before.mean(axis=0)) > 0.02
    pace = json.loads((tmp_path / "live" / "summary.json").read_text(encoding="utf-8"))["pace"]
    assert (pace["first"], pace["pace"], pace["deadlines"]) == (0.1, None, 0)
    alone = kept_run("run", "ir_grasp", "--no-report")
    assert pq.read_table(tmp_path / "live" / "signals.parquet").equals(pq.read_table(alone / "signals.parquet"))


def test_pictures_that_come_late_are_coarse_until_there_is_time_and_a_run_that_is_stopped_has_all_its_plots(
    browser: Browser, tmp_path: Path
):
    scene = "document.querySelector('.replay-scene')"
    with live_run(tmp_path / "live", "--pace", "0.2") as (address, run), shown(browser, address) as page:
        frames_come(page)
        page.evaluate(
            """() => {
                const busy = () => { for (const end = performance.now() + 100; performance.now() < end;); };
                setInterval(busy, 110);
            }"""
        )
        wait_until(page, f"Number({scene}.dataset.coarse) === 3")
        wide, shown_wide = page.evaluate("[live.scene.canvas.width, live.scene.canvas.clientWidth]")
        assert wide == pytest.approx(0.5 * shown_wide, abs=1.0)
        pictures = page.evaluate(f"Number({scene}.dataset.pictures)")
        wait_until(page, f"Number({scene}.dataset.pictures) > {pictures + 2}")
        page.get_by_label("pause").click()
        wait_until(page, f"{scene}.hasAttribute('data-sharp') && live.scene.canvas.width >= {shown_wide}")
        page.get_by_label("go on").click()
        wait_until(page, f"live.scene.canvas.width < {0.6 * shown_wide}")
        page.locator("#stop").click()
        wait_until(page, f"{LIVE}.dataset.ended")
        wait_until(page, f"live.scene.canvas.width >= {shown_wide}")
        assert page.evaluate(f"{TITLES}.length") > 1
        drawn = "[...document.querySelectorAll('#plots > *')].map(part => part.querySelector('.main-svg') !== null)"
        wait_until(page, f"{drawn}.every(Boolean)")  # also those below what the page shows
        assert run.wait().status != 0
    summary = json.loads((tmp_path / "live" / "summary.json").read_text(encoding="utf-8"))
    assert summary["reason"].startswith("interrupted")
    assert len(Record(tmp_path / "live" / "signals.parquet").time) > 10


def test_the_page_shows_what_the_cameras_see_and_the_run_is_the_same(browser: Browser, tmp_path: Path):
    given, cameras = ("-p", "patience=2"), "document.getElementById('cameras')"
    with (
        live_run(tmp_path / "live", *given, "--pace", "0.1", scenario="helix_handover") as (address, run),
        shown(browser, address) as page,
    ):
        wait_until(page, f"{cameras}.dataset.pictures > 2")
        pictures = page.locator("#cameras img")
        assert pictures.count() == 2  # the third camera, which is not there, is left out
        wait_until(page, f"[...{cameras}.querySelectorAll('img')].every(i => i.complete && i.naturalWidth === 640)")
        captions = page.locator("#cameras figcaption").all_inner_texts()
        assert [caption.partition(",")[0] for caption in captions] == ["camera.left", "camera.right"]
        coded = str(pictures.first.get_attribute("src")).partition("base64,")[2]
        page.locator("#pace").select_option("0")
        wait_until(page, f"{LIVE}.dataset.ended")
        run.wait()
    seen = cv2.imdecode(np.frombuffer(base64.b64decode(coded), dtype=np.uint8), cv2.IMREAD_COLOR)
    alone = kept_run("run", "helix_handover", *given, "--no-report")
    left = next(p.pixels for p in read_picture_files(alone / "pictures") if p.camera == "left")
    whole = cv2.resize(left, (640, 360), interpolation=cv2.INTER_AREA)
    assert np.mean(cv2.absdiff(np.asarray(seen), whole)) < 8.0  # the arm has moved little
    a, b = ((folder / "signals.parquet").read_bytes() for folder in (tmp_path / "live", alone))
    assert a == b


def test_pages_are_informed_of_a_record_that_is_damaged_and_the_session_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    page, messages = LivePage(), list[dict[str, str]]()

    async def tell(content: dict[str, str]) -> None:
        messages.append(content)

    monkeypatch.setattr(page, "tell", tell)
    (tmp_path / "signals.parquet").write_bytes(b"PAR1")
    asyncio.run(page.show_past(ShownRun(WatchedRun(tmp_path), LiveControl.in_memory(1.0), tmp_path)))
    assert "signals.parquet is damaged" in messages[0]["refused"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "given"),
    [
        pytest.param(signal.SIGINT, (), id="interrupted"),
        pytest.param(signal.SIGKILL, ("--checkpoint", "0.1"), id="killed after a checkpoint"),
    ],
)
def test_the_page_of_a_run_that_is_ended_from_outside_says_what_is_left_of_it(
    how: signal.Signals, given: tuple[str, ...], tmp_path: Path, wording: Wording
):
    given = ("--pace", "0.5", "--stop", "100", *given)
    with live_run(tmp_path / "live", *given, scenario=cached("Push", 3)) as (address, run), connected(address) as page:
        frame(page)
        while reported(page, "time") < 0.3:
            pass
        server = process_with(run, SERVER)
        scratch = Path(server.cmdline()[server.cmdline().index(SERVER) + 2])
        assert scratch.is_dir()
        run.send_signal(how)
        ended = reported(page, "ended")
    assert ended["judged"] is (how is signal.SIGINT)
    wording.check(re.sub(r"\d+\.\d+ s", "T s", ended["reason"]))
    until(lambda: not server.is_running(), 300.0)
    assert not scratch.exists()
