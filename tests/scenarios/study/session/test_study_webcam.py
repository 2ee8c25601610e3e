"""A webcam leads the hand in a study's rounds, by the lab's files, with a stand-in for MediaPipe."""

import hashlib
import json
import re
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from support.commands import call, refusal
from support.opened_page import launched, wait_until
from support.scenarios import study_server
from support.scenarios.served_page import at, pilot_plan, served, to_round
from support.scenarios.study_server import server_of, status
from support.webcam_files import camera_of, write_files, write_video
from support.wording import Wording

from handover.cosim.record.reader import Record
from handover.scenarios.live.webcam import FILES, MODEL, WebcamFiles
from handover.scenarios.runs.reporting.page import asset
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.plan import default_plan, parse_plan
from handover.scenarios.study.session.server import page_words

TOLD = "document.getElementById('camera').textContent"


def plan_of_webcam(path: Path, devices: str = '["webcam"]') -> Path:
    return pilot_plan(path, devices=devices, patience=12)


@pytest.mark.slow
def test_a_hand_before_a_webcam_plays_a_round_whose_files_hashes_are_kept(tmp_path: Path):
    write_video(tmp_path / "camera.y4m")
    folder = write_files(tmp_path / "vision")
    plan = plan_of_webcam(tmp_path / "plan.toml", '["mouse", "webcam"]')
    with (
        launched(*camera_of(tmp_path / "camera.y4m")) as browser,
        served(plan, tmp_path / "study", "--webcam", str(folder)) as address,
        browser.new_page() as page,
    ):
        messages: list[str] = []
        page.on("pageerror", lambda error: messages.append(str(error)))
        page.goto(address)
        to_round(page, device="Webcam")
        wait_until(page, f"{TOLD} === 'The camera sees your hand.'")
        page.get_by_role("button", name="Begin").click()
        at(page, "rating")
        assert page.locator("#video").is_visible()  # it goes on to the next round
        page.get_by_role("button", name="Stop taking part").click()
        page.locator("#sure-yes").click()
        at(page, "withdrawn")
        assert not page.locator("#video").is_visible()
        assert messages == []
    session = StudyFolder.read(tmp_path / "study").session(1)
    assert not session.records[1].void
    assert session.records[1].latency_median_ms is not None
    run = session.run_folder(1)
    inputs = json.loads((run / "run.json").read_text(encoding="utf-8"))["inputs"]
    assert inputs["device"] == "webcam"
    assert inputs["webcam"]["sha256"] == {n: hashlib.sha256((folder / n).read_bytes()).hexdigest() for n in FILES}
    record = Record(run / "signals.parquet")
    seen = record["person.age"] < 1.0
    assert seen.sum() > 20
    assert np.ptp(record["person.p_WH_track"][seen], axis=0).max() > 0.1  # the hand in the video goes 0.12 m aside
    assert set(record["person.closed_track"][seen].tolist()) == {0, 1}


def test_a_webcams_files_are_served_below_the_page_and_nothing_else_of_their_folder(tmp_path: Path):
    folder = write_files(tmp_path / "vision")
    plan = parse_plan(plan_of_webcam(tmp_path / "plan.toml").read_text(encoding="utf-8"))
    offered = server_of(tmp_path / "study", "192.0.2.7", plan, WebcamFiles.read(folder))
    with study_server.served(offered) as where:
        for path in ("webcam/package.json", "webcam/../package.json", "webcam/"):
            assert status(where, offered.path + path) == 404
        with urlopen(f"http://{where}{offered.path}webcam/{MODEL}") as answer:
            assert answer.read() == (folder / MODEL).read_bytes()
    with study_server.served(server_of(tmp_path / "mice")) as where:
        with urlopen(f"http://{where}/") as answer:
            text = answer.read().decode()
        for word in ("const handCamera", "worker-src", 'id="video"'):
            assert word not in text
        assert status(where, "/webcam/worker.js") == 404


def test_every_fault_of_a_camera_has_a_text_in_english_and_in_every_other_language():
    script = asset("hand/hand_camera.js")
    of_errors = re.search(r"const FAULTS = \{(.*?)\};", script)
    texts = re.search(r"const FAULT_TEXTS = \{(.*?)\};", script, re.DOTALL)
    assert of_errors
    assert texts
    faults = {*re.findall(r'"(\w+)"', of_errors[1]), *re.findall(r'(?:fail\(|\?\? )"(\w+)"', script)}
    assert len(faults) == 10
    assert faults == set(re.findall(r"^ +(\w+): ", texts[1], re.MULTILINE))
    words = page_words()
    assert not {f"camera_{fault}" for fault in faults} & words.pop("en").keys()
    for language in words.values():
        assert {f"camera_{fault}" for fault in faults} <= language.keys()


def test_a_webcam_without_files_or_plan_is_refused_before_anything_starts(tmp_path: Path, wording: Wording):
    folder, out = write_files(tmp_path / "vision"), tmp_path / "study"
    plan = plan_of_webcam(tmp_path / "plan.toml")
    mice = tmp_path / "mice.toml"
    mice.write_text(default_plan(), encoding="utf-8")
    (tmp_path / "empty").mkdir()
    for given in ((plan,), (plan, "--webcam", tmp_path / "empty"), (mice, "--webcam", folder)):
        wording.check(refusal("study", "serve", *given, "--out", out))
    assert not out.exists()
    shown = call("study", "plan", plan)
    assert "webcam, hand followed by a webcam (offered by `study serve --webcam FOLDER`)" in shown.output
