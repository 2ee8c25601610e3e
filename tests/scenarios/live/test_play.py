"""`handover play`: a change begins a run anew, verdicts stand side by side, each run is that of its command."""

import json
import signal
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
import pytest
from playwright.sync_api import Browser, Page
from support.commands import Command, refusal, run_command
from support.kept_runs import kept_run
from support.live_pages import LIVE, connected, frame, frames_come, page_command, reported, send, shown, time_passes
from support.opened_page import overflow, wait_until
from support.processes import until
from support.scenarios.tutorial import SCENE, write_files
from support.served_live_page import answered
from support.wording import Wording

from handover.cosim.record.reader import Record


@contextmanager
def played(
    subject: str, out: Path, *more: str, folder: Path | None = None
) -> Generator[tuple[str, Command], None, None]:
    """Begin a session; yield its page's address and the command."""
    with page_command("play", subject, "--out", out, *more, cwd=folder) as begun:
        yield begun


def begun(page: Page, number: int) -> None:
    wait_until(page, f"{LIVE}.dataset.begun >= {number} && !{LIVE}.dataset.ended")


def ended(page: Page, rows: int) -> None:
    """Wait until the run that is shown has ended, and as many rows stand in the table."""
    over = "[...document.querySelectorAll('#runs tbody tr')].every(row => row.dataset.state !== 'under way')"
    count = f"document.querySelectorAll('#runs tbody tr').length === {rows}"
    wait_until(page, f"{LIVE}.dataset.ended && {count} && {over}")


def changed(page: Page) -> list[str]:
    return page.locator("#runs td.set").all_inner_texts()


def test_a_slider_begins_a_run_anew_and_a_run_is_that_of_its_command_is_shown_again_and_gets_a_report(
    browser: Browser, tmp_path: Path
):
    with played("flyer_impedance", tmp_path / "runs", "--pace", "0.05") as (address, session):
        with shown(browser, address) as page:
            begun(page, 1)
            frames_come(page)
            refusals_are_told_beside_their_fields(page)
            a_plot_of_choice_is_drawn_beside_the_scene(page)
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
            errors = page.locator("#runs td[data-label='greatest position error']").all_inner_texts()
            assert float(errors[0].split()[0]) > 1.2 * float(errors[1].split()[0])  # the compliant robot yields more

            page.set_viewport_size({"width": 390, "height": 844})
            last = page.evaluate("live.scene.points('robot')")
            page.locator("#pace").select_option("1")
            page.get_by_role("button", name="show again").first.click()
            begun(page, 4)
            frames_come(page)
            assert page.evaluate("live.scene.points('robot')") != last
            page.get_by_role("button", name="write a report").first.click()
            page.get_by_role("link", name="open the report").wait_for()
            assert overflow(page) <= 0
            assert answered(address, "/report/3")[1].startswith(b"<!doctype html>")
            assert answered(address, "/report/2")[0].status == 404
        session.send_signal(signal.SIGINT)
        done = session.wait()
        assert "3 runs in" in done.errors
        assert done.status == 0
    assert command == "handover run flyer_impedance -p force=12"
    again = kept_run("run", "flyer_impedance", "-p", "force=12", "--no-report") / "signals.parquet"
    assert (tmp_path / "runs/002/signals.parquet").read_bytes() == again.read_bytes()


def a_plot_of_choice_is_drawn_beside_the_scene(page: Page) -> None:
    titles = page.locator("#plot-choice option").all_inner_texts()
    page.locator("#plot-choice").select_option(titles[-1])
    wait_until(page, "document.querySelector('#plot-beside .main-svg') !== null")
    assert page.locator("#plot-beside h3").text_content() == titles[-1]
    assert page.locator("#plots h3").all_text_contents() == titles[:-1]


def refusals_are_told_beside_their_fields(page: Page) -> None:
    page.locator("#field-force").fill("60")
    fault = page.locator("[data-name=force] .fault")
    fault.wait_for()
    assert fault.inner_text() == "force: 60.0 is out of range: from -50 to 50 N"
    assert page.locator("#fault").inner_text() == "No run was begun: see force"
    for seed, why in (
        ("-1", "-1 is out of range: a whole number from 0 to 9007199254740991"),
        ("1.5", "1.5 is not a whole number: expected one from 0 to 9007199254740991"),
        ("1e30", "1e30 is out of range: a whole number"),
        ("", "expected a whole number"),
    ):
        page.locator("#seed").fill(seed)
        page.get_by_text(f"seed: {why}").wait_for()
        assert page.locator("#fault").inner_text() == "No run was begun: see force, seed"
    page.locator("#seed").fill("0")
    page.locator("#seed-fault").wait_for(state="hidden")
    assert page.evaluate(f"{LIVE}.dataset.begun") == "1"
    page.locator("#search").fill("nozzle stuck")
    found = page.locator(".field[data-name]:visible").evaluate_all("all => all.map(f => f.dataset.name)")
    assert found == ["stuck_nozzle", "thrusters.flapper_range"]
    page.locator("#search").fill("")


