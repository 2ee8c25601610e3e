"""A controller of one's own in a place of a scenario: it has what it uses, and the run does without the rest."""

import json
from pathlib import Path

import numpy as np
import pytest
from own_controllers import JOINTS, MISSPELLED, PROPORTIONAL, write_controller
from tutorial import call, refused, succeeded, write_files

from handover.cosim.record.reader import Record

SCENE = "placed:Placed"
PLACED = '''
from goal_spring import Inputs, Outputs, Params, SpringToGoal
from dataclasses import dataclass
from handover.cosim.blocks.ports import output
from handover.cosim.blocks.units import Number
from handover.scenarios.experiment.places import Place
from reach import TwoLinkReach


@dataclass(kw_only=True)
class MoreOutputs(Outputs):
    energy: Number = output("energy of the springs, in units of its own")


class Telling(SpringToGoal):
    """A controller that also gives an energy."""

    feedthrough = {"tau": ("q", "v"), "energy": ()}

    def __init__(self, params: Params) -> None:
        super().__init__(params)

    def outputs(self, t: float, u: Inputs) -> MoreOutputs:
        return MoreOutputs(tau=super().outputs(t, u).tau, energy=1.0)

    def step(self, t: float, dt: float, u: Inputs) -> MoreOutputs:
        return self.outputs(t, u)


class Placed(TwoLinkReach):
    """An arm of two links, with a place for controllers."""

    units = {"arm": "arm:TwoLinkArm", "controller": "placed:Telling"}
    places = {
        "controller": Place(
            required={"tau": "positive turns left, as seen from above"},
            optional={"q": "", "v": "", "p_WG": "the scenario's goal, in W", "energy": "shown"},
            remarks=("W has its origin at the shoulder.",),
        )
    }
'''


@pytest.fixture
def here(tmp_path: Path) -> Path:
    folder = tmp_path / "mine"
    folder.mkdir()
    write_files(folder)
    (folder / "placed.py").write_text(PLACED)
    write_controller(folder, "joints", JOINTS)
    write_controller(folder, "wrong", MISSPELLED)
    return folder


@pytest.mark.slow
def test_a_controller_without_the_optional_ports_runs_and_what_is_left_out_is_noted_once(here: Path):
    options = ["--unit", "controller=joints:Joints", "-p", "patience=0.5"]
    done = call(here, "run", SCENE, *options, "--out", "run")
    assert done.returncode == 1, done.stderr  # it moves, and not to where the scenario has its goal
    assert "KeyError" not in done.stderr + done.stdout
    note = (
        "unit controller (Joints) has no output energy: what the scenario would make of it is left out; "
        "no parameter p_WG: what the scenario would set it to is not used"
    )
    assert done.stderr.count(note) == 1
    assert json.loads((here / "run" / "run.json").read_text())["notes"] == [note]
    assert note in (here / "run" / "report.html").read_text(encoding="utf-8")
    record = Record(here / "run" / "signals.parquet")
    np.testing.assert_allclose(record["controller.tau"][0], [0.5, 0.8] - record["arm.q"][0], atol=1e-9)
    swept = call(here, "sweep", SCENE, "patience=0.2,0.3", "--workers", "1", *options[:2], "--out", "swept")
    assert "2 of 2 runs done" in swept.stdout
    assert swept.stderr.count(note) == 1
    assert {json.loads(p.read_text())["notes"][0] for p in here.glob("swept/runs/*/run.json")} == {note}


@pytest.mark.slow
def test_the_scenarios_own_unit_has_nothing_left_out(here: Path):
    done = call(here, "run", SCENE, "--out", "run", "--no-report", "-p", "patience=0.2")
    assert "unit controller" not in done.stderr
    assert "notes" not in json.loads((here / "run" / "run.json").read_text())
    exported = call(here, "export", SCENE, "--unit", "controller=joints:Joints", "--ssp", "reach.ssp")
    assert "unit controller (Joints) has no output energy" in exported.stderr
    succeeded(here, "run", "reach.ssp", "--out", "exported", "--no-report")


