"""A run in a browser while it goes on: it is followed, paused, stepped, ended; its record is what it would be alone."""

import base64
import json
import re
import signal
import subprocess
import urllib.error
import urllib.request
from pathlib import Path

import cv2
import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest
from live_runs import HANDOVER, LIVE, TOLD, live_run, shown
from opened_page import wait_until
from playwright.sync_api import Browser
from scipy.spatial.transform import Rotation
from support.processes import with_argument
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from handover.cosim.record.reader import Record
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.ir_grasp.parameters import Parameters
from handover.scenarios.results.pictures import read_picture_files


def test_a_run_is_followed_paused_and_stepped_and_its_record_is_that_of_a_run_alone(browser: Browser, tmp_path: Path):
    with live_run(tmp_path / "live") as (address, run), shown(browser, address) as page:
        wait_until(page, f"{LIVE}.dataset.frames > 3")
        page.get_by_label("pause").click()
        page.get_by_label("go on").wait_for()
        page.wait_for_timeout(500)
        paused = page.evaluate(TOLD)
        before = np.array(page.evaluate("live.scene.points('palm')"))
        page.wait_for_timeout(500)
        assert page.evaluate(TOLD) == paused
        for _ in range(3):
            page.locator("#step").click()
        wait_until(page, f"{TOLD} !== '{paused}'")
        page.locator("#pace").select_option("0")
        page.get_by_label("go on").click()
        wait_until(page, f"{LIVE}.dataset.ended")
        assert page.locator(".verdict").inner_text().startswith("Succeeded: ")
        after = np.array(page.evaluate("live.scene.points('palm')"))
        shown_at = page.evaluate(TOLD).partition(",")[0]
        run.wait(timeout=120)
        assert run.returncode == 0
    record = Record(tmp_path / "live" / "signals.parquet")
    assert shown_at == f"{record.time[-1]:.2f} s"
    palm = next(b for b in IrGrasp().replay(Parameters(), record.row(-1)).bodies if b.label == "palm")
    assert palm.q_WB is not None
    turned = Rotation.from_quat(palm.q_WB[0], scalar_first=True).apply(palm.mesh.vertices)
    np.testing.assert_allclose(after, palm.p_WB[0] + turned, atol=1e-4)
    assert np.linalg.norm(after.mean(axis=0) - before.mean(axis=0)) > 0.02
    alone = [*HANDOVER, "run", "ir_grasp", "--no-report", "--out", str(tmp_path / "alone")]
    subprocess.run(alone, check=True, capture_output=True)
    assert pq.read_table(tmp_path / "live" / "signals.parquet").equals(
        pq.read_table(tmp_path / "alone" / "signals.parquet")
    )


def test_the_page_plots_what_it_is_asked_for_and_ends_the_run(browser: Browser, tmp_path: Path):
    with live_run(tmp_path / "live", "--pace", "0.5") as (address, run), shown(browser, address) as page:
        page.locator("#signal").fill("nonsense")
        page.locator("#signal").dispatch_event("change")
        assert page.locator("#told").inner_text().startswith("There is no signal nonsense;")
        titles = "[...document.querySelectorAll('#plots h3')].map(heading => heading.textContent)"
        wait_until(page, f"{titles}.length")
        own = page.evaluate(titles)
        for signal in ("scene.p_WO", "reflex.cost"):
            page.locator("#signal").fill(signal)
            page.locator("#signal").dispatch_event("change")
        wait_until(page, f"{titles}.includes('reflex.cost')")
        assert page.evaluate(titles) == ["reflex.cost", "scene.p_WO", *own], "the last chosen one is seen at once"
        page.locator("#stop").click()
        wait_until(page, f"{LIVE}.dataset.ended")
        run.wait(timeout=120)
        assert run.returncode != 0
        drawn = "[...document.querySelectorAll('#plots > *')].map(part => part.querySelector('.main-svg') !== null)"
        assert page.evaluate(f"{drawn}.length") > 2
        assert all(page.evaluate(drawn)), "also those below what the page shows"
    summary = json.loads((tmp_path / "live" / "summary.json").read_text(encoding="utf-8"))
    assert summary["reason"].startswith("interrupted")
    assert len(Record(tmp_path / "live" / "signals.parquet").time) > 10


