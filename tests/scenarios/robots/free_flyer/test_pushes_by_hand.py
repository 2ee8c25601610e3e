"""Pushes by hand on a free-flyer belong to what acts on it in the impedance model, and to every verdict."""

from typing import Any

import numpy as np
import pytest

import handover
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.free_flyer import FreeFlyer, Inputs, Params
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause, PersonsDeeds
from handover.scenarios.robots.free_flyer.parameters import Behaviour, ImpedanceParameters
from handover.scenarios.robots.free_flyer.push.arm_evaluation import SIGNALS, errors_with_arm
from handover.scenarios.robots.free_flyer.push.arm_parameters import ArmPushParameters
from handover.scenarios.robots.free_flyer.push.hand_push import HAND_SIGNALS
from handover.scenarios.robots.free_flyer.push.impedance_evaluation import Motion, errors_of

STEP, STEPS = 0.016, 30
HAND = {
    "f_P": np.array([3.0, -4.0, 2.0]),
    "p_BP": np.array([0.1, 0.16, -0.05]),
    "f_Q": np.array([0.5, 1.0, -1.5]),
    "p_GQ": np.array([0.02, 0.0, 0.03]),
}


def drifting(**values: Any) -> dict[str, Floats]:
    """Return a free-flyer's motion without thrust, pushed by hand alone."""
    robot, u = FreeFlyer(Params(**values)), Inputs(**HAND)
    rows = [vars(robot.outputs(0.0, u)), *(vars(robot.step(k * STEP, STEP, u)) for k in range(STEPS))]
    motion: dict[str, Floats] = {f"robot.{name}": np.array([row[name] for row in rows]) for name in rows[0]}
    by_hand: dict[str, Floats] = {f"robot.{name}": np.tile(value, (len(rows), 1)) for name, value in HAND.items()}
    nothing: dict[str, Floats] = {name: np.zeros((len(rows), 3)) for name in SIGNALS if not name.startswith("robot.")}
    times: Floats = np.arange(len(rows), dtype=np.float64) * STEP
    return {**motion, **by_hand, **nothing, "t": times}


def test_a_body_that_only_a_hand_pushes_agrees_with_a_model_without_a_spring():
    p = ImpedanceParameters()
    motion = drifting(**vars(p.robot))
    errors = errors_of(Motion.of(motion, motion["t"]), np.zeros(3), Behaviour.RIGID, p.model)
    damped = 15.0 * motion["robot.v_WG"][:-1] / (7.0 * p.model.mass)  # nothing thrusts: k_D xt' = k_B x'
    assert np.abs(motion["robot.v_WG"]).max() > 0.1
    assert np.abs(errors.p_model - damped[: len(errors.p_model)]).max() < 1e-3
    without = {name: values for name, values in motion.items() if name not in HAND_SIGNALS}
    departed = errors_of(Motion.of(without, motion["t"]), np.zeros(3), Behaviour.RIGID, p.model)
    assert np.abs(departed.p_model - damped[: len(errors.p_model)]).max() > 0.05


@pytest.mark.parametrize("tolerance", [10.0, 0.0])
def test_an_arm_that_only_a_hand_pushes_agrees_with_a_model_without_a_spring(tolerance: float):
    p = ArmPushParameters(tolerance=tolerance)
    joints = {"q_J_0": p.posture, "tolerance_J": tolerance, "friction_J": np.zeros(3)}
    motion = drifting(**vars(p.robot), **p.arm(1.0), **joints)
    target = p.target()
    errors = errors_with_arm(motion, target)
    R_WD, v_WG = target.R_WG, motion["robot.v_WG"][: len(errors.p_model)]
    softness: Floats = np.linalg.inv(target.gains.stiffness()[:3, :3]).astype(np.float64)
    D: Floats = R_WD @ softness @ target.gains.damping()[:3, :3] @ np.transpose(R_WD)
    damped: Floats = v_WG @ np.transpose(D)
    assert np.abs(v_WG).max() > 0.1
    assert np.abs(errors.p_model - damped).max() < 2e-3


def test_the_verdict_of_a_session_knows_of_a_push_by_hand():
    with handover.open("flyer_impedance") as s:
        s.step(0.1)
        s["robot.f_P"], s["robot.p_BP"] = HAND["f_P"], HAND["p_BP"]
        s.step(0.2)
        s["robot.f_P"] = np.zeros(3)
        s.step(0.1)
        assert s.outcome.metrics["disagreement_position"].value < 0.007
        force = np.linalg.norm(HAND["f_P"])
        assert s.outcome.reason.endswith(f"; besides, somebody pushed the robot by hand, with up to {force:.1f} N")
        saved = s.save()
        s.restore(saved)
        assert "by hand" in s.outcome.reason


def test_a_robot_that_let_go_because_it_was_pushed_by_hand_is_not_said_to_have_felt_nothing():
    cause, reason = PersonsDeeds().released(20.0, "it saw its gripper move", pushed=19.0)
    assert cause is Cause.RELEASED_UNHELD
    assert "push by hand" in reason
    assert "push by hand" not in PersonsDeeds().released(20.0, "it saw its gripper move", pushed=-np.inf)[1]
