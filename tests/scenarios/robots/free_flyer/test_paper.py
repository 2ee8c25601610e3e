"""The free-flyer's units agree with each other, and with what its `paper.toml` gives."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli

import handover.scenarios.robots.free_flyer
from handover.controllers.free_flyer.arm_impedance_controller import Params as ArmControllerParams
from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.controllers.free_flyer.handover_team import Params as TeamDecisionParams
from handover.controllers.free_flyer.impedance_controller import Behaviour
from handover.controllers.free_flyer.impedance_controller import Params as ImpedanceParams
from handover.plants.free_flyer.hand.parameters import Params as PersonParams
from handover.plants.free_flyer.large_object.parameters import Params as LargeObjectParams
from handover.plants.free_flyer.robot.free_flyer import Params as RobotParams
from handover.scenarios.robots.free_flyer import scene
from handover.scenarios.robots.free_flyer.parameters import TeamParameters

Paper = dict[str, dict[str, dict[str, Any]]]


@pytest.fixture(scope="module")
def paper() -> Paper:
    file = Path(handover.scenarios.robots.free_flyer.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


def test_runs_and_pictures_begin_where_person_and_robot_expect_the_object(paper: Paper):
    team, large, place = TeamParameters(), LargeObjectParams(), paper["team_place"]
    for one, other in (
        (TeamDecisionParams().p_WO_0, large.p_WO_0),
        (TeamDecisionParams().p_OG, large.p_OG),
        (TeamDecisionParams().grip_spacing, large.grip_spacing),
        (TeamDecisionParams().p_WO_0, place["p_WO_0"]["value"]),
        (TeamDecisionParams().p_WG_handover, team.p_WG_handover),
        (team.object_mass, large.object_mass),
    ):
        np.testing.assert_array_equal(one, other)
    person, place = PersonParams(), paper["handover_place"]
    assert place["angle_0"]["value"] == paper["team_place"]["angle_0"]["value"] == person.angle_empty
    np.testing.assert_array_equal(place["p_WO_0"]["value"], person.p_WO_0)
    np.testing.assert_array_equal(place["p_OG"]["value"], person.p_OG)
    assert paper["scene"]["edge"]["value"] == scene.EDGE
    assert (person.object_size.tolist(), person.palm_depth) == (list(scene.OBJECT), scene.PALM_DEPTH)


def test_robot_and_controller_know_the_same_arm(paper: Paper):
    robot, controller = RobotParams(), ArmControllerParams()
    for name in ("axis_J", "link", "centre_L", "mass_L", "I_L", "rotor_J"):
        np.testing.assert_array_equal(getattr(robot, name), getattr(controller, name))
    for name, entry in paper["arm_2"].items():
        np.testing.assert_array_equal(getattr(robot, name), entry["value"])


@pytest.mark.parametrize("behaviour", [Behaviour.RIGID, Behaviour.COMPLIANT])
def test_gains_and_thresholds_are_the_published_ones(paper: Paper, behaviour: Behaviour):
    params = ImpedanceParams(behaviour=behaviour)
    body, gains = params.body(), params.gains()
    table = {name: entry["value"] for name, entry in paper[f"gains_{behaviour.name.lower()}"].items()}
    assert np.allclose(gains.stiffness_translation, table["k_D_linear"] * body.mass * np.eye(3))
    assert np.allclose(gains.damping_translation, table["k_B_linear"] * np.eye(3))
    assert np.allclose(gains.stiffness_rotation, table["k_D_rotational"] * np.asarray(body.I_B))
    assert np.allclose(gains.damping_rotation, table["k_B_rotational"] * np.eye(3))
    published = {name: entry["value"] for name, entry in paper["published"].items()}
    thresholds = published["velocity_hand"][behaviour], published["velocity_gripper"][behaviour]
    assert DecisionParams(behaviour=behaviour).velocities() == thresholds
    assert DecisionParams().angle_threshold == published["angle_threshold"]
