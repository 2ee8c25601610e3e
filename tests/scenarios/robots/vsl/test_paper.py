"""The code has the values that `paper.toml` gives, and units agree with each other."""

import math
import pathlib
from typing import Any

import numpy as np
import pytest
import tomli

import handover.scenarios.robots.vsl
from handover.controllers.vsl.hybrid_kinematics import Params as KinematicsParams
from handover.controllers.vsl.paths import Path, QuarterArc, segments_of
from handover.controllers.vsl.trajectory_planner import Elbow
from handover.controllers.vsl.trajectory_planner import Params as PlannerParams
from handover.cosim.blocks.declarations import declared_variables
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.variable import Causality
from handover.plants.vsl.parameters import Params as ArmParams
from handover.scenarios.cli.robots.vsl_train import vsl_train
from handover.scenarios.robots.vsl import training_data
from handover.scenarios.robots.vsl.parameters import Parameters
from handover.scenarios.robots.vsl.path_experiments import ELECTRONICS

Paper = dict[str, dict[str, dict[str, Any]]]


@pytest.fixture(scope="module")
def paper() -> Paper:
    file = pathlib.Path(handover.scenarios.robots.vsl.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


def test_values_that_several_units_have_are_the_same(paper: Paper):
    scenario, arm, planner, kinematics = Parameters(), ArmParams(), PlannerParams(), KinematicsParams()
    for name in ("L_1", "L_2", "L_3"):
        assert getattr(arm, name) == getattr(planner, name) == getattr(kinematics, name)
    assert (scenario.speed, scenario.points) == (planner.V, planner.N)
    np.testing.assert_array_equal(scenario.q_0, arm.q_0)
    np.testing.assert_array_equal(Parameters(elbow=Elbow.DOWN).q_0, -arm.q_0)
    assert [scenario.load, scenario.pressure] in paper["published"]["experiment_2"]["value"]
    lengths = [Parameters(path=path).length for path in (Path.LINEAR, Path.CURVE, Path.SQUARE, Path.CUSTOM)]
    assert lengths == pytest.approx([0.3, 0.1 * math.pi, 0.4, math.hypot(0.1, 0.1)])


def test_the_electronics_are_those_of_the_paper_file(paper: Paper):
    group = paper["resolution"]
    assert {name: entry["value"] for name, entry in group.items()} == ELECTRONICS
    assert {name: entry["unit"] for name, entry in group.items()} == {
        v.name: v.unit.symbol for v in declared_variables(ArmParams, Causality.PARAMETER) if v.name in group
    }


def test_the_training_is_as_stated(paper: Paper):
    as_paper = {name: entry["value"] for name, entry in paper["training"].items()}
    points = next(p.default for p in vsl_train.params if p.name == "points")
    assert as_paper.pop("points") == points
    assert as_paper.pop("split") == list(training_data.SPLIT) == paper["published"]["split"]["value"]
    assert {n: np.ravel(v).tolist() for n, v in as_paper.items()} == {
        n: np.ravel(getattr(training_data, n.upper())).tolist() for n in as_paper
    }


def test_the_paths_are_the_published_ones(paper: Paper):
    def ends(path: Path) -> list[list[Floats]]:
        return [[s.x_0, s.x_g] for s in segments_of(path, np.zeros(3), np.zeros(3))]

    published = {name: np.array(paper["published"][name]["value"]) for name in ("linear", "curve", "square")}
    np.testing.assert_allclose(ends(Path.LINEAR), [published["linear"]])
    first, second = published["curve"][:3], published["curve"][3:]
    np.testing.assert_allclose(ends(Path.CURVE), [first[:2], [second[0], second[1]]], atol=1e-12)
    for arc, centre in zip(segments_of(Path.CURVE, np.zeros(3), np.zeros(3)), (first[2], second[2]), strict=True):
        assert isinstance(arc, QuarterArc)
        np.testing.assert_allclose(arc.x_c, centre)
    corners = published["square"]
    np.testing.assert_allclose(ends(Path.SQUARE), np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))
