"""Small campaigns of real runs of the infrared grasp's experiments."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.in_process_pool import InProcessPool
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.published.ir_grasp.ir_convergence import IrConvergence, descents_of
from handover.scenarios.published.ir_grasp.ir_limits import IrLimits
from handover.scenarios.published.ir_grasp.ir_sensor import (
    IrSensorCurve,
    case,
    fits_of,
    readings_of_rows,
    sensor_runs,
)
from handover.scenarios.published.ir_grasp.ir_table import ARMS, BLIND, FORWARD_55, REFLEX, IrTable, IrTableRuns
from handover.scenarios.published.ir_grasp.limits_axes import ARMS as LIMIT_ARMS
from handover.scenarios.published.ir_grasp.limits_axes import AXES
from handover.scenarios.published.published_experiment import (
    PaperResults,
    PublishedExperiment,
    draw_figures,
    write_claims,
)
from handover.scenarios.robots.ir_grasp.ir_sensor import Finger
from handover.scenarios.runs.campaign.campaign import run_campaign
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan_check import prepared
from handover.scenarios.runs.campaign.table import CampaignTable

pytestmark = pytest.mark.slow


def run(
    experiment: PublishedExperiment, path: Path, wanted: Mapping[str, str], **changed: Any
) -> tuple[CampaignFolder, CampaignTable]:
    """Run those points of the quick plan that have the wanted values."""
    plan = experiment.plan(quick=True)
    few = replace(plan, points=[p for p in plan.points if all(p.get(n) == v for n, v in wanted.items())], **changed)
    folder = CampaignFolder(path)
    return folder, run_campaign(prepared(few), folder, InProcessPool(), lambda _tally: None)


def test_a_sensors_fit_is_the_curve_that_the_controller_has(tmp_path: Path, sketches: Sketches):
    folder, table = run(IrSensorCurve(), tmp_path / "c", {"finger": "ring", "scene.sensor_tolerance": "0"})
    runs = sensor_runs(table)
    (fit,) = fits_of(runs.of(*case(Finger.RING)))
    assert (fit.a, fit.b, fit.c, fit.d) == pytest.approx((0.062, -0.003, 0.022, -0.00043), rel=0.05)
    assert fit.residual < 4e-4
    distance, ticks = readings_of_rows(runs.of(*case(Finger.RING, reflectivity=0.5)).rows, folder.runs)
    assert ticks[np.argmin(np.abs(distance - 0.010))] == pytest.approx(1850 / 2, rel=0.03)
    draw_figures(IrSensorCurve(), table, folder.runs, folder.figures)
    assert set(sketches) == {"characteristic", "one_curve", "time_of_flight"}
    assert PaperResults.of(IrSensorCurve(), table, folder.runs).claims


def test_descents_begin_at_the_first_step_and_end_where_the_hand_closed(tmp_path: Path, sketches: Sketches):
    folder, table = run(IrConvergence(), tmp_path / "c", {"thing": "baby_cup_a", "perturbed": "true"})
    runs = IrTableRuns(table).of(REFLEX, True)
    (descent,), (row,) = descents_of(runs, folder.runs), runs
    assert len(descent.norm) == row["steps"] + 1
    assert descent.ends is not None
    assert descent.ends[1] < descent.ends[0]
    ends = [row["final_distance_thumb"], row["final_distance_ring"]]
    assert descent.distance[-1, [0, 2]] == pytest.approx(ends, abs=2e-3)
    draw_figures(IrConvergence(), table, folder.runs, folder.figures)
    assert set(sketches) == {"convergence_nominal", "convergence_perturbed", "poses", "sequences", "recoveries"}
    assert len(PaperResults.of(IrConvergence(), table, folder.runs).claims) == 8


def test_runs_of_the_limits_are_found_by_what_they_are_of(tmp_path: Path, sketches: Sketches):
    folder, table = run(IrLimits(), tmp_path / "c", {"thing": "disc", "disc_radius": "0.055", "strategy": "contact"})
    runs = IrLimits().results(table)
    large = next(axis for axis in AXES if axis.key == "large")
    tried = [int(arm.meets(large) and arm.parameters["strategy"] == "contact") for arm in LIMIT_ARMS]
    assert sum(tried) > 1
    assert [runs.count(arm, large, large.levels[-1:])[1] for arm in LIMIT_ARMS] == tried
    assert sum(runs.count(arm, axis, axis.all_levels)[1] for axis in AXES for arm in LIMIT_ARMS) == sum(tried)
    draw_figures(IrLimits(), table, folder.runs, folder.figures)
    assert set(sketches) == {"limits", "limits_displacement"}
    assert [len(t.rows) for t in IrLimits().tables(table)] == [0, 0, 0, 1, 1]


def test_a_moved_cylinder_grasped_once_in_each_way_has_its_cells_and_files(tmp_path: Path):
    folder, table = run(IrTable(), tmp_path / "c", {"thing": "cylinder", "perturbed": "true"}, repetitions=1)
    runs = IrTableRuns(table)
    assert [runs.count(arm, True, Thing.CYLINDER)[1] for arm in ARMS] == [1, 1, 1, 1]
    assert (runs.count(REFLEX, False), runs.count(BLIND, True)) == ((0, 0), (0, 1))
    assert runs.pairs((REFLEX, True), (FORWARD_55, True)) == ([True], [True])
    (thumb,) = runs.distance("thumb", True, "cylinder")
    assert thumb == pytest.approx(0.010, abs=0.004)  # the target, and what the threshold of the cost allows
    why = {row[0]: row[1] for row in IrTable().tables(table)[3].rows}
    wanted = {"blind": "1 blind", "forward 35 mm": "1 forward", "IR-guided": "1 threshold"}
    assert {name: why[f"{name}, perturbed"] for name in wanted} == wanted
    write_claims(IrTable().claims(table), folder)
    draw_figures(IrTable(), table, folder.runs, folder.figures)
    left = {str(p.relative_to(folder.path)) for p in folder.path.rglob("*") if "runs" not in p.parts}
    assert {"claims.json", "figures/success_rates.svg", "figures/final_distances.png"} <= left
    assert folder.read()["experiment"] == "ir-table"
