"""Draws a film's page in Chromium without a window, by Playwright, and takes a screenshot of each frame."""

import base64
import os
import shutil
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, cast

from playwright.sync_api import Browser, Page, Playwright, sync_playwright
from playwright.sync_api import Error as PlaywrightError

from handover.cosim.exceptions import one_line
from handover.cosim.files import scratch_folder
from handover.cosim.python_process import environment_changed

_FLAGS = (
    "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
"""Space is drawn by software, which gives the same pictures on any machine."""
_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge", "microsoft-edge")
"""Of the system's own browsers."""
_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
"""Variables that name the folder of temporary files, on POSIX and on Windows."""
_PATIENCE = 300_000
"""How long the page may take to be drawn, or a frame of it, ms."""
_SCALES = (4.0, 3.0, 2.5, 2.0, 1.5, 1.25)
_DESIGN = (1280, 720)
"""Width and height that letters and lines are made for, px: what is larger by one of the scales is enlarged."""


class NoBrowser(RuntimeError):
    """There is no Chromium, or none that starts; the message says how to get one."""


class BrowserFailed(RuntimeError):
    """The browser ended, or could not draw the page."""


class Camera(Protocol):
    """Takes screenshots of a film's page."""

    def __call__(self, t: float) -> bytes:
        """Return what is seen at t, s, as PNG.

        Raises:
            BrowserFailed: the browser ended, or the page failed.
        """
        ...


def window_of(size: tuple[int, int]) -> tuple[tuple[int, int], float]:
    """Return the page's size and how many of the film's pixels one of its pixels has, for a film of a size."""
    for scale in _SCALES:
        page = tuple(n / scale for n in size)
        if all(p >= least and p.is_integer() for p, least in zip(page, _DESIGN, strict=True)):
            return (int(page[0]), int(page[1])), scale
    return size, 1.0


@contextmanager
def open_camera(html: str, size: tuple[int, int], *, dark: bool) -> Generator[Camera, None, None]:
    """Open a film's page, and give what takes screenshots of it, of so many pixels.

    Raises:
        NoBrowser: there is no Chromium.
        BrowserFailed: it could not draw the page.
    """
    window, scale = window_of(size)
    with scratch_folder("browser") as folder, _driver(folder) as playwright:
        browser = _launched(playwright)
        errors: list[str] = []
        with _browser_failures_raised(errors):
            page = browser.new_page(
                viewport={"width": window[0], "height": window[1]},
                device_scale_factor=scale,
                color_scheme="dark" if dark else "light",
            )
            page.set_default_timeout(_PATIENCE)
            page.on("pageerror", lambda error: errors.append(str(error)))
            page.set_content(html, wait_until="commit")
            page.wait_for_selector("html[data-drawn]", state="attached")
            if errors:
                raise BrowserFailed(f"the film's page failed in the browser: {errors[0]}")
            yield _camera(page, errors, window, scale)
        browser.close()


def _camera(page: Page, errors: Sequence[str], window: tuple[int, int], scale: float) -> Camera:
    """Return a camera that asks the browser itself, in less than half of the time of Playwright's screenshots."""
    session = page.context.new_cdp_session(page)
    whole = {"x": 0, "y": 0, "width": window[0], "height": window[1], "scale": scale}
    asked = {"format": "png", "optimizeForSpeed": True, "clip": whole}

    def take(t: float) -> bytes:
        with _browser_failures_raised(errors):
            page.evaluate("t => film.show(t)", t)
            return base64.b64decode(cast(dict[str, Any], session.send("Page.captureScreenshot", asked))["data"])

    return take


@contextmanager
def _driver(folder: Path) -> Generator[Playwright, None, None]:
    """Start Playwright's driver with a folder for what it leaves: the browsers' profiles and downloads.

    It takes the folder from this process's environment alone.
    """
    started = sync_playwright()
    with environment_changed(dict.fromkeys(_TEMPORARY, str(folder))):
        playwright = started.__enter__()
    try:
        yield playwright
    finally:
        started.__exit__()


def _launched(playwright: Playwright) -> Browser:
    """Return Playwright's own Chromium, else the system's.

    It keeps this process's folder for temporary files: there it makes, and removes, a socket, whose path must be short.
    """
    found = [None, *dict.fromkeys(path for name in _NAMES if (path := shutil.which(name)))]
    faults: list[str] = []
    for path in found:
        try:
            return playwright.chromium.launch(executable_path=path, args=_FLAGS, env={**os.environ})
        except PlaywrightError as e:
            if path is not None or "playwright install" not in str(e):
                faults.append(f"{path or 'that of Playwright'} does not start: {one_line(e)[:200]}")
    raise NoBrowser(
        f"{'; '.join(faults) or 'there is no Chromium to draw the film'}."
        " Cure: `python -m playwright install --with-deps chromium`; or the system's, on Debian"
        " `apt-get install chromium`"
    )


@contextmanager
def _browser_failures_raised(errors: Sequence[str]) -> Generator[None, None, None]:
    try:
        yield
    except PlaywrightError as e:
        raise BrowserFailed(f"the browser failed: {errors[0] if errors else one_line(e)[:300]}") from e
