"""Makes the pictures of README and site, of this version's runs: `make pictures`. Needs what tests need, and chromium.

Those of published experiments take their whole campaigns, up to an hour; `PYTHONPATH=tests python docs/pictures.py
NAME...` makes some. After a change of what a figure or the report looks like, run it, look at the pictures, and commit
them with `pictures.json`, which says what they were made of. `check` finds those that are older than what they show.
"""

import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from support.kept_runs import kept_run

from handover.scenarios.published.catalog import EXPERIMENTS as PUBLISHED

if TYPE_CHECKING:
    from playwright.sync_api import Browser

DOCS = Path(__file__).parent
MADE_OF = DOCS / "pictures.json"
"""By picture, what it was made of."""

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


_EVERY = {REPORT: ("helix_handover", ""), FILM: ("helix_handover", ""), **FIGURES, **EXPERIMENTS}
_LOOKS: Mapping[str, tuple[str, ...]] = {REPORT: ("*.css", "*.html"), FILM: ("film/*",)}
"""Files of the report's pages that make what these two look like."""
_ALIKE, _DIFFERENT = 0.1, 4.0
"""Relative difference of a metric, and mean difference of two figures' levels, from which on a picture is old. Runs
of other machines, whose arithmetic differs in the last bits, differ by less."""


class OldPictures(ValueError):
    """Committed pictures that are older than what they show."""


def check() -> None:
    """Compare the pictures with the runs that are kept of this version.

    Raises:
        OldPictures: some show what is no longer so; it names them and the command that makes them.
    """
    made_of = json.loads(MADE_OF.read_text(encoding="utf-8"))
    old = [name for name in _EVERY if not _is_of(made_of.get(name, {}), _sources(name)) or _differs(name)]
    if old:
        raise OldPictures(f"older than what they show: PYTHONPATH=tests python docs/pictures.py {' '.join(old)}")


def _sources(name: str) -> dict[str, Any]:
    """Return what a picture follows from: metrics of a run of its scenario, an experiment's plan, a page's style."""
    source, _ = _EVERY[name]
    sources: dict[str, Any] = {}
    if name in EXPERIMENTS:
        plan, source = PUBLISHED[source]().plan(quick=False), PUBLISHED[source].scenario
        sources["plan"] = _digest(repr((plan.points, plan.fixed, plan.repetitions, plan.seed)).encode())
    if name in _LOOKS:
        pages = DOCS.parent / "scenarios" / "runs" / "reporting" / "page"
        sources["look"] = _digest(b"".join(f.read_bytes() for p in _LOOKS[name] for f in sorted(pages.glob(p))))
    metrics = json.loads((kept_run("run", source) / "summary.json").read_text(encoding="utf-8"))["metrics"]
    costs = ("cpu_", "pace_", "peak_memory")
    return {**sources, "metrics": {n: m["value"] for n, m in metrics.items() if not n.startswith(costs)}}


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _is_of(made_of: Mapping[str, Any], now: Mapping[str, Any]) -> bool:
    """Return whether a picture was made of what there is, with metrics that are alike."""
    then, metrics = made_of.get("metrics", {}), now["metrics"]
    return (
        {**made_of, "metrics": 0} == {**now, "metrics": 0}
        and then.keys() == metrics.keys()
        and all(np.isclose(then[n] or 0.0, metrics[n] or 0.0, rtol=_ALIKE, atol=1e-3) for n in metrics)
    )


def _differs(name: str) -> bool:
    """Return whether a scenario's figure is another one than the picture."""
    if name not in FIGURES:
        return False
    source, figure = FIGURES[name]
    files = (DOCS / name, kept_run("run", source) / "figures" / f"{figure}.png")
    seen = [np.asarray(cv2.imread(str(f)), dtype=np.float64) for f in files]
    shapes = [s.shape[0] / s.shape[1] for s in seen]
    small = [cv2.resize(s, (200, 200), interpolation=cv2.INTER_AREA) for s in seen]
    return not np.isclose(*shapes, rtol=0.02) or float(np.mean(np.abs(small[0] - small[1]))) > _DIFFERENT


def main() -> None:
    """Make the runs and campaigns of the pictures that are asked for, or of all, and write the pictures."""
    wanted = sys.argv[1:] or list(_EVERY)
    if unknown := set(wanted) - set(_EVERY):
        sys.exit(f"no picture of README and site: {', '.join(sorted(unknown))}; there are {', '.join(_EVERY)}")
    made_of = json.loads(MADE_OF.read_text(encoding="utf-8")) if MADE_OF.exists() else {}
    with tempfile.TemporaryDirectory(prefix="handover-") as folder:
        for name in wanted:
            source, figure = _EVERY[name]
            made = Path(folder) / source if name in EXPERIMENTS else kept_run("run", source)
            if not made.exists():
                _handover("paper", source, "--out", made)
            if name == FILM:
                _handover("film", made, "--out", DOCS / name, "--force", *FILM_OPTIONS)
            elif name == REPORT:
                _draw_report(made / "report.html", DOCS / REPORT)
            else:
                _copy(made / "figures" / f"{figure}.png", DOCS / name)
            made_of[name] = _sources(name)
            MADE_OF.write_text(json.dumps(made_of, indent=1, sort_keys=True) + "\n", encoding="utf-8")


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
    from playwright.sync_api import sync_playwright  # the check needs no browser

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


def _shown(browser: "Browser", file: Path, width: int, scheme: Any, hidden: str) -> Pixels:
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
