"""Units that crash or hang: the command names them, keeps the record, leaves nothing else and exits with status 3."""

import json
import sys
from fractions import Fraction
from pathlib import Path

import pytest
from failing_systems import failing_ssp, native_fmu, start

from handover.cosim.record.reader import Record
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from handover.fmus.build import build_block

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no process can be forked that tells")

CRASH = "unit bad crashed in fmi{}DoStep at t = 0.2 s: segmentation fault"
EXIT = "unit bad crashed in fmi{}DoStep at t = 0.2 s: it ended the process with status 0"
HANG = "bad: fmi{}DoStep at t = 0.2 s did not return within 0.5 s"
slow = pytest.mark.slow


@pytest.mark.parametrize(
    ("bad", "fmi", "text", "kind"),
    [
        ("crashes", 3, CRASH, "crash"),
        pytest.param("hangs", 2, HANG, "hang", marks=slow),
        pytest.param("crashes", 2, CRASH, "crash", marks=slow),
        pytest.param("exits", 3, EXIT, "crash", marks=slow),
        pytest.param("hangs", 3, HANG, "hang", marks=slow),
    ],
)
def test_a_run_whose_unit_does_not_come_back_is_complete_to_the_last_good_step(
    bad: str, fmi: int, text: str, kind: str, tmp_path: Path
):
    going = start(tmp_path, failing_ssp(tmp_path, bad, fmi), "--out", "r", "--call-limit", "0.5")
    shown, errors = going.communicate(timeout=120)
    assert going.returncode == 3, errors
    said, doing = errors.splitlines()
    assert (said, doing.endswith("writing the report ...")) == (text.format(fmi), True)
    assert f"{bad}.ssp failed: a unit failed: " in shown
    assert shown.endswith("report: r/report.html\n")
    out = tmp_path / "r"
    assert sorted(p.name for p in out.iterdir()) == [
        "figures", "report.html", "run.json", "signals.parquet", "summary.json"
    ]  # fmt: skip
    assert list((tmp_path / "tmp").iterdir()) == []
    assert Record(out / "signals.parquet").time.tolist() == [0.0, 0.1, 0.2]
    summary = json.loads((out / "summary.json").read_text())
    assert summary["failure"] == json.loads((out / "run.json").read_text())["failure"]
    assert (summary["success"], summary["complete"], summary["simulated_seconds"]) == (False, False, 0.2)
    failure = {key: summary["failure"][key] for key in ("kind", "instance", "call", "time", "log")}
    assert failure == {"kind": kind, "instance": "bad", "call": f"fmi{fmi}DoStep", "time": 0.2, "log": []}


def test_a_crash_as_units_are_made_is_named_and_leaves_nothing(tmp_path: Path):
    s = System()
    for i in range(6):
        s.add(f"unit_{i}", native_fmu("crashes_on_fifth"))
    going = start(tmp_path, write_ssp(s, tmp_path / "six.ssp", "six"), "--stop", "1", "--out", "r")
    _, errors = going.communicate(timeout=120)
    assert (going.returncode, errors) == (
        3,
        "unit unit_4 crashed in fmi3InstantiateCoSimulation at t = 0 s: segmentation fault\n",
    )
    assert not (tmp_path / "r").exists()
    assert list((tmp_path / "tmp").iterdir()) == []


@pytest.mark.slow
def test_a_unit_that_holds_the_whole_process_is_reported_by_the_parent(tmp_path: Path):
    s = System()
    s.add("bad", build_block("endless_blocks:HoldsTheInterpreter", 3, tmp_path, step=Fraction(1, 10)))
    ssp = write_ssp(s, tmp_path / "held.ssp", "held", Fraction(1))
    going = start(tmp_path, ssp, "--out", "r", "--call-limit", "1")
    _, errors = going.communicate(timeout=120)
    said = "bad: fmi3DoStep at t = 0.3 s did not return within 1 s\nwriting the report ...\n"
    assert (going.returncode, errors) == (3, said)
    assert Record(tmp_path / "r" / "signals.parquet").time.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])
