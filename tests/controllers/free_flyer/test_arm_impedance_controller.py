"""Impedance control of base and arm: its law, beside the linear loop and the plant, and what it refuses."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.wording import Wording

from handover.controllers.free_flyer.arm_impedance_controller import (
    ArmAtRest,
    ArmImpedanceController,
    Inputs,
    InvalidControllerParameters,
    Outputs,
    Params,
)
from handover.controllers.free_flyer.impedance_controller import Behaviour, ImpedanceController
from handover.controllers.free_flyer.impedance_controller import Inputs as RigidInputs
from handover.controllers.free_flyer.impedance_controller import Params as RigidParams
from handover.controllers.free_flyer.sampled_loop import SampledLoop
from handover.cosim.blocks.plain_rotation import IDENTITY, ZERO, vector
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.arm import Arm
from handover.plants.free_flyer.robot.articulated_body import ArticulatedBody
from handover.plants.free_flyer.robot.stopping_joints import JointLimits, StoppingJoints

PERIOD = 0.016
IDEAL = Params(lag=0.0)


def robot(p: Params, q_J: Floats, p_WG: Floats) -> StoppingJoints:
    """Return the robot that parameters describe, at rest, without turn, its gripper at a place."""
    arm = Arm.of(p.joints, p.p_BG, p.axis_J, p.link, p.centre_L, p.mass_L, p.I_L, p.rotor_J)
    body, angles = ArticulatedBody(p.mass, p.I_B, arm), tuple(q_J[: p.joints].tolist())
    free = JointLimits((-9.0,) * p.joints, (9.0,) * p.joints, (0.0,) * p.joints, (0.0,) * p.joints)
    p_WB = vector(p_WG - np.array(body.posture(angles).p_BG))
    return StoppingJoints(body, free, angles, (p_WB, IDENTITY), (ZERO, ZERO))


def seen(plant: StoppingJoints, p_WG_goal: Floats, q_WG_goal: Floats) -> Inputs:
    m, q_J, v_J = plant.motion(), np.zeros(3), np.zeros(3)
    q_J[: len(m.q_J)], v_J[: len(m.v_J)] = m.q_J, m.v_J
    places = {name: np.array(getattr(m, name.removesuffix("_meas"))) for name in ("p_WB_meas", "q_WB_meas")}
    rates = {name: np.array(getattr(m, name.removesuffix("_meas"))) for name in ("v_WB_meas", "w_WB_meas")}
    return Inputs(**places, **rates, q_J=q_J, v_J=v_J, p_WG_goal=p_WG_goal, q_WG_goal=q_WG_goal, active=True)


def step(plant: StoppingJoints, y: Outputs, f_G: Floats, tau_G: Floats, parts: int = 4) -> None:
    wrench = vector(y.f_cmd), vector(y.tau_cmd), vector(f_G), vector(tau_G)
    for _ in range(parts):
        plant.advance(PERIOD / parts, wrench, tuple(y.tau_J_cmd[: len(plant.still)].tolist()))


def random_inputs(seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    q = Rotation.random(2, rng=rng).as_quat(scalar_first=True)
    names = ("p_WB_meas", "v_WB_meas", "w_WB_meas", "p_WG_goal")
    return {**dict(zip(names, rng.normal(size=(4, 3)), strict=True)), "q_WB_meas": q[0], "q_WG_goal": q[1]}


def test_without_joints_it_is_the_impedance_controller():
    law: dict[str, Any] = {"behaviour": Behaviour.CUSTOM, "damping_rotation": np.diag([1.0, 2.0, 3.0])}
    with_arm, rigid = ArmImpedanceController(Params(joints=0, **law)), ImpedanceController(RigidParams(**law))
    for seed in range(4):
        u = random_inputs(seed)
        a = with_arm.outputs(0.0, Inputs(**u, active=True))
        b = rigid.outputs(0.0, RigidInputs(**u, active=True))
        for name in ("f_cmd", "tau_cmd", "error_p", "error_R", "pole_radius"):
            np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-9, atol=1e-12)
        assert not np.any(a.tau_J_cmd)
    off = ArmImpedanceController(Params()).outputs(0.0, Inputs(**random_inputs(1), active=False))
    assert not np.any(np.concatenate([off.f_cmd, off.tau_cmd, off.tau_J_cmd]))
    assert off.error_p > 0.1


@pytest.mark.parametrize("behaviour", [Behaviour.RIGID, Behaviour.COMPLIANT])
def test_a_small_push_moves_the_robot_as_the_linear_loop_does(behaviour: Behaviour):
    p = replace(IDEAL, behaviour=behaviour, q_J_goal=np.array([0.5, -0.4, 0.0]))
    controller, plant, d = ArmImpedanceController(p), robot(p, p.q_J_goal, np.zeros(3)), np.zeros((120, 6))
    rest = ArmAtRest(p.model(), p.posture)
    d[10:40] = 0.02, -0.01, 0.03, 0.001, 0.002, -0.001
    linear = SampledLoop(rest.linear_plant(0.0), rest.law(p.gains(), p.null()), PERIOD).response(d)
    start, errors = plant.motion(), list[float]()
    for k in range(len(d)):
        m = plant.motion()
        moved = np.subtract(m.p_WB, start.p_WB), 2.0 * np.array(m.q_WB[1:]), np.subtract(m.q_J, p.posture)
        errors.append(float(np.max(np.abs(np.concatenate(moved) - linear[k, :8]))))
        y = controller.step(PERIOD * k, PERIOD, seen(plant, np.zeros(3), np.array(start.q_WG)))
        step(plant, y, d[k, :3], d[k, 3:])
    assert np.max(np.abs(linear[:, 6:8])) > 0.001
    assert max(errors) < 0.02 * np.max(np.abs(linear[:, :8]))


def test_the_joints_go_back_to_their_posture_while_the_gripper_stays():
    p = replace(IDEAL, null_frequency=1.0)
    plant = robot(p, np.array([0.8, -0.6, 0.0]), np.zeros(3))
    controller, start = ArmImpedanceController(p), plant.motion()
    strayed = turned = 0.0
    for k in range(500):
        y = controller.step(PERIOD * k, PERIOD, seen(plant, np.zeros(3), np.array(start.q_WG)))
        strayed, turned = max(strayed, y.error_p), max(turned, y.error_R)
        step(plant, y, np.zeros(3), np.zeros(3), parts=1)
    end = plant.motion()
    assert np.max(np.abs(end.q_J)) < 0.01
    assert np.linalg.norm(np.subtract(end.p_WB, start.p_WB)) > 0.1
    assert strayed < 0.005
    assert turned < 0.02


def test_the_published_rigid_damping_is_refused_with_a_remedy_and_the_compliant_one_is_not(wording: Wording):
    nothing: dict[str, Any] = {"mass": 0.0, "I_B": -np.eye(3), "axis_J": np.diag([1.0, 0.0, 1.0])}
    unusable: tuple[tuple[dict[str, Any], int], ...] = (
        ({"rotational_damping": 5.0}, 1),
        ({**nothing, "mass_L": np.array([-1.0, 1.0, 1.0])}, 4),
    )
    for given, faults in unusable:
        with pytest.raises(InvalidControllerParameters) as caught:
            ArmImpedanceController(Params(**given))
        assert len(caught.value.faults) == faults
        wording.check(caught.value)
    compliant = ArmImpedanceController(Params(behaviour=Behaviour.COMPLIANT, rotational_damping=1.0))
    assert compliant.outputs(0.0, Inputs()).pole_radius < 1.0
    heavy = Params(rotational_damping=5.0, rotor_J=np.full(3, 0.1))
    assert ArmImpedanceController(heavy).outputs(0.0, Inputs()).pole_radius < 1.0
