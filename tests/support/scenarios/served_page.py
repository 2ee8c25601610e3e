"""The page of a study that the command serves in a process of its own, and the way through it to the first round."""

import re
import signal
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page

from handover.scenarios.study.plan.plan import default_plan
from handover.scenarios.study.session.server import page_words
from support.live_pages import page_command
from support.opened_page import wait_until

_ABOUT_TASKS = r'^\[tasks\.(?:{0})\]\nscenario = [^\n]*\n|^(?:{0}) = (?:""".*?"""|"[^"\n]*")\n'


def pilot_plan(
    path: Path, *, devices: str, patience: float, practice: float = 0, repetitions: int = 1, people: int = 1,
    without: str = "",
) -> Path:  # fmt: skip
    """Write the plan of scripted pilots: whatever leads the hand in tests is not a person. `without`: tasks, by `|`."""
    text = default_plan()
    if without:
        text = re.sub(_ABOUT_TASKS.format(without), "", text, flags=re.MULTILINE | re.DOTALL)
    for name, value in {
        "pilot": "true",
        "participants": people,
        "repetitions": repetitions,
        "practice": practice,
        "devices": devices,
    }.items():
        text = re.sub(rf"^{name} = .*$", f"{name} = {value}", text, count=1, flags=re.MULTILINE)
    path.write_text(f"{text}\n[parameters]\npatience = {patience}\n", encoding="utf-8")
    return path


@contextmanager
def served(plan: Path, out: Path, *more: str) -> Generator[str, None, None]:
    """Serve a study, and yield the address of its page."""
    with page_command("study", "serve", plan, "--out", out, *more) as (address, server):
        yield address
        server.send_signal(signal.SIGINT)
        done = server.wait()
        assert "Traceback" not in done.errors, done.errors


def at(page: Page, screen: str) -> None:
    """Wait for a screen of the protocol."""
    wait_until(page, f"document.querySelector('.study').dataset.screen === '{screen}'")


def to_round(page: Page, first: str = "instruction", device: str = "Mouse and keyboard", language: str = "en") -> None:
    """Go through the page from its opening to the screen after the choice of a device."""
    words = page_words()[language]
    at(page, "language")
    page.locator(f".study-choice[lang={language}]").click()
    at(page, "consent")
    page.get_by_role("button", name=words["agree"], exact=True).click()
    at(page, "eligibility")
    assert page.get_by_role("button", name=words["eligibility_all"]).is_disabled()
    for box in page.get_by_role("checkbox").all():
        box.check()
    page.get_by_role("button", name=words["eligibility_all"]).click()
    at(page, "device")
    page.get_by_role("button", name=device).click()
    at(page, first)
