"""A study in a browser, and a session of a scripted pilot, whose rounds can be played back and analysed."""

import json
import signal
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest
from playwright.sync_api import Browser, Page
from support.commands import Command, refusal, run_command
from support.opened_page import overflow, wait_until
from support.processes import until
from support.scenarios.served_page import at, pilot_plan, served, to_round
from support.wording import Wording

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


UNDER_WAY = "study.play?.time > 0.1"


@contextmanager
def opened(browser: Browser, address: str, **options: object) -> Generator[Page, None, None]:
    """Open a study's page; fail if its scripts do."""
    context = browser.new_context(**options)  # type: ignore
    page = context.new_page()
    page.set_default_timeout(300_000)
    messages: list[str] = []
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(address)
    try:
        yield page
        assert messages == []
    finally:
        context.close()


def test_a_round_is_played_with_the_mouse_and_rated_by_keys_and_who_comes_next_may_go_on(
    browser: Browser, tmp_path: Path
):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["mouse"]', patience=15, people=2)
    with (
        served(plan, tmp_path / "study", "--pace", "4", "--photodiode") as address,
        opened(browser, address, viewport={"width": 1000, "height": 600}) as page,
    ):
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
        assert mouse.is_enabled(), "what is refused frees the buttons"
        in_the_way.unlink()
        mouse.dblclick()
        at(page, "instruction")
        page.wait_for_timeout(300)
        assert page.locator("#told").is_hidden(), "a double click does one thing"
        assert overflow(page) == 0
        assert page.locator(".study-pilot").inner_text() == "Pilot"

        page.get_by_role("button", name="Begin").click()
        wait_until(page, UNDER_WAY)
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
    session = StudyFolder.read(tmp_path / "study").session(1)
    assert session.answers == {1: {"S1": 7, "S2": 3, "S3": 9}}
    record = session.records[1]
    assert not record.void
    assert None not in (record.latency_median_ms, record.age_at_use_ms, record.missed_deadlines)

    with served(plan, tmp_path / "study") as address, opened(browser, address) as page:
        at(page, "who")
        assert page.get_by_role("button", name="New participant, P02").is_enabled()
        page.get_by_role("button", name="Go on with P01").click()
        at(page, "instruction")
        assert page.locator("#who").inner_text() == "Participant P01"


def test_a_phone_shows_both_views_and_tells_how_far_the_hand_is_from_the_ball(browser: Browser, tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["touch"]', patience=15, practice=300)
    far = "Number(document.querySelector('#task').textContent.match(/It is (\\d+) cm away/)?.[1])"
    phone = {"viewport": {"width": 390, "height": 844}, "has_touch": True}
    with served(plan, tmp_path / "out") as address, opened(browser, address, **phone) as page:
        to_round(page, "practice", "Touch screen")
        assert "The practice lasts 5 min." in page.locator("main").inner_text()
        assert page.locator("#photodiode").count() == 0
        page.get_by_role("button", name="Begin").click()
        wait_until(page, UNDER_WAY)
        eye, side = page.locator("#eye").bounding_box(), page.locator("#side canvas").bounding_box()
        assert eye is not None
        assert side is not None
        assert side["y"] >= eye["y"] + eye["height"]
        assert side["y"] + side["height"] <= 844.0
        assert overflow(page) == 0
        assert page.locator("#views").inner_text() == "one view"  # without a key, which a phone has not
        page.locator("#views").click()
        assert page.locator("#side canvas").count() == 0

        wait_until(page, f"{far} === 18")  # from where it rests, along x
        page.evaluate("(now => { performance.now = () => now() + 31000; })(performance.now.bind(performance))")
        still = "document.querySelector('#told')"
        wait_until(page, f"{still}.textContent.startsWith('The hand has not moved for half a minute.')")
        screen, (x, y) = page.context.new_cdp_session(page), (eye["x"] + 200.0, eye["y"] + 100.0)
        for kind, right in (("touchStart", 0), ("touchMove", 40), ("touchMove", 80)):
            touching = [{"x": x - right, "y": y, "id": 0}]
            screen.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touching})
        wait_until(page, f"{far} !== 18")
        wait_until(page, f"{still}.hidden")


