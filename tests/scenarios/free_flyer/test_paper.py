"""The defaults of the free-flyer's code are the values whose origins its `paper.toml` gives."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli
from support.scenarios.parameter_origins import assert_every_default_has_its_origin

import handover.scenarios.free_flyer
from handover.controllers.free_flyer.admittance_controller import Params as AdmittanceParams
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
    "impedance + admittance": AdmittanceParams,
    "pose": PoseParams,
    "decision": DecisionParams,
    "decision + team_decision": TeamDecisionParams,
    "push_scenario": PushScenarioParameters,
    "push_scenario + arm_push_scenario": ArmPushParameters,
    "handover_scenario": HandoverParameters,
    "handover_scenario + task_scenario": TaskParameters,
    "handover_scenario + team_scenario": TeamParameters,
}


@pytest.fixture(scope="module")
def paper() -> Paper:
    file = Path(handover.scenarios.free_flyer.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


@pytest.mark.parametrize("groups", CODE)
def test_every_default_has_its_origin(paper: Paper, groups: str):
    origins = {name: entry for group in groups.split(" + ") for name, entry in paper[group].items()}
    assert_every_default_has_its_origin(origins, CODE[groups])


def test_the_large_object_has_its_parameters_origins(paper: Paper):
    names = {f.name for f in fields(ContactParams)}
    of_handle = {name: entry for name, entry in paper["person"].items() if name in names}
    assert_every_default_has_its_origin(of_handle | paper["large_object"], LargeObjectParams)


def test_runs_and_pictures_begin_where_person_and_robot_expect_the_object(paper: Paper):
    for one, other in (
        ("decision.p_WO_0", "large_object.p_WO_0"),
        ("decision.p_OG", "large_object.p_OG"),
        ("decision.grip_spacing", "large_object.grip_spacing"),
        ("decision.p_WO_0", "place.p_WO_0"),
        ("decision.p_WG_handover", "scenario.p_WG_handover"),
        ("scenario.object_mass", "large_object.object_mass"),
    ):
        values = (f"team_{text}".replace("team_large", "large").split(".") for text in (one, other))
        assert len({str(paper[group][name]["value"]) for group, name in values}) == 1, other
    person, place = paper["person"], paper["handover_place"]
    assert place["angle_0"]["value"] == paper["team_place"]["angle_0"]["value"] == person["angle_empty"]["value"]
    assert [place[n]["value"] for n in ("p_WO_0", "p_OG")] == [person[n]["value"] for n in ("p_WO_0", "p_OG")]
    assert paper["scene"]["edge"]["value"] == scene.EDGE
    assert (person["object_size"]["value"], person["palm_depth"]["value"]) == (list(scene.OBJECT), scene.PALM_DEPTH)


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
