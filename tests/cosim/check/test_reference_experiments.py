"""The related files of a foreign FMU: its manifest is judged, its experiments are run, and the results are compared."""

import math
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import decay
import pytest

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.check.experiment_run import communication_points
from handover.cosim.check.finding import CheckReport, Finding, Level, Section
from handover.cosim.check.reference_experiment import ExperimentCheck, experiments_in
from handover.cosim.check.related_files import FOLDER, MANIFEST, related_files
from handover.cosim.check.signal_table import read_table
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.description import describe_fmu
from handover.fmus.compile import host_platform

ROOT = (
    '<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest" '
    'fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="1.0.0-alpha.1" '
    'fmi-ls:fmi-ls-description="Layered Standard providing information on related files included in an FMU.">'
)
STIMULUS = '<Related type="text/csv" source="in.csv" role="experiment/smoke-test">{}</Related>'
RESULT = '<Related type="text/csv" source="out.csv" role="result"/>'
SETUP = (
    '<Annotations><Annotation type="handover.experiment"><Setup xmlns="urn:handover:experiment" result="out.csv" '
    'step="1/10" relative="{}" absolute="0">{}</Setup></Annotation></Annotations>'
)
INPUTS = "time,u\n0.0,0.0\n0.3,2.0\n1.0,2.0\n"


def outputs(error: float = 0.0) -> str:
    """Return the closed form of x' = u - x, x(0) = 1, u = 0 until 0.3 s and then 2; the last value is wrong."""
    times = [k / 10 for k in range(11)]
    at = math.exp(-0.3)
    values = [math.exp(-t) if t <= 0.3 else 2.0 + (at - 2.0) * math.exp(-(t - 0.3)) for t in times]
    values[-1] += error
    return "time,y\n" + "".join(f"{t!r},{y!r}\n" for t, y in zip(times, values, strict=True))


def manifest(*related: str) -> bytes:
    return f"{ROOT}{''.join(related)}</fmiReferences>".encode()


def packed(folder: Path, content: bytes, files: Mapping[str, str] | None = None, library: bytes = b"") -> Path:
    others = {MANIFEST: content, **{f"{FOLDER}/{name}": text.encode() for name, text in (files or {}).items()}}
    return decay.pack(folder / "Decay.fmu", library, others=others)


def manifest_findings(fmu: Path) -> list[tuple[Level, str]]:
    files, findings = related_files(FmuArchive(fmu))
    return [(f.level, f.line) for f in [*findings, *experiments_in(files)[1]]]


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
    ("content", "level", "wanted"),
    [
        (b"<fmiReferences", Level.FAULT, f"{MANIFEST}: it is not well-formed"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><fmiReferences/>', Level.FAULT, "it has a document type"),
        (b"<Manifest/>", Level.FAULT, "its outermost element is <Manifest>; <fmiReferences> is right"),
        (b"<fmiReferences/>", Level.FAULT, "line 1: it has no attribute fmi-ls-name of the namespace"),
        (manifest("<Other/>"), Level.FAULT, "<Other> is not known; <Related> or <Annotations> is right"),
        (manifest('<Related role="model"/>'), Level.FAULT, "a file without a source"),
        (manifest('<Related source="a" role="code"/>'), Level.FAULT, "role 'code' is not known; one of document,"),
        (manifest('<Related source="a" role="experiment/quick"/>'), Level.FAULT, "experiment/smoke-test, experiment/v"),
        (manifest('<Related source="a" role="model/x"/>'), Level.FAULT, "a sub-role that is not known; model is right"),
        (manifest('<Related source="../../../a" role="model"/>'), Level.FAULT, "'../../../a' leads out of the archive"),
        (manifest('<Related source="..%2F..%2F..%2Fa" role="model"/>'), Level.FAULT, "leads out of the archive"),
        (manifest('<Related source="/etc/passwd" role="model"/>'), Level.FAULT, "leads out of the archive"),
        (manifest('<Related source="x.csv" role="model"/>'), Level.WARNING, f"{FOLDER}/x.csv is not in the archive"),
        (manifest('<Related source="https://a.b/c" role="model"/>'), Level.NOTE, "lies outside of the FMU"),
        (manifest('<Related source="//[" role="model"/>'), Level.NOTE, "lies outside of the FMU"),
        (manifest(STIMULUS.format("")), Level.WARNING, "in.csv: no result belongs to it; a CSV file of role result"),
        (manifest('<Related source="in.exp" role="experiment"/>'), Level.NOTE, "application/octet-stream are not run"),
        (manifest(STIMULUS.format(SETUP.format("x", ""))), Level.FAULT, "relative='x' is no tolerance"),
        (manifest(STIMULUS.format(SETUP.format("1", "").replace("1/10", "0"))), Level.FAULT, "step='0' is no positive"),
    ],
)  # fmt: skip
def test_a_manifest_at_fault_is_reported(tmp_path: Path, content: bytes, level: Level, wanted: str):
    found = manifest_findings(packed(tmp_path, content, {"in.csv": INPUTS, "in.exp": ""}))
    assert any(each is level and wanted in line for each, line in found), found


def step_finding(folder: Path, step: str) -> tuple[Level, str]:
    """Return the first finding of a manifest whose experiment has a step."""
    content = manifest(STIMULUS.format(SETUP.format("1", "").replace("1/10", step)))
    return manifest_findings(packed(folder, content, {"in.csv": INPUTS}))[0]


@pytest.mark.parametrize("step", ["-1", "1/0", f"1/{'9' * 400}"])
def test_a_step_that_is_not_positive_or_that_no_double_holds_is_refused(tmp_path: Path, step: str):
    level, line = step_finding(tmp_path, step)
    assert level is Level.FAULT
    assert f"step='{step[:40]}' is no positive number of seconds" in line


