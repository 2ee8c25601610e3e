"""`--isolate`: a unit that ends its process fails the run with status 3, and its record is whole."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from support.failing_systems import failing_ssp, native_fmu

from handover.cosim.master.unit_options import isolated_units
from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.cli.command import main


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["run", *(str(a) for a in arguments), "--no-report"])


def read(out: Path, name: str) -> Any:
    return json.loads((out / name).read_text())


CRASH = "unit bad crashed in fmi3DoStep at t = 0.3 s: segmentation fault"


@pytest.mark.parametrize(
    ("fault", "wanted", "how"),
    [
        ("crashes_in_step", "bad", CRASH),
        ("crashes_in_step", "foreign", CRASH),
        ("crashes_in_step", "all", CRASH),
        ("exits_in_set", "bad", "unit bad crashed in fmi3SetFloat64 at t = 0.3 s: it ended its process with status 0"),
        ("aborts_in_terminate", "foreign", "unit bad crashed in fmi3Terminate at t = 1 s: aborted"),
        ("hangs_in_step", "all", "bad: fmi3DoStep at t = 0.3 s did not return within 0.3 s"),
    ],
)
def test_a_unit_that_ends_its_process_fails_the_run(fault: str, how: str, wanted: str, tmp_path: Path):
    out = tmp_path / "r"
    result = run(failing_ssp(tmp_path, fault, 3), "--out", out, "--isolate", wanted, "--call-limit", "0.3")
    assert result.exit_code == 3, result.output
    assert how in result.output.replace("\n", " ")
    summary = read(out, "summary.json")
    assert (summary["success"], summary["failure"]["instance"]) == (False, "bad")
    assert any("about to" in line for line in summary["failure"]["log"])
    assert Record(out / "signals.parquet").time[-1] == pytest.approx(1.0 if "terminate" in fault else 0.3)
    assert read(out, "run.json")["master"]["isolated"] == [wanted]


def test_one_that_does_so_before_the_run_has_begun_leaves_no_folder(tmp_path: Path):
    result = run(failing_ssp(tmp_path, "crashes_in_initialize", 2), "--out", tmp_path / "r", "--isolate", "bad")
    assert result.exit_code == 3, result.output
    assert "crashed in fmi2EnterInitializationMode" in result.output.replace("\n", " ")
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_unknown_names_are_refused(command: str, tmp_path: Path):
    out = str(tmp_path / "r")
    result = CliRunner().invoke(main, [command, "flyer_impedance", "--isolate", "hand", "--out", out])
    assert result.exit_code == 2, result.output
    assert "there is no unit 'hand' to isolate; there are " in result.output.replace("\n", " ")
    assert not (tmp_path / "r").exists()


def test_foreign_units_are_those_that_this_project_did_not_build():
    system = System()
    system.add("push", cached("Push", fmi=3))
    system.add("theirs", native_fmu("sine"))
    assert isolated_units(system, ["foreign"]) == {"theirs"}
    assert isolated_units(system, ["foreign", "push"]) == isolated_units(system, ["all"]) == {"push", "theirs"}
    assert isolated_units(system, []) == frozenset()


def test_units_that_are_named_like_the_words_for_several_are_isolated_by_all():
    """As the help says: by name they cannot be."""
    system = System()
    for name in ("foreign", "all"):
        system.add(name, native_fmu("gain"))
    assert isolated_units(system, ["all"]) == {"foreign", "all"}
    assert isolated_units(system, ["foreign"]) == {"foreign", "all"}  # both were not built by this project
    shown = " ".join(CliRunner().invoke(main, ["run", "--help"]).output.split())
    assert "Units that are named foreign or all themselves are isolated by all only" in shown


@pytest.mark.parametrize("again", [(), ("--isolate", "all")])
def test_a_failed_run_is_resumed_with_the_units_isolated_that_were(again: tuple[str, ...], tmp_path: Path):
    """The unit fails again at the same step; as one in this process it would end the test."""
    out = tmp_path / "r"
    ssp = failing_ssp(tmp_path, "crashes_in_step", 3)
    assert run(ssp, "--out", out, "--isolate", "bad", "--checkpoint", "0.2").exit_code == 3
    record = (out / "signals.parquet").read_bytes()
    resumed = CliRunner().invoke(main, ["resume", str(out), "--no-report", *again])
    assert resumed.exit_code == 3, resumed.output
    assert "unit bad crashed in fmi3DoStep at t = 0.3 s" in resumed.output.replace("\n", " ")
    assert (out / "signals.parquet").read_bytes() == record
