"""`handover run FILE.ssp`: the files that it writes, and the errors for files that it cannot run."""

import contextlib
import hashlib
import json
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from support.cosim.native_units import native_fmu
from support.failing_systems import failing_ssp
from support.wording import Wording

import handover
from handover.cosim.record.reader import Record
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from handover.fmus.build import build_block
from handover.scenarios.cli.command import main
from handover.scenarios.execution.resume import InterruptedRun
from handover.scenarios.results.run_folder import RunFolder


def run(file: Path, *arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["run", str(file), *(str(a) for a in arguments)])


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("spring")
    return build_block("support.scenarios.tearing_spring:TearingSpring", 2, folder, step=Fraction(1, 10))


def packed(spring: Path, folder: Path, stop: Fraction | None = None, **start: Any) -> Path:
    system = System()
    system.add("left", spring, **start)
    system.add("right", spring)
    return write_ssp(system, folder / "springs.ssp", "two springs", stop)


def test_a_run_ends_at_the_file_s_stop_time_and_leaves_a_folder(spring: Path, tmp_path: Path):
    out = tmp_path / "out"
    result = run(packed(spring, tmp_path, Fraction(2)), "--out", out)
    assert result.exit_code == 0, result.output
    assert "springs.ssp succeeded: ran to 2 s" in result.output
    record = Record(out / "signals.parquet")
    assert record.time[-1] == 2.0
    assert record["left.x"][-1] == 4.0
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["success"], summary["simulated_seconds"]) == (True, 2.0)
    data = json.loads((out / "run.json").read_text())
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


def test_stop_and_step_of_the_call_come_first(spring: Path, tmp_path: Path):
    out = tmp_path / "out"
    result = run(packed(spring, tmp_path, Fraction(2)), "--stop", "1/2", "--step", "1/4", "--no-report", "--out", out)
    assert result.exit_code == 0, result.output
    assert Record(out / "signals.parquet").time.tolist() == [0.0, 0.25, 0.5]


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
    assert run(file, "--start", "3", "--out", tmp_path / "none").exit_code == 2


def test_a_unit_that_fails_ends_the_run_with_status_3_and_keeps_the_record(spring: Path, tmp_path: Path):
    out = tmp_path / "out"
    result = run(packed(spring, tmp_path, Fraction(2), tears=0.45), "--no-report", "--out", out)
    assert result.exit_code == 3, result.output
    assert "the spring tore" in result.output
    summary = json.loads((out / "summary.json").read_text())
    assert summary["reason"].startswith("a unit failed: left: fmi2DoStep at t = 0.5 s: RuntimeError: the spring tore")
    assert Record(out / "signals.parquet").time[-1] == pytest.approx(0.5)


@pytest.mark.parametrize(("fmi", "more"), [(2, ("--no-report",)), (3, ())])
def test_a_unit_that_ends_the_simulation_ends_the_run_well(fmi: int, more: tuple[str, ...], tmp_path: Path):
    out = tmp_path / "out"
    result = run(failing_ssp(tmp_path, "ends", fmi), "--out", out, "--checkpoint", "0.1", *more)
    assert result.exit_code == 0, result.output
    told = "ran to 0.3 s of 1 s; unit bad ended the simulation at t = 0.3 s"
    if more:
        said = [f"ends.ssp succeeded: {told}"]
    else:
        said = [f"ends.ssp succeeded: {told}", "drawing figures, writing the report ...", f"report: {out}"]
        page = " ".join((out / "report.html").read_text().split())  # numbers and units do not break
        assert f"Succeeded</b>: {told}" in page
    assert sorted(said, key=result.output.index) == said  # the verdict comes before what takes seconds
    assert "to resume" not in result.output
    assert Record(out / "signals.parquet").time.tolist() == [0.0, 0.1, 0.2, 0.3]
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["success"], summary["complete"], summary["failure"]) == (True, True, None)
    assert (summary["reason"], summary["simulated_seconds"]) == (told, 0.3)
    ended = summary["ended"]
    assert (ended["instance"], ended["call"], ended["time"], ended["reached"]) == ("bad", f"fmi{fmi}DoStep", 0.2, 0.3)
    assert CliRunner().invoke(main, ["resume", str(out)]).exit_code == 2  # complete


