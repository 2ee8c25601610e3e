"""The experiments of a foreign FMU are run, and the results are compared."""

from pathlib import Path
from typing import Any

import pytest
from support.cosim.experiment_files import INPUTS, RESULT, SETUP, STIMULUS, manifest, outputs, packed
from support.wording import Wording

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.check.experiment_check import ExperimentCheck
from handover.cosim.check.report import CheckReport, Section
from handover.cosim.experiments.manifest import related_files
from handover.cosim.experiments.reference_experiment import experiments_in
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.probe.finding import Finding, Level
from handover.fmus.compile import host_platform


def checked(fmu: Path, folder: Path) -> tuple[str, list[Finding]]:
    """Return what the check of a file's only experiment says."""
    archive = FmuArchive(fmu)
    (experiment,) = experiments_in(related_files(archive)[0])[0]
    check = ExperimentCheck(archive, describe_fmu(fmu), ["x", "u", "y", "mode"], folder / "none", folder, 60.0)
    return check.run(experiment)


def refused(fmu: Path, folder: Path) -> str:
    """Return why a file's only experiment is not run."""
    (finding,) = checked(fmu, folder)[1]
    assert finding.level is Level.FAULT
    return finding.line


def section(report: CheckReport, name: str) -> Section:
    return next(s for s in report.sections if s.name == name)


@pytest.mark.skipif(not host_platform().endswith("linux"), reason="decay.c is compiled for Linux")
@pytest.mark.parametrize(
    ("relative", "error", "level", "wanted"),
    [
        ("1e-9", 0.0, Level.OK, ""),
        ("1e-3", 1e-4, Level.NOTE, "differs from the result by up to 0.0001 at t = 1 s; 0.00137"),
        ("1e-9", 1e-4, Level.FAULT, "output 'y': it differs from the result by up to 0.0001 at t = 1 s; 1.3"),
    ],
)
def test_a_result_is_compared(
    decay_library: bytes, tmp_path: Path, relative: str, error: float, level: Level, wanted: str
):
    files = {"in.csv": INPUTS, "out.csv": outputs(error)}
    content = manifest(STIMULUS.format(SETUP.format(relative, '<Parameter name="mode" value="0"/>')), RESULT)
    report = check_fmu(packed(tmp_path, content, files, decay_library), 60.0)
    found = section(report, "experiments")
    worst = [f.line for f in found.findings if f.level is level] or [""]
    assert report.passed is (level is not Level.FAULT)
    assert report.ran
    assert wanted in worst[0]
    assert found.summary.startswith("in.csv: 10 steps, 1 output compared")


@pytest.mark.skipif(not host_platform().endswith("linux"), reason="decay.c is compiled for Linux")
def test_an_experiment_without_setup_is_run_too(decay_library: bytes, tmp_path: Path):
    files = {"in.csv": INPUTS, "out.csv": "time,y\n0.55,1.0\n1.0,1.0\n"}  # a row within a step
    report = check_fmu(packed(tmp_path, manifest(STIMULUS.format(""), RESULT), files, decay_library), 60.0)
    (finding,) = section(report, "experiments").findings
    assert "by up to 0.375 at t = 1 s; 0.001 is allowed" in finding.line


@pytest.mark.parametrize(
    ("inputs", "results"),
    [
        (INPUTS.replace("u", "v"), outputs()),
        (INPUTS, outputs().replace("y", "z")),
        (INPUTS, outputs().replace("y", "x")),
        (INPUTS.replace("0.3,2.0", "0.3,nan"), outputs()),
        (INPUTS.replace("0.3,2.0", "0.3,fast"), outputs()),
        (INPUTS.replace("0.3,", "nan,"), outputs()),
        (INPUTS.replace("0.3,", "1.0,"), outputs()),
        (INPUTS.replace("0.3,2.0", "0.3"), outputs()),
        (INPUTS.replace("time,u", "u,time"), outputs()),
        (INPUTS.replace("time,u", "time,u,u"), outputs()),
        ("time,u\n", outputs()),
        ("", outputs()),
        ("time,u\n1.0,0.0\n2.0,0.0\n", outputs()),
        ("time,u\n0.0,0.0\n1e308,0.0\n", outputs()),
    ],
    ids=[
        "no input", "no variable", "no output", "not finite", "no number", "no time", "descends", "short row",
        "time not first", "twice", "no rows", "empty", "result before stimulus", "too many steps",
    ],
)  # fmt: skip
def test_a_table_that_does_not_fit_is_refused(tmp_path: Path, inputs: str, results: str, wording: Wording):
    content = manifest(STIMULUS.format(SETUP.format("1e-9", "")), RESULT)
    wording.check(refused(packed(tmp_path, content, {"in.csv": inputs, "out.csv": results}), tmp_path))


@pytest.mark.parametrize(("name", "value"), [("mode", "3"), ("mood", "0")])
def test_a_result_of_other_parameters_is_refused(tmp_path: Path, name: str, value: str, wording: Wording):
    setup = SETUP.format("1e-9", f'<Parameter name="{name}" value="{value}"/>')
    content = manifest(STIMULUS.format(setup), RESULT)
    wording.check(refused(packed(tmp_path, content, {"in.csv": INPUTS, "out.csv": outputs()}), tmp_path))


@pytest.mark.parametrize(("y", "wanted"), [("1e-13", "y 1e-13 off, which is 0 in the result"), ("0", "all equal")])
def test_an_output_at_rest_is_compared_absolutely(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, y: str, wanted: str):
    def play(*arguments: Any) -> list[Any]:
        arguments[2][0]["result"].write_text(f"time,y\n0.0,{y}\n0.3,{y}\n1.0,{y}\n")
        return []

    monkeypatch.setattr("handover.cosim.check.experiment_check.run_experiment", play)
    files = {"in.csv": INPUTS, "out.csv": "time,y\n0.0,0\n0.3,0\n1.0,0\n"}
    summary, findings = checked(packed(tmp_path, manifest(STIMULUS.format(""), RESULT), files), tmp_path)
    assert summary.endswith(f", 1 output at 3 of 11 points compared, {wanted}")
    assert all(f.level is Level.NOTE for f in findings)


@pytest.mark.skipif(not host_platform().endswith("linux"), reason="decay.c is compiled for Linux")
def test_a_result_that_is_cut_off_does_not_pass_for_a_whole_one(decay_library: bytes, tmp_path: Path):
    rows = outputs().splitlines(keepends=True)
    content = manifest(STIMULUS.format(SETUP.format("1e-9", '<Parameter name="mode" value="0"/>')), RESULT)
    files = {"in.csv": INPUTS, "out.csv": "".join(rows[:4])}
    found = section(check_fmu(packed(tmp_path, content, files, decay_library), 60.0), "experiments")
    assert "out.csv: it lacks 8 of 11 communication points" in found.findings[-1].line
    assert found.summary.startswith("in.csv: 10 steps, 1 output at 3 of 11 points compared")
