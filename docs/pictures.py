"""Makes the pictures of README and site anew, of runs of today: `make pictures`. Needs what tests need, and chromium.

Those of published experiments take their whole campaigns, up to an hour; `python docs/pictures.py NAME...` makes some.

Whoever changes what a figure or the report looks like runs it, looks at the pictures, and commits them.
"""

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from playwright.sync_api import Browser, sync_playwright

DOCS = Path(__file__).parent

FIGURES: Mapping[str, tuple[str, str]] = {
    "helix_handover.jpg": ("helix_handover", "pictures"),
    "vsl_hybrid.png": ("vsl_hybrid", "shape"),
    "flyer_robot_to_human.png": ("flyer_robot_to_human", "scene"),
    "ir_grasp.png": ("ir_grasp", "scene"),
}
"""Scenario and figure that a picture shows; the first seed's run, with the scenario's defaults."""
EXPERIMENTS: Mapping[str, tuple[str, str]] = {
    "flyer_ratio.png": ("flyer-impedance", "ratio"),
    "flyer_strength.png": ("flyer-handover", "strength"),
    "helix_errors.png": ("helix-1", "errors"),
    "helix_workspace.png": ("helix-workspace", "workspace"),
}
"""Published experiment and figure that a picture shows."""
FILM, FILM_OPTIONS = "helix_handover.gif", ("--size", "640x360", "--pace", "4", "--fps", "8")
"""The film of `helix_handover`, with its options."""
REPORT = "report.jpg"
"""The report page of `helix_handover`, on a desk and on a phone."""

Pixels = NDArray[np.uint8]

_JPEG = (cv2.IMWRITE_JPEG_QUALITY, 90)
_WIDTH, _HEIGHT = 1400, 1350
"""Width of the picture of the handover, and height of the report's, px."""
_FLAGS = ("--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_BACKGROUND = (237, 229, 222)  # blue green red
_EDGE = 24
"""Around the pictures of the page, px."""


def main() -> None:
    """Make the runs and campaigns of the pictures that are asked for, or of all, and write the pictures."""
    every = {REPORT: ("helix_handover", ""), FILM: ("helix_handover", ""), **FIGURES, **EXPERIMENTS}
    wanted = sys.argv[1:] or list(every)
    if unknown := set(wanted) - set(every):
        sys.exit(f"no picture of README and site: {', '.join(sorted(unknown))}; there are {', '.join(every)}")
    with tempfile.TemporaryDirectory(prefix="handover-") as folder:
        for name in wanted:
            source, figure = every[name]
            made = Path(folder) / source
            if not made.exists():
                _handover("paper" if name in EXPERIMENTS else "run", source, "--out", made)
            if name == FILM:
                _handover("film", made, "--out", DOCS / name, "--force", *FILM_OPTIONS)
            elif name == REPORT:
                _draw_report(made / "report.html", DOCS / REPORT)
            else:
                _copy(made / "figures" / f"{figure}.png", DOCS / name)


def _handover(*arguments: str | Path) -> None:
    call = "from handover.scenarios.cli.command import main; main()"
    subprocess.run([sys.executable, "-c", call, *map(str, arguments)], check=True)


def _copy(figure: Path, to: Path) -> None:
    if to.suffix == ".png":
        shutil.copyfile(figure, to)
        return
    pixels = np.asarray(cv2.imread(str(figure)), dtype=np.uint8)
    height = round(pixels.shape[0] * _WIDTH / pixels.shape[1])
    cv2.imwrite(str(to), cv2.resize(pixels, (_WIDTH, height), interpolation=cv2.INTER_AREA), _JPEG)


def _draw_report(page: Path, to: Path) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit(f"{to.name} is not made: there is no chromium on the path")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=_FLAGS)
        desk = _shown(browser, page, 1150, "light", "section:not(#time, #replay), #time h3 ~ h3, #time .plot ~ .plot")
        phone = _shown(browser, page, 430, "dark", "section:not(#replay, #pictures)")
        browser.close()
    high = desk.shape[0] + 2 * _EDGE
    width = desk.shape[1] + phone.shape[1] + 3 * _EDGE
    canvas = np.full((high, width, 3), _BACKGROUND, dtype=np.uint8)
    canvas[_EDGE : _EDGE + desk.shape[0], _EDGE : _EDGE + desk.shape[1]] = desk
    canvas[_EDGE : _EDGE + phone.shape[0], -_EDGE - phone.shape[1] : -_EDGE] = phone
    cv2.imwrite(str(to), canvas, _JPEG)


def _shown(browser: Browser, file: Path, width: int, scheme: Any, hidden: str) -> Pixels:
    """Return a page as a browser shows it half way through the replay, without what is to be hidden."""
    page = browser.new_page(viewport={"width": width, "height": _HEIGHT}, color_scheme=scheme)
    page.set_default_timeout(120_000)
    page.goto(file.as_uri(), wait_until="commit")
    page.wait_for_selector("html[data-drawn]", state="attached")
    page.add_style_tag(content=f"{hidden} {{ display: none }}")
    page.evaluate("""() => {
        const slider = document.querySelector(".replay-time");
        slider.value = Math.round(slider.max * 0.43);
        slider.dispatchEvent(new Event("input"));
    }""")
    page.wait_for_timeout(3000)
    seen = np.frombuffer(page.screenshot(), dtype=np.uint8)
    page.close()
    return np.asarray(cv2.imdecode(seen, cv2.IMREAD_COLOR), dtype=np.uint8)


if __name__ == "__main__":
    main()
