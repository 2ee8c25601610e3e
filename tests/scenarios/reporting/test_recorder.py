"""The button "record a video" of a replay: the scene as it plays, as a file, where the browser can record one."""

from collections.abc import Generator
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from support.opened_page import opened, wait_until
from playwright.sync_api import Browser, Page

from handover.cosim.record.reader import Record


@pytest.fixture(scope="module")
def page(browser: Browser, grasp: Path) -> Generator[Page, None, None]:
    with opened(browser, grasp / "report.html") as page:
        yield page


def frames(file: Path) -> list[NDArray[np.uint8]]:
    video = cv2.VideoCapture(str(file))
    found: list[NDArray[np.uint8]] = []
    while True:
        there, frame = video.read()
        if not there:
            return found
        found.append(np.asarray(frame, np.uint8))


def test_the_button_saves_the_replay_from_its_beginning_to_its_end(page: Page, grasp: Path, tmp_path: Path):
    last = float(Record(grasp / "signals.parquet").time[-1])
    page.locator(".replay-time").fill("100")
    page.locator(".replay-speed").select_option("5")
    with page.expect_download() as saved:
        page.get_by_role("button", name="record a video").click()
        assert page.get_by_role("button", name="stop and save").is_visible()
    assert page.locator(".replay-told").inner_text().startswith(f"{last:.1f} s")
    assert saved.value.suggested_filename.split(".") in (["ir_grasp", "mp4"], ["ir_grasp", "webm"])
    file = tmp_path / saved.value.suggested_filename
    saved.value.save_as(file)
    shown = frames(file)
    wide, high = page.evaluate("[replays[0].scene.canvas.width & ~1, replays[0].scene.canvas.height & ~1]")
    assert {p.shape for p in shown} == {(high, wide, 3)}
    assert np.abs(shown[-1].astype(float) - shown[0]).max() > 100.0
    assert shown[0].mean() > 180.0  # it has the page's background


def test_a_video_that_is_ended_early_is_saved_and_another_can_begin(page: Page, tmp_path: Path):
    page.locator(".replay-speed").select_option("1")
    for _ in range(2):
        with page.expect_download() as saved:
            page.get_by_role("button", name="record a video").click()
            wait_until(page, "replays[0].element.dataset.frame > 10")
            page.get_by_role("button", name="stop and save").click()
        saved.value.save_as(tmp_path / "video")
        assert frames(tmp_path / "video")
        assert float(page.evaluate("replays[0].element.dataset.frame")) < 200
        page.get_by_role("button", name="record a video").wait_for()


@pytest.mark.slow
def test_without_a_recorder_there_is_no_button(browser: Browser, grasp: Path):
    page = browser.new_page()
    page.add_init_script("delete window.MediaRecorder")
    page.goto((grasp / "report.html").as_uri())
    wait_until(page, "document.querySelector('.replay-scene').dataset.frame === '0'")
    assert not page.locator(".replay-film").is_visible()
    page.close()
