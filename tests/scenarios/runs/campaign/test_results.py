"""Medians of points: one value for figures and tables, with an interval where it says something."""

import math
from pathlib import Path

import pytest
from support.campaigns import results_of, table_of

from handover.fmus.build import cached
from handover.scenarios.pages.campaign_report.point_layout import layout_of
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.results import CampaignResults
from handover.scenarios.runs.campaign.statistics import time_interval


def moved(points: int, values: list[float]) -> CampaignResults:
    return results_of("ir_grasp", [{"forward": f"{k}"} for k in range(points)], len(values), moved=values * points)


def test_a_median_has_its_bootstrapped_interval_and_is_made_once():
    results = moved(1, [0.1, 0.2, 0.4, math.nan])
    assert results.median(results.points[0], "moved") == 0.2
    found = results.median_interval(results.points[0], "moved")
    assert found == time_interval([0.1, 0.2, 0.4])
    assert results.median_interval(results.points[0], "moved") is found
    nothing = moved(1, [math.nan, math.nan])
    assert math.isnan(nothing.median(nothing.points[0], "moved"))


@pytest.mark.parametrize(("points", "values"), [(1, [0.2, 0.2, 0.2]), (1, [0.1, 0.3]), (151, [0.1, 0.2, 0.3])])
def test_there_is_no_interval_that_says_nothing_or_takes_too_long(points: int, values: list[float]):
    results = moved(points, values)
    assert results.median(results.points[0], "moved") == pytest.approx(0.2)
    assert results.median_interval(results.points[0], "moved") is None


def test_labels_have_the_names_of_numbers_and_of_classes_and_files_as_they_are():
    numbers = [{"forward": a, "standoff": b} for a in ("0.03", "0.05") for b in ("0.06", "0.1")]
    results = results_of("ir_grasp", numbers)
    assert results.label(results.points[0]) == "forward 30 mm, standoff 60 mm"
    paths = ("my_own:Reflex", "b_1.fmu")
    units = [{"thing": thing, "reflex": path} for thing in ("baby_cup_a", "cylinder") for path in paths]
    results = results_of("ir_grasp", units)
    assert [results.label(p) for p in results.points[:2]] == ["baby cup a, Reflex", "baby cup a, b_1.fmu"]
    namesakes = results_of("ir_grasp", [{"reflex": path} for path in ("my_own:Reflex", "old.my_own:Reflex")])
    assert [namesakes.label(p) for p in namesakes.points] == ["my_own:Reflex", "old.my_own:Reflex"]


def test_units_parameters_have_the_units_that_their_fmus_declare(tmp_path: Path):
    def results_in(path: Path, plan: CampaignPlan, fmus: dict[str, Path]) -> CampaignResults:
        folder = CampaignFolder(path)
        with folder.opened(plan, fmus, lambda _path: None):
            metadata = folder.read()
        return CampaignResults(metadata, table_of(metadata["points"], 1))

    plan = CampaignPlan(scenario="ir_grasp", points=[{"scene.wrist_speed": value} for value in ("0.05", "0.1", "0.2")])
    results = results_in(tmp_path / "c", plan, {"scene": cached("GraspScene", 3)})
    assert layout_of(results).title == "scene.wrist speed (m/s)"
    assert results.label(results.points[0]) == "scene.wrist speed 0.05 m/s"
    soft = "impedance.stiffness_translation"
    arrays = [{"p_WG_handover": "0,-0.07,0", soft: ",".join(f"{k}00010001")} for k in (1, 2)]
    plan = CampaignPlan(scenario="flyer_robot_to_human", points=arrays)
    results = results_in(tmp_path / "d", plan, {"impedance": cached("ImpedanceController", 3)})
    assert results.label(results.points[1]) == "impedance.stiffness translation 2,0,0,0,1,0,0,0,1 N/m"
    assert results.named_value("p_WG_handover", "0,-0.07,0") == "p WG handover 0,-0.07,0 m"
