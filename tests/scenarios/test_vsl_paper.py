"""What the code has as defaults is what `paper.toml` tells the origin of."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli

import scenarios.vsl
from controllers.hybrid_kinematics import Params as KinematicsParams
from controllers.trajectory_planner import Params as PlannerParams
from plants.vsl_parameters import Params as ArmParams
from scenarios.vsl.parameters import HybridParameters, Parameters

STATUS = {"stated", "derived", "assumed", "read off figure"}
NUMERICAL = {"hinges", "hinges_dynamic", "substep", "high_frequency_damping", "damping_time"}
CHOSEN_BY_THE_SCENARIO = {"motion", "link_2", "link_3", "path", "x_0", "x_g", "elbow", "pressure", "method", "model"}

Paper = dict[str, dict[str, dict[str, Any]]]


@pytest.fixture(scope="module")
def paper() -> Paper:
    file = Path(scenarios.vsl.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


def told(value: Any) -> Any:
    return getattr(value, "name", value).lower() if hasattr(value, "name") else value


def test_every_value_has_its_unit_origin_and_status(paper: Paper):
    for group in paper.values():
        for name, entry in group.items():
            assert set(entry) == {"value", "unit", "where", "status"}, name
            assert entry["status"] in STATUS, name
            assert entry["where"], name


@pytest.mark.parametrize(
    ("group", "params"),
    [
        ("scenario", Parameters()),
        ("hybrid", HybridParameters()),
        ("planner", PlannerParams()),
        ("kinematics", KinematicsParams()),
        ("arm", ArmParams()),
    ],
)
def test_defaults_are_those_of_the_paper_file(paper: Paper, group: str, params: Any):
    for name, entry in paper[group].items():
        assert np.array_equal(told(getattr(params, name)), entry["value"]), name


@pytest.mark.parametrize(
    ("group", "params"),
    [
        ("scenario", Parameters),
        ("planner", PlannerParams),
        ("kinematics", KinematicsParams),
        ("arm", ArmParams),
    ],
)
def test_every_default_has_an_origin(paper: Paper, group: str, params: type[Any]):
    apart = NUMERICAL | {"seed", "q_0", "p_0"}
    if group != "scenario":
        apart |= CHOSEN_BY_THE_SCENARIO
    assert {f.name for f in dataclasses.fields(params)} - apart == set(paper[group]) - apart


def test_the_planner_and_the_kinematics_know_the_arms_dimensions(paper: Paper):
    for name in ("L_1", "L_2", "L_3"):
        assert paper["arm"][name]["value"] == paper["planner"][name]["value"] == paper["kinematics"][name]["value"]


def test_the_scenario_leaves_the_planners_speed_and_points_as_they_are(paper: Paper):
    assert paper["scenario"]["speed"]["value"] == paper["planner"]["V"]["value"]
    assert paper["scenario"]["points"]["value"] == paper["planner"]["N"]["value"]


def test_the_default_case_is_one_of_the_published_ones(paper: Paper):
    case = [paper["scenario"]["load"]["value"], paper["scenario"]["pressure"]["value"]]
    assert case in paper["published"]["experiment_2"]["value"]
