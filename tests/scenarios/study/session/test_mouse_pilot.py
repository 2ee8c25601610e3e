"""A whole session by the mouse and keys of a browser: from the consent to the thanks, its report, export and replay."""

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from playwright.sync_api import Browser, Page
from support.commands import run_command
from support.opened_page import wait_until
from support.scenarios.mouse_hand import MouseHand
from support.scenarios.served_page import at, pilot_plan, served, to_round

FIGURES = ["round", "success", "latency_median_ms", "latency_p95_ms", "missed_deadlines"]
"""Of the rounds: what is printed."""
SCREEN = "document.querySelector('.study').dataset.screen"


def take_part(page: Page, hand: MouseHand) -> list[str]:
    """Do what each screen asks for until the questions come, void rounds once more; return the screens in order."""
    screens: list[str] = []
    while (screen := page.evaluate(SCREEN)) != "questions":
        if not screens or screens[-1] != screen:
            screens.append(screen)
        match screen:
            case "practising" | "round":
                hand.act()
                continue
            case "rating":
                wait_until(page, "!document.querySelector('.study-rating').disabled")
                for rating in "739":
                    page.keyboard.press(rating)
                page.get_by_role("button", name="Send").click()
            case "void":
                page.get_by_role("button", name="Next").click()
            case _:
                page.get_by_role("button", name="Begin").click()
        wait_until(page, f"{SCREEN} !== '{screen}'")
    return screens


@pytest.mark.real_time
def test_a_person_with_a_mouse_gets_through_the_study_by_what_the_page_shows(browser: Browser, tmp_path: Path):
    plan = pilot_plan(tmp_path / "plan.toml", devices='["mouse"]', patience=60, practice=60, repetitions=1)
    out = tmp_path / "study"
    with served(plan, out) as address, browser.new_page(viewport={"width": 1000, "height": 600}) as page:
        messages: list[str] = []
        page.on("pageerror", lambda error: messages.append(str(error)))
        hand = MouseHand(page)
        page.goto(address)
        to_round(page, "practice")
        screens = take_part(page, hand)
        assert screens[:4] == ["practice", "practising", "instruction", "round"]
        page.get_by_label("21 to 30").check()
        page.get_by_role("textbox").fill("it was a script")
        page.get_by_role("button", name="Send").click()
        at(page, "thanks")
        assert messages == []

    session = out / "participants" / "P01"
    rounds: Any = pd.read_csv(session / "rounds.csv")
    print(f"\n{rounds[FIGURES].to_string(index=False)}")
    assert rounds["round"].tolist() == list(range(1, 7))
    assert set(rounds["kind"]) == {"scripted pilot"}
    assert rounds["success"].sum() >= 4, rounds[["task", "behaviour", "reason"]].to_string()
    practice = json.loads((session / "practice.json").read_text(encoding="utf-8"))
    assert [r["name"] for r in practice["reached"]][:3] == ["+x", "-x", "+y"]
    for more in (["report", str(out)], ["export", str(out)], ["replay", str(out), "P01", "1", "--check"]):
        assert run_command("study", *more).status == 0
    answers: Any = pd.read_parquet(out / "answers.parquet")
    assert set(zip(answers["statement"], answers["value"], strict=True)) == {("S1", 7), ("S2", 3), ("S3", 9)}
    assert pd.read_csv(out / "questionnaire.csv")["comments"].tolist() == ["it was a script"]