@pytest.mark.parametrize("command", ["run", "sweep", "export"])
def test_all_that_a_controller_lacks_is_told_in_one_line_before_anything_starts(here: Path, command: str):
    more = {"run": ("--out", "r"), "sweep": ("--out", "s"), "export": ("--ssp", "a.ssp")}[command]
    line = refused(here, command, SCENE, "--unit", "controller=wrong:Misspelled", *more)
    assert "2 faults in the system" in line
    assert "unit controller (Misspelled) needs the output tau (real [2] N.m): " in line
    assert "positive turns left, as seen from above; did you mean taw?" in line
    assert "controller.energy (integer): it must be real, as that of Telling" in line


def test_an_output_of_the_same_kind_is_named_where_no_name_is_near(here: Path):
    write_controller(here, "other", MISSPELLED.replace("taw", "moment"))
    line = refused(here, "run", SCENE, "--unit", "controller=other:Misspelled", "--out", "r")
    assert "positive turns left, as seen from above; did you mean moment?" in line


def test_an_input_that_nothing_feeds_is_noted_with_the_nearest_name(here: Path):
    write_controller(here, "nearly", MISSPELLED.replace("taw", "tau").replace("    energy: int", "    work: int")
                     .replace("energy", "work"))  # fmt: skip
    done = call(here, "run", SCENE, "--unit", "controller=nearly:Misspelled", "-p", "patience=0.1", "--out", "r")
    assert "controller.vv: nothing feeds it, so it stays at its start value; did you mean v?" in done.stderr
    assert "controller.angles: nothing feeds it, so it stays at its start value\n" in done.stderr


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
    assert "placed has no unit 'controler': did you mean controller?" in refused(
        here, "list", SCENE, "--unit", "controler"
    )
    assert "--unit is for a SCENARIO" in refused(here, "list", "--unit", "controller")


def test_list_prints_the_place_of_the_helix_controller(tmp_path: Path):
    printed = succeeded(tmp_path, "list", "helix_handover", "--unit", "servo")
    required = printed.split("Inputs, optional")[0]
    assert "y of B is minus y of W" in " ".join(required.split())
    assert "dl_t  real[9] m" in required
    assert "closure" not in required.split("Outputs, required")[1]


@pytest.mark.slow
def test_the_shortest_controller_of_the_helix_brings_the_gripper_over_the_ball(tmp_path: Path):
    write_controller(tmp_path, "my_servo", PROPORTIONAL)
    unit = ["--unit", "servo=my_servo:Proportional"]
    sweep = ["sweep", "helix_handover", "place=front,left", *unit, "-p", "patience=15", "--out", "places"]
    done = call(tmp_path, *sweep, limit=1500)
    assert "2 of 2 runs done" in done.stdout, done.stderr
    assert done.stderr.count("unit servo (Proportional) has no inputs p_WR_meas, seen_O") == 1
    runs = sorted(tmp_path.glob("places/runs/*"))
    assert len(runs) == 2
    for run in runs:
        summary = json.loads((run / "summary.json").read_text())
        assert "not judged" not in summary["reason"]
        assert "steps" not in summary["metrics"]  # its gripper never began to close
        record = Record(run / "signals.parquet")
        apart = np.linalg.norm(record["arm.p_WG"] - record["hand.p_WO"] - [0.0, 0.0, 0.08], axis=1)
        assert apart[0] > 0.15
        assert np.all(apart[record.time > 12.0] < 0.015)
    succeeded(tmp_path, "report", str(runs[0]), "--figures", limit=600)
    page = (runs[0] / "report.html").read_text(encoding="utf-8")
    assert "KeyError" not in page
    assert "left out:" not in page.lower()
    assert {"error.png", "paths.png", "tendons.png"} <= {p.name for p in (runs[0] / "figures").iterdir()}