@pytest.mark.parametrize("step", ["nan", "1e20000000", "1e-20000000", "0e99999999", "1" * 5000])
def test_a_step_that_would_take_long_is_refused_before_it_is_made_exact(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
):
    def exact(text: str) -> Fraction:
        raise AssertionError(f"{text[:40]} is made exact")

    monkeypatch.setattr("handover.cosim.check.reference_experiment.Fraction", exact)
    level, line = step_finding(tmp_path, step)
    assert level is Level.FAULT
    assert f"step='{step[:40]}' is no positive number of seconds" in line


def test_a_path_that_leads_to_another_folder_of_the_archive_is_right(tmp_path: Path):
    content = manifest('<Related source="../../modelDescription.xml" role="model"/>')
    assert manifest_findings(packed(tmp_path, content)) == []


@pytest.mark.parametrize(
    ("inputs", "results", "wanted"),
    [
        (INPUTS.replace("u", "v"), outputs(), "in.csv: column 'v' is no input of the FMU"),
        (INPUTS, outputs().replace("y", "z"), "out.csv: column 'z' is no variable of the FMU"),
        (INPUTS, outputs().replace("y", "x"), "out.csv: no column is an output of the FMU: valid: y"),
        (INPUTS.replace("0.3,2.0", "0.3,nan"), outputs(), "in.csv: line 3, column 'u': 'nan': a finite number"),
        (INPUTS.replace("0.3,2.0", "0.3,fast"), outputs(), "line 3, column 'u': 'fast': a number is right"),
        (INPUTS.replace("0.3,", "nan,"), outputs(), "line 3: time 'nan' is not a finite number of seconds"),
        (INPUTS.replace("0.3,", "1.0,"), outputs(), "line 4: the time 1.0 s is not after 1 s, the one before"),
        (INPUTS.replace("0.3,2.0", "0.3"), outputs(), "line 3 has 1 values; 2 are right, as in the first line"),
        (INPUTS.replace("time,u", "u,time"), outputs(), "its first line begins with 'u'; names, of which time"),
        (INPUTS.replace("time,u", "time,u,u"), outputs(), "column 'u' is there twice"),
        ("time,u\n", outputs(), "it has no rows of values"),
        ("", outputs(), "its first line begins with nothing"),
        ("time,u\n1.0,0.0\n2.0,0.0\n", outputs(), "out.csv: it begins at 0 s, before its stimulus at 1 s"),
        ("time,u\n0.0,0.0\n1e308,0.0\n", outputs(), "until 1e+308 s there are more than 1e+06 steps of 0.1 s"),
    ],
)  # fmt: skip
def test_a_table_that_does_not_fit_is_refused(tmp_path: Path, inputs: str, results: str, wanted: str):
    content = manifest(STIMULUS.format(SETUP.format("1e-9", "")), RESULT)
    fmu = packed(tmp_path, content, {"in.csv": inputs, "out.csv": results})
    assert wanted in refused(fmu, tmp_path)


@pytest.mark.parametrize(
    ("parameters", "wanted"),
    [
        ('<Parameter name="mode" value="3"/>', "other parameters: mode was '3' and is '0'; a result of the present"),
        (
            '<Parameter name="mood" value="0"/>',
            "'mood' is no parameter of the FMU: did you mean mode?, mode was not",
        ),
    ],
)
def test_a_result_of_other_parameters_is_refused(tmp_path: Path, parameters: str, wanted: str):
    content = manifest(STIMULUS.format(SETUP.format("1e-9", parameters)), RESULT)
    fmu = packed(tmp_path, content, {"in.csv": INPUTS, "out.csv": outputs()})
    assert wanted in refused(fmu, tmp_path)


@pytest.mark.parametrize(("y", "wanted"), [("1e-13", "y 1e-13 off, which is 0 in the result"), ("0", "all equal")])
def test_an_output_at_rest_is_compared_absolutely(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, y: str, wanted: str):
    def play(*arguments: Any) -> list[Any]:
        arguments[2][0]["result"].write_text(f"time,y\n0.0,{y}\n0.3,{y}\n1.0,{y}\n")
        return []

    monkeypatch.setattr("handover.cosim.check.reference_experiment.run_experiment", play)
    files = {"in.csv": INPUTS, "out.csv": "time,y\n0.0,0\n0.3,0\n1.0,0\n"}
    summary, findings = checked(packed(tmp_path, manifest(STIMULUS.format(""), RESULT), files), tmp_path)
    assert summary.endswith(f", 1 output compared, {wanted}")
    assert all(f.level is Level.NOTE for f in findings)


@pytest.mark.parametrize("varies_step", [False, True])
def test_times_with_few_digits_are_ends_of_steps(varies_step: bool):
    step = Fraction(1, 30)
    table = read_table(b"time\n0\n0.0333333\n0.06666667\n1.0e-1\n0.13333\n", "in.csv", {}).snapped(Fraction(0), step)
    assert communication_points(table.times, (), step, varies_step=varies_step) == [k * step for k in range(5)]


@pytest.mark.parametrize(
    ("rows", "wanted"),
    [("0\n0.035\n", [0.0, 0.035]), ("0\n0.03333\n0.03334\n", [0.0, 0.03333, 0.03334]), ("0\n1\n", [0.0, 1.0]),
     ("0e-99999999999999999999\n1\n", [0.0, 1.0])],
)  # fmt: skip
def test_times_within_a_step_stay(rows: str, wanted: list[float]):
    table = read_table(f"time\n{rows}".encode(), "in.csv", {}).snapped(Fraction(0), Fraction(1, 30))
    assert [float(t) for t in table.times] == wanted
