"""Units that crash or hang: the command names them, keeps the record, leaves nothing else and exits with status 3."""

import sys
from fractions import Fraction
from pathlib import Path

import pytest
from support.commands import data_in
from support.cosim.native_units import native_fmu
from support.failing_systems import failing_ssp, start

from handover.cosim.record.reader import Record
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from handover.fmus.build import build_block

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no process can be forked that tells")

CRASH = "unit bad crashed in fmi{}DoStep at t = 0.2 s: segmentation fault"
EXIT = "unit bad crashed in fmi{}DoStep at t = 0.2 s: it ended the process with status 0"
HANG = "bad: fmi{}DoStep at t = 0.2 s did not return within 0.5 s"


@pytest.mark.parametrize(
    ("bad", "fmi", "text", "kind", "has_page"),
    [
        ("crashes", 3, CRASH, "crash", True),
        ("exits", 3, EXIT, "crash", False),
        ("hangs", 2, HANG, "hang", False),
    ],
)
def test_a_run_whose_unit_does_not_come_back_is_complete_to_the_last_good_step(
    bad: str, fmi: int, text: str, kind: str, has_page: bool, tmp_path: Path
):
    more = () if has_page else ("--no-report",)
    ssp = failing_ssp(tmp_path, bad, fmi)
    status, shown, errors = start(tmp_path, ssp, "--out", "r", "--call-limit", "0.5", *more).wait()
    assert status == 3, errors
    said, *doing = errors.splitlines()
    assert said == text.format(fmi)
    assert [line.endswith("writing the report ...") for line in doing] == [True] * has_page
    assert f"{bad}.ssp failed: a unit failed: " in shown
    assert shown.endswith("report: r/report.html\n" if has_page else "results: r\n")
    out = tmp_path / "r"
    left = {"run.json", "signals.parquet", "summary.json"} | ({"figures", "report.html"} if has_page else set())
    assert {p.name for p in out.iterdir()} == left
    assert list((tmp_path / "tmp").iterdir()) == []
    assert Record(out / "signals.parquet").time.tolist() == [0.0, 0.1, 0.2]
    summary, run = data_in(out), data_in(out, "run")
    assert summary["failure"] == run["failure"]
    assert (summary["success"], summary["complete"], summary["simulated_seconds"]) == (False, False, 0.2)
    failure = {key: summary["failure"][key] for key in ("kind", "instance", "call", "time", "log")}
    assert failure == {"kind": kind, "instance": "bad", "call": f"fmi{fmi}DoStep", "time": 0.2, "log": []}
    assert [u["name"] for u in summary["units"]] == [u["name"] for u in run["system"]["units"]]
    if kind == "crash":  # nobody could tell any more what the units had cost
        assert {(u["steps"], u["cpu_seconds"]) for u in summary["units"]} == {(None, None)}


def test_a_crash_as_units_are_made_is_named_and_leaves_nothing(tmp_path: Path):
    s = System()
    for i in range(6):
        s.add(f"unit_{i}", native_fmu("crashes_on_fifth"))
    going = start(tmp_path, write_ssp(s, tmp_path / "six.ssp", "six"), "--stop", "1", "--out", "r")
    status, _, errors = going.wait()
    said = "unit unit_4 crashed in fmi3InstantiateCoSimulation at t = 0 s: segmentation fault\n"
    assert (status, errors) == (3, said)
    assert not (tmp_path / "r").exists()
    assert list((tmp_path / "tmp").iterdir()) == []


@pytest.mark.slow
def test_a_unit_that_holds_the_whole_process_is_reported_by_the_parent(tmp_path: Path):
    s = System()
    s.add("bad", build_block("support.cosim.endless_blocks:HoldsTheInterpreter", 3, tmp_path, step=Fraction(1, 10)))
    ssp = write_ssp(s, tmp_path / "held.ssp", "held", Fraction(1))
    status, _, errors = start(tmp_path, ssp, "--out", "r", "--call-limit", "1", "--no-report").wait()
    assert (status, errors) == (3, "bad: fmi3DoStep at t = 0.3 s did not return within 1 s\n")
    assert Record(tmp_path / "r" / "signals.parquet").time.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])
