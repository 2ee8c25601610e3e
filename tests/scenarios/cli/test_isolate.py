"""`--isolate`: a unit that ends its process fails the run with status 3, and its record is whole."""

from pathlib import Path

import pytest
from support.commands import call, data_in
from support.failing_systems import failing_ssp, native_fmu

from handover.cosim.master.unit_options import isolated_units
from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.fmus.build import cached


@pytest.mark.parametrize(
    ("fault", "wanted", "how"),
    [
        ("crashes_in_step", "bad", "unit bad crashed in fmi3DoStep at t = 0.3 s: segmentation fault"),
        ("aborts_in_terminate", "foreign", "unit bad crashed in fmi3Terminate at t = 1 s: aborted"),
        ("hangs_in_step", "all", "bad: fmi3DoStep at t = 0.3 s did not return within 0.3 s"),
        ("crashes_in_initialize", "bad", "crashed in fmi3EnterInitializationMode"),
    ],
)
def test_a_unit_that_ends_its_process_fails_the_run(fault: str, how: str, wanted: str, tmp_path: Path):
    out = tmp_path / "r"
    given = ("--out", out, "--isolate", wanted, "--call-limit", "0.3", "--no-report")
    result = call("run", failing_ssp(tmp_path, fault, 3), *given)
    assert result.exit_code == 3, result.output
    assert how in result.output.replace("\n", " ")
    if fault == "crashes_in_initialize":  # before the run has begun
        assert not out.exists()
        return
    summary = data_in(out)
    assert (summary["success"], summary["failure"]["instance"]) == (False, "bad")
    assert any("about to" in line for line in summary["failure"]["log"])
    assert Record(out / "signals.parquet").time[-1] == pytest.approx(1.0 if "terminate" in fault else 0.3)
    assert data_in(out, "run")["master"]["isolated"] == [wanted]


def test_foreign_units_are_those_that_this_project_did_not_build_and_all_are_all():
    system = System()
    system.add("push", cached("Push", fmi=3))
    system.add("theirs", native_fmu("sine"))
    assert isolated_units(system, ["foreign"]) == {"theirs"}
    assert isolated_units(system, ["foreign", "push"]) == isolated_units(system, ["all"]) == {"push", "theirs"}
    assert isolated_units(system, []) == frozenset()
    system = System()
    for name in ("foreign", "all"):  # by name they cannot be isolated
        system.add(name, native_fmu("gain"))
    assert isolated_units(system, ["all"]) == isolated_units(system, ["foreign"]) == {"foreign", "all"}


@pytest.mark.parametrize("again", [(), ("--isolate", "all")])
def test_a_failed_run_is_resumed_with_the_units_isolated_that_were(again: tuple[str, ...], tmp_path: Path):
    """The unit fails again at the same step; as one in this process it would end the test."""
    out = tmp_path / "r"
    given = ("--out", out, "--isolate", "bad", "--checkpoint", "0.2", "--no-report")
    failed = call("run", failing_ssp(tmp_path, "crashes_in_step", 3), *given)
    assert failed.exit_code == 3
    assert f"to resume: handover resume {out}\n" in failed.output
    record = (out / "signals.parquet").read_bytes()
    resumed = call("resume", out, "--no-report", *again)
    assert resumed.exit_code == 3, resumed.output
    assert "unit bad crashed in fmi3DoStep at t = 0.3 s" in resumed.output.replace("\n", " ")
    assert (out / "signals.parquet").read_bytes() == record
