"""What watching a run costs it: runs with a page and without, in a real browser.

Run with `pytest tests/benchmarks/test_live_speed.py --benchmark-enable -s`. The browser draws by software, on the cores
of the run. CPU time is that of the run's own process: its page's server and the browser have theirs. A process takes
longer for the same where another one uses the cores' caches, memory and clock, so a run without a page is measured
beside a browser, too, that draws as often as a page does, but a paused run of which nothing comes: so much is the
browser's, as of any program that draws. What a run with a page costs more than that is its server's, which shares the
cores, too, and what reading its controls takes.
"""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, sync_playwright
from pytest_benchmark.fixture import BenchmarkFixture

pytestmark = pytest.mark.real_time

Waiter = Callable[[Page, str], None]

HANDOVER = (sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()")
FLAGS = ("--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
PACES = {"flyer_robot_to_human": "4", "helix_handover": "1"}
"""Of runs without cameras' pictures and with."""
DRAW_AS_A_RUN_DOES = "() => { setInterval(() => live.scene.show(Infinity), 1000 / 30); }"


def summary_of(out: Path) -> dict[str, Any]:
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


@contextmanager
def watched(wait_until: Waiter, scenario: str, out: Path, *given: str) -> Generator[Page, None, None]:
    """Run a scenario with a page open, until it ends."""
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("there is no chromium to look at pages with")
    command = [*HANDOVER, "run", scenario, "--live", "--no-report", "--out", str(out), *given]
    run = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, stdout=subprocess.DEVNULL)
    assert run.stderr is not None
    address = None
    while address is None:
        line = run.stderr.readline()
        assert line, "the run ended before it told its address"
        address = re.search(r"live: (http://\S+)", line)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page(viewport={"width": 1000, "height": 900})
        page.set_default_timeout(300_000)
        page.goto(address[1])
        page.wait_for_selector(".live")
        wait_until(page, "document.querySelector('.live').dataset.frames > 3")
        yield page
        wait_until(page, "document.querySelector('.live').dataset.ended")
        browser.close()
    run.communicate(timeout=300)


@pytest.mark.parametrize("scenario", PACES)
def test_what_a_page_costs_its_run(
    benchmark: BenchmarkFixture, tmp_path: Path, wait_until: Waiter, scenario: str
) -> None:
    """A run with a page, the same without, and without beside a browser that draws, paced alike and by turns."""
    given = ("--pace", PACES[scenario], "--stop", "20")
    found: dict[str, list[dict[str, Any]]] = {"alone": [], "beside a browser": [], "watched": []}

    def run_alone(out: Path) -> None:
        command = [*HANDOVER, "run", scenario, "--no-report", *given, "--out", str(out)]
        subprocess.run(command, check=False, capture_output=True)

    def measure() -> None:
        folder = tmp_path / str(len(found["alone"]))
        run_alone(folder / "alone")
        with watched(wait_until, scenario, folder / "paused", *given) as page:
            page.get_by_label("pause").click()
            page.get_by_label("go on").wait_for()
            page.evaluate(DRAW_AS_A_RUN_DOES)
            run_alone(folder / "beside a browser")
            page.locator("#stop").click()
        with watched(wait_until, scenario, folder / "watched", *given):
            pass
        for name, summaries in found.items():
            summaries.append(summary_of(folder / name))

    benchmark.pedantic(measure, rounds=3 if benchmark.enabled else 1)
    cpu = {name: np.array([s["cpu_seconds"] for s in summaries]) for name, summaries in found.items()}
    shares = {name: [100.0 * s["pace"]["share"] for s in summaries] for name, summaries in found.items()}
    late = {name: float(np.median(of_name)) for name, of_name in shares.items()}
    print()
    for other in ("alone", "beside a browser"):
        ratios = cpu["watched"] / cpu[other]
        ratio, each = float(np.median(ratios)), [round(float(r), 3) for r in ratios]
        print(f"CPU time of a run with a page, over that without, {other}: {ratio:.3f} (each: {each})")
        benchmark.extra_info[f"over {other}"] = ratio
    told = ", ".join(f"{share:.1f} % {name}" for name, share in late.items())
    print(f"{scenario}: deadlines missed at pace {PACES[scenario]}: {told}")
    benchmark.extra_info.update(late)
