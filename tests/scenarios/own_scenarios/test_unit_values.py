"""Values of units' parameters, `-p UNIT.NAME=VALUE`: in runs, sweeps, exports and after a resume."""

import json
from pathlib import Path

import numpy as np
import pytest
from tutorial import ran, refused, succeeded, write_files

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


def test_a_run_takes_it_and_keeps_it(here: Path):
    weak = ["-p", "controller.stiffness=10", "-p", "controller.p_WG=0.3,0.6", "-p", "arm.mass=3"]
    ran(here, "run", SCENE, *QUIET, "--out", "stiff")
    ran(here, "run", SCENE, *QUIET, *weak, "--out", "weak")
    np.testing.assert_allclose(torque(here / "weak"), 0.5 * torque(here / "stiff"), rtol=1e-12)
    kept = json.loads((here / "weak" / "run.json").read_text())
    assert kept["unit_values"] == {"controller.stiffness": "10", "controller.p_WG": "0.3,0.6", "arm.mass": "3"}
    assert ["arm.mass", "3", "given value of the unit's parameter"] in kept["told_parameters"]
    assert "unit_values" not in json.loads((here / "stiff" / "run.json").read_text())


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
    line = refused(here, "sweep", SCENE, "controller.stiffness=3,-4", "arm.mass=x,1", "--out", "swept")
    assert "stiffness = '-4': it is out of range" in line
    assert "mass = 'x': a number is right" in line
    assert "controller.stiffness is varied and set by -p" in refused(
        here, "sweep", SCENE, "controller.stiffness=3,4", "-p", "controller.stiffness=5"
    )