@pytest.mark.slow
def test_an_own_scenario_is_played_with(tmp_path: Path):
    write_files(tmp_path)
    with (
        played(SCENE, tmp_path / "runs", "--pace", "50", folder=tmp_path) as (address, _),
        connected(address) as page,
    ):
        assert "goal" in [f["name"] for group in reported(page, "fields")["groups"] for f in group["fields"]]
        reported(page, "ended")
        send(page, "set", {"parameters": {"goal": "0.4,0.3"}})
        rows = reported(page, "runs")["rows"]
        while [row["state"] for row in rows].count("succeeded") < 2:
            rows = reported(page, "runs")["rows"]
        assert sorted((row["number"], row["parameters"]) for row in rows) == [(1, {}), (2, {"goal": "0.4,0.3"})]
        for number in (1, 2, 1):  # at once
            send(page, "show", number)
        while reported(page, "runs")["seen"] != 1:
            pass
        send(page, "set", {"parameters": {"patience": "-1"}})
        assert "patience" in reported(page, "choice")["faults"]
    assert json.loads((tmp_path / "runs/002/summary.json").read_text(encoding="utf-8"))["success"]


@pytest.mark.slow
def test_a_run_ends_where_its_session_is_killed(tmp_path: Path):
    with played("flyer_impedance", tmp_path / "runs", "--pace", "0.1") as (address, session):
        with connected(address) as page:
            frame(page)
            session.send_signal(signal.SIGKILL)
        summary = tmp_path / "runs" / "001" / "summary.json"
        until(summary.exists, 300.0)
        assert json.loads(summary.read_text(encoding="utf-8"))["reason"].startswith("interrupted")


@pytest.mark.parametrize(
    "given",
    [
        pytest.param(("nothing",), id="no scenario"),
        pytest.param(("flyer_impedance", "-p", "force=1e9"), id="a parameter out of range"),
        pytest.param(("flyer_impedance", "--step", "1"), id="a step of a scenario"),
    ],
)
def test_a_session_that_cannot_begin_is_refused(
    given: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(tmp_path)
    wording.check(refusal("play", *given))
    assert list(tmp_path.iterdir()) == []


def test_a_push_moves_the_robot_and_is_played_back_and_what_is_killed_is_reported_as_lost(
    browser: Browser, tmp_path: Path
):
    out = tmp_path / "runs"
    with (
        played("flyer_impedance", out, "-p", "begin=30") as (address, session),
        shown(browser, address) as page,
    ):
        begun(page, 1)
        assert page.locator("#field-begin").input_value() == "30"
        page.locator("#push").check()
        begun(page, 2)
        frames_come(page)
        assert page.locator("#push-help").is_visible()
        assert dragged(page) > 0.01
        time_passes(page, 0.3)
        page.locator("#stop").click()
        ended(page, 2)
        assert page.locator("#push-help").is_hidden()
        assert "somebody pushed the robot by hand, with up to" in page.locator("#runs .reason").all_inner_texts()[0]
        assert f"--push --inputs-from {tmp_path}" in page.locator("#command code").inner_text()
        page.locator("#again").click()
        begun(page, 3)
        frames_come(page)
        running = min(psutil.Process(session.pid).children(), key=psutil.Process.create_time)  # later ones wait
        running.kill()
        page.locator("#runs").get_by_text(f"lost: its process has ended; what it recorded is in {out}").wait_for()
        assert page.locator(".verdict").inner_text().startswith("No verdict: its process has ended; ")
        assert ["pushed by hand" in text for text in changed(page)] == [False, True, False]
        assert page.locator("#command code").inner_text().endswith("_impedance -p begin=30")
        session.send_signal(signal.SIGKILL)
        page.get_by_text("The connection to the session is lost: its command has ended").wait_for()
        assert page.get_by_role("button", name="run again").is_disabled()
    pushed = Record(out / "002/signals.parquet")
    force = np.linalg.norm(pushed["robot.f_P"], axis=1)
    assert 0.5 < force.max() <= 5.0
    assert force[-1] == 0.0
    (point,) = np.unique(pushed["robot.p_BP"][force > 0.0], axis=0)
    assert np.abs(point).max() == pytest.approx(0.16, abs=0.02)  # on the cube's surface
    again = ("run", "flyer_impedance", "-p", "begin=30", "--push", "--inputs-from", out / "002")
    run_command(*again, "--stop", pushed.time[-1], "--no-report", "--out", tmp_path / "again")
    played_back = Record(tmp_path / "again/signals.parquet")
    rows = len(pushed.time)
    assert all(np.array_equal(played_back[name][:rows], pushed[name]) for name in pushed.signals)


def dragged(page: Page) -> float:
    """Press on the robot and drag; return how far it has moved until it is released, m."""
    page.locator(".replay-scene").scroll_into_view_if_needed()
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
    time_passes(page, 0.8)
    after = np.array(page.evaluate("live.scene.points('robot')")).mean(axis=0)
    page.mouse.up()
    return float(np.linalg.norm(after - before))
