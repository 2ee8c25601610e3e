"""A webcam leads the hand: its files, and the way from a camera's pictures to a run, with a stand-in for MediaPipe."""

import hashlib
import json
import socket
import zipfile
from collections.abc import Callable
from html import unescape
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.commands import refusal
from support.live_pages import LIVE, live_run, shown
from support.opened_page import launched, wait_until
from support.served_live_page import answered, served
from support.webcam_files import camera_of, write_files, write_video
from support.wording import Wording

from handover.cosim.record.reader import Record
from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.webcam import (
    BUNDLE,
    FILES,
    LOADER,
    MODEL,
    MODEL_PARTS,
    WASM,
    InvalidWebcamFiles,
    WebcamFiles,
)

SCENARIO = "flyer_robot_to_human"
OUTSIDE = ("-p", "hand=outside")
TOLD = "document.getElementById('hand-told').value"


def badly_deflated(model: bytes) -> bytes:
    """Return a model whose first part is said to be compressed, with a kind of block that there is none of."""
    method = model.index(b"PK\x01\x02") + 10
    return (model[:method] + b"\x08" + model[method + 1 :]).replace(b"\x1c", b"\x06", 1)


MODELS: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "a page": lambda _: b"<html>not found</html>",
    "cut off": lambda model: model[:60],
    "damaged": lambda model: model.replace(b"TFL3", b"TGL3", 1),
    "whose stream is damaged": badly_deflated,
    "of no landmarks": lambda model: model.replace(MODEL_PARTS[1].encode(), b"x" * len(MODEL_PARTS[1])),
}


@pytest.mark.parametrize("case", [*MODELS, "missing"])
def test_what_is_not_what_its_name_says_is_refused(case: str, tmp_path: Path, wording: Wording):
    folder = write_files(tmp_path / "vision")
    if case in MODELS:
        (folder / MODEL).write_bytes(MODELS[case]((folder / MODEL).read_bytes()))
        (folder / WASM).write_bytes(b"<html>")
    else:
        for name in (MODEL, WASM):
            (folder / name).unlink()
        (folder / WASM).mkdir()
        (folder / LOADER).write_text("var a;")
        (folder / BUNDLE).write_text("export class FaceLandmarker {}")
    with pytest.raises(InvalidWebcamFiles) as refused:
        WebcamFiles.read(folder)
    wording.check(refused.value)


