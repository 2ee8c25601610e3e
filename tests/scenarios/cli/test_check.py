import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from ssp_of import component, connection, connectors, described, pack_ssp, system

from handover.fmus.build import cached
from handover.fmus.catalog import UNITS
from handover.fmus.contents.fmi2_description import NoFmi2Form
from handover.scenarios.cli.command import main

LIGHT = ("Push", "IrReflex", "TrajectoryPlanner")


def check(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["check", *(str(a) for a in arguments)])


@pytest.fixture
def broken(tmp_path: Path) -> Path:
    made = tmp_path / "broken.fmu"
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr("../../escaped", b"")
        archive.writestr("readme.txt", b"")
    return made


def assert_passes(unit: str, fmi: int) -> None:
    try:
        result = check(cached(unit, fmi), "--json")
    except NoFmi2Form:
        pytest.skip("FMI 2 has no binary variables")
    assert result.exit_code == 0, result.output
    (report,) = json.loads(result.stdout)
    assert all(c["result"] in ("ok", "note") for c in report["checks"]), result.output
    assert "second instance, reset" in report["checks"][-1]["summary"]


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("unit", LIGHT)
def test_a_light_unit_of_the_catalog_passes(unit: str, fmi: int):
    assert_passes(unit, fmi)


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("unit", [name for name in UNITS if name not in LIGHT])
def test_every_unit_of_the_catalog_passes(unit: str, fmi: int):
    assert_passes(unit, fmi)


def test_a_fault_is_reported_with_status_1(broken: Path):
    result = check(broken)
    assert result.exit_code == 1
    lines = result.stdout.splitlines()
    assert lines[0] == str(broken)
    assert lines[1].split() == ["fault", "archive"]
    assert lines[2] == " " * 11 + (
        "- the archive holds paths that lead out of it; they must be relative: ../../escaped"
    )
    assert "  -        description  not reached: see archive" in lines
    assert lines[-1] == "not usable as it is (1 fault)"


def test_a_unit_that_runs_against_the_standard_is_reported_as_that(tmp_path: Path):
    file = tmp_path / "x.fmu"
    with zipfile.ZipFile(cached("Push", 2)) as source, zipfile.ZipFile(file, "w") as target:
        for name in source.namelist():
            target.writestr(name, re.sub(rb"<InitialUnknowns>.*</InitialUnknowns>", b"", source.read(name), flags=re.S))
    result = check(file)
    assert result.exit_code == 1
    assert "ModelStructure/InitialUnknowns lacks" in result.output
    assert "against the standard: it runs here" in result.output.splitlines()[-1]


def test_what_cannot_be_tried_says_where_the_reason_is(tmp_path: Path):
    file = tmp_path / "x.fmu"
    with zipfile.ZipFile(cached("Push", 3)) as source, zipfile.ZipFile(file, "w") as target:
        for name in source.namelist():
            content = source.read(name).replace(b'needsExecutionTool="true"', b'needsExecutionTool="maybe"')
            target.writestr(name, content)
    result = check(file)
    assert result.exit_code == 1
    assert "  -        run          not tried: its description is invalid, see there" in result.output.splitlines()
    assert result.output.splitlines()[-1].startswith("not usable as it is (1 fault")


@pytest.mark.parametrize(
    ("fmi", "spoilt", "fault"),
    [
        (2, b"x = 1\ny = = 2\n", "invalid syntax"),
        (3, b"x = 1\ny = = 2\n", "invalid syntax"),
        (2, b"x = 1\ny = '\0'\n", "a zero byte"),
        (3, b"x = 1\ny = '\xf6'\n", "not UTF-8: "),
    ],
)
def test_a_source_that_python_cannot_read_is_reported_with_file_and_line(
    tmp_path: Path, fmi: int, spoilt: bytes, fault: str
):
    file = tmp_path / "x.fmu"
    source = "resources/sources/" + UNITS["Push"].block.partition(":")[0].replace(".", "/") + ".py"
    with zipfile.ZipFile(cached("Push", fmi)) as original, zipfile.ZipFile(file, "w") as target:
        for name in original.namelist():
            target.writestr(name, original.read(name) if name != source else spoilt)
    result = check(file)
    assert result.exit_code == 1
    place = source.removeprefix("resources/sources/")
    output = re.search(rf"- instantiation: SyntaxError: {fault}.*\({place}, line 2\)", result.output, re.DOTALL)
    assert output, result.output
    lines = result.stdout.splitlines()
    assert any(line.startswith(" " * 13 + "|   File ") and line.endswith(f'{source}", line 2') for line in lines)
    assert any(line.startswith(" " * 13 + f"| SyntaxError: {fault}") for line in lines)


