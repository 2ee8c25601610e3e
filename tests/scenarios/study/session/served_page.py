"""The page of a study that the command serves in a process of its own, and the way through it to the first round."""

import re
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from support.opened_page import wait_until
from playwright.sync_api import Page

from handover.scenarios.study.plan.plan import default_plan
from handover.scenarios.study.session.server import page_words

HANDOVER = (sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()")


def pilot_plan(path: Path, *, devices: str, patience: float, practice: float, repetitions: int) -> Path:
    """Write the plan of one scripted pilot: whatever leads the hand in tests is no person."""
    text = default_plan()
    for name, value in {
        "pilot": "true",
        "participants": 1,
        "repetitions": repetitions,
        "practice": practice,
        "devices": devices,
    }.items():
        text = re.sub(rf"^{name} = .*$", f"{name} = {value}", text, count=1, flags=re.MULTILINE)
    path.write_text(f"{text}\n[parameters]\npatience = {patience}\n", encoding="utf-8")
    return path


@contextmanager
def served(plan: Path, out: Path, *more: str) -> Generator[tuple[str, "subprocess.Popen[str]"], None, None]:
    """Serve a study, and yield the address of its page and the process."""
    command = [*HANDOVER, "study", "serve", str(plan), "--out", str(out), *more]
    server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        assert server.stderr is not None
        address = re.search(r"study: (http://\S+)", server.stderr.readline())
        assert address
        yield address[1], server
    finally:
        server.send_signal(signal.SIGINT)
        _, told = server.communicate(timeout=120)
        assert "Traceback" not in told, told


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
