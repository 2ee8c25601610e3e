"""`handover run FILE.fmu`: one unit by itself, with its inputs constant or from a table, as `fmpy simulate` runs it."""

import contextlib
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from click.testing import Result
from support.commands import call, data_in, refusal, run_command
from support.cosim import decay
from support.cosim.native_units import native_fmu
from support.cosim.ssp_of import component, described, pack_ssp, system
from support.killed_run import killed_run
from support.rewritten_archive import described_otherwise

import handover
from handover.cosim.exceptions import InvalidSsp
from handover.cosim.fmu.file.default_experiment import NoStep
from handover.cosim.record.reader import Record
from handover.scenarios.runs.execution.request import is_file
from handover.scenarios.runs.execution.ssp_run import naming_step, open_experiment
from handover.scenarios.runs.reporting.run_page import write_run_page
from handover.scenarios.runs.results.run_folder import RunFolder, sha256_of

PULL = "time,f\n0,0\n0.5,2\n0.5,-1\n0.8,1\n"


def run(file: object, *arguments: object) -> Result:
    return call("run", file, *arguments)


def table(folder: Path, text: str) -> Path:
    file = folder / "inputs.csv"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def decay_library(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return decay.compiled(tmp_path_factory.mktemp("decay"))


@pytest.mark.parametrize("fmi", [2, 3])
def test_it_gives_what_fmpy_gives_and_leaves_the_folder_of_a_run(tmp_path: Path, fmi: int):
    file, out, inputs = native_fmu("mass", fmi), tmp_path / "out", table(tmp_path, PULL)
    result = run(file, "--input", inputs, "-p", "m=2", "-p", "k=10", "--format", "csv", "--no-report", "--out", out)
    assert result.exit_code == 0, result.output
    assert f"{file.name} succeeded: ran to 1 s" in result.output
    assert {p.name for p in out.iterdir()} == {"summary.json", "run.json", "signals.parquet", "signals.csv"}
    source = data_in(out, "run")["source"]
    assert (source["stop"], source["step"], source["parameters"]) == ("1", None, ["m=2", "k=10"])
    assert source["input"] == str(inputs)
    record = Record(out / "signals.parquet")
    rows = [(0.0, 0.0), (0.5, 2.0), (0.5, -1.0), (0.8, 1.0)]
    signals = np.array(rows, dtype=[("time", "f8"), ("f", "f8")])
    start = {"m": 2.0, "k": 10.0}
    expected: Any = fmpy.simulate_fmu(
        str(file), stop_time=1.0, output_interval=0.01, input=signals, start_values=start, fmi_type="CoSimulation"
    )
    assert len(record.time) == len(expected) == 101
    for name in ("x", "v"):
        np.testing.assert_allclose(record[f"mass.{name}"], expected[name], rtol=0, atol=1e-12)
    assert np.ptp(expected["x"]) > 0.01


def page_of(out: Path) -> str:
    folder = RunFolder.of_run(out)
    write_run_page(folder)
    return folder.report.read_text(encoding="utf-8")


def test_inputs_stay_at_their_start_values(tmp_path: Path):
    given = ("-p", "f=2", "--stop-time", "1/2", "--step", "1/4", "--no-report")
    result = run(native_fmu("mass", 3), *given, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    page = page_of(tmp_path / "out")
    assert "mass, an FMU by itself" in page
    assert "given start value" in page
    record = Record(tmp_path / "out" / "signals.parquet")
    assert record.time.tolist() == [0.0, 0.25, 0.5]
    assert record["mass.x"].tolist() == pytest.approx([0.0, 0.0625, 0.25])


def test_a_unit_is_given_its_tolerance_and_the_stop_time_and_both_are_kept(tmp_path: Path):
    out = tmp_path / "out"
    given = "--stop", "0.35", "--unit-tolerance", "1e-3", "--unit-tolerance", "clerk=1e-6", "--no-report", "--out", out
    result = run(native_fmu("clerk", 2), *given)
    assert result.exit_code == 0, result.output
    record = Record(out / "signals.parquet")
    assert record["clerk.tolerance"].tolist() == [1e-6] * 5
    assert record["clerk.stop"][0] == record.time[-1] == pytest.approx(0.4)
    data = data_in(out, "run")
    assert data["experiment"] == {"start": 0.0, "stop": 0.35, "tolerances": {"clerk": 1e-6}}
    assert data["master"]["unit_tolerances"] == {"all": 1e-3, "clerk": 1e-6}


@pytest.mark.parametrize(
    ("given", "start", "times"),
    [
        ((), 2.0, [2.0, 2.5, 3.0]),
        (("--start", "2.25", "--stop", "3.25"), 2.25, [2.25, 2.75, 3.25]),
        (("--start", "-1", "--stop", "1/4"), -1.0, [-1.0, -0.5, 0.0, 0.5]),
    ],
)
def test_a_run_starts_where_the_fmu_or_the_command_says(
    given: Sequence[str], start: float, times: list[float], tmp_path: Path
):
    fmu = edited(tmp_path, b'startTime="0" stopTime="1"', b'startTime="2" stopTime="3"', "clerk")
    out = tmp_path / "out"
    result = run(fmu, "--step", "0.5", *given, "--no-report", "--out", out)
    assert result.exit_code == 0, result.output
    record = Record(out / "signals.parquet")
    assert record.time.tolist() == record["clerk.now"].tolist() == times
    assert set(record["clerk.start"].tolist()) == {start}
    assert data_in(out)["simulated_seconds"] == times[-1] - start
    assert data_in(out, "run")["experiment"]["start"] == start


def test_what_is_not_continuous_is_held(tmp_path: Path):
    inputs = table(tmp_path, "time,truth_in,count_in\n0,true,1\n0.3,0,5\n0.7,TRUE,-2\n")
    result = run(native_fmu("discrete_passer", 3), "--input", inputs, "--no-report", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    record = Record(tmp_path / "out" / "signals.parquet")
    at_begin = np.maximum(np.arange(11) - 1, 0)  # outputs at the end of a step are of the inputs at its beginning
    assert record["discrete_passer.count"].tolist() == [1 if k < 3 else 5 if k < 7 else -2 for k in at_begin]
    assert record["discrete_passer.truth"].tolist() == [not 3 <= k < 7 for k in at_begin]


def test_entries_of_an_array_are_columns(tmp_path: Path):
    inputs = table(tmp_path, "time,u[3],u[1]\n0,0,1\n1,10,1\n")
    given = ("--input", inputs, "-p", "u=7,8,9", "--no-report")
    result = run(native_fmu("array_passer"), *given, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    last = Record(tmp_path / "out" / "signals.parquet")["array_passer.y"][-1]
    assert last.tolist() == pytest.approx([1.0, 8.0, 9.0])


def test_an_input_has_a_start_value_or_a_column_and_a_late_table_is_reported(tmp_path: Path):
    mass, inputs = native_fmu("mass", 3), table(tmp_path, "time,f\n7,0\n8,2\n")
    for command in (("run", mass, "-p", "f=3"), ("sweep", mass, "f=1,2"), ("sweep", mass, "m=1,2", "-p", "f=3")):
        assert "f: the table of inputs gives it" in refusal(*command, "--input", inputs)
    result = run(mass, "--input", inputs, "--no-report", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert len(data_in(tmp_path / "out", "run")["notes"]) == 1


@pytest.mark.parametrize("order", [1, -1])
def test_an_array_and_an_entry_of_it_are_not_given_both(order: int):
    given = ["-pu=7,8,9", "-pu[2]=1"][::order]
    assert "u and u[2] are both given" in refusal("run", native_fmu("array_passer"), "--stop", "1", *given)
    varied = ("u=7,8,9;1,2,3", "u[2]=1,2")[::order]
    assert "u and u[2] are both given" in refusal("sweep", native_fmu("array_passer"), "--stop", "1", *varied)


def test_a_start_value_that_is_nan_is_warned_of_unless_another_is_given(
    decay_library: bytes, tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    undefined = ('<Real start="0"', '<Real start="NaN"')
    file = decay.pack(tmp_path / "decay.fmu", decay_library, decay.edited(undefined))
    line = "Decay.u starts from NaN, as its FMU says"
    for given in ((), ("-p", "u=0")):
        caplog.clear()
        result = run(file, *given, "--no-report", "--out", tmp_path / f"out{len(given)}")
        assert result.exit_code == 0, result.output
        warned = data_in(tmp_path / f"out{len(given)}", "run").get("warnings", [])
        assert [line in text for text in (caplog.text, " ".join(warned))] == [not given] * 2


@pytest.mark.parametrize("initial", ["exact", "approx"])
def test_a_local_variable_starts_from_what_is_given(decay_library: bytes, tmp_path: Path, initial: str):
    """x' = -x from the given x; where that is a guess, the unit may find another one."""
    local = ('"local" variability="continuous"><Real', f'"local" initial="{initial}"><Real start="1"')
    file = decay.pack(tmp_path / "decay.fmu", decay_library, decay.edited(local))
    result = run(file, "-p", "x=3", "--no-report", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    record = Record(tmp_path / "out" / "signals.parquet")
    assert record["Decay.y"][1:] == pytest.approx(3.0 * np.exp(-record.time[1:]))


def test_a_run_with_a_table_resumes_to_the_same_bytes(tmp_path: Path):
    arguments = ("run", native_fmu("mass", 2), "--input", table(tmp_path, PULL), "-p", "k=30", "--start", "-0.2")
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    assert call(*arguments, "--no-report", "--out", whole).exit_code == 0
    killed_run(parted, 0.6, *arguments, "--no-report", "--checkpoint", "0.25")
    result = call("resume", parted, "--no-report")
    assert result.exit_code == 0, result.output
    assert (parted / "signals.parquet").read_bytes() == (whole / "signals.parquet").read_bytes()


def test_the_option_is_added_to_faults_of_steps_alone(tmp_path: Path):
    other = "b: a limit of 0 m; give one that is above 0 s"
    assert naming_step([NoStep("a", "none"), other]) == [f"{NoStep('a', 'none')}, such as by --step 0.01", other]
    parts = {"resources/unit.fmu": edited(tmp_path, b' stopTime="1" stepSize="0.01"', b"")}
    file = pack_ssp(tmp_path / "a.ssp", described(system(component("a"))), parts)
    with contextlib.ExitStack() as opened, pytest.raises(InvalidSsp, match=r"above 0 s, such as by --step 0\.01$"):
        open_experiment(file, None, None, opened)


@pytest.mark.parametrize(
    ("experiment", "arguments", "taken"),
    [
        (b'stopTime="1"', ["--stop", "0.01"], 0.002),  # the same step however long a run is
        (b'stopTime="0.9"', ["--stop", "0.01"], 0.002),
        (b"", ["--stop", "0.05"], 0.0001),
    ],
)
def test_an_fmu_that_proposes_no_step_takes_a_500th(
    tmp_path: Path, experiment: bytes, arguments: Sequence[str], taken: float
):
    file, out = edited(tmp_path, b'stopTime="1" stepSize="0.01"', experiment), tmp_path / "out"
    result = run(file, *arguments, "--strict", "--out", out)
    assert (result.exit_code, out.exists()) == (2, False), result.output
    assert "mass: its FMU proposes no communication step" in result.output
    result = run(file, *arguments, "--no-report", "--out", out)
    assert result.exit_code == 0, result.output
    assert Record(out / "signals.parquet").time[:3] == pytest.approx([0.0, taken, 2 * taken])
    (line,) = data_in(out, "run")["warnings"]
    assert f"{taken:g} s is taken" in line
    assert run(file, *arguments, "--step", "0.01", "--strict", "--no-report", "--out", tmp_path / "a").exit_code == 0


def test_a_step_is_asked_for_where_there_is_no_time_to_take_it_from(tmp_path: Path):
    file = edited(tmp_path, b'stopTime="1" stepSize="0.01"', b"")
    with pytest.raises(handover.InvalidInput, match="proposes no communication step; give one"):
        handover.open(file)
    result = run(file, "--stop", "1000000", "--strict")
    assert "2000 s is taken" in result.output  # no stop time is so large that it stands for none
    with handover.open(file, step=0.01, start=10**6) as s:
        assert s.step(0.02) == 10**6 + 0.02
    with handover.open(file, step=0.01) as s:
        assert s.step(0.02) == 0.02


def test_a_fault_that_co_simulation_does_not_touch_is_warned_of_once(tmp_path: Path):
    file, out = edited(tmp_path, b'name="x"', b'name="x" description="" annotation="odd"'), tmp_path / "out"
    refusal("run", file, "--out", out)  # of an output: it touches co-simulation
    local = b'<Float64 name="s" valueReference="90" causality="local" derivative="999"/></ModelVariables>'
    file = edited(tmp_path, b"</ModelVariables>", local)
    done = run_command("run", file, "--no-report", "--out", out)
    assert done.status == 0, done.errors
    assert done.errors.count("references value reference 999 which does not exist") == 1
    (line,) = data_in(out, "run")["warnings"]
    assert line.startswith("edited.fmu: The derivative attribute of model variable s (line ")
    page = page_of(out)
    assert "<h3>Warnings</h3>" in page
    assert '<a href="#master">1 warning</a>' in page
    assert "value reference 999" in page
    strict = refusal("run", file, "--strict", "--out", tmp_path / "strict")
    assert "its modelDescription.xml is not valid: The derivative attribute" in strict
    assert not (tmp_path / "strict").exists()


def edited(folder: Path, old: bytes, new: bytes, unit: str = "mass") -> Path:
    def edit(text: str) -> str:
        assert old.decode() in text
        return text.replace(old.decode(), new.decode(), 1)

    return described_otherwise(native_fmu(unit, 3), folder / "edited.fmu", edit)


INSIDE = (
    '"local" variability="continuous"><Real unit="m"/>',
    '"local" variability="continuous"><Real unit="m"/></ScalarVariable><ScalarVariable name="p[2]" valueReference="2" '
    'causality="local" variability="continuous"><Real/>',
)
WITHOUT_OUTPUTS = (
    ('causality="output" variability="continuous"><Real unit="m" max="100"/>', 'causality="local"><Real unit="m"/>'),
    ("<Outputs>", "<!--"),
    ("</InitialUnknowns>", "-->"),
)


def test_variables_inside_of_a_unit_are_recorded_where_they_are_asked_for(decay_library: bytes, tmp_path: Path):
    """x' = -x + u from 1, so x = u + (1 - u) exp(-t), of which y is a copy."""
    file = decay.pack(tmp_path / "decay.fmu", decay_library, decay.edited(INSIDE, ('index="3"', 'index="4"')))
    out = tmp_path / "out"
    arguments = ("-p", "u=3", "--record", "Decay.x", "--record", "D*.p[?]", "--no-report")
    result = run(file, *arguments, "--checkpoint", "0.5", "--out", out)
    assert result.exit_code == 0, result.output
    record = Record(out / "signals.parquet")
    assert set(record.signals) == {"Decay.y", "Decay.x", "Decay.p[2]"}
    for name in record.signals:
        assert record[name] == pytest.approx(3.0 - 2.0 * np.exp(-record.time))
    again = run("--config", out / "run.json", "--no-report", "--out", tmp_path / "again")
    assert again.exit_code == 0, again.output
    assert (tmp_path / "again" / "signals.parquet").read_bytes() == (out / "signals.parquet").read_bytes()


def test_a_unit_without_outputs_leaves_its_local_variables(decay_library: bytes, tmp_path: Path):
    file = decay.pack(tmp_path / "decay.fmu", decay_library, decay.edited(*WITHOUT_OUTPUTS))
    handover.run(file, out=tmp_path / "out", u=3.0)
    record = Record(tmp_path / "out" / "signals.parquet")
    assert set(record.signals) == {"Decay.x", "Decay.y"}
    assert record["Decay.x"] == pytest.approx(3.0 - 2.0 * np.exp(-record.time))
    assert ["no outputs" in line for line in data_in(tmp_path / "out", "run")["notes"]] == [True]
    handover.run(file, out=tmp_path / "asked", record="Decay.y")
    assert Record(tmp_path / "asked" / "signals.parquet").signals == ("Decay.y",)


def test_folders_of_an_fmu_and_of_an_ssp_do_what_the_files_do_and_are_left_as_they_are(tmp_path: Path):
    """The FMU of the SSP is a folder itself, and beside it lies what is not of it; a description may have any name."""
    description, mass = described(system(component("mass"))), native_fmu("mass", 3)
    file = pack_ssp(tmp_path / "a.ssp", description, {"resources/unit.fmu": mass})
    folder = tmp_path / "system"
    unit = folder / "resources" / "unit.fmu"
    with zipfile.ZipFile(mass) as archive:
        archive.extractall(unit)
    for name in ("SystemStructure.ssd", "other.ssd"):
        (folder / name).write_text(description, encoding="utf-8")
    for path in [*folder.rglob("*"), folder]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    records: list[bytes] = []
    for k, subject in enumerate((file, folder, folder / "other.ssd", mass, unit)):
        given = ("--stop", "1", "-p", "mass.x0=3" if k < 3 else "x0=3", "--no-report", "--out", tmp_path / str(k))
        assert run(subject, *given).exit_code == 0
        records.append((tmp_path / str(k) / "signals.parquet").read_bytes())
    assert [len({*records[:3]}), len({*records[3:]})] == [1, 1]
    for command in ("check", "info"):
        assert call(command, unit).exit_code == 0
    refusal("sweep", unit, "--sweep", "f=0,1", "--out", tmp_path / "campaign")
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    assert len(sha256_of(unit)) == 64
    assert sha256_of(unit) != sha256_of(tmp_path / "0")


def test_no_name_is_too_long_to_be_no_files():
    assert not is_file("A" * 300_000)
    assert not is_file("a\0b")