def test_the_worst_of_several_files_decides(broken: Path):
    result = check(cached("Push", 2), broken)
    assert result.exit_code == 1
    assert "usable: no faults were found" in result.output
    assert "not usable as it is" in result.output


@pytest.mark.parametrize(("output", "status"), [("f_G", 0), ("f_B", 1)])
def test_of_an_ssp_the_system_is_checked_and_then_each_unit(tmp_path: Path, output: str, status: int):
    ends = connectors(**{output: "output"})
    element = component("push", ends, "resources/Push.fmu")
    wired = system(element, connection(f"push.{output}", "f"), before=connectors(f="output"))
    file = pack_ssp(tmp_path / "x.ssp", described(wired), {"resources/Push.fmu": cached("Push", 3).read_bytes()})
    result = check(file, "--json")
    assert result.exit_code == status, result.output
    whole, unit = json.loads(result.stdout)
    assert whole["file"] == str(file)
    assert whole["passed"] == (status == 0)
    told = " ".join(finding["what"] for finding in whole["checks"][0]["findings"])
    assert ("the FMU of 'push' has no variable 'f_B'" in told) == (status == 1), told
    assert unit["file"] == str(file / "resources/Push.fmu")
    assert unit["passed"]


def test_the_units_of_an_unpacked_system_are_named_in_its_folder(tmp_path: Path):
    file = pack_ssp(tmp_path / "x.ssp", described(system(component("push", "", "Push.fmu"))), {"Push.fmu": b""})
    with zipfile.ZipFile(file) as archive:
        archive.extractall(tmp_path)
    result = check(tmp_path / "SystemStructure.ssd", "--json")
    found = [report["file"] for report in json.loads(result.stdout)]
    assert found == [str(tmp_path / name) for name in ("SystemStructure.ssd", "Push.fmu")]


def test_files_that_are_not_there_are_all_reported_before_anything_is_checked(broken: Path, tmp_path: Path):
    result = check(broken, tmp_path / "missing.fmu", tmp_path, Path(os.devnull))
    assert result.exit_code == 2
    assert "missing.fmu: no such file" in result.output
    assert f"{tmp_path}: a folder with neither modelDescription.xml" in result.output
    assert f"{os.devnull}: not a regular file" in result.output
    assert "archive" not in result.output


@pytest.mark.parametrize("arguments", [[], ["--timeout", "0", "x.fmu"], ["--timeout", "soon", "x.fmu"]])
def test_a_usage_error_is_refused(arguments: list[str]):
    assert check(*arguments).exit_code == 2


def test_json_holds_what_was_found(broken: Path):
    result = check("--json", broken)
    assert result.exit_code == 1
    (report,) = json.loads(result.stdout)
    assert report["file"] == str(broken)
    assert not report["passed"]
    assert [c["result"] for c in report["checks"]] == ["fault"] + 5 * ["not reached"]
    (finding,) = report["checks"][0]["findings"]
    assert finding["level"] == "fault"
    assert "lead out" in finding["what"]


def test_any_file_is_reported_without_a_traceback(tmp_path: Path):
    for content in (b"", b"PK\x03\x04", b"PK\x05\x06" + bytes(18), os.urandom(5000)):
        file = tmp_path / "x.fmu"
        file.write_bytes(content)
        result = check(file)
        assert (result.exit_code, result.exception.__class__) == (1, SystemExit)
        assert "fault    " in result.output


def test_what_a_file_says_does_not_steer_the_terminal(tmp_path: Path):
    file = tmp_path / "x.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", '<fmiModelDescription fmiVersion="\u009b31m\u202e[bold]"/>')
    result = check(file)
    assert result.exit_code == 1
    assert "an FMU of FMI \ufffd31m\ufffd[bold]" in result.output


def test_a_reader_who_leaves_does_not_change_the_status(broken: Path, tmp_path: Path):
    command = [sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()", "check", str(broken)]
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, check=False, cwd=tmp_path)
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (1, "checking broken.fmu ...\n")
