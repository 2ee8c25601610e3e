"""The files of FMI-LS-REF in our FMUs: manifest, parameter sets, and an experiment that any host can repeat."""

import csv
import io
import itertools
import xml.etree.ElementTree as ET
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import fmpy
import pytest
import xmlschema
from support.wording import Wording

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.experiments.manifest import FOLDER, MANIFEST, related_files
from handover.cosim.experiments.reference_experiment import Setup, experiments_in
from handover.cosim.experiments.signal_table import InvalidTable
from handover.cosim.fmu.file.archive import FmuArchive
from handover.fmus.build import ExperimentRequest, build
from handover.fmus.catalog import Entry
from handover.fmus.contents.related_files import (
    PAGE,
    CannotRecordExperiment,
    InvalidParameterSet,
    NothingToCompare,
    ParameterSet,
)

SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"
FORMS = [(2, False), (3, False), (3, True)]


def unit(block: str, step: Fraction = Fraction(1, 10)) -> Entry:
    return Entry(block.rpartition(":")[2], f"support.sample_units.{block}", step, "a sample")


EVERY_KIND, SAMPLED = unit("every_kind:EveryKind"), unit("sampled:Sampled", Fraction(1, 30))
CHAOTIC, EYE = unit("chaotic:Chaotic"), unit("eye:Eye", Fraction(1, 30))
SETS = [
    ParameterSet(
        name="keen",
        description="A set",
        values={"gain": 3.0, "p0": [1.0, 2.0, 4.0], "mood": "keen", "fast": True, "n": 4},
        origins={"gain": "table 1 (stated)"},
        labels=("origin:published",),
    )
]


def contents(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def rows_of(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(content.decode())))


def schema() -> Any:
    """Return the standard's schema, with the two that it takes from FMI 3 as FMPy brings them."""
    text = Path(__file__).with_name("schema").joinpath("fmi-ls-ref.xsd").read_text(encoding="utf-8")
    for name in ("fmi3LayeredStandardManifest.xsd", "fmi3Annotation.xsd"):
        text = text.replace(f"https://raw.githubusercontent.com/modelica/fmi-standard/main/schema/{name}",
                            (SCHEMAS / name).as_uri())  # fmt: skip
    return xmlschema.XMLSchema(text, allow="local")


def setup_of(fmu: Path) -> Setup:
    (experiment,) = experiments_in(related_files(FmuArchive(fmu))[0])[0]
    return experiment.setup


def test_an_experiment_is_stored_with_its_result(tmp_path: Path):
    fmu = build(EVERY_KIND, 3, tmp_path, platforms=["host"], parameter_sets=SETS, experiment=ExperimentRequest())
    files = contents(fmu)
    schema().validate(io.BytesIO(files[MANIFEST]))
    listed, findings = related_files(FmuArchive(fmu))
    assert findings == []
    assert [f.role for f in listed] == ["model", "document", "document", "parameter", "experiment", "result"]
    assert listed[0].path == "resources/sources/support/sample_units/every_kind.py"
    stimulus, result = (rows_of(files[f"{FOLDER}/smoke-test/{name}.csv"]) for name in ("stimulus", "result"))
    assert {"a", "v[3]", "M[2,1]", "k", "on", "mood_in", "word"} <= set(stimulus[0])
    assert (stimulus[0]["mood_in"], stimulus[0]["on"], stimulus[0]["word"]) == ("CALM", "true", "hello")
    assert float(result[-1]["total"]) == 50
    assert (result[-1]["off"], result[-1]["mood_out"]) == ("false", "CALM")
    assert result[-1]["sentence"] == 'a<b&"c" 100% #1 hello'
    assert setup_of(fmu).relative == 1e-9
    assert set(setup_of(fmu).parameters) == {"gain", "p0", "n", "fast", "mood", "label", "seed"}


@pytest.mark.slow
def test_an_experiment_is_repeated_in_another_form(tmp_path: Path):
    fmu = build(EVERY_KIND, 2, tmp_path, platforms=["host"], parameter_sets=SETS, experiment=ExperimentRequest())
    schema().validate(io.BytesIO(contents(fmu)[MANIFEST]))
    report = check_fmu(fmu, 60.0)
    assert report.passed
    assert report.sections[-1].summary == "smoke-test/stimulus.csv: 50 steps, 8 outputs compared, all equal"


