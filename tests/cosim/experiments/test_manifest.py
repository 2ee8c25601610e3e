"""The manifest of a foreign FMU is judged, with the setups of its experiments."""

from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.experiment_files import INPUTS, SETUP, STIMULUS, manifest, packed

from handover.cosim.experiments.experiment_run import communication_points
from handover.cosim.experiments.manifest import FOLDER, MANIFEST, related_files
from handover.cosim.experiments.reference_experiment import experiments_in
from handover.cosim.experiments.signal_table import read_table
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.probe.finding import Level


def manifest_findings(fmu: Path) -> list[tuple[Level, str]]:
    files, findings = related_files(FmuArchive(fmu))
    return [(f.level, f.line) for f in [*findings, *experiments_in(files)[1]]]


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

    monkeypatch.setattr("handover.cosim.experiments.reference_experiment.Fraction", exact)
    level, line = step_finding(tmp_path, step)
    assert level is Level.FAULT
    assert f"step='{step[:40]}' is no positive number of seconds" in line


def test_a_path_that_leads_to_another_folder_of_the_archive_is_right(tmp_path: Path):
    content = manifest('<Related source="../../modelDescription.xml" role="model"/>')
    assert manifest_findings(packed(tmp_path, content)) == []


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
