"""The defaults of the free-flyer's code are the values whose origins its `paper.toml` gives."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli
from support.scenarios.parameter_origins import assert_every_default_has_its_origin

import handover.scenarios.free_flyer
from handover.controllers.free_flyer.arm_impedance_controller import Params as ArmControllerParams
from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.controllers.free_flyer.handover_team import Params as TeamDecisionParams
from handover.controllers.free_flyer.impedance_controller import Behaviour
from handover.controllers.free_flyer.impedance_controller import Params as ImpedanceParams
from handover.controllers.free_flyer.pose_controller import Params as PoseParams
from handover.plants.free_flyer.hand.parameters import ContactParams
from handover.plants.free_flyer.hand.parameters import Params as PersonParams
from handover.plants.free_flyer.large_object.parameters import Params as LargeObjectParams
from handover.plants.free_flyer.robot.free_flyer import Params as RobotParams
from handover.plants.free_flyer.robot.navigation import Params as NavigationParams
from handover.plants.free_flyer.robot.push import Params as PushParams
from handover.plants.free_flyer.robot.thrusters import Params as ThrustersParams
from handover.scenarios.free_flyer import scene
from handover.scenarios.free_flyer.parameters import HandoverParameters, TaskParameters, TeamParameters
from handover.scenarios.free_flyer.parameters import ImpedanceParameters as PushScenarioParameters
from handover.scenarios.free_flyer.push.arm_parameters import ArmPushParameters

Paper = dict[str, dict[str, dict[str, Any]]]

CODE = {
    "robot": RobotParams,
    "navigation": NavigationParams,
    "thrusters": ThrustersParams,
    "push": PushParams,
    "person": PersonParams,
    "impedance": ImpedanceParams,
    "pose": PoseParams,
    "decision": DecisionParams,
    "push_scenario": PushScenarioParameters,
    "handover_scenario": HandoverParameters,
}


@pytest.fixture(scope="module")
def paper() -> Paper:
    file = Path(handover.scenarios.free_flyer.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


@pytest.mark.parametrize("group", CODE)
def test_every_default_has_its_origin(paper: Paper, group: str):
    assert_every_default_has_its_origin(paper[group], CODE[group])


def test_the_scenario_of_any_task_has_its_parameters_origins(paper: Paper):
    assert_every_default_has_its_origin(paper["handover_scenario"] | paper["task_scenario"], TaskParameters)


def test_two_robots_have_their_parameters_origins(paper: Paper):
    names = {f.name for f in fields(ContactParams)}
    of_handle = {name: entry for name, entry in paper["person"].items() if name in names}
    assert_every_default_has_its_origin(of_handle | paper["large_object"], LargeObjectParams)
    assert_every_default_has_its_origin(paper["decision"] | paper["team_decision"], TeamDecisionParams)
    assert_every_default_has_its_origin(paper["handover_scenario"] | paper["team_scenario"], TeamParameters)


def test_two_robots_begin_where_they_and_the_person_expect_the_object(paper: Paper):
    place, decision = paper["team_place"], paper["team_decision"]
    for name in ("p_WO_0", "p_OG", "grip_spacing"):
        assert decision[name]["value"] == paper["large_object"][name]["value"]
    assert place["p_WO_0"]["value"] == decision["p_WO_0"]["value"]
    assert place["angle_0"]["value"] == paper["person"]["angle_empty"]["value"]
    assert decision["p_WG_handover"]["value"] == paper["team_scenario"]["p_WG_handover"]["value"]
    assert paper["team_scenario"]["object_mass"]["value"] == paper["large_object"]["object_mass"]["value"]


def test_the_push_on_an_arm_has_its_parameters_origins(paper: Paper):
    assert_every_default_has_its_origin(paper["push_scenario"] | paper["arm_push_scenario"], ArmPushParameters)


def test_robot_and_controller_know_the_same_arm(paper: Paper):
    robot, controller = RobotParams(), ArmControllerParams()
    for name in ("axis_J", "link", "centre_L", "mass_L", "I_L", "rotor_J"):
        np.testing.assert_array_equal(getattr(robot, name), getattr(controller, name))
    for name, entry in paper["arm_2"].items():
        np.testing.assert_array_equal(getattr(robot, name), entry["value"])


@pytest.mark.parametrize("behaviour", [Behaviour.RIGID, Behaviour.COMPLIANT])
def test_the_gains_are_those_of_table_4_1(paper: Paper, behaviour: Behaviour):
    params = ImpedanceParams(behaviour=behaviour)
    body, gains = params.body(), params.gains()
    table = {name: entry["value"] for name, entry in paper[f"gains_{behaviour.name.lower()}"].items()}
    assert np.allclose(gains.stiffness_translation, table["k_D_linear"] * body.mass * np.eye(3))
    assert np.allclose(gains.damping_translation, table["k_B_linear"] * np.eye(3))
    assert np.allclose(gains.stiffness_rotation, table["k_D_rotational"] * np.asarray(body.I_B))
    assert np.allclose(gains.damping_rotation, table["k_B_rotational"] * np.eye(3))


@pytest.mark.parametrize("behaviour", [Behaviour.RIGID, Behaviour.COMPLIANT])
def test_the_thresholds_are_the_published_ones(paper: Paper, behaviour: Behaviour):
    published = paper["published"]
    release, receive = DecisionParams(behaviour=behaviour).velocities()
    assert release == published["velocity_hand"]["value"][behaviour]
    assert receive == published["velocity_gripper"]["value"][behaviour]
    assert DecisionParams().angle_threshold == published["angle_threshold"]["value"]


def test_the_pictures_are_of_what_is_simulated(paper: Paper):
    assert paper["scene"]["edge"]["value"] == scene.EDGE
    assert paper["person"]["object_size"]["value"] == list(scene.OBJECT)
    assert paper["person"]["palm_depth"]["value"] == scene.PALM_DEPTH


def test_a_handover_begins_where_person_and_robot_expect_it(paper: Paper):
    assert paper["handover_place"]["p_WO_0"]["value"] == paper["person"]["p_WO_0"]["value"]
    assert paper["handover_place"]["angle_0"]["value"] == paper["person"]["angle_empty"]["value"]
    assert paper["handover_place"]["p_OG"]["value"] == paper["person"]["p_OG"]["value"]