def test_without_proof_there_are_source_documents_and_parameters(tmp_path: Path):
    fmu = build(SAMPLED, 3, tmp_path, platforms=["host"])
    files = contents(fmu)
    schema().validate(io.BytesIO(files[MANIFEST]))
    assert [f.role for f in related_files(FmuArchive(fmu))[0]] == ["model", "document", "document"]
    assert "There is none. `handover build --prove` records one." in files[PAGE].decode()
    assert not any("smoke-test" in name for name in files)


def test_a_stimulus_of_ones_own_is_played(tmp_path: Path):
    given = tmp_path / "given.csv"
    given.write_text("time,u\n0.0,1.0\n0.1,10.0\n0.2,10.0\n")
    fmu = build(SAMPLED, 3, tmp_path, platforms=["host"], experiment=ExperimentRequest(given))
    result = rows_of(contents(fmu)[f"{FOLDER}/smoke-test/result.csv"])
    assert [float(row["time"]) for row in result] == pytest.approx([k / 30 for k in range(7)])
    gained = [float(after["y"]) - float(before["y"]) for before, after in itertools.pairwise(result)]
    assert gained == pytest.approx([0.1] * 3 + [1.0] * 3, abs=1e-12)  # a tick takes the input of its instant


def test_a_stimulus_at_fault_is_refused_before_anything_is_written(tmp_path: Path, wording: Wording):
    given = tmp_path / "given.csv"
    for block, content in (
        (CHAOTIC, "time,w\n0,1\n1,1\n"),
        (CHAOTIC, "time,x\n0,nan\n1,1\n"),
        (CHAOTIC, "time,x\n0,0.1\n0,0.1\n"),
        (CHAOTIC, "time,x\n0,2.0\n1,0.1\n"),
        (CHAOTIC, "time,x\n0,0.1\n"),
        (SAMPLED, "time,u\n0.0,1.0\n0.25,1.0\n"),  # ends within a step
    ):
        given.write_text(content)
        with pytest.raises(InvalidTable) as caught:
            build(block, 3, tmp_path / "out", platforms=["host"], experiment=ExperimentRequest(given))
        wording.check(caught.value)
        assert not (tmp_path / "out").exists()


def test_a_unit_of_pictures_or_that_fails_is_not_proven(tmp_path: Path, wording: Wording):
    with pytest.raises(NothingToCompare) as nothing:
        build(EYE, 3, tmp_path / "out", platforms=["host"], experiment=ExperimentRequest())
    wording.check(nothing.value)
    given = tmp_path / "given.csv"
    given.write_text("time,a\n0.0,1.0\n0.1,666\n0.3,1\n")
    with pytest.raises(CannotRecordExperiment, match=r"fmi3DoStep at t = 0\.1 s .*the number of the beast"):
        build(EVERY_KIND, 3, tmp_path / "out", platforms=["host"], experiment=ExperimentRequest(given))


@pytest.mark.parametrize(("fmi", "scalar"), FORMS)
def test_a_parameter_set_has_the_variables_of_its_form(tmp_path: Path, fmi: int, scalar: bool):
    files = contents(build(EVERY_KIND, fmi, tmp_path, scalar=scalar, platforms=["host"], parameter_sets=SETS))
    root = ET.fromstring(files[f"{FOLDER}/parameters/keen.ssv"])
    assert root.get("version") == ("1.0" if fmi == 2 else "2.0")
    found = {p.get("name"): (p[0].tag.partition("}")[2], p[0].get("value")) for p in root[0]}
    real, whole = ("Real", "Integer") if fmi == 2 else ("Float64", "Int64")
    places = {"p0": (real, "1.0 2.0 4.0")}
    if fmi == 2 or scalar:
        places = {f"p0[{i}]": (real, value) for i, value in enumerate(("1.0", "2.0", "4.0"), 1)}
    others = {"gain": (real, "3.0"), "mood": ("Enumeration", "KEEN"), "fast": ("Boolean", "true"), "n": (whole, "4")}
    assert found == places | others
    assert root[0][0].get("description") == "table 1 (stated)"


def test_a_parameter_set_that_is_no_files_or_does_not_fit_is_refused(tmp_path: Path, wording: Wording):
    for names, values in (
        (["../a"], {"gain": 3.0}),
        (["a b"], {"gain": 3.0}),
        ([""], {"gain": 3.0}),
        (["a", "A"], {"gain": 3.0}),
        (["a"], {"gains": 1.0}),
        (["a"], {"gain": 11.0}),
    ):
        sets = [ParameterSet(name=name, description="b", values=values) for name in names]
        with pytest.raises(InvalidParameterSet) as caught:
            build(EVERY_KIND, 3, tmp_path / "out", parameter_sets=sets)
        wording.check(caught.value)
        assert not (tmp_path / "out").exists()
