"""A push against the free-flyer's gripper, on the built FMUs."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from flyer_runs import metric, run

from handover.cosim.exceptions import InitializationError
from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.scenarios.cli.command import main
from handover.scenarios.execution.request import RunRequest
from handover.scenarios.execution.runner import experiment_system
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.free_flyer.model_mismatch import model_mismatch
from handover.scenarios.free_flyer.parameters import ImpedanceParameters, Propulsion
from handover.scenarios.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.free_flyer.robot_wiring import expected_lag, thruster_settings


def test_a_pushed_robot_comes_back_and_moves_as_the_impedance_model_says(tmp_path: Path):
    ended = run(FlyerImpedance, tmp_path / "r", drawn=True)
    assert ended.outcome.success, ended.outcome.reason
    assert metric(ended, "disagreement_position") <= 0.007
    assert metric(ended, "disagreement_orientation") <= 0.02
    assert metric(ended, "pole_margin_impedance") > 0.0
    record = Record(tmp_path / "r" / "signals.parquet")
    away = np.linalg.norm(record["robot.p_WG"] - [0.0, -0.07, 0.0], axis=1)
    assert metric(ended, "greatest_position_error") == pytest.approx(away.max())
    assert np.all(away[record.time > 1.5 + metric(ended, "settling_time") + 0.016] < 0.010)
    impulse = np.diff(record.time) @ record["push.f_G"][1:]
    assert impulse == pytest.approx([2.5, 0.0, 0.0])
    figures = {p.name for p in (tmp_path / "r" / "figures").iterdir()}
    assert figures == {f"{n}.{s}" for n in ("errors", "push", "scene", "thrust") for s in ("png", "svg")}


@pytest.mark.parametrize(
    ("push", "error"),
    [
        (("axis=x",), "greatest_position_error"),
        (("axis=y", "kind=torque"), "greatest_orientation_error"),
    ],
)
def test_the_compliant_robot_yields_more_than_twice_as_far(tmp_path: Path, push: tuple[str, ...], error: str):
    rigid = run(FlyerImpedance, tmp_path / "rigid", "behaviour=rigid", *push)
    compliant = run(FlyerImpedance, tmp_path / "compliant", "behaviour=compliant", *push)
    assert rigid.outcome.success, rigid.outcome.reason
    assert compliant.outcome.success, compliant.outcome.reason
    assert metric(compliant, error) > 2.0 * metric(rigid, error)


def test_with_real_limits_a_push_saturates_the_thrusters_and_the_verdict_says_so(tmp_path: Path):
    ended = run(FlyerImpedance, tmp_path / "r", "propulsion=limited", "patience=5")
    assert not ended.outcome.success
    assert "did not come back to rest, within 10 mm and 1.7°" in ended.outcome.reason
    assert "and departed from the impedance model" in ended.outcome.reason
    assert "more was commanded than the thrusters give for" in ended.outcome.reason
    assert metric(ended, "saturated_share") > 0.5
    assert "settling_time" not in ended.summary["metrics"]


def test_a_known_delay_that_makes_the_loop_unstable_is_refused_before_anything_is_written(tmp_path: Path):
    with pytest.raises(InitializationError, match="unstable"):
        run(FlyerImpedance, tmp_path / "r", "delay=0.032")
    assert not (tmp_path / "r").exists()


@pytest.mark.slow
@pytest.mark.parametrize("delays", [("navigation_delay=0.032",), ("delay=0.016", "navigation_delay=0.016")])
def test_the_controller_expects_both_delays_together(delays: tuple[str, ...], tmp_path: Path):
    with pytest.raises(InitializationError, match=r"unstable at 62\.5 Hz with a delay of 0\.032 s"):
        run(FlyerImpedance, tmp_path / "r", *delays)
    assert not (tmp_path / "r").exists()


@pytest.mark.slow
def test_a_late_estimate_counts_as_much_as_late_thrust(tmp_path: Path):
    poles = ("pole_margin_impedance", "damping_ratio_impedance", "frequency_impedance")
    given = {"on_time": (), "thrust": ("delay=0.016",), "estimate": ("navigation_delay=0.016",)}
    runs = {name: run(FlyerImpedance, tmp_path / name, *parameters) for name, parameters in given.items()}
    on_time, late_thrust, late_estimate = ([metric(ended, name) for name in poles] for ended in runs.values())
    assert late_estimate == late_thrust
    assert late_estimate[1] < on_time[1]


def test_a_late_estimate_that_the_controller_does_not_know_of_makes_it_lose_control(tmp_path: Path):
    ended = run(FlyerImpedance, tmp_path / "r", "navigation_delay=0.048", "delay_known=false")
    assert ended.failure is None
    assert not ended.outcome.success
    assert "out of control" in ended.outcome.reason


def test_an_unknown_delay_makes_the_robot_lose_control_and_the_run_ends_in_time(tmp_path: Path):
    ended = run(FlyerImpedance, tmp_path / "r", "delay=0.032", "delay_known=false")
    assert ended.failure is None
    assert not ended.outcome.success
    assert "out of control" in ended.outcome.reason


def test_values_that_have_no_effect_are_refused(tmp_path: Path):
    soft = "impedance.stiffness_translation=5,0,0,0,67,0,0,0,67"
    done = CliRunner().invoke(main, ["run", "flyer_impedance", "-p", soft, "--out", str(tmp_path / "r")])
    assert done.exit_code == 2
    assert "impedance.stiffness_translation has no effect unless impedance.behaviour=custom" in done.output
    assert not (tmp_path / "r").exists()
    crossed = ["-p", "robot.lower_J=2,2,2", "-p", "robot.upper_J=-1,-1,-1"]
    done = CliRunner().invoke(main, ["run", "flyer_impedance", *crossed, "--out", str(tmp_path / "r")])
    assert done.exit_code == 2
    assert "robot.lower_J has no effect unless robot.joints is 1 or more" in done.output
    assert not (tmp_path / "r").exists()
    chosen = ["-p", soft, "-p", "impedance.behaviour=custom", "--stop", "0.1", "--no-report"]
    done = CliRunner().invoke(main, ["run", "flyer_impedance", *chosen, "--out", str(tmp_path / "r")])
    assert done.exit_code == 1, done.output


def test_a_controller_of_joints_is_refused_where_there_are_none():
    fmus = {**FlyerImpedance.units, "impedance": "ArmImpedanceController"}
    system = FlyerImpedance().build(ImpedanceParameters(), 0, lambda unit: cached(fmus[unit], 3))
    with pytest.raises(InvalidParameter, match="drives an arm's joints, and the robot here has none"):
        FlyerImpedance().check_unit_values(system, ())


def test_limits_of_a_controllers_own_are_told_where_thrust_has_none():
    fmus = {**FlyerImpedance.units, "impedance": "AdmittanceController"}
    limited, ideal = (
        FlyerImpedance().build(ImpedanceParameters(propulsion=p), 0, lambda unit: cached(fmus[unit], 3))
        for p in (Propulsion.LIMITED, Propulsion.IDEAL)
    )
    assert limited.notes == []
    (note,) = ideal.notes
    assert "clips its own commands at impedance.f_max" in note


def test_bad_parameters_are_refused_with_their_ranges(tmp_path: Path):
    with pytest.raises(InvalidParameter) as caught:
        run(FlyerImpedance, tmp_path / "r", "force=1000", "axis=w", "duration=-1")
    assert len(caught.value.faults) == 3
    assert not (tmp_path / "r").exists()


@pytest.mark.slow
@pytest.mark.parametrize("behaviour", ["rigid", "compliant"])
def test_every_published_push_agrees_with_the_model(tmp_path: Path, behaviour: str):
    for kind in ("force", "torque"):
        for seed, axis in enumerate("xyz"):
            given = f"behaviour={behaviour}", f"kind={kind}", f"axis={axis}"
            ended = run(FlyerImpedance, tmp_path / f"{kind}-{axis}", *given, seed=seed)
            assert ended.outcome.success, (given, ended.outcome.reason)


@pytest.mark.parametrize(
    ("behaviour", "factor", "apart"),
    [
        ("rigid", "mass_factor=1.3", 0.010),
        ("compliant", "mass_factor=1.3", 0.100),
        ("rigid", "model_mass_factor=1.3", 0.010),
    ],
)
def test_a_robot_that_is_not_what_its_controller_assumes_departs_from_the_impedance_model(
    tmp_path: Path, behaviour: str, factor: str, apart: float
):
    ended = run(FlyerImpedance, tmp_path / "r", f"behaviour={behaviour}", factor)
    assert not ended.outcome.success
    assert "departed from the impedance model" in ended.outcome.reason
    assert metric(ended, "disagreement_position") > apart


def test_robot_and_controller_that_are_both_heavier_agree(tmp_path: Path):
    ended = run(FlyerImpedance, tmp_path / "r", "mass_factor=1.3", "model_mass_factor=1.3")
    assert metric(ended, "disagreement_position") < 0.007


def test_nothing_published_stands_beside_another_robot():
    published = FlyerImpedance().published
    assert published(ImpedanceParameters())
    assert not published(ImpedanceParameters(arm_factor=1.2))


@pytest.mark.slow
def test_a_push_is_borne_by_nozzles_and_a_stuck_one_is_told(tmp_path: Path):
    small = ("propulsion=nozzles", "force=0.3", "patience=10")
    whole = run(FlyerImpedance, tmp_path / "whole", *small)
    assert metric(whole, "greatest_orientation_error") < 0.03
    stuck = run(FlyerImpedance, tmp_path / "stuck", *small, "stuck_nozzle=1")
    assert stuck.outcome.reason.endswith("; nozzle 1 was stuck closed")
    assert metric(stuck, "greatest_orientation_error") > metric(whole, "greatest_orientation_error")


STUCK = ("propulsion=nozzles", "stuck_nozzle=5")
ASSUMED = "what its controllers assumed"


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (("mass_factor=1.3", "model_mass_factor=1.3"), ""),
        (("mass_factor=1.3", "impedance.mass=12.4592"), ""),
        (("robot.mass=19.168",), f"the robot's mass was 2 times {ASSUMED}"),
        (
            ("inertia_factor=1.3", "model_arm_factor=0.5"),
            f"the robot's inertia was 1.3 times {ASSUMED}; the robot's arm was 2 times {ASSUMED}",
        ),
        (STUCK, "nozzle 5 was stuck closed"),
        ((*STUCK, "thrusters.propulsion=ideal"), ""),
        ((*STUCK, "thrusters.flapper_range=1,1,0,1,1,1,1,1,1,1,1,0"), "nozzles 3, 12 were stuck closed"),
        (("navigation.delay=0.008",), "the robot's thrust followed its state 8 ms late, of which impedance knew 0 ms"),
    ],
)
def test_what_the_controllers_do_not_know_is_told_by_the_values_that_the_units_got(
    given: tuple[str, ...], told: str, tmp_path: Path
):
    with contextlib.ExitStack() as opened:
        task = RunRequest(subject="flyer_impedance", parameters=given, out=tmp_path).task(opened)
    system = experiment_system(task.experiment, task.parameters, task.seed, task.fmus, task.unit_values, task.options)
    assert model_mismatch(system.units) == (f"; {told}" if told else "")


def test_only_nozzles_can_be_stuck():
    p = ImpedanceParameters(propulsion=Propulsion.LIMITED, stuck_nozzle=3)
    with pytest.raises(InvalidParameter, match="stuck_nozzle: 3 is to be stuck, and propulsion limited has no nozzle"):
        thruster_settings(p.propulsion, p.delay, p.stuck_nozzle)


def test_controllers_expect_the_flappers_lag_of_nozzles():
    assert [expected_lag(p) for p in Propulsion] == [0.0, 0.02, 0.0386]
