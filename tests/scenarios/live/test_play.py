"""`handover play`: a change begins a run anew, verdicts stand side by side, each run is that of its command."""

import importlib
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from native_units import native_fmu
from opened_page import wait_until
from playwright.sync_api import Browser, Page
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from handover.cosim.fmu.file.archive import FmuArchive, write_archive
from handover.cosim.record.reader import Record
from handover.scenarios.cli.command import main

HANDOVER = (sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()")
LIVE = "document.querySelector('.live')"
OWN = '''
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.units import Second
from handover.cosim.system.system import System
from handover.scenarios.execution.file_experiment import UntilStop
from handover.scenarios.experiment.experiment import Experiment


@dataclass(frozen=True, kw_only=True)
class Parameters:
    long: Second = parameter(2.0, "how long it lasts", minimum=0.5, maximum=10.0)


class Pushing(Experiment[UntilStop]):
    """a push into the void"""

    parameters_type = Parameters
    units = {"push": "Push"}

    def build(self, parameters, seed, fmu):
        s = System()
        s.add("push", fmu("push"))
        return s

    def stop_time(self, parameters):
        return Fraction(parameters.long)

    def evaluator(self, parameters):
        return UntilStop(self.stop_time(parameters))
'''


@contextmanager
def played(
    subject: str, out: Path, *more: str, folder: Path | None = None
) -> Generator[tuple[str, "subprocess.Popen[str]"], None, None]:
    """Begin a session; yield its page's address and the command."""
    command = [*HANDOVER, "play", subject, "--out", str(out), *more]
    session = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder)
    try:
        assert session.stderr is not None
        address = re.search(r"play: (http://\S+)", session.stderr.readline())
        assert address is not None
        yield address[1], session
    finally:
        if session.poll() is None:
            session.terminate()
        session.communicate(timeout=120)


@contextmanager
def shown(browser: Browser, address: str, width: int = 1400, height: int = 900) -> Generator[Page, None, None]:
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(120_000)
    messages: list[str] = []
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(address)
    try:
        yield page
        assert messages == []
    finally:
        page.close()


def begun(page: Page, number: int) -> None:
    wait_until(page, f"{LIVE}.dataset.begun >= {number} && !{LIVE}.dataset.ended")


def ended(page: Page, rows: int) -> None:
    """Wait until the run that is shown has ended, and as many rows stand in the table."""
    over = "[...document.querySelectorAll('#runs tbody tr')].every(row => row.dataset.state !== 'under way')"
    count = f"document.querySelectorAll('#runs tbody tr').length === {rows}"
    wait_until(page, f"{LIVE}.dataset.ended && {count} && {over}")


def changed(page: Page) -> list[str]:
    return page.locator("#runs td.set").all_inner_texts()


@pytest.mark.slow
def test_a_slider_begins_a_run_anew_and_each_run_is_that_of_its_command(browser: Browser, tmp_path: Path):
    with played("flyer_impedance", tmp_path / "runs", "--pace", "0.5") as (address, session):
        with shown(browser, address) as page:
            begun(page, 1)
            wait_until(page, f"{LIVE}.dataset.frames > 3")
            where = page.evaluate("live.scene.viewpoint()")
            page.get_by_label("force, slider", exact=True).fill("12")
            begun(page, 2)
            there = page.evaluate("live.scene.viewpoint()")
            assert all(there[name] == pytest.approx(where[name], abs=1e-6) for name in where)
            assert page.locator("#field-force").input_value() == "12"
            page.locator("#pace").select_option("0")
            ended(page, 2)
            command = page.locator("#command code").inner_text()
            page.locator("#field-behaviour").select_option("compliant")
            begun(page, 3)
            ended(page, 3)
            assert changed(page) == ["behaviour = compliant, force = 12", "force = 12", "nothing"]
            states = page.locator("#runs tbody tr").evaluate_all("rows => rows.map(row => row.dataset.state)")
            assert states[1:] == ["succeeded", "ended by a change"]
            with shown(browser, address) as reopened:
                wait_until(reopened, f"{LIVE}.dataset.ended && {LIVE}.dataset.frames > 0")
            errors = page.locator("#runs td[data-label='greatest position error']").all_inner_texts()
            assert float(errors[0].split()[0]) > 1.2 * float(errors[1].split()[0])  # the compliant robot yields more
        session.send_signal(signal.SIGINT)
        assert "3 runs in" in session.communicate(timeout=60)[1]
        assert session.returncode == 0
    assert command == "handover run flyer_impedance -p force=12"
    again = [*shlex.split(command)[1:], "--no-report", "--out", str(tmp_path / "again")]
    subprocess.run([*HANDOVER, *again], check=True, capture_output=True)
    own, others = (pq.read_table(tmp_path / name / "signals.parquet") for name in ("runs/002", "again"))
    assert own.equals(others)
    assert (tmp_path / "runs/002/signals.parquet").read_bytes() == (tmp_path / "again/signals.parquet").read_bytes()


