"""Runs of the command with a live page, and the page in a browser."""

import re
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page

HANDOVER = (sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()")
LIVE = "document.querySelector('.live')"
TOLD = "document.querySelector('.replay-told').value"


@contextmanager
def live_run(
    out: Path, *more: str, scenario: str = "ir_grasp"
) -> Generator[tuple[str, "subprocess.Popen[str]"], None, None]:
    """Begin a run that waits for its page; yield the page's address and the run."""
    command = [*HANDOVER, "run", scenario, "--live", "--no-report", "--out", str(out), *more]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert run.stderr is not None
        address = None
        while address is None:
            line = run.stderr.readline()
            assert line, "the run ended before it told its address"
            address = re.search(r"live: (http://\S+)", line)
        yield address[1], run
    finally:
        if run.poll() is None:
            run.terminate()
        run.communicate(timeout=120)


@contextmanager
def shown(browser: Browser, address: str, *, has_touch: bool = False, script: str = "") -> Generator[Page, None, None]:
    """Open the page; a script runs before its own."""
    page = browser.new_page(viewport={"width": 1000, "height": 900}, has_touch=has_touch)
    page.add_init_script(script)
    page.set_default_timeout(120_000)
    messages: list[str] = []
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(address)
    page.wait_for_selector(".live")  # before that, a page that loads itself again until the run has begun
    try:
        yield page
        assert messages == []
    finally:
        page.close()
