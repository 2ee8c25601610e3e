"""What each corrector makes of the tip's error, on the built FMUs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from handover.controllers.vsl.beam import HINGES, Beam, Stiffness, Weights
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
from handover.scenarios.vsl.path_experiments import VslHybrid

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
        pytest.param("learned=small", 1.3, marks=pytest.mark.slow),
        ("learned=physics", 1.8),
        pytest.param("friction_compensation=true", 0.6, marks=pytest.mark.slow),
    ],
)
def test_each_corrector_against_the_polynomials(cubic: float, given: str, share: float):
    assert error_of(*QUICK, given) < share * cubic


@pytest.mark.slow
def test_the_closed_loop_makes_up_for_an_arm_that_differs(cubic: float):
    stiffer = {"EI_0": 0.55 * 1.2, "EI_p": 1.05e-5 * 1.2}
    open_loop = error_of(*QUICK, **stiffer)
    assert open_loop > 2.0 * cubic
    assert error_of("settle=2", "closed_loop=true", **stiffer) < 0.5 * open_loop


def test_the_tracker_is_wired_only_where_it_closes_the_loop():
    def targets(system: System) -> set[str]:
        return {str(c.target) for c in system.connections}

    assert targets(wired("closed_loop=true")) - targets(wired()) == {"kinematics.p_WG_meas"}
    assert targets(wired("imu=monitor")) - targets(wired()) == {"kinematics.tilt_meas"}


@pytest.mark.slow
def test_imus_make_up_for_an_arm_that_differs_and_tell_that_it_does(cubic: float):
    stiffer = (*QUICK, "EI_factor=1.2")
    assert metrics_of(*stiffer, "imu=feedback")["mean_error_true"] < 1.5 * cubic
    monitored, open_loop = metrics_of(*stiffer, "imu=monitor"), metrics_of(*stiffer)
    assert monitored["mean_error_true"] == open_loop["mean_error_true"] > 2.0 * cubic
    assert monitored["model_mismatch"] > 0.8
    assert monitored["outside"] < 0.1
    assert "model_mismatch" not in open_loop
    assert metrics_of(*QUICK, "imu=monitor")["model_mismatch"] == 0.0


def test_imus_beside_a_tracker_are_refused():
    with pytest.raises(InvalidParameter, match="imu: with closed_loop=true the tracker sees the tip itself"):
        wired("closed_loop=true", "imu=monitor")


def test_a_gain_of_damping_without_friction_compensation_is_refused():
    plain = wired("vibration_damping=true")
    with pytest.raises(InvalidParameter, match="K_D: without effect unless friction_compensation=true"):
        VslHybrid().check_unit_values(plain, ["kinematics.K_D"])
    VslHybrid().check_unit_values(plain, ["kinematics.K_F"])
    VslHybrid().check_unit_values(wired("friction_compensation=true"), ["kinematics.K_D"])


def test_a_network_that_does_not_ship_is_refused_with_how_to_make_it():
    with (
        pytest.raises(InitializationError, match="handover vsl-train --learned published"),
        Master(wired("learned=published")),
    ):
        pass


def test_a_model_of_another_kind_is_refused(tmp_path: Path):
    from handover.controllers.vsl.default_model import DEFAULT_MODEL

    (tmp_path / "m.json").write_text(DEFAULT_MODEL)
    with (
        pytest.raises(InitializationError, match="it is a cubic model, and the parameter learned says physics"),
        Master(wired("learned=physics", f"model={tmp_path / 'm.json'}")),
    ):
        pass


@pytest.mark.slow
def test_fast_motion_of_an_arm_that_swings():
    fast = ("motion=dynamic", "speed=0.2", "friction_compensation=true")
    plain, compensated = error_of(*fast), error_of(*fast, "vibration_damping=true")
    assert compensated < 0.8 * plain
    assert compensated < 0.003


@pytest.mark.slow
def test_the_closed_loop_does_not_swing_the_arm_up():
    swinging = [
        error_of("motion=dynamic", "friction_compensation=true", f"closed_loop={closed}")
        for closed in ("false", "true")
    ]
    assert np.all(np.array(swinging) < 0.002)


def test_the_weights_of_the_controllers_beam_are_those_of_the_arm():
    w, arm = Weights(), ArmParams()
    assert (w.link, w.elbow, w.gripper) == (arm.link_mass, arm.servo_mass, arm.gripper_mass)
    assert (w.cap, w.kt, w.gravity) == (arm.cap, arm.kt, arm.gravity)


@pytest.mark.parametrize("load", [0.0, 0.05, 0.1])
@pytest.mark.parametrize("theta", [(0.84, -1.68), (0.48, -0.95), (0.2, -0.6)])
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
    ("scenario", "given", "text"),
    [
        ("vsl_hybrid", "kinematics.imu=feedback", "kinematics.tilt_meas, which would read 0; `-p imu=feedback` of"),
        ("vsl_hybrid", "kinematics.closed_loop=true", "`-p closed_loop=true` of vsl_hybrid connects it"),
        ("vsl_model_based", "kinematics.closed_loop=true", "nothing is connected to kinematics.p_WG_meas"),
        ("vsl_pick_and_place", "kinematics.imu=feedback", "this scenario has no imu=feedback, vsl_hybrid has"),
        ("vsl_pick_and_place", "arm.links=3", "arm.links: planner and kinematics are of an arm of two links"),
        ("vsl_pick_and_place", "arm.face=-10", "arm.face: the table is as high as the top of the object, pick"),
        ("vsl_hybrid", "arm.links=1", "arm.links: planner and kinematics are of an arm of two links"),
    ],
)
def test_what_the_wiring_does_not_have_is_refused(scenario: str, given: str, text: str, tmp_path: Path):
    result = CliRunner().invoke(main, ["run", scenario, "-p", given, "--out", str(tmp_path / "run")])
    assert result.exit_code == 2
    assert text in result.output
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("row", ["0.3,0,nan", "0.3,0,1e308", "0.3,0", "x,0,0.1"])
def test_a_faulty_list_of_waypoints_is_refused_in_a_line(row: str, tmp_path: Path):
    (tmp_path / "way.csv").write_text(f"x,y,z\n0.3,0,0.1\n{row}\n")
    given = ("-p", "path=custom", "-p", f"waypoints={tmp_path / 'way.csv'}", "--out", str(tmp_path / "run"))
    result = CliRunner().invoke(main, ["run", "vsl_hybrid", *given])
    assert result.exit_code == 2
    assert "waypoints: " in result.output
    assert "Traceback" not in result.output
    assert not (tmp_path / "run").exists()