@pytest.mark.slow
def test_what_is_refused_is_told_beside_its_parameter_and_the_run_goes_on(browser: Browser, tmp_path: Path):
    with played("flyer_robot_to_human", tmp_path / "runs") as (address, _), shown(browser, address, 1280) as page:
        begun(page, 1)
        page.locator("#field-strength").fill("50")
        fault = page.locator("[data-name=strength] .fault")
        fault.wait_for()
        assert fault.inner_text() == "strength: 50.0 is out of range: from 0.1 to 20 N"
        assert page.locator("#fault").inner_text() == "No run was begun: see strength"
        right = "part => Math.round(part.getBoundingClientRect().right)"
        edges = [page.locator(part).evaluate(right) for part in (".play-head", "#fault", "#defaults", "#groups")]
        assert len(set(edges)) == 1
        frames = page.evaluate(f"Number({LIVE}.dataset.frames)")
        wait_until(page, f"{LIVE}.dataset.frames > {frames}")
        page.locator("[data-name=p_WG_handover] input[type=number]").nth(1).fill("0.9")
        page.locator("[data-name=strength] .reset").click()  # the later one: alone it would begin a run
        out_of_reach = page.locator("[data-name=p_WG_handover] .fault")
        out_of_reach.wait_for()
        assert "out of the person's reach" in out_of_reach.inner_text()
        assert fault.is_hidden()
        assert page.evaluate(f"{LIVE}.dataset.begun") == "1"
        for seed, why in (
            ("-1", "-1 is out of range: a whole number from 0 to 9007199254740991"),
            ("1.5", "1.5 is no whole number: one from 0 to 9007199254740991 is right"),
            ("1e30", "1e30 is out of range: a whole number"),
            ("", "it is no number: a whole number"),
        ):
            page.locator("#seed").fill(seed)
            page.get_by_text(f"seed: {why}").wait_for()
            assert page.locator("#fault").inner_text() == "No run was begun: see p_WG_handover, seed"
        page.get_by_role("button", name="another seed").click()
        assert page.locator("#seed").input_value() == "1"
        page.locator("#seed-fault").wait_for(state="hidden")
        assert page.locator("#told").inner_text() == ""
        page.locator("#search").fill("nozzle stuck")
        found = page.locator(".field[data-name]:visible").evaluate_all("all => all.map(f => f.dataset.name)")
        assert found == ["stuck_nozzle", "thrusters.flapper_range"]


BEYOND = """[...document.querySelectorAll("body *")]
  .filter(part => document.documentElement.scrollWidth > innerWidth)
  .filter(part => part.getBoundingClientRect().right > innerWidth + 1)
  .map(part => `${part.tagName} ${part.id} ${part.className.baseVal ?? part.className}`).slice(0, 12)"""
"""What makes a page wider than its window."""


@pytest.mark.slow
def test_a_run_is_shown_again_and_gets_a_report(browser: Browser, tmp_path: Path):
    with played("ir_grasp", tmp_path / "runs", "-p", "strategy=blind", "--pace", "100") as (address, _):
        with shown(browser, address, 390, 844) as page:
            begun(page, 1)
            ended(page, 1)
            assert page.locator("#field-strategy").input_value() == "blind"
            last = page.evaluate("live.scene.points('palm')")
            page.locator("#pace").select_option("1")
            page.get_by_role("button", name="show again").click()
            begun(page, 2)
            wait_until(page, f"{LIVE}.dataset.frames > 3")
            assert page.evaluate("live.scene.points('palm')") != last
            page.get_by_role("button", name="write a report").click()
            link = page.get_by_role("link", name="open the report")
            link.wait_for()
            assert page.evaluate(BEYOND) == []
            with page.context.expect_page() as opened:
                link.click()
            opened.value.wait_for_selector("html[data-drawn]", state="attached")
            assert opened.value.title().startswith("ir_grasp")
            opened.value.close()
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"{address}report/2")


