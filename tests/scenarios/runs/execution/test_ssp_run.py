"""`handover run FILE.ssp`: the files that it writes, and the errors for files that it cannot run."""

import contextlib
import hashlib
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from support.commands import call, data_in, refusal
from support.cosim.native_units import native_fmu
from support.failing_systems import failing_ssp

import handover
from handover.cosim.record.reader import Record
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from handover.fmus.build import build_block
from handover.scenarios.runs.execution.resume import InterruptedRun
from handover.scenarios.runs.results.run_folder import RunFolder


def run(file: object, *arguments: object) -> Result:
    return call("run", file, *arguments)


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("spring")
    return build_block("support.scenarios.tearing_spring:TearingSpring", 2, folder, step=Fraction(1, 10))


def packed(spring: Path, folder: Path, stop: Fraction | None = None, **start: Any) -> Path:
    system = System()
    system.add("left", spring, **start)
    system.add("right", spring)
    return write_ssp(system, folder / "springs.ssp", "two springs", stop)


@pytest.mark.usefixtures("empty_figures")
def test_a_run_ends_at_the_file_s_stop_time_and_leaves_a_folder(spring: Path, tmp_path: Path):
    out = tmp_path / "out"
    result = run(packed(spring, tmp_path, Fraction(2)), "--out", out)
    assert result.exit_code == 0, result.output
    said = ["springs.ssp succeeded: ran to 2 s", "drawing figures, writing the report ...", f"report: {out}"]
    assert sorted(said, key=result.output.index) == said  # the verdict comes before what takes seconds
    record = Record(out / "signals.parquet")
    assert record.time[-1] == 2.0
    assert record["left.x"][-1] == 4.0
    summary = data_in(out)
    assert (summary["success"], summary["simulated_seconds"]) == (True, 2.0)
    data = data_in(out, "run")
    assert data["seed"] is None
    sha256 = hashlib.sha256((tmp_path / "springs.ssp").read_bytes()).hexdigest()
    assert (data["source"]["sha256"], data["source"]["stop"]) == (sha256, "2")
    units = data["units"]
    assert {u: data["fmu"] for u, data in units.items()} == dict.fromkeys(("left", "right"), "TearingSpring.fmi2.fmu")
    figures = {p.name for p in (out / "figures").iterdir()}
    assert figures == {f"{n}.{s}" for n in ("1_left", "2_right") for s in ("png", "svg")}
    lead = (out / "report.html").read_text().partition("<main>")[0]
    assert "two springs" in lead
    assert "seed" not in lead


def test_stop_and_step_of_the_call_come_first_and_the_stop_may_be_before_0(spring: Path, tmp_path: Path):
    file = packed(spring, tmp_path, Fraction(2))
    for stop, times in (("1/2", [0.0, 0.25, 0.5]), ("0", [-0.25, 0.0]), ("-1", [-1.25, -1.0])):
        out = tmp_path / f"to {times[-1]}"
        given = ("--start", str(times[0]), "--stop", stop, "--step", "1/4", "--no-report", "--out", out)
        assert run(file, *given).exit_code == 0
        assert Record(out / "signals.parquet").time.tolist() == times


def test_a_run_starts_where_the_file_or_the_call_says(tmp_path: Path):
    s, file = System(), tmp_path / "a.ssp"
    s.start = Fraction(2)
    s.add("clerk", native_fmu("clerk", 2), period=Fraction(1, 2))
    write_ssp(s, file, "a", Fraction(3))
    for given, times in (((), [2.0, 2.5, 3.0]), (("--start", "1"), [1.0, 1.5, 2.0, 2.5, 3.0])):
        out = tmp_path / f"from {times[0]}"
        assert run(file, *given, "--no-report", "--out", out).exit_code == 0
        record = Record(out / "signals.parquet")
        assert record.time.tolist() == record["clerk.now"].tolist() == times
        assert record["clerk.start"][0] == times[0]


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_that_ends_the_simulation_ends_the_run_well(fmi: int, tmp_path: Path):
    out = tmp_path / "out"
    result = run(failing_ssp(tmp_path, "ends", fmi), "--out", out, "--checkpoint", "0.1", "--no-report")
    assert result.exit_code == 0, result.output
    reported = "ran to 0.3 s of 1 s; unit bad ended the simulation at t = 0.3 s"
    assert f"ends.ssp succeeded: {reported}" in result.output
    assert "to resume" not in result.output
    assert Record(out / "signals.parquet").time.tolist() == [0.0, 0.1, 0.2, 0.3]
    summary = data_in(out)
    assert (summary["success"], summary["complete"], summary["failure"]) == (True, True, None)
    assert (summary["reason"], summary["simulated_seconds"]) == (reported, 0.3)
    ended = summary["ended"]
    assert (ended["instance"], ended["call"], ended["time"], ended["reached"]) == ("bad", f"fmi{fmi}DoStep", 0.2, 0.3)
    refusal("resume", out)  # it is complete


def test_of_a_run_that_ended_where_it_began_nothing_is_drawn(spring: Path, tmp_path: Path):
    out = tmp_path / "out"
    assert run(packed(spring, tmp_path, Fraction(2), tears=-1.0), "--out", out).exit_code == 3
    assert Record(out / "signals.parquet").time.tolist() == [0.0]
    assert not list((out / "figures").glob("*"))
    page = (out / "report.html").read_text()
    assert 'id="files"' in page
    assert 'id="signals"' not in page


def test_a_unit_that_fails_ends_the_run_with_status_3_and_its_parameters_are_set_again(spring: Path, tmp_path: Path):
    file, out = packed(spring, tmp_path, Fraction(2), tears=5.0), tmp_path / "out"
    given = ("-p", "left.tears=0.45", "-p", "right.tears=1.05", "--checkpoint", "0.2", "--no-report", "--out", out)
    result = run(file, *given)
    assert (result.exit_code, "the spring tore" in result.output) == (3, True), result.output
    reported = "a unit failed: left: fmi2DoStep at t = 0.5 s: RuntimeError: the spring tore"
    assert data_in(out)["reason"].startswith(reported)
    assert Record(out / "signals.parquet").time[-1] == pytest.approx(0.5)
    data = data_in(out, "run")
    assert data["source"]["parameters"] == ["left.tears=0.45", "right.tears=1.05"]
    assert ["right.tears", "1.05", "given start value"] in data["told_parameters"]
    with contextlib.ExitStack() as opened:
        task = InterruptedRun(RunFolder.of_run(out)).task(opened)
        system = task.experiment.build(task.parameters, 0, lambda _unit: file)
        assert {name: unit.start["tears"] for name, unit in system.units.items()} == {"left": 0.45, "right": 1.05}


def test_python_gives_them_too(spring: Path, tmp_path: Path):
    file = packed(spring, tmp_path, Fraction(2))
    with handover.open(file, parameters={"left.tears": 0.25}) as s:
        assert (s["left.tears"], s["right.tears"]) == (0.25, 100.0)
