"""A push on a robot whose arm moves, on the built FMUs: what base and joints do, and what may be amiss."""

from pathlib import Path

import numpy as np
import pytest
from support.scenarios.flyer_runs import kept, metric, run
from support.wording import Wording

from handover.cosim.exceptions import InitializationError
from handover.cosim.record.reader import Record
from handover.scenarios.robots.free_flyer.push.arm_impedance import FlyerArmImpedance
from handover.scenarios.robots.free_flyer.push.arm_parameters import ArmPushParameters


def test_a_pushed_robot_yields_with_its_arm_and_moves_as_the_impedance_model_says():
    done = kept("flyer_arm_impedance")
    assert done.success, done.reason
    assert done.metric("disagreement_position") <= 0.007
    assert done.metric("disagreement_orientation") <= 0.02
    assert done.metric("joint_motion") > 0.2
    away = np.linalg.norm(done.record["robot.p_WG"] - [0.0, -0.07, 0.0], axis=1)
    assert done.metric("greatest_position_error") == pytest.approx(away.max())
    moved = np.linalg.norm(done.record["robot.p_WB"] - done.record["robot.p_WB"][0], axis=1)
    assert done.metric("base_displacement") == pytest.approx(moved.max())


@pytest.mark.slow
def test_with_fixed_joints_the_model_is_that_of_one_body_and_the_base_does_it_all(tmp_path: Path):
    ended = run(FlyerArmImpedance, tmp_path / "r", "tolerance=0", stop=2.0)
    assert metric(ended, "disagreement_position") <= 0.007
    assert metric(ended, "joint_motion") == 0.0


@pytest.mark.slow
def test_joints_that_lock_unknown_to_the_controller_depart_from_the_model(tmp_path: Path):
    ended = run(FlyerArmImpedance, tmp_path / "r", "lock_time=1.25", stop=2.5)
    assert not ended.outcome.success
    assert "departed from the impedance model" in ended.outcome.reason
    assert "joint 1 was held at" in ended.outcome.reason
    record = Record(tmp_path / "r" / "signals.parquet")
    assert len(np.unique(record["robot.q_J"][record.time > 1.28], axis=0)) == 1


@pytest.mark.slow
def test_a_joint_at_its_end_stop_is_reported(tmp_path: Path):
    ended = run(FlyerArmImpedance, tmp_path / "r", "posture=1.5,1.5,1.5", "joints=3", stop=2.5)
    assert "joint 1 was held at 90°" in ended.outcome.reason
    assert "of which 7 mm and 1.1° at most agree" in ended.outcome.reason


@pytest.mark.parametrize(
    "given",
    [
        ("rotational_damping=5",),  # the published one, rigid
        pytest.param(("delay=0.05", "navigation_delay=0.1"), marks=pytest.mark.slow),
    ],
)
def test_what_makes_the_loop_unstable_is_refused(tmp_path: Path, given: tuple[str, ...], wording: Wording):
    with pytest.raises(InitializationError) as refused:
        run(FlyerArmImpedance, tmp_path / "r", *given)
    wording.check(refused.value)


@pytest.mark.slow
def test_the_age_of_the_estimate_reaches_navigation_and_controller(tmp_path: Path):
    late = run(FlyerArmImpedance, tmp_path / "late", "navigation_delay=0.004", stop=0.1)
    assert metric(late, "pole_margin_impedance") < kept("flyer_arm_impedance").metric("pole_margin_impedance")


def test_factors_of_the_arm_scale_its_links():
    p = ArmPushParameters(arm_factor=2.0, model_arm_factor=0.5, model_link_factor=0.7)
    robot, model = p.arm(p.arm_factor), p.controller()
    np.testing.assert_allclose(robot["link"][0], [-0.2, 0.0, 0.0])
    np.testing.assert_allclose(model["link"][0], [-0.05, 0.0, 0.0])
    np.testing.assert_allclose(model["mass_L"], 0.7 * robot["mass_L"])


def test_a_nozzle_that_is_stuck_is_reported(tmp_path: Path):
    ended = run(FlyerArmImpedance, tmp_path / "r", "propulsion=nozzles", "stuck_nozzle=3", stop=0.1)
    assert "; nozzle 3 was stuck closed" in ended.outcome.reason