@pytest.mark.slow
def test_an_ssp_and_an_own_scenario_are_played_with(browser: Browser, tmp_path: Path):
    export = [*HANDOVER, "export", "flyer_impedance", "--ssp", str(tmp_path / "x.ssp")]
    subprocess.run(export, check=True, capture_output=True)
    (tmp_path / "pushing.py").write_text(OWN)
    for subject, field, value in (("x.ssp", "push.force", "8"), ("pushing:Pushing", "long", "1")):
        out = tmp_path / f"runs_of_{field}"
        more = ("--stop", "2") if subject == "x.ssp" else ()
        session = played(subject, out, *more, "--pace", "50", folder=tmp_path)
        with session as (address, _), shown(browser, address) as page:
            ended(page, 1)
            page.evaluate(f"document.getElementById('field-{field}').closest('details').open = true")
            page.locator(f"[id='field-{field}']").fill(value)
            begun(page, 2)
            ended(page, 2)
            page.locator("#plots h3").first.scroll_into_view_if_needed()
            wait_until(page, "document.querySelectorAll('#plots .js-plotly-plot').length > 0")
            assert changed(page) == [f"{field} = {value}", "nothing"]
        assert json.loads((out / "002" / "summary.json").read_text(encoding="utf-8"))["success"]


def test_the_readmes_session_refuses_who_is_not_the_page_and_what_is_no_command(tmp_path: Path):
    readme = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    (scenario,) = re.findall(r"^\.venv/bin/handover play (\w+)$", readme, re.MULTILINE)
    with played(scenario, tmp_path / "runs") as (address, _):
        host = address.removeprefix("http://").rstrip("/")
        with pytest.raises(urllib.error.HTTPError, match="400"):
            urllib.request.urlopen(urllib.request.Request(address, headers={"Host": "elsewhere.example"}))
        with pytest.raises(InvalidStatus, match="403"):
            connect(f"ws://{host}/run", open_timeout=60.0, origin="http://elsewhere.example")  # type: ignore
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"{address}report/../../etc/passwd")
        with connect(f"ws://{host}/run", open_timeout=60.0, origin=f"http://{host}") as page:  # type: ignore
            for value, why in (
                ('"all"', "set takes"),
                ('{"parameters": {"secret": "1"}}', "set takes"),
                ('{"parameters": {"force": 3}}', "set takes"),
                ('{"parameters": {}, "seed": -1}', "set takes"),
                ('{"parameters": {}, "out": "/tmp"}', "set takes"),
            ):
                page.send(f'{{"command": "set", "value": {value}}}')
                assert why in refusal(page)
            for name in ("show", "report"):
                page.send(json.dumps({"command": name, "value": 7}))
                assert "number of a run that is over" in refusal(page)


def refusal(page: ClientConnection) -> str:
    while True:
        got = page.recv(timeout=60)
        if isinstance(got, str) and "refused" in (content := json.loads(got)):
            return str(content["refused"])


def test_a_run_ends_where_its_session_is_killed(tmp_path: Path):
    with played("flyer_impedance", tmp_path / "runs", "--pace", "0.1") as (address, session):
        host = address.removeprefix("http://").rstrip("/")
        with connect(f"ws://{host}/run", open_timeout=60.0, origin=f"http://{host}") as page:  # type: ignore
            while not isinstance(page.recv(timeout=60), bytes):  # until the first frame
                pass
            os.kill(session.pid, signal.SIGKILL)
        summary, late = tmp_path / "runs" / "001" / "summary.json", time.monotonic() + 60
        while not summary.exists():
            assert time.monotonic() < late
            time.sleep(0.1)
        assert json.loads(summary.read_text(encoding="utf-8"))["reason"].startswith("interrupted")


