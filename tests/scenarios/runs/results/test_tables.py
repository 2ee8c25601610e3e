"""What a run's output and its report say about the master: conversions, steps, pace, failures."""

import json
import re
from fractions import Fraction
from html import unescape
from pathlib import Path

import pytest
from support.commands import call
from support.failing_systems import failing_ssp, native_fmu
from support.faults.faulty_units import faulty_fmu

import handover
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from handover.cosim.typed_data import InvalidData, checked
from handover.scenarios.runs.reporting.run_page import write_run_page
from handover.scenarios.runs.results.folder_data import Summary
from handover.scenarios.runs.results.run_folder import RunFolder
from handover.scenarios.runs.results.tables import headline_rows, master_rows, pace_rows


class Page:
    """The rows of a run's page, its headings, and the log that it shows."""

    def __init__(self, folder: RunFolder) -> None:
        write_run_page(folder)
        html = folder.report.read_text(encoding="utf-8")
        cells = re.compile(r"<t[dh]\b[^>]*>(.*?)</t[dh]>", re.DOTALL)
        self.rows = [[*map(text_of, cells.findall(row))] for row in re.findall(r"<tr\b.*?</tr>", html, re.DOTALL)]
        self.headings = [*map(text_of, re.findall(r"<h2\b.*?</h2>", html, re.DOTALL))]
        self.pre = "".join(map(text_of, re.findall(r"<pre\b.*?</pre>", html, re.DOTALL)))


def text_of(html: str) -> str:
    return unescape(re.sub(r"<[^>]*>", "", html))


def run(file: Path, out: Path, *arguments: str) -> str:
    done = call("run", file, "--out", out, *arguments)
    assert done.exit_code == 0, done.output
    return done.output


def test_conversions_are_reported_in_run_json_terminal_and_report(tmp_path: Path):
    s = System()
    for i in range(3):
        a, b = s.add(f"a{i}", native_fmu("workshop", 3)), s.add(f"b{i}", native_fmu("si", 3))
        for name in ("angle", "length", "temperature"):
            s.connect(getattr(a.y, name), getattr(b.u, f"{name}_in"))
    shown = run(write_ssp(s, tmp_path / "x.ssp", "x", Fraction(1)), tmp_path / "out", "--no-report")
    content = json.loads((tmp_path / "out" / "run.json").read_text())["conversions"]
    assert len(content) == 9
    assert content[0] == {
        "source": "a0.angle", "unit": "deg", "target": "b0.angle_in", "target_unit": "rad",
        "factor": 0.017453292519943295, "offset": 0.0,
    }  # fmt: skip
    lines = [" ".join(line.split()) for line in shown.splitlines()]
    assert "converted: a0.angle (deg) -> b0.angle_in (rad) times 0.0174533" in lines
    assert sum(line.startswith("converted: ") for line in lines) == 8
    assert "1 conversion more in the report" in lines
    rows = Page(RunFolder.of_run(tmp_path / "out")).rows
    assert ["a0.temperature (degC) -> b0.temperature_in (K)", "plus 273.15"] in rows
    assert sum(" -> " in row[0] for row in rows if row) == 9


def test_the_report_says_how_units_were_coupled(tmp_path: Path):
    file, out = failing_ssp(tmp_path, "gain"), tmp_path / "out"
    run(file, out, "--adaptive", "1e-3", "--pace", "1000", "--extrapolation", "linear", "--no-report")
    page, summary = Page(RunFolder.of_run(out)), json.loads((out / "summary.json").read_text())
    absent = {
        "ended",
        "inputs",
        "left_out",
        "not_finite",
        "out_of_range",
        "recorded",
        "stop",
        "unit_values",
        "warnings",
    }
    assert set(summary) == set(Summary.__annotations__) - absent
    rows = dict(row for row in page.rows if len(row) == 2)
    assert rows["algorithm"] == "gauss-seidel"
    assert rows["extrapolation"] == "linear"
    assert rows["tolerated step error"].startswith("0.001, and 1e-06")
    assert rows["steps"].startswith(
        f"{summary['steps']['accepted']} accepted, {summary['steps']['rejected']} rejected, "
    )
    assert rows["pace"] == f"1000 x real time asked for, {summary['pace']['reached']:.3g} x reached"
    assert f"of {summary['pace']['deadlines']}" in rows["deadlines missed"]
    assert "Parameters" not in page.headings
    assert any(row[2:3] == ["varies"] for row in page.rows)


def test_a_pace_that_was_changed_on_the_way_is_reported_with_deadlines_only_where_there_were_some():
    pace = {"largest_lateness": 0.0, "latest_at": None, "missed": 0, "reached": None, "share": 0.0, "changed": True}
    fast = {"pace": {**pace, "pace": None, "deadlines": 0, "first": 1.0}}
    assert pace_rows(fast) == [("pace", "changed on the way, 1 x real time at first, as fast as it goes at last")]
    five = {"pace": {**pace, "pace": 5.0, "deadlines": 7, "first": None, "reached": 5.0}}
    assert pace_rows(five) == [
        ("pace", "changed on the way, as fast as it goes at first, 5 x real time at last"),
        ("deadlines missed at the last pace", "none of 7"),
    ]


