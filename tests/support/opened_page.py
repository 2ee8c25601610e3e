"""A browser, and a page in it; errors on its console and network requests fail the test."""

import os
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, sync_playwright

_FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
"""No network, no screen; space is drawn by software."""
_OF_DRIVERS = ("[.WebGL-", "Canvas2D: Multiple readback")
"""How messages begin that a browser which draws by software has for any page with pictures of space."""

_PATIENCE = 300_000
"""ms; other tests may be using all of the machine."""


@contextmanager
def launched(*more: str) -> Generator[Browser, None, None]:
    """Launch Chromium, with more of its flags; skip the test where there is none."""
    chromium = shutil.which("chromium")
    if chromium is None:
        assert "CI" not in os.environ, "there is no chromium to look at pages with"
        pytest.skip("there is no chromium to look at pages with")
    with sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=chromium, args=[*_FLAGS, *more])
        try:
            yield made
        finally:
            made.close()


@contextmanager
def opened(
    browser: Browser, file: Path, width: int = 1400, scheme: Literal["light", "dark"] = "light"
) -> Generator[Page, None, None]:
    """Open a file and wait until its figures are drawn; in the end, fail if a message came or a request went out."""
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    messages: list[str] = []
    requests: list[str] = []

    def note(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning") and not message.text.startswith(_OF_DRIVERS):
            messages.append(message.text)

    def ask(request: Request) -> None:
        if not request.url.startswith(("data:", "blob:")):
            requests.append(request.url)

    page.on("console", note)
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.on("request", ask)
    try:
        page.set_default_timeout(_PATIENCE)
        page.goto(file.as_uri(), wait_until="commit")
        page.wait_for_selector("html[data-drawn]", state="attached")
        yield page
        assert messages == []
        assert requests == [file.as_uri()]
    finally:
        page.close()


def overflow(page: Page) -> int:
    """Return by how many pixels a page is wider than its window."""
    return page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")


def wait_until(page: Page, condition: str) -> None:
    """Wait until a JavaScript expression is true; fail after long.

    Playwright's own `wait_for_function` compiles code in the page, which the page forbids.
    """
    page.evaluate(
        f"""new Promise((done, fail) => {{
            const late = performance.now() + {_PATIENCE};
            const look = () => {{
                if ({condition}) done();
                else if (performance.now() > late) fail(new Error("it never came true"));
                else requestAnimationFrame(look);
            }};
            look();
        }})"""
    )