@pytest.mark.slow
def test_a_run_that_is_killed_is_told_as_lost_and_a_lost_session_offers_nothing(browser: Browser, tmp_path: Path):
    out = tmp_path / "runs"
    with played("flyer_impedance", out, "--pace", "0.2") as (address, session), shown(browser, address) as page:
        wait_until(page, f"{LIVE}.dataset.frames > 3")
        min(psutil.Process(session.pid).children(), key=psutil.Process.create_time).kill()  # later ones wait
        page.locator("#runs").get_by_text(f"lost: its process has ended; what it recorded is in {out}").wait_for()
        assert page.locator(".verdict").inner_text().startswith("No verdict: its process has ended; ")
        session.kill()
        page.get_by_text("The connection to the session is lost: its command has ended").wait_for()
        assert page.get_by_role("button", name="run again").is_disabled()


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (("nothing",), "no scenario 'nothing'"),
        (("flyer_impedance", "-p", "force=1e9"), "out of range: from -50 to 50 N"),
        (("flyer_impedance", "--step", "1"), "--step is for an SSP or an FMU"),
    ],
)
def test_a_session_that_cannot_begin_is_refused_in_a_line(given: tuple[str, ...], why: str, tmp_path: Path):
    done = subprocess.run(
        [*HANDOVER, "play", *given], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 2
    assert why in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_step_that_is_taken_is_said_before_a_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    made = FmuArchive(fmu := native_fmu("mass", 2))
    files = {name: made.read(name) for name in made.names if not name.endswith("/")}
    files["modelDescription.xml"] = files["modelDescription.xml"].replace(b' stepSize="0.01"', b"")
    assert files["modelDescription.xml"] != made.description(), fmu

    async def served(_: object) -> None:
        pass

    monkeypatch.setattr(importlib.import_module("handover.scenarios.cli.play"), "_serve", served)
    file = write_archive(tmp_path / "mass.fmu", files)
    result = CliRunner().invoke(main, ["play", str(file), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert "0.002 s is taken, a 500th of its default experiment" in result.stderr


@pytest.mark.slow
def test_a_push_moves_the_robot_a_compliant_one_farther_and_is_played_back(browser: Browser, tmp_path: Path):
    with (
        played("flyer_impedance", tmp_path / "runs", "-p", "begin=30") as (address, _),
        shown(browser, address) as page,
    ):
        begun(page, 1)
        moved: list[float] = []
        for number, change in (
            (2, lambda: page.locator("#push").check()),
            (3, lambda: page.locator("#field-behaviour").select_option("compliant")),
        ):
            change()  # one at a time: of two, far enough apart on a loaded machine, each begins a run
            begun(page, number)
            wait_until(page, f"{LIVE}.dataset.frames > 3")
            assert page.locator("#push-help").is_visible()
            moved.append(dragged(page))
            passed(page, 0.3)
        assert moved[0] > 0.01
        assert moved[1] > 1.2 * moved[0]
        page.locator("#stop").click()
        ended(page, 3)
        assert page.locator("#push-help").is_hidden()
        assert "somebody pushed the robot by hand, with up to" in page.locator("#runs .reason").all_inner_texts()[0]
        assert page.locator("#runs .reason").first.evaluate("cell => cell.offsetWidth") >= 350
        assert f"--push --inputs-from {tmp_path}" in page.locator("#command code").inner_text()
        page.locator("#again").click()
        begun(page, 4)
        page.locator("#stop").click()
        ended(page, 4)
        assert ["pushed by hand" in text for text in changed(page)] == [False, True, True, False]
        assert page.locator("#command code").inner_text().endswith("_impedance -p behaviour=compliant -p begin=30")
    rigid = Record(tmp_path / "runs/002/signals.parquet")
    force = np.linalg.norm(rigid["robot.f_P"], axis=1)
    assert 0.5 < force.max() <= 5.0
    assert force[-1] == 0.0
    (pushed,) = np.unique(rigid["robot.p_BP"][force > 0.0], axis=0)
    assert np.abs(pushed).max() == pytest.approx(0.16, abs=0.02)  # on the cube's surface
    again = ("run", "flyer_impedance", "-p", "begin=30", "--push", "--inputs-from", str(tmp_path / "runs/002"))
    stop = ("--stop", str(rigid.time[-1]), "--no-report", "--out", str(tmp_path / "again"))
    subprocess.run([*HANDOVER, *again, *stop], check=False, capture_output=True)
    played_back = Record(tmp_path / "again/signals.parquet")
    rows = len(rigid.time)
    assert all(np.array_equal(played_back[name][:rows], rigid[name]) for name in rigid.signals)


def passed(page: Page, seconds: float) -> None:
    """Wait until so much simulated time has passed, s."""
    now = "parseFloat(document.querySelector('.replay-told').value)"
    since = float(page.evaluate(now))
    wait_until(page, f"{now} > {since + seconds}")


@pytest.mark.slow
def test_the_command_of_a_run_whose_hand_is_led_plays_its_inputs_back(browser: Browser, tmp_path: Path):
    given = ("-p", "hand=outside", "--stop", "1", "--pace", "2")
    with played("flyer_robot_to_human", tmp_path / "runs", *given) as (address, _), shown(browser, address) as page:
        ended(page, 1)
        assert page.locator("#command code").inner_text().endswith(f"--inputs-from {tmp_path}/runs/001")


def dragged(page: Page) -> float:
    """Press on the robot and drag; return how far it has moved until it is released, m."""
    x, y = page.evaluate(
        """(() => {
            const {left, top} = document.querySelector(".replay-scene").getBoundingClientRect();
            const [x, y] = live.scene.toPixels(live.scene.toWorld("robot", [0, 0, 0]));
            return [left + x, top + y];
        })()"""
    )
    before = np.array(page.evaluate("live.scene.points('robot')")).mean(axis=0)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 80, y)
    page.mouse.move(x + 100, y - 30)
    page.locator(".push-arrow").wait_for()
    passed(page, 0.8)
    after = np.array(page.evaluate("live.scene.points('robot')")).mean(axis=0)
    page.mouse.up()
    return float(np.linalg.norm(after - before))
