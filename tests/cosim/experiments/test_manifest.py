"""The manifest of a foreign FMU is judged, with the setups of its experiments."""

from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.experiment_files import INPUTS, SETUP, STIMULUS, manifest, packed
from support.wording import Wording

from handover.cosim.experiments.experiment_run import communication_points
from handover.cosim.experiments.manifest import related_files
from handover.cosim.experiments.reference_experiment import experiments_in
from handover.cosim.experiments.signal_table import read_table
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.probe.finding import Level


def manifest_findings(fmu: Path) -> list[tuple[Level, str]]:
    files, findings = related_files(FmuArchive(fmu))
    return [(f.level, f.line) for f in [*findings, *experiments_in(files)[1]]]


RELATED = (
    '<Related role="model"/>',
    '<Related source="a" role="code"/>',
    '<Related source="a" role="experiment/quick"/>',
    '<Related source="a" role="model/x"/>',
    '<Related source="../../../a" role="model"/>',
    '<Related source="..%2F..%2F..%2Fa" role="model"/>',
    '<Related source="/etc/passwd" role="model"/>',
    '<Related source="x.csv" role="model"/>',
    '<Related source="https://a.b/c" role="model"/>',
    '<Related source="//[" role="model"/>',
    '<Related source="in.exp" role="experiment"/>',
    STIMULUS.format(""),
    STIMULUS.format(SETUP.format("x", "")),
    *(STIMULUS.format(SETUP.format("1", "").replace("1/10", step)) for step in ("0", "-1", "1/0", f"1/{'9' * 400}")),
)


def test_a_manifest_at_fault_is_reported(tmp_path: Path, wording: Wording):
    whole = (
        b"<fmiReferences",
        b'<!DOCTYPE a [<!ENTITY b "c">]><fmiReferences/>',
        b"<Manifest/>",
        b"<fmiReferences/>",
        manifest("<Other/>"),
    )
    for content in (*whole, *(manifest(related) for related in RELATED)):
        found = manifest_findings(packed(tmp_path, content, {"in.csv": INPUTS, "in.exp": ""}))
        wording.check("\n".join(f"{level.name}: {line}" for level, line in found))


@pytest.mark.parametrize("step", ["nan", "1e20000000", "1e-20000000", "0e99999999", "1" * 5000])
def test_a_step_that_would_take_long_is_refused_before_it_is_made_exact(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
):
    def exact(text: str) -> Fraction:
        raise AssertionError(f"{text[:40]} is made exact")

    monkeypatch.setattr("handover.cosim.experiments.reference_experiment.Fraction", exact)
    content = manifest(STIMULUS.format(SETUP.format("1", "").replace("1/10", step)))
    level, line = manifest_findings(packed(tmp_path, content, {"in.csv": INPUTS}))[0]
    assert level is Level.FAULT
    assert f"step='{step[:40]}' is not a positive number of seconds" in line


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