def test_a_page_in_german_tells_that_the_practice_is_over_and_why_a_round_is_void_and_who_goes_on_may_stop(
    browser: Browser, tmp_path: Path
):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["mouse"]', patience=15, practice=2)
    main = "document.querySelector('main').innerText"
    with served(plan, tmp_path / "out") as address:
        with opened(browser, address) as page:
            to_round(page, "practice", "Maus und Tastatur", "de")
            page.get_by_role("button", name="Beginnen").click()
            wait_until(page, UNDER_WAY)
            at(page, "instruction")
            assert "Die Übung ist vorbei." in page.evaluate(main)
            task = page.locator("h1").inner_text()
            page.get_by_role("button", name="Beginnen").click()
            wait_until(page, f"{main}.includes('Die Simulation wird vorbereitet') && {main}.includes({task!r})")
            wait_until(page, UNDER_WAY)
            page.locator("#withdraw").click()
            asked_at = page.evaluate("study.play.time")
            wait_until(page, f"study.play.time > {asked_at + 4.0}")  # a device may be silent for 3 s
            page.locator("#sure-no").click()
            assert page.evaluate("study.screen") == "round"
        with opened(browser, address) as page:
            at(page, "void")
            assert "Die Seite wurde geschlossen, oder ihre Verbindung war verloren." in page.evaluate(main)
            page.get_by_role("button", name="Weiter").click()
            at(page, "instruction")
            assert "Übung" not in page.evaluate(main)
            page.locator("#withdraw").click()
            page.locator("#sure-yes").click()
            at(page, "withdrawn")


def record_of_first(session_folder: Path) -> object:
    return json.loads((session_folder / "rounds" / "01.json").read_text(encoding="utf-8"))["record"]


@pytest.mark.parametrize(
    ("without", "repetitions"),
    [
        # The second is short. How well the script leads the hand depends on what else the machine does.
        pytest.param("human_to_robot|collaborative", 1, marks=pytest.mark.slow, id="two rounds"),
        pytest.param("", 2, marks=pytest.mark.real_time, id="twelve rounds"),
    ],
)
def test_a_scripted_pilot_plays_rounds_that_survive_a_kill(without: str, repetitions: int, tmp_path: Path):
    plan = pilot_plan(
        tmp_path / "plan.toml", devices='["mouse", "script"]', patience=60, practice=2, repetitions=repetitions,
        without=without,
    )  # fmt: skip
    if without:
        text = plan.read_text(encoding="utf-8").replace('= "compliant"', '= "compliant"\npatience = 5', 1)
        plan.write_text(text, encoding="utf-8")
    out = tmp_path / "study"
    command = ("study", "serve", plan, "--out", out, "--pilot", "--pace", "4")
    session_folder = out / "participants" / "P01"
    killed = Command(*command)
    until(lambda: killed.poll() is not None or (session_folder / "rounds" / "01.json").exists(), 600.0)
    assert killed.poll() is None
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    first = record_of_first(session_folder)
    assert Command(*command).wait(3000.0).status == 0
    assert record_of_first(session_folder) == first
    rounds, session = pd.read_csv(session_folder / "rounds.csv"), StudyFolder.read(out).session(1)
    assert rounds["round"].tolist() == [r.number for r in session.rounds]
    assert (rounds["kind"] == "scripted pilot").all()
    assert not rounds["void"].any()
    if not without:
        assert rounds["success"].sum() >= 9, rounds[["task", "behaviour", "reason"]].to_string()
    assert rounds["latency_p95_ms"].notna().all()
    assert len(pd.read_csv(session_folder / "answers.csv")) == 3 * len(session.rounds)
    assert session.session.device == "script"
    again = run_command("study", "replay", out, "P01", session.rounds[-1].number, "--check")
    assert again.status == 0, again.errors


@pytest.mark.slow
def test_a_scripted_pilot_that_is_refused_ends_the_command_with_the_reason(tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["script"]', patience=15)
    study = StudyFolder.opened(tmp_path / "study", parse_plan(plan.read_text(encoding="utf-8")))
    (study.participants / "P01").write_text("", encoding="utf-8")  # in the way of the session's folder
    ended = run_command("study", "serve", plan, "--out", study.path, "--pilot")
    assert ended.status == 1
    assert "the scripted pilot was broken off: it could not be kept" in ended.errors
    assert "Traceback" not in ended.errors


@pytest.mark.parametrize(
    "more",
    [
        pytest.param(("--pilot",), id="a pilot of people"),
        pytest.param(("--pace", "2"), id="a pace of people"),
        pytest.param(("--participant", "99"), id="a participant too many"),
    ],
)
def test_what_a_plan_does_not_allow_is_refused(more: tuple[str, ...], tmp_path: Path, wording: Wording):
    plan = tmp_path / "plan.toml"
    plan.write_text(default_plan(), encoding="utf-8")
    wording.check(refusal("study", "serve", plan, "--out", tmp_path / "study", *more))
    assert not (tmp_path / "study").exists()
