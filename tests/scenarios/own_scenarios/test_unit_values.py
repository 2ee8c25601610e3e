"""Values of units' parameters, `-p UNIT.NAME=VALUE`, and other units in a place: in runs, sweeps and exports."""

import json
from pathlib import Path

import numpy as np
import pytest
from support.scenarios.tutorial import QUIET, SCENE, call, ran, refused, signals, succeeded

from handover.cosim.record.reader import Record
from handover.scenarios.runs.campaign.table import CampaignTable

pytestmark = pytest.mark.slow


def torque(run: Path) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    return Record(run / "signals.parquet")["controller.tau"][0]


def test_a_run_takes_a_value_and_keeps_it_and_an_export_binds_it(here: Path):
    weak = ["-p", "controller.stiffness=10", "-p", "controller.p_WD=0.3,0.6", "-p", "arm.mass=3"]
    ran(here, "run", SCENE, *QUIET, "--out", "stiff")
    ran(here, "run", SCENE, *QUIET, *weak, "--out", "weak")
    np.testing.assert_allclose(torque(here / "weak"), 0.5 * torque(here / "stiff"), rtol=1e-12)
    kept = json.loads((here / "weak" / "run.json").read_text())
    assert kept["unit_values"] == {"controller.stiffness": "10", "controller.p_WD": "0.3,0.6", "arm.mass": "3"}
    assert ["arm.mass", "3", "given value of the unit's parameter"] in kept["told_parameters"]
    assert "unit_values" not in json.loads((here / "stiff" / "run.json").read_text())
    succeeded(here, "export", SCENE, "-p", "controller.stiffness=10", "--ssp", "weak.ssp")
    succeeded(here, "run", "weak.ssp", "--stop", "0.2", "--no-report", "--out", "exported")
    np.testing.assert_array_equal(torque(here / "exported"), torque(here / "weak"))


def test_another_block_or_file_takes_a_units_place(here: Path, tmp_path: Path):
    ran(here, "run", SCENE, *QUIET, "--out", "stiff")
    ran(here, "run", SCENE, *QUIET, "--unit", "controller=softer:Softer", "--out", "soft")
    np.testing.assert_allclose(torque(here / "soft"), 0.5 * torque(here / "stiff"), rtol=1e-12)
    built = succeeded(here, "build", "softer:Softer", "--fmi", "3", "--out", "fmus").strip()
    ran(here, "run", SCENE, *QUIET, "--unit", f"controller={built}", "--out", "file")
    again = ("--out", str(here / "again"), "--no-report")
    ran(tmp_path, "run", "--config", str(here / "soft" / "run.json"), *again)  # from elsewhere
    assert signals(here / "soft") == signals(here / "file") == signals(here / "again")


def test_a_sweep_varies_values_and_units_and_is_reported_from_elsewhere(here: Path, tmp_path: Path):
    succeeded(here, "build", "softer:Softer", "--fmi", "3", "--out", "else")
    units = "controller=goal_spring:SpringToGoal,else/Softer.fmi3.fmu"
    given = ["arm.mass=1,2", "--unit", units, "-p", "patience=0.1", "-p", "controller.damping=1"]
    sweep = ["sweep", SCENE, *given, "--paired", "--no-report", "--out", "swept"]
    swept = json.loads(succeeded(here, *sweep, "--json"))
    assert swept["counts"]["ended"] == 4
    controllers = ["goal_spring:SpringToGoal", "else/Softer.fmi3.fmu"]
    wanted = [{"controller": c, "arm.mass": m} for c in controllers for m in ("1", "2")]
    assert [p["values"] for p in swept["points"]] == wanted
    assert [p["successes"] for p in swept["points"]] == [0, 0, 0, 0]
    assert swept["points"][0]["medians"]["distance"]["unit"] == "m"
    table = CampaignTable.read(here / "swept" / "runs.parquet")
    assert list(table.column("controller")) == [c for c in controllers for _ in (1, 2)]
    assert list(table.column("arm.mass")) == [1.0, 2.0] * 2
    assert set(table.column("controller.damping")) == {1.0}
    assert "distance" in table.metrics
    runs = sorted((here / "swept" / "runs").iterdir())
    assert "has all of its runs; nothing was run" in call(here, *sweep).errors
    (here / "swept" / "runs.parquet").unlink()
    assert "it has no runs.parquet" in refused(here, "report", "swept")
    assert "nothing was run" in call(here, *sweep).errors
    assert CampaignTable.read(here / "swept" / "runs.parquet").rows == table.rows
    succeeded(tmp_path, "report", str(here / "swept"))
    page = (here / "swept" / "report.html").read_text(encoding="utf-8")
    assert "An arm of two links reaches for a point" in page
    assert "controller.damping" in page
    assert "else/Softer.fmi3.fmu" in page
    assert json.loads((runs[0] / "run.json").read_text())["source"]["folder"] == str(here)