def test_of_a_run_that_ended_where_it_began_nothing_is_drawn(spring: Path, tmp_path: Path):
    out = tmp_path / "out"
    assert run(packed(spring, tmp_path, Fraction(2), tears=-1.0), "--out", out).exit_code == 3
    assert Record(out / "signals.parquet").time.tolist() == [0.0]
    assert not list((out / "figures").glob("*"))
    page = (out / "report.html").read_text()
    assert 'id="files"' in page
    assert 'id="signals"' not in page


@pytest.mark.parametrize(
    ("stop", "given"),
    [
        pytest.param(None, (), id="no stop time"),
        pytest.param(2, ("--unit", "a=1", "--seed", "3"), id="what is for scenarios"),
        *(pytest.param(None, ("--step", step), id=f"step {step}") for step in ("0", "soon", "-1", "1/0", "1e400")),
        pytest.param(2, ("-p", "left.tear=1", "-p", "tears=1"), id="unknown parameters"),
        pytest.param(2, ("-p", "left.tears=soon"), id="no number"),
        pytest.param(2, ("-p", "left.tears"), id="no value"),
    ],
)
def test_what_cannot_be_run_is_refused_and_leaves_nothing(
    spring: Path, tmp_path: Path, stop: int | None, given: tuple[str, ...], wording: Wording
):
    file = packed(spring, tmp_path, None if stop is None else Fraction(stop))
    result = run(file, *given, "--out", tmp_path / "out")
    assert result.exit_code == 2, result.output
    wording.check(result.output)
    assert not (tmp_path / "out").exists()


def test_a_scenario_has_steps_of_its_own(tmp_path: Path, wording: Wording):
    result = run(Path("ir_grasp"), "--step", "1", "--out", tmp_path / "out")
    assert result.exit_code == 2, result.output
    wording.check(result.output)


def test_a_stop_time_may_be_0_or_before_it(spring: Path, tmp_path: Path):
    for stop in ("0", "-1"):
        out = tmp_path / f"to{stop}"
        result = run(packed(spring, tmp_path), "--start", "-2", "--stop", stop, "--no-report", "--out", out)
        assert result.exit_code == 0, result.output
        assert Record(out / "signals.parquet").time[-1] == float(stop)
        result = CliRunner().invoke(main, ["run", "ir_grasp", "--stop", stop])
        assert (result.exit_code, f"{stop} s is not after" in result.output) == (2, True)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'name="left"', b'name="right"'),
        (b"TearingSpring", b"Spring"),
        (b'<ssd:Connector name="x"', b'<ssd:Connector name="y"'),
        (b"</ssd:System>", b""),
    ],
    ids=["two of a name", "no such FMU", "no such variable", "no XML"],
)
def test_a_malformed_file_is_refused_in_one_line_and_nothing_is_written(
    spring: Path, tmp_path: Path, old: bytes, new: bytes, wording: Wording
):
    file, out = tmp_path / "bad.ssp", tmp_path / "out"
    with zipfile.ZipFile(packed(spring, tmp_path, Fraction(2))) as good, zipfile.ZipFile(file, "w") as bad:
        for name in good.namelist():
            content = good.read(name)
            bad.writestr(name, content.replace(old, new) if name.endswith(".ssd") else content)
    result = run(file, "--out", out)
    assert result.exit_code == 2, result.output
    (line,) = result.output.splitlines()
    wording.check(line)
    assert not out.exists()


def test_a_file_that_is_not_there_is_reported(tmp_path: Path):
    result = run(tmp_path / "missing.ssp")
    assert result.exit_code == 2, result.output
    assert result.output == f"Error: {tmp_path / 'missing.ssp'}: there is no such file\n"


def test_p_sets_a_components_parameter_which_a_resumed_run_sets_again(spring: Path, tmp_path: Path):
    file, out = packed(spring, tmp_path, Fraction(2), tears=5.0), tmp_path / "out"
    result = run(
        file, "-p", "left.tears=0.45", "-p", "right.tears=1.05", "--checkpoint", "0.2", "--no-report", "--out", out
    )
    assert result.exit_code == 3, result.output
    assert "left: fmi2DoStep at t = 0.5 s: RuntimeError: the spring tore" in result.output
    data = json.loads((out / "run.json").read_text())
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
