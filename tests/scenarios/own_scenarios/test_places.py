"""A controller of one's own in a place of a scenario: it has what it uses, and the run does without the rest."""

import json
from pathlib import Path

import numpy as np
import pytest
from support.scenarios.own_controllers import PROPORTIONAL, write_controller, write_placed
from support.scenarios.tutorial import call, ran, succeeded

from handover.cosim.record.reader import Record

SCENE = "placed:Placed"
JOINTS = ("--unit", "controller=joints:Joints")


@pytest.fixture
def here(here: Path) -> Path:
    write_placed(here)
    return here


@pytest.mark.slow
def test_a_controller_without_the_optional_ports_runs_and_what_is_left_out_or_not_fed_is_noted_once(here: Path):
    done = call(here, "run", SCENE, *JOINTS, "-p", "patience=0.1", "--no-report", "--out", "run")
    assert done.status == 1, done.errors  # it moves, and not to where the scenario has its goal
    note = (
        "unit controller (Joints) has no output energy: what the scenario would make of it is left out; "
        "no parameter p_WD: what the scenario would set it to is not used"
    )
    assert done.errors.count(note) == 1
    assert json.loads((here / "run" / "run.json").read_text())["notes"] == [note]
    record = Record(here / "run" / "signals.parquet")
    np.testing.assert_allclose(record["controller.tau"][0], [0.5, 0.8] - record["arm.q"][0], atol=1e-9)
    reported = call(here, "report", "run", "--trust", "placed.py")
    assert "KeyError" not in reported.errors + reported.output
    assert note in (here / "run" / "report.html").read_text(encoding="utf-8")
    swept = call(here, "sweep", SCENE, "patience=0.1,0.2", *JOINTS, "--no-report", "--out", "swept")
    assert "2 of 2 runs done" in swept.output
    assert swept.errors.count(note) == 1 + 2  # by the command, and by each run, of which a worker keeps it to itself
    assert {json.loads(p.read_text())["notes"][0] for p in here.glob("swept/runs/*/run.json")} == {note}
    given = ("run", SCENE, "--no-report", "-p", "patience=0.1", "--unit", "controller=nearly:Misspelled", "--out", "r")
    noted = call(here, *given).errors
    assert "controller.vv: nothing feeds it, so it stays at its start value; did you mean v?" in noted
    assert "controller.angles: nothing feeds it, so it stays at its start value\n" in noted
    exported = call(here, "export", SCENE, *JOINTS, "--ssp", "reach.ssp")
    assert "unit controller (Joints) has no output energy" in exported.errors
    succeeded(here, "run", "reach.ssp", "--stop", "0.1", "--out", "exported", "--no-report")


def test_list_prints_what_a_place_needs(here: Path):
    printed = succeeded(here, "list", SCENE, "--unit", "controller")
    assert "W has its origin at the shoulder." in printed
    required, optional = printed.split("Inputs, optional")
    assert "tau  real[2] N.m" in required
    assert "positive turns left, as seen from above" in required
    assert optional.index("q  ") < optional.index("Outputs, optional") < optional.index("energy")
    assert optional.index("Parameters, optional") < optional.index("the scenario's goal, in W")
    assert "handover list placed:Placed --unit name" in succeeded(here, "list", SCENE)
    assert "does not say what a unit in the place arm may lack" in succeeded(here, "list", SCENE, "--unit", "arm")


@pytest.mark.slow
def test_a_controller_of_the_helix_with_two_inputs_and_one_output_is_judged_and_drawn(tmp_path: Path):
    printed = succeeded(tmp_path, "list", "helix_handover", "--unit", "servo")
    required = printed.split("Inputs, optional")[0]
    assert "+y of B, which is -y of W" in " ".join(required.split())
    assert "dl_t  real[9] m" in required
    assert "closure" not in required.split("Outputs, required")[1]
    write_controller(tmp_path, "my_servo", PROPORTIONAL)
    units = ("--unit", "arm=TendonArmFast", "--unit", "servo=my_servo:Proportional")
    ran(tmp_path, "run", "helix_handover", *units, "--stop", "1", "--no-report", "--out", "run")
    run = tmp_path / "run"
    (note,) = json.loads((run / "run.json").read_text())["notes"]
    assert note.startswith("unit servo (Proportional) has no inputs p_WR_meas, seen_O")
    summary = json.loads((run / "summary.json").read_text())
    assert "not judged" not in summary["reason"]
    assert "steps" not in summary["metrics"]  # its gripper never began to close
    assert np.ptp(Record(run / "signals.parquet")["arm.p_WG"], axis=0).max() > 0.002
    succeeded(tmp_path, "report", str(run), "--figures")
    page = (run / "report.html").read_text(encoding="utf-8")
    assert "KeyError" not in page
    assert "left out:" not in page.lower()
    assert {"error.png", "paths.png", "tendons.png"} <= {p.name for p in (run / "figures").iterdir()}
