import json
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Generator
from pathlib import Path

import pytest
from click.testing import Result
from support.commands import call
from support.cosim.ssp_of import component, connection, connectors, described, pack_ssp, system
from support.forked_probes import forked_probes
from support.rewritten_archive import rewritten
from support.wording import Wording

from handover.cosim.fmu.file.archive import write_archive
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS
from handover.fmus.contents.fmi2_description import NoFmi2Form

OTHER_KINDS = (("StereoCamera", 3), ("HandAndObject", 2))
"""Units with pictures, and with a simulator of their own."""


@pytest.fixture(scope="module", autouse=True)
def forked() -> Generator[None, None, None]:
    with forked_probes():
        yield


def check(*arguments: object) -> Result:
    return call("check", *arguments)


@pytest.fixture
def broken(tmp_path: Path) -> Path:
    return write_archive(tmp_path / "broken.fmu", {"../../escaped": b"", "readme.txt": b""})


def assert_passes(unit: str, fmi: int) -> None:
    try:
        result = check(cached(unit, fmi), "--json")
    except NoFmi2Form:
        pytest.skip("FMI 2 has no binary variables")
    assert result.exit_code == 0, result.output
    (report,) = json.loads(result.stdout)
    assert all(c["result"] in ("ok", "note") for c in report["checks"]), result.output
    assert "second instance, reset" in report["checks"][-1]["summary"]


@pytest.mark.parametrize(
    ("unit", "fmi"), [("Push", 2), *(pytest.param(*k, marks=pytest.mark.slow) for k in OTHER_KINDS)]
)
def test_a_unit_of_the_catalog_passes(unit: str, fmi: int):
    assert_passes(unit, fmi)


@pytest.mark.platforms
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("unit", UNITS)
def test_every_unit_of_the_catalog_passes(unit: str, fmi: int):
    assert_passes(unit, fmi)


def test_faults_are_reported_with_status_1(broken: Path, tmp_path: Path, wording: Wording):
    def changed(fmi: int, pattern: bytes, new: bytes) -> Path:
        file = tmp_path / "x.fmu"
        return rewritten(cached("Push", fmi), file, lambda _, text: re.sub(pattern, new, text, flags=re.DOTALL))

    without_unknowns = changed(2, rb"<InitialUnknowns>.*</InitialUnknowns>", b"")
    results = [check(file) for file in (broken, without_unknowns)]
    assert [result.exit_code for result in results] == [1, 1]
    wording.check(results[0].stdout)
    wording.check(results[1].stdout.splitlines()[3])
    wording.check(results[1].stdout.splitlines()[-1])
    invalid = changed(3, b'needsExecutionTool="true"', b'needsExecutionTool="?"')
    result = check(invalid, broken, cached("Push", 2), "--json")
    assert result.exit_code == 1
    reports = json.loads(result.stdout)
    assert [report["passed"] for report in reports] == [False, False, True]
    assert reports[0]["checks"][-1]["summary"] == "not tried: its description is invalid, see there"
    assert [c["result"] for c in reports[1]["checks"]] == ["fault"] + 5 * ["not reached"]
    assert [finding["level"] for finding in reports[1]["checks"][0]["findings"]] == ["fault"]


@pytest.mark.parametrize(
    ("fmi", "spoilt", "fault"),
    [
        (2, b"x = 1\ny = '\0'\n", "a zero byte"),
        (3, b"x = 1\ny = '\xf6'\n", "not UTF-8: "),
    ],
)
def test_a_source_that_python_cannot_read_is_reported_with_file_and_line(
    tmp_path: Path, fmi: int, spoilt: bytes, fault: str
):
    place = UNITS["Push"].block.partition(":")[0].replace(".", "/") + ".py"
    source = f"resources/sources/{place}"
    unit = rewritten(cached("Push", fmi), tmp_path / "x.fmu", lambda name, text: text if name != source else spoilt)
    result = check(unit)
    assert result.exit_code == 1
    output = re.search(rf"- instantiation: SyntaxError: {fault}.*\({place}, line 2\)", result.output, re.DOTALL)
    assert output, result.output
    lines = result.stdout.splitlines()
    assert any(line.startswith(" " * 13 + "|   File ") and line.endswith(f'{source}", line 2') for line in lines)
    assert any(line.startswith(" " * 13 + f"| SyntaxError: {fault}") for line in lines)


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
    reported = " ".join(finding["what"] for finding in whole["checks"][0]["findings"])
    assert ("the FMU of 'push' has no variable 'f_B'" in reported) == (status == 1), reported
    assert unit["file"] == str(file / "resources/Push.fmu")
    assert unit["passed"]
    *_, overall = check(file).stdout.splitlines()
    assert overall == (f"faults in 1 of 2: {file}" if status else "no faults in all 2")


def test_the_units_of_an_unpacked_system_are_named_in_its_folder(tmp_path: Path):
    file = pack_ssp(tmp_path / "x.ssp", described(system(component("push", "", "Push.fmu"))), {"Push.fmu": b""})
    with zipfile.ZipFile(file) as archive:
        archive.extractall(tmp_path)
    result = check(tmp_path / "SystemStructure.ssd", "--json")
    found = [report["file"] for report in json.loads(result.stdout)]
    assert found == [str(tmp_path / name) for name in ("SystemStructure.ssd", "Push.fmu")]


def test_what_a_file_says_does_not_steer_the_terminal(tmp_path: Path):
    file = tmp_path / "x.fmu"
    file.write_bytes(b"PK\x05\x06" + bytes(18))
    assert check(file).exit_code == 1
    write_archive(file, {"modelDescription.xml": '<fmiModelDescription fmiVersion="\u009b31m\u202e[bold]"/>'.encode()})
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
