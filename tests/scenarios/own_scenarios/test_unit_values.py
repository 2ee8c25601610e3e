"""Values of units' parameters, `-p UNIT.NAME=VALUE`: in runs, sweeps, exports and after a resume."""

import json
from pathlib import Path

import numpy as np
import pytest
from tutorial import call, ran, refused, succeeded, write_files

from handover.cosim.record.reader import Record
from handover.scenarios.campaign.table import CampaignTable

SCENE = "reach:TwoLinkReach"
QUIET = ["--no-report", "-p", "patience=0.2"]


@pytest.fixture
def here(tmp_path: Path) -> Path:
    write_files(tmp_path)
    return tmp_path


def torque(run: Path) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    return Record(run / "signals.parquet")["controller.tau"][0]


@pytest.mark.slow
def test_a_run_takes_it_and_keeps_it(here: Path):
    weak = ["-p", "controller.stiffness=10", "-p", "controller.p_WG=0.3,0.6", "-p", "arm.mass=3"]
    ran(here, "run", SCENE, *QUIET, "--out", "stiff")
    ran(here, "run", SCENE, *QUIET, *weak, "--out", "weak")
    np.testing.assert_allclose(torque(here / "weak"), 0.5 * torque(here / "stiff"), rtol=1e-12)
    kept = json.loads((here / "weak" / "run.json").read_text())
    assert kept["unit_values"] == {"controller.stiffness": "10", "controller.p_WG": "0.3,0.6", "arm.mass": "3"}
    assert ["arm.mass", "3", "given value of the unit's parameter"] in kept["told_parameters"]
    assert "unit_values" not in json.loads((here / "stiff" / "run.json").read_text())


@pytest.mark.slow
def test_a_sweep_varies_it(here: Path):
    sweep = ["sweep", SCENE, "controller.stiffness=10:30:3", "patience=0.1", "-p", "arm.mass=2", "--out", "swept"]
    printed = succeeded(here, *sweep)
    assert "controller.stiffness" in printed
    table = CampaignTable.read(here / "swept" / "runs.parquet")
    assert sorted(table.column("controller.stiffness")) == [10.0, 20.0, 30.0]
    assert set(table.column("arm.mass")) == {2.0}
    runs = sorted((here / "swept" / "runs").iterdir())
    first = [torque(run) for run in runs]
    np.testing.assert_allclose(first[2], 3.0 * first[0], rtol=1e-12)
    page = (here / "swept" / "report.html").read_text(encoding="utf-8")
    assert "controller.stiffness" in page


@pytest.mark.slow
def test_an_export_binds_it(here: Path):
    succeeded(here, "export", SCENE, "-p", "controller.stiffness=10", "--ssp", "weak.ssp")
    succeeded(here, "run", "weak.ssp", "--stop", "0.2", "--no-report", "--out", "weak")
    ran(here, "run", SCENE, *QUIET, "-p", "controller.stiffness=10", "--out", "own")
    np.testing.assert_array_equal(torque(here / "weak"), torque(here / "own"))


def test_all_faults_are_told_at_once_and_nothing_is_written(here: Path):
    line = refused(here, "run", SCENE, "-p", "contr.stiffness=3", "-p", "goall=1", "-p", "arm.=2")
    assert "no unit 'contr'; did you mean controller?" in line
    assert "no parameter 'goall'; did you mean goal?" in line
    assert "'arm.=2' is not of the form UNIT.NAME=VALUE" in line
    line = refused(here, "run", SCENE, "-p", "controller.stif=3", "-p", "arm.mass=-1", "-p", "controller.p_WG=1,2,3")
    assert "unit controller: no parameter 'stif'; did you mean stiffness?" in line
    assert "unit arm: mass = '-1': it is out of range: at least 0.01 kg" in line
    assert "p_WG = '1,2,3': 3 values where 2 are right" in line
    line = refused(here, "run", SCENE, "-p", "controller.p_WG=1,east")
    assert "p_WG = '1,east': 'east': a number is right" in line
    line = refused(here, "sweep", SCENE, "controller.stiffness=3,-4", "arm.mass=x,1", "--out", "swept")
    assert "stiffness = '-4': it is out of range" in line
    assert "mass = 'x': a number is right" in line
    assert "controller.stiffness is varied and set by -p" in refused(
        here, "sweep", SCENE, "controller.stiffness=3,4", "-p", "controller.stiffness=5"
    )


SOFT = """
from goal_spring import Inputs, Outputs, Params, SpringToGoal


class Soft(SpringToGoal):
    def __init__(self, params: Params) -> None:
        super().__init__(params)

    def outputs(self, t: float, u: Inputs) -> Outputs:
        return Outputs(tau=0.5 * super().outputs(t, u).tau)
"""


@pytest.mark.slow
def test_a_sweep_varies_the_unit_itself(here: Path):
    (here / "soft.py").write_text(SOFT)
    (here / "else").mkdir()
    succeeded(here, "build", "soft:Soft", "--fmi", "3", "--out", "else")
    units = "controller=goal_spring:SpringToGoal,else/Soft.fmi3.fmu"
    sweep = ["sweep", SCENE, "arm.mass=1,2", "--unit", units, "-p", "patience=0.1", "--paired", "--out", "swept"]
    printed = succeeded(here, *sweep)
    assert "else/Soft.fmi3.fmu" in printed
    table = CampaignTable.read(here / "swept" / "runs.parquet")
    assert list(table.column("controller")) == ["goal_spring:SpringToGoal"] * 2 + ["else/Soft.fmi3.fmu"] * 2
    assert list(table.column("arm.mass")) == [1.0, 2.0] * 2
    first = [torque(run) for run in sorted((here / "swept" / "runs").iterdir())]
    np.testing.assert_allclose(first[2], 0.5 * first[0], rtol=1e-12)
    assert "has all of its runs; nothing was run" in call(here, *sweep).stderr
    (here / "swept" / "runs.parquet").unlink()
    assert "it has no runs.parquet" in refused(here, "report", "swept")
    assert "nothing was run" in call(here, *sweep).stderr
    assert CampaignTable.read(here / "swept" / "runs.parquet").rows == table.rows


@pytest.mark.slow
def test_units_that_cannot_be_varied_are_told_and_nothing_is_written(here: Path):
    line = refused(here, "sweep", SCENE, "--unit", "controller=goal_spring:SpringToGoal,", "--out", "other")
    assert "--unit controller: 'goal_spring:SpringToGoal,' has an empty item" in line
    done = call(here, "sweep", SCENE, "--unit", "controller=goal_spring:SpringToGoal,arm:TwoLinkArm", "--out", "other")
    assert done.returncode == 2
    assert "4 faults in the system" in done.stderr
    assert not (here / "other").exists()


@pytest.mark.slow
def test_a_run_and_a_sweep_are_summarised_as_json(here: Path):
    done = call(here, "run", SCENE, *QUIET, "--json", "--out", "run")
    summary = json.loads(done.stdout)
    assert (done.returncode, summary["success"], summary["folder"]) == (1, False, "run")
    assert summary["metrics"]["distance"]["unit"] == "m"
    swept = json.loads(succeeded(here, "sweep", SCENE, "arm.mass=1,2", *QUIET, "--json", "--out", "swept"))
    assert swept["counts"]["ended"] == 2
    assert [p["values"] for p in swept["points"]] == [{"arm.mass": "1"}, {"arm.mass": "2"}]
    assert [p["successes"] for p in swept["points"]] == [0, 0]
    assert swept["points"][0]["medians"]["distance"]["unit"] == "m"