def test_warnings_of_units_are_reported_in_summary_json_terminal_report_and_python(tmp_path: Path):
    s, out = System(), tmp_path / "out"
    s.add("b", faulty_fmu("warning_in_step", 2, tmp_path))
    s.add("c", faulty_fmu("warning_in_all", 3, tmp_path))
    shown = run(write_ssp(s, tmp_path / "x.ssp", "x", Fraction(1)), out, "--no-report")
    write_run_page(RunFolder.of_run(out))
    lines = [
        "unit b returned Warning from fmi2DoStep 7 times, first at t = 0.3 s; last message: step: the step size was "
        "halved",
        "unit c returned Warning 18 times, first at t = 0 s (fmi3DoStep 7, fmi3EnterInitializationMode 1, "
        "fmi3ExitInitializationMode 1, fmi3GetFloat64 8, fmi3Terminate 1); last message: terminate: the step size was "
        "halved",
    ]
    assert [line for line in shown.splitlines() if "Warning" in line] == lines
    page = (out / "report.html").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert all(f"<li>{line}</li>" in page for line in lines)
    assert json.loads((out / "summary.json").read_text())["warnings"][0] == {
        "instance": "b", "calls": {"fmi2DoStep": 7}, "time": 0.3, "message": "step: the step size was halved"
    }  # fmt: skip
    loaded = handover.load(out)
    assert isinstance(loaded, handover.Run)
    assert list(loaded.warnings) == lines


def test_of_many_last_values_a_summary_says_how_many_it_leaves_out():
    metrics = {name: {"value": 1.0, "unit": "m"} for name in ("last_x", "last_y", "last_z", "min_x")}
    *shown, more = headline_rows(metrics, ("last_x",))
    assert [name for name, _ in shown] == ["last_x"]
    assert more[0] == "and 2 last values more"
    assert len(headline_rows(metrics, ("last_x", "last_y", "last_z"))) == 3
    assert len(headline_rows(metrics, ("min_x", "last_x"))) == 2


def test_iterations_are_reported_once():
    metrics = {"iterations": {"value": 2.5}, "rollbacks": {"value": 7.0}}
    master = {"algorithm": "newton", "tolerance": 1e-8, "iterations": 100, "extrapolation": "hold", "adaptive": None,
              "repeat_discarded": True}  # fmt: skip
    assert master_rows({"master": master, "metrics": metrics})[2:] == [
        ("tolerance of iterations", "1e-08, after at most 100"),
        ("iterations", "2.5 a step, 7 rollbacks"),
        ("steps that a unit discards", "repeated shorter by all"),
    ]


def test_what_another_version_s_summary_lacks_has_no_row():
    lacking = {"iterations": {"value": None}, "rollbacks": {"value": 7.0}}
    master = {"algorithm": "jacobi", "extrapolation": "hold", "adaptive": None, "repeat_discarded": False}
    assert master_rows({"master": {**master, "tolerance": 1e-8, "iterations": 9}, "metrics": lacking})[2:] == [
        ("tolerance of iterations", "1e-08, after at most 9")
    ]
    pace = {"pace": 1.0, "deadlines": 4, "missed": 1, "largest_lateness": 0.5, "latest_at": None, "of_later": 1}
    assert pace_rows({"pace": pace})[1] == ("deadlines missed", "1 of 4 (25.0%), at most 0.50 s late")
    with pytest.raises(InvalidData, match="relative"):
        checked({"master": {**master, "tolerance": 1.0, "iterations": 9, "adaptive": {}}, "success": True,
                 "reason": "", "metrics": {}}, Summary)  # fmt: skip


def test_a_failure_s_log_is_shown_and_what_is_not_known_is_not_zero(tmp_path: Path):
    folder = RunFolder(tmp_path / "out")
    folder.make()
    folder.write_run({"scenario": "x.ssp", "parameters": {}})
    master = {"algorithm": "jacobi", "tolerance": 1e-8, "iterations": 100, "extrapolation": "hold", "adaptive": None,
              "repeat_discarded": False}  # fmt: skip
    summary = {
        "scenario": "x.ssp", "seed": 0, "simulated_seconds": 0.2, "wall_seconds": 1.0, "success": False,
        "reason": "a unit failed", "metrics": {}, "master": master,
        "failure": {"instance": "arm", "log": ["tendon <3> tore", "sorry"]},
        "units": [{"name": "arm", "model": "Arm (FMI 3)", "step": "10 ms", "steps": None, "cpu_seconds": None}],
    }  # fmt: skip
    folder.write_summary(summary)
    page = Page(folder)
    assert page.pre == "tendon <3> tore\nsorry"
    assert page.headings == ["Log of arm", "Master", "Files"]