def test_a_model_that_is_packed_to_a_thousandth_is_refused_unread(tmp_path: Path):
    folder = write_files(tmp_path / "vision")
    with zipfile.ZipFile(folder / MODEL, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as model:
        model.writestr(MODEL_PARTS[0], bytes(100_000_001))
    with pytest.raises(InvalidWebcamFiles, match=f"more than 100 MB: {MODEL_PARTS[0]}"):
        WebcamFiles.read(folder)


@pytest.mark.parametrize(
    "given",
    [
        pytest.param((*OUTSIDE, "--live", "--webcam", "empty"), id="an empty folder"),
        pytest.param((*OUTSIDE, "--live", "--webcam", "nowhere"), id="no folder"),
        pytest.param((*OUTSIDE, "--webcam", "vision"), id="without a page"),
        pytest.param(("--live", "--webcam", "vision"), id="where nobody leads a hand"),
    ],
)
def test_a_run_is_refused_a_webcam_before_anything_runs(
    given: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    write_files(tmp_path / "vision")
    wording.check(refusal("run", SCENARIO, "--out", "run", *given))
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_a_hand_in_a_cameras_pictures_leads_the_hand_of_a_run(tmp_path: Path):
    write_video(tmp_path / "camera.y4m")
    camera = camera_of(tmp_path / "camera.y4m")
    with socket.create_server(("127.0.0.1", 0)) as makers, launched(*camera) as browser:
        folder = write_files(tmp_path / "vision", makers=f"http://127.0.0.1:{makers.getsockname()[1]}/report")
        given = (*OUTSIDE, "--webcam", str(folder), "--pace", "0.5")
        with live_run(tmp_path / "led", *given, scenario=SCENARIO) as (address, run), shown(browser, address) as page:
            wait_until(page, "live.hand")
            page.locator("[data-view=front]").click()
            page.wait_for_timeout(500)
            right = page.evaluate("live.scene.camera.matrixWorld.elements.slice(0, 3)")
            page.locator("#hand-device").select_option("webcam")
            for _ in range(2):  # the video begins again
                wait_until(page, f"{TOLD} === 'The camera sees the hand.'")
                assert page.locator("#hand-video").is_visible()
                wait_until(page, f"{TOLD}.startsWith('Show your hand')")
            page.locator("#stop").click()
            wait_until(page, f"{LIVE}.dataset.ended")
            run.wait()
        makers.setblocking(False)
        with pytest.raises(BlockingIOError):
            makers.accept()  # nobody asked the makers of the package
    record = Record(tmp_path / "led" / "signals.parquet")
    reported = json.loads((tmp_path / "led" / "inputs.json").read_text(encoding="utf-8"))
    assert reported["webcam"]["sha256"] == {n: hashlib.sha256((folder / n).read_bytes()).hexdigest() for n in FILES}
    assert reported["samples"]["webcam"] > 20
    assert not reported["refused"]

    age, closed, p = record["person.age"], record["person.closed_track"], record["person.p_WH_track"]
    used = np.flatnonzero(age < 0.5)
    gone = [bool(age[a : b + 1].max() > 1.0) for a, b in pairwise(used)]
    seen = np.split(used, np.flatnonzero(gone) + 1)  # from when it came to when it left
    ways = [(p[span[-1]] - p[span[0]]) @ right for span in seen]
    assert 0.04 < max(ways) < 0.135  # its right is the view's; 0.12 where it is seen before it moves
    assert set(closed[used].tolist()) == {False, True}
    bent = record["person.finger_track"][used][:, 2:]
    assert bent[~closed[used].astype(bool)].min(axis=0).max() < 0.1
    assert bent[closed[used].astype(bool)].max(axis=0).min() > 0.9
    lost = np.flatnonzero((age > 0.5) & (np.arange(len(age)) > used[0]))
    assert age[lost].max() > 1.0
    wanted = record["person.p_WH_goal"]
    assert all((wanted[k] == wanted[k - 1]).all() for k in lost if k - 1 in lost)


@pytest.mark.slow
def test_why_a_camera_cannot_lead_is_reported_and_another_device_can(tmp_path: Path):
    folder = write_files(tmp_path / "vision", model=b"broken")
    given = (*OUTSIDE, "--webcam", str(folder), "--pace", "0.5")
    with (
        launched("--use-fake-ui-for-media-stream") as browser,
        live_run(tmp_path / "led", *given, scenario=SCENARIO) as (address, _),
        shown(browser, address) as page,
    ):
        wait_until(page, "live.hand")
        page.locator("#hand-device").select_option("webcam")
        wait_until(page, f"{TOLD}.endsWith('no camera is connected. Another device may be chosen.')")
        page.evaluate(
            "navigator.mediaDevices.getUserMedia = () => Promise.reject(new DOMException('', 'NotAllowedError')); 0"
        )
        page.locator("#hand-side").select_option("left")
        wait_until(page, f"{TOLD}.includes('the browser was not allowed to use the camera')")
        page.evaluate(
            "navigator.mediaDevices.getUserMedia = async () => document.createElement('canvas').captureStream(); 0"
        )
        page.locator("#hand-side").select_option("right")
        wait_until(page, f'{TOLD}.includes("has failed: the model\'s graph has no landmarks")')
        assert not page.locator("#hand-video").is_visible()
        page.locator("#hand-device").select_option("pointer")
        assert page.evaluate(TOLD) == ""
        box = page.locator(".replay-scene canvas").bounding_box()
        assert box is not None
        before = page.evaluate("live.hand.pose().p_WH")
        page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.4 * box["height"], steps=5)
        wait_until(page, f"JSON.stringify(live.hand.pose().p_WH) !== '{json.dumps(before, separators=(',', ':'))}'")


def test_a_webcams_files_are_served_and_nothing_else_of_their_folder(tmp_path: Path):
    folder = write_files(tmp_path / "vision")
    files = WebcamFiles.read(folder)
    assert files.hashes() == {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in FILES}
    assert len(files.routes()) == len(FILES) + 1  # and what calls them
    with served(LivePage(files)) as (address, _):
        for path in ("/webcam/package.json", "/webcam/../package.json", "/webcam/"):
            assert answered(address, path)[0].status == 404
        assert answered(address, f"/webcam/{MODEL}", Host="elsewhere.example")[0].status == 400
        assert answered(address, f"/webcam/{MODEL}")[1] == (folder / MODEL).read_bytes()
        policy = answered(address, "/webcam/worker.js")[0].headers["Content-Security-Policy"]
        assert policy == "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; connect-src 'self'"
        page = unescape(answered(address, "/")[1].decode())
        assert "worker-src 'self'" in page
        assert "wasm-unsafe-eval" not in page.partition("<title>")[0]


def test_without_its_files_no_webcam_is_offered():
    with served(page := LivePage()) as (address, _):
        assert answered(address, "/webcam/worker.js")[0].status == 404
    assert 'value="tracker"' in page.html()
    for word in ('value="webcam"', "const handCamera", "worker-src", "wasm-unsafe-eval"):
        assert word not in page.html()
