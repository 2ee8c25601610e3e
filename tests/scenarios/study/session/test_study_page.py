"""A study in a browser, and a whole session of a scripted pilot, whose rounds can be played back and analysed."""

import os
import signal
import subprocess
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest
from support.opened_page import overflow, wait_until
from playwright.sync_api import Browser
from served_page import HANDOVER, at, pilot_plan, served, to_round

from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.plan import default_plan, parse_plan

SEEN_AT = """(() => {
    const scene = study.play.scene, box = document.querySelector("#eye canvas").getBoundingClientRect();
    const p = scene.camera.position.clone().set(...study.play.hand().p_WH).project(scene.camera);
    return [box.left + (p.x + 1) / 2 * box.width, box.top + (1 - p.y) / 2 * box.height];
})()"""
"""Where the hand is seen in the view from the person's eye, in pixels of the page."""

NOTE_FIRST_RATING = """new MutationObserver(() => {
    const set = document.querySelector(".study-rating");
    if (set) window.firstRating ??= set.disabled;
}).observe(document.body, {childList: true, subtree: true})"""
"""Notes whether statements cannot be rated yet as they appear."""


@pytest.mark.slow
def test_a_round_is_played_with_the_mouse_and_rated_by_keys(browser: Browser, tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["mouse"]', patience=15, practice=0, repetitions=1)
    with served(plan, tmp_path / "study", "--pace", "4", "--photodiode") as (address, _):
        page = browser.new_page(viewport={"width": 1000, "height": 600})
        page.set_default_timeout(120_000)
        messages: list[str] = []
        page.on("pageerror", lambda error: messages.append(str(error)))
        page.goto(address)
        to_round(page)
        assert overflow(page) == 0
        assert page.locator(".study-pilot").inner_text() == "Pilot"
        page.get_by_role("button", name="Begin").click()
        wait_until(page, "study.play?.time > 0.5")
        before = page.evaluate("study.play.hand().p_WH")
        page.mouse.move(250, 200)
        page.mouse.move(350, 220)
        page.mouse.wheel(0, -200)
        wait_until(page, f"Math.hypot(...study.play.hand().p_WH.map((x, i) => x - {before}[i])) > 0.05")
        wait_until(page, "document.querySelector('.study').dataset.drawn > 5")
        lit = "document.querySelector('#photodiode').classList.contains('lit')"
        wait_until(page, f"{lit} !== {str(page.evaluate(lit)).lower()}")
        assert not page.locator("#side").is_hidden()
        wait_until(page, f"Math.hypot(...{SEEN_AT}.map((x, i) => x - [350, 220][i])) < 15")
        notch = f"Math.hypot(...study.play.hand().p_WH.map((x, i) => x - {page.evaluate('study.play.hand().p_WH')}[i]))"
        page.mouse.wheel(0, 100)
        wait_until(page, f"{notch} > 0.01")
        page.wait_for_timeout(500)
        assert page.evaluate(notch) < 0.03  # a notch goes 15 mm
        page.evaluate(NOTE_FIRST_RATING)
        at(page, "rating")
        assert page.evaluate("window.firstRating"), "what was meant for the hand rates nothing"
        wait_until(page, "!document.querySelector('.study-rating').disabled")
        for key in "739":
            page.keyboard.press(key)
        page.get_by_role("button", name="Send").click()
        at(page, "instruction")
        assert page.locator("#progress").inner_text() == "Round 2 of 6"
        page.close()
        assert messages == []
    session = StudyFolder.read(tmp_path / "study").session(1)
    assert session.answers == {1: {"S1": 7, "S2": 3, "S3": 9}}
    record = session.records[1]
    assert not record.void
    assert record.latency_median_ms is not None
    assert record.age_at_use_ms is not None
    assert record.missed_deadlines is not None


@pytest.mark.slow
def test_a_double_click_does_one_thing_a_refusal_frees_the_buttons_and_who_goes_on_is_asked(
    browser: Browser, tmp_path: Path
):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["mouse"]', patience=15, practice=0, repetitions=1)
    plan.write_text(plan.read_text().replace("participants = 1", "participants = 2"), encoding="utf-8")
    with served(plan, tmp_path / "study") as (address, _):
        page = browser.new_page()
        page.goto(address)
        at(page, "language")
        in_the_way = tmp_path / "study" / "participants" / "P01"
        in_the_way.write_text("", encoding="utf-8")
        page.get_by_role("button", name="English").dblclick()
        at(page, "consent")
        page.get_by_role("button", name="I agree").click()
        at(page, "eligibility")
        for box in page.get_by_role("checkbox").all():
            box.check()
        page.get_by_role("button", name="All of this applies to me").click()
        at(page, "device")
        mouse = page.get_by_role("button", name="Mouse and keyboard")
        mouse.click()
        wait_until(page, "!document.getElementById('told').hidden")
        assert "P01" in page.locator("#told").inner_text()
        assert mouse.is_enabled()
        in_the_way.unlink()
        mouse.dblclick()
        at(page, "instruction")
        page.wait_for_timeout(300)
        assert page.locator("#told").is_hidden()
        page.close()
    with served(plan, tmp_path / "study") as (address, _):
        page = browser.new_page()
        page.goto(address)
        at(page, "who")
        assert page.get_by_role("button", name="New participant, P02").is_enabled()
        page.get_by_role("button", name="Go on with P01").click()
        at(page, "instruction")
        assert page.locator("#who").inner_text() == "Participant P01"
        page.close()


@pytest.mark.slow
def test_the_practice_tells_how_far_the_hand_is_from_the_ball(browser: Browser, tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["mouse"]', patience=15, practice=60, repetitions=1)
    far = "Number(document.querySelector('#task').textContent.match(/It is (\\d+) cm away/)?.[1])"
    with served(plan, tmp_path / "out") as (address, _), browser.new_page() as page:
        page.goto(address)
        to_round(page, "practice")
        assert "The practice lasts 60 s." in page.locator("main").inner_text()
        assert page.locator("#photodiode").count() == 0
        page.get_by_role("button", name="Begin").click()
        wait_until(page, "study.play?.time > 0.5")
        wait_until(page, f"{far} === 18")  # from where it rests, along x
        page.mouse.move(500, 300)
        wait_until(page, f"{far} > 25")
        told = "document.querySelector('#told')"
        wait_until(page, f"{told}.textContent.startsWith('The hand has not moved for half a minute.')")
        page.mouse.move(400, 300)
        wait_until(page, f"{told}.hidden")


@pytest.mark.slow
def test_a_round_goes_on_while_the_page_asks_whether_to_stop(browser: Browser, tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["mouse"]', patience=15, practice=0, repetitions=1)
    with served(plan, tmp_path / "out") as (address, _), browser.new_page() as page:
        page.set_default_timeout(120_000)
        page.goto(address)
        to_round(page)
        page.get_by_role("button", name="Begin").click()
        wait_until(page, "study.play?.time > 0.5")
        page.locator("#withdraw").click()
        page.wait_for_timeout(4000)  # longer than a device may be silent
        assert page.locator("#sure").inner_text().startswith("Do you want to stop taking part?")
        page.locator("#sure-no").click()
        assert page.evaluate("study.screen") == "round"
        page.locator("#withdraw").click()
        page.locator("#sure-yes").click()
        at(page, "withdrawn")
        page.wait_for_timeout(1500)
        assert page.evaluate("study.screen") == "withdrawn"


@pytest.mark.slow
def test_a_page_in_german_tells_that_the_practice_is_over_and_why_a_round_is_void(browser: Browser, tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["mouse"]', patience=15, practice=2, repetitions=1)
    main = "document.querySelector('main').innerText"
    with served(plan, tmp_path / "out") as (address, _):
        with browser.new_page() as page:
            page.set_default_timeout(120_000)
            page.goto(address)
            to_round(page, "practice", "Maus und Tastatur", "de")
            page.get_by_role("button", name="Beginnen").click()
            wait_until(page, "study.play?.time > 0.5")
            at(page, "instruction")
            assert "Die Übung ist vorbei." in page.evaluate(main)
            task = page.locator("h1").inner_text()
            page.get_by_role("button", name="Beginnen").click()
            wait_until(page, f"{main}.includes('Die Simulation wird vorbereitet') && {main}.includes({task!r})")
            wait_until(page, "study.play?.time > 0.5")
        with browser.new_page() as page:
            page.goto(address)
            at(page, "void")
            assert "Die Seite wurde geschlossen, oder ihre Verbindung war verloren." in page.evaluate(main)
            page.get_by_role("button", name="Weiter").click()
            at(page, "instruction")
            assert "Übung" not in page.evaluate(main)


@pytest.mark.slow
def test_a_phone_shows_the_view_from_the_side_below_that_of_the_eye_from_the_first(browser: Browser, tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["touch"]', patience=15, practice=60, repetitions=1)
    phone = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    with served(plan, tmp_path / "out") as (address, _), phone, phone.new_page() as page:
        page.goto(address)
        to_round(page, "practice", "Touch screen")
        page.get_by_role("button", name="Begin").click()
        wait_until(page, "study.play?.time > 0.5")
        eye, side = page.locator("#eye").bounding_box(), page.locator("#side canvas").bounding_box()
        assert eye is not None
        assert side is not None
        assert side["y"] >= eye["y"] + eye["height"]
        assert side["y"] + side["height"] <= 844.0
        assert overflow(page) == 0
        assert page.locator("#views").inner_text() == "one view"  # without a key, which a phone has not
        page.locator("#views").click()
        assert page.locator("#side canvas").count() == 0


@pytest.mark.slow
def test_a_scripted_pilot_plays_twelve_rounds_that_survive_a_kill_and_are_played_back(tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["mouse", "script"]', patience=60, practice=5, repetitions=2)
    out = tmp_path / "study"
    command = [*HANDOVER, "study", "serve", str(plan), "--out", str(out), "--pilot", "--pace", "4"]
    killed = subprocess.Popen(command, start_new_session=True)
    session_folder = out / "participants" / "P01"
    while not (session_folder / "rounds" / "02.json").exists():
        assert killed.poll() is None
        try:
            killed.wait(0.2)
        except subprocess.TimeoutExpired:
            continue
    os.kill(killed.pid, signal.SIGKILL)
    killed.wait()
    first = (session_folder / "rounds" / "01.json").read_bytes()
    subprocess.run(command, check=True, timeout=3000)
    assert (session_folder / "rounds" / "01.json").read_bytes() == first
    rounds = pd.read_csv(session_folder / "rounds.csv")
    assert rounds["round"].tolist() == list(range(1, 13))
    assert rounds["behaviour"].value_counts().to_dict() == {"rigid": 6, "compliant": 6}
    assert (rounds["kind"] == "scripted pilot").all()
    assert not rounds["void"].any()
    assert rounds["success"].sum() >= 9, rounds[["task", "behaviour", "reason"]].to_string()
    assert pd.read_parquet(session_folder / "rounds.parquet")["latency_p95_ms"].notna().all()
    assert len(pd.read_csv(session_folder / "answers.csv")) == 36
    assert StudyFolder.read(out).session(1).session.device == "script"
    planned = StudyFolder.read(out).session(1).rounds[0]
    given = [text for p in (*planned.condition.given, "hand=outside") for text in ("-p", p)]
    again = [*HANDOVER, "run", planned.condition.scenario, *given, "--seed", str(planned.seed), "--no-report"]
    played = session_folder / "rounds" / "01"
    subprocess.run([*again, "--inputs-from", str(played), "--out", str(tmp_path / "again")], check=False)
    assert pq.read_table(tmp_path / "again" / "signals.parquet").equals(pq.read_table(played / "signals.parquet"))


def test_a_scripted_pilot_that_is_refused_ends_the_command_with_the_reason(tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["script"]', patience=15, practice=0, repetitions=1)
    study = StudyFolder.opened(tmp_path / "study", parse_plan(plan.read_text(encoding="utf-8")))
    (study.participants / "P01").write_text("", encoding="utf-8")  # in the way of the session's folder
    command = [*HANDOVER, "study", "serve", str(plan), "--out", str(study.path), "--pilot"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 1
    assert "the scripted pilot was broken off: it could not be kept" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_what_a_plan_does_not_allow_is_told_in_one_line(tmp_path: Path):
    plan = tmp_path / "plan.toml"
    plan.write_text(default_plan(), encoding="utf-8")
    for more, why in ((["--pilot"], "of people"), (["--pace", "2"], "pace 1"), (["--participant", "99"], "18, not 99")):
        command = [*HANDOVER, "study", "serve", str(plan), "--out", str(tmp_path / "study"), *more]
        ended = subprocess.run(command, capture_output=True, text=True)
        assert ended.returncode == 2
        assert why in ended.stderr
    assert parse_plan(default_plan()).participants == 18
    assert not (tmp_path / "study").exists()