@pytest.mark.slow
def test_a_run_under_way_is_recorded_as_a_video(browser: Browser, tmp_path: Path):
    with live_run(tmp_path / "live") as (address, _), shown(browser, address) as page:
        page.get_by_role("button", name="record a video").click()
        before = page.evaluate(f"Number({LIVE}.dataset.frames)")
        wait_until(page, f"{LIVE}.dataset.frames > {before + 10}")
        with page.expect_download() as saved:
            page.get_by_role("button", name="stop and save").click()
        saved.value.save_as(tmp_path / "video")
        assert saved.value.suggested_filename.startswith("ir_grasp.")
        video = cv2.VideoCapture(str(tmp_path / "video"))
        assert sum(video.read()[0] for _ in range(10)) > 5


@pytest.mark.slow
def test_pictures_that_come_late_are_drawn_with_fewer_pixels_and_without_shadows(browser: Browser, tmp_path: Path):
    coarse = "Number(document.querySelector('.replay-scene').dataset.coarse)"
    with live_run(tmp_path / "live", "--pace", "0.2") as (address, _), shown(browser, address) as page:
        wait_until(page, f"{LIVE}.dataset.frames > 3")
        page.evaluate(
            """() => {
                const busy = () => { for (const end = performance.now() + 100; performance.now() < end;); };
                setInterval(busy, 110);
            }"""
        )
        wait_until(page, f"{coarse} === 3")
        wide, shown_wide = page.evaluate("[live.scene.canvas.width, live.scene.canvas.clientWidth]")
        assert wide == pytest.approx(0.5 * shown_wide, abs=1.0)
        pictures = page.evaluate("Number(document.querySelector('.replay-scene').dataset.pictures)")
        wait_until(page, f"Number(document.querySelector('.replay-scene').dataset.pictures) > {pictures + 2}")
        page.get_by_label("pause").click()
        wait_until(page, "document.querySelector('.replay-scene').hasAttribute('data-sharp')")
        wide, shown_wide = page.evaluate("[live.scene.canvas.width, live.scene.canvas.clientWidth]")
        assert wide >= shown_wide, "there is time for a sharp picture"
        page.get_by_label("go on").click()
        wait_until(page, f"live.scene.canvas.width < {0.6 * shown_wide}")
        page.locator("#stop").click()
        wait_until(page, f"{LIVE}.dataset.ended")
        wait_until(page, f"live.scene.canvas.width >= {shown_wide}")


@pytest.mark.slow
def test_the_page_tells_the_pace_that_is_reached_where_it_is_less_than_the_wanted_one(browser: Browser, tmp_path: Path):
    reached = "document.getElementById('reached').value"
    with live_run(tmp_path / "live", "--pace", "0.1") as (address, run), shown(browser, address) as page:
        wait_until(page, f"parseFloat({TOLD}) > 0.25")
        assert page.evaluate(reached) == ""
        page.evaluate("""() => {
            const now = performance.now.bind(performance);
            performance.now = () => 2 * now();
        }""")
        wait_until(page, f"{reached} === 'reached 0.05\u00d7'")
        page.get_by_label("pause").click()
        wait_until(page, f"{reached} === ''")
        page.get_by_label("go on").click()
        page.locator("#pace").select_option("0")
        wait_until(page, f"{LIVE}.dataset.ended")
        shown_text, _ = run.communicate(timeout=120)
    assert "changed on the way, 0.1 x real time at first, as fast as it goes at last" in shown_text
    assert "deadlines missed" not in shown_text
    pace = json.loads((tmp_path / "live" / "summary.json").read_text(encoding="utf-8"))["pace"]
    assert (pace["first"], pace["pace"], pace["deadlines"]) == (0.1, None, 0)


@pytest.mark.slow
def test_the_page_shows_what_the_cameras_see_and_the_run_is_the_same(browser: Browser, tmp_path: Path):
    given, cameras = ("-p", "patience=2"), "document.getElementById('cameras')"
    with (
        live_run(tmp_path / "live", *given, "--pace", "3", scenario="helix_handover") as (address, run),
        shown(browser, address) as page,
    ):
        wait_until(page, f"{cameras}.dataset.pictures > 2")
        pictures = page.locator("#cameras img")
        assert pictures.count() == 2  # the third camera, which is not there, is left out
        wait_until(page, f"[...{cameras}.querySelectorAll('img')].every(i => i.complete && i.naturalWidth === 640)")
        captions = page.locator("#cameras figcaption").all_inner_texts()
        assert [caption.partition(",")[0] for caption in captions] == ["camera.left", "camera.right"]
        coded = str(pictures.first.get_attribute("src")).partition("base64,")[2]
        wait_until(page, f"{LIVE}.dataset.ended")
        run.wait(timeout=120)
    seen = cv2.imdecode(np.frombuffer(base64.b64decode(coded), dtype=np.uint8), cv2.IMREAD_COLOR)
    alone = [*HANDOVER, "run", "helix_handover", *given, "--no-report", "--out", str(tmp_path / "alone")]
    subprocess.run(alone, check=False, capture_output=True)
    kept = read_picture_files(tmp_path / "alone" / "pictures")
    left = next(picture.pixels for picture in kept if picture.camera == "left")
    whole = cv2.resize(left, (640, 360), interpolation=cv2.INTER_AREA)
    assert np.mean(cv2.absdiff(np.asarray(seen), whole)) < 8.0  # the arm has moved little
    a, b = ((tmp_path / name / "signals.parquet").read_bytes() for name in ("live", "alone"))
    assert a == b


