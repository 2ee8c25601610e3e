"""What each corrector makes of the tip's error, on the built FMUs."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from support.wording import Wording

from handover.controllers.vsl.beam import HINGES, Beam, Stiffness, Weights
from handover.controllers.vsl.hybrid_kinematics import shipped_file
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.cosim.exceptions import InitializationError
from handover.cosim.master.master import Master
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.plants.vsl.chain import VslChain
from handover.plants.vsl.parameters import Params as ArmParams
from handover.plants.vsl.statics import VslStatics
from handover.scenarios.cli.command import main
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.robots.vsl.path_experiments import VslHybrid

QUICK = ("settle=2", "speed=0.1")


def wired(*parameters: str, **arm: Any) -> System:
    """Return the scenario's system with other parameters of the arm."""
    s = VslHybrid().build(parse_parameters(VslHybrid, parameters), 0, lambda name: cached(VslHybrid.units[name], 3))
    s.units["arm"] = replace(s.units["arm"], start={**s.units["arm"].start, **arm})
    return s


def error_of(*parameters: str, **arm: Any) -> float:
    """Return the mean distance of the tip itself from its path's points, at 0.5 bar and with 75 g, m."""
    return metrics_of(*parameters, **arm)["mean_error_true"]


def metrics_of(*parameters: str, **arm: Any) -> dict[str, float]:
    """Return the metrics of a run that came to its end, in SI units."""
    p = parse_parameters(VslHybrid, parameters)
    evaluator = VslHybrid().evaluator(p)
    with Master(wired(*parameters, **arm)) as master:
        master.run(VslHybrid().stop_time(p), [evaluator], until=lambda: evaluator.over)
    outcome = evaluator.outcome()
    assert "the path was completed" in outcome.reason
    return {name: metric.value for name, metric in outcome.metrics.items()}


@pytest.fixture(scope="module")
def cubic() -> float:
    return error_of(*QUICK)


@pytest.mark.parametrize(
    ("given", "share"),
    [
        ("learned=physics", 1.8),
        pytest.param("learned=small", 1.3, marks=pytest.mark.slow),
        pytest.param("friction_compensation=true", 0.6, marks=pytest.mark.slow),
    ],
)
def test_each_corrector_against_the_polynomials(cubic: float, given: str, share: float):
    assert error_of(*QUICK, given) < share * cubic


@pytest.mark.slow
def test_the_closed_loop_and_imus_make_up_for_an_arm_that_differs_and_imus_tell_that_it_does(cubic: float):
    stiffer = (*QUICK, "EI_factor=1.2")
    monitored = metrics_of(*stiffer, "imu=monitor")
    assert monitored["mean_error_true"] > 2.0 * cubic
    assert error_of("settle=2", "EI_factor=1.2", "closed_loop=true") < 0.5 * monitored["mean_error_true"]
    assert error_of(*stiffer, "imu=feedback") < 1.5 * cubic
    assert monitored["model_mismatch"] > 0.8
    assert monitored["outside"] < 0.1
    assert metrics_of(*QUICK, "imu=monitor")["model_mismatch"] == 0.0


def test_tracker_and_imus_are_wired_only_where_they_are_used():
    def targets(system: System) -> set[str]:
        return {str(c.target) for c in system.connections}

    assert targets(wired("closed_loop=true")) - targets(wired()) == {"kinematics.p_WG_meas"}
    assert targets(wired("imu=monitor")) - targets(wired()) == {"kinematics.tilt_meas"}


def test_a_gain_of_damping_without_friction_compensation_and_imus_beside_a_tracker_are_refused(wording: Wording):
    plain = wired("vibration_damping=true")
    with pytest.raises(InvalidParameter) as refused:
        VslHybrid().check_unit_values(plain, ["kinematics.K_D"])
    wording.check(refused.value)
    VslHybrid().check_unit_values(plain, ["kinematics.K_F"])
    VslHybrid().check_unit_values(wired("friction_compensation=true"), ["kinematics.K_D"])
    with pytest.raises(InvalidParameter) as refused:
        wired("closed_loop=true", "imu=monitor")
    wording.check(refused.value)


def test_a_network_that_does_not_ship_and_a_model_of_another_kind_are_refused(tmp_path: Path, wording: Wording):
    shutil.copyfile(shipped_file("cubic"), tmp_path / "m.json")
    for given in (("learned=published",), ("learned=physics", f"model={tmp_path / 'm.json'}")):
        with pytest.raises(InitializationError) as refused, Master(wired(*given)):
            pass
        wording.check(refused.value)


@pytest.mark.slow
def test_fast_motion_of_an_arm_that_swings():
    fast = ("motion=dynamic", "settle=1", "speed=0.2", "friction_compensation=true")
    plain, compensated = error_of(*fast), error_of(*fast, "vibration_damping=true")
    assert compensated < 0.8 * plain
    assert compensated < 0.003


@pytest.mark.slow
def test_the_closed_loop_does_not_swing_the_arm_up():
    assert error_of("motion=dynamic", "friction_compensation=true", "closed_loop=true") < 0.002


def test_the_weights_of_the_controllers_beam_are_those_of_the_arm():
    w, arm = Weights(), ArmParams()
    assert (w.link, w.elbow, w.gripper) == (arm.link_mass, arm.servo_mass, arm.gripper_mass)
    assert (w.cap, w.kt, w.gravity) == (arm.cap, arm.kt, arm.gravity)


@pytest.mark.parametrize(("theta", "load"), [((0.84, -1.68), 0.1), ((0.48, -0.95), 0.0), ((0.2, -0.6), 0.05)])
def test_the_controllers_beam_bends_as_the_arm_does(theta: tuple[float, float], load: float):
    """With as many hinges, no shear, and currents without friction; the load it has from the currents alone."""
    arm = ArmParams(shear_0=1e9)
    p, chain = (8e4, 1.5e5), VslChain(arm, HINGES)
    statics = VslStatics(chain, arm.gravity, 1.0 / arm.servo_stiffness)
    statics.settle(theta, p, load)
    pose = statics.pose
    q = (theta[0] - pose.droop[0], theta[1] - pose.droop[1])
    i = (pose.torque[0] / arm.kt, pose.torque[1] / arm.kt)
    stiffness = Stiffness(arm.EI_0, arm.EI_p, arm.joint_stiffness)
    kinematics = VslKinematics(arm.L_1, arm.L_2, arm.L_3, Elbow.UP)
    tip, torques = Beam(kinematics, stiffness, Weights()).bent(q, p, i)
    sag = kinematics.L_2 * np.exp(1j * q[0]) + kinematics.L_3 * np.exp(1j * sum(q)) - chain.ends(pose)[-1]
    assert abs(sag) > 0.008
    assert abs(complex(*tip) - chain.ends(pose)[-1]) < 2e-4
    assert torques == pytest.approx(pose.torque, rel=2e-3)


@pytest.mark.parametrize(
    ("scenario", "given"),
    [
        ("vsl_hybrid", "kinematics.imu=feedback"),
        ("vsl_model_based", "kinematics.closed_loop=true"),
        ("vsl_pick_and_place", "kinematics.imu=feedback"),
        ("vsl_pick_and_place", "arm.face=-10"),
        ("vsl_hybrid", "arm.links=1"),
    ],
)
def test_what_the_wiring_does_not_have_is_refused(scenario: str, given: str, tmp_path: Path, wording: Wording):
    result = CliRunner().invoke(main, ["run", scenario, "-p", given, "--out", str(tmp_path / "run")])
    assert result.exit_code == 2
    wording.check(result.output)
    assert not (tmp_path / "run").exists()