@pytest.mark.slow
def test_ctrl_c_ends_the_run_and_the_page_is_told_how(browser: Browser, tmp_path: Path):
    with live_run(tmp_path / "live", "--pace", "0.5") as (address, run), shown(browser, address) as page:
        wait_until(page, f"{LIVE}.dataset.frames > 3")
        run.send_signal(signal.SIGINT)
        wait_until(page, f"{LIVE}.dataset.ended")
        assert "interrupted" in page.locator(".verdict").inner_text()
        run.wait(timeout=120)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "left"),
    [
        ((), "what it recorded is in {}, without a checkpoint to go on from."),
        (("--checkpoint", "0.1"), "handover resume {} goes on from its last checkpoint."),
    ],
)
def test_the_page_of_a_killed_run_says_what_is_left_of_it(
    browser: Browser, tmp_path: Path, given: tuple[str, ...], left: str
):
    out = tmp_path / "live"
    with live_run(out, "--pace", "0.5", *given) as (address, run), shown(browser, address) as page:
        wait_until(page, f"{LIVE}.dataset.frames > 3")
        if given:
            wait_until(page, f"parseFloat({TOLD}) > 0.3")
        run.kill()
        wait_until(page, f"{LIVE}.dataset.ended")
        told = page.locator(".verdict").inner_text()
        assert told == f"No verdict: its process has ended; {left.format(out)}"


def server_of(run: "subprocess.Popen[str]") -> psutil.Process:
    (server,) = with_argument(run.pid, "handover.scenarios.live")
    return psutil.Process(server)


@pytest.mark.slow
def test_a_page_whose_server_ends_says_that_the_run_goes_on_and_offers_nothing(browser: Browser, tmp_path: Path):
    with live_run(tmp_path / "live", "--pace", "1") as (address, run), shown(browser, address) as page:
        wait_until(page, f"{LIVE}.dataset.frames > 3")
        server_of(run).kill()
        page.get_by_text("is lost: what serves this page has ended, and the run goes on without it.").wait_for()
        assert page.locator("#pace").is_disabled()


def test_a_run_goes_on_without_its_page_if_the_pages_server_ends(tmp_path: Path):
    with live_run(tmp_path / "live", "--pace", "100") as (_, run):
        server_of(run).kill()
        _, told = run.communicate(timeout=120)
        assert "the run goes on without it" in told
        assert run.returncode == 0


def test_the_readmes_command_refuses_who_is_not_the_page(tmp_path: Path):
    readme = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    (scenario,) = re.findall(r"^\.venv/bin/handover run (\w+) --live$", readme, re.MULTILINE)
    with live_run(tmp_path / "live", scenario=scenario) as (address, _):
        host = address.removeprefix("http://").rstrip("/")
        with pytest.raises(urllib.error.HTTPError, match="400"):
            urllib.request.urlopen(urllib.request.Request(address, headers={"Host": "elsewhere.example"}))
        with pytest.raises(InvalidStatus, match="403"):
            connect(f"ws://{host}/run", open_timeout=60.0, origin="http://elsewhere.example")  # type: ignore
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"{address}etc/passwd")
        with connect(f"ws://{host}/run", open_timeout=60.0, origin=f"http://{host}") as page:  # type: ignore
            wrong = {
                "{": "not JSON",
                "[]": "is right: Expected",
                '{"command": "fly"}': "no command 'fly'",
                '{"command": "pace", "value": -1}': "pace takes",
                '{"command": "pace", "value": NaN}': "not JSON",
                '{"command": "choose", "value": ["secret"]}': "names of signals",
                '{"command": "see", "value": "all"}': "numbers of plots",
                " " * 1500: "1000 characters",
            }
            for text, why in wrong.items():
                page.send(text)
                answer = ""
                while why not in answer:
                    got = page.recv(timeout=60)
                    answer = json.loads(got).get("refused", "") if isinstance(got, str) else ""
