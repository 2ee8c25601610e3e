"""A push against the free-flyer's gripper, on the built FMUs."""

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.flyer_runs import fmu, kept, metric, run
from support.scenarios.staged_signals import staged
from support.wording import Wording

from handover.controllers.free_flyer.ports import PERIOD
from handover.cosim.exceptions import InitializationError
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.robots.free_flyer.model_mismatch import model_mismatch
from handover.scenarios.robots.free_flyer.parameters import ImpedanceParameters, Propulsion
from handover.scenarios.robots.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.robots.free_flyer.push.impedance_evaluation import ImpedanceEvaluator
from handover.scenarios.robots.free_flyer.push.push_plots import phases_of_push
from handover.scenarios.robots.free_flyer.robot_wiring import expected_lag
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.execution.runner import experiment_system


def test_a_pushed_robot_comes_back_and_moves_as_the_impedance_model_says():
    done = kept("flyer_impedance")
    assert done.success, done.reason
    assert done.metric("disagreement_position") <= 0.007
    assert done.metric("disagreement_orientation") <= 0.02
    assert done.metric("pole_margin_impedance") > 0.0
    record = done.record
    away = np.linalg.norm(record["robot.p_WG"] - [0.0, -0.07, 0.0], axis=1)
    assert done.metric("greatest_position_error") == pytest.approx(away.max())
    assert np.all(away[record.time > 1.5 + done.metric("settling_time") + 0.016] < 0.010)
    impulse = np.diff(record.time) @ record["push.f_G"][1:]
    assert impulse == pytest.approx([2.5, 0.0, 0.0])


def system_of(folder: Path, *given: str) -> System:
    """Return the system of a run with parameters as the command takes them."""
    with contextlib.ExitStack() as opened:
        task = RunRequest(subject="flyer_impedance", parameters=given, out=folder).task(opened)
    return experiment_system(task.experiment, task.parameters, task.seed, task.fmus, task.unit_values, task.options)


def rows_of_a_push(until: float) -> Iterator[tuple[float, Signals]]:
    """Yield times and signals of a robot that is pushed from 8 s until a time, and back at its place a second later."""
    still = {name: np.zeros(3) for name in ("v_WG", "w_WB")} | {"q_WB": np.array([1.0, 0.0, 0.0, 0.0])}
    for t in np.arange(0.0, 20.0, float(PERIOD)).tolist():
        away, force = 0.5 * (8.0 < t <= until + 1.0), 2.0 * (8.0 < t <= until)
        robot = {**still, "p_WG": np.array([away, -0.07, 0.0])}
        push = {"f_G": np.array([force, 0.0, 0.0]), "tau_G": np.zeros(3)}
        yield t, staged({"robot": robot, "push": push, "thrusters": {"saturated": False}})


@pytest.mark.parametrize("own_unit", [True, False])
def test_rest_is_counted_from_the_end_of_the_push_that_acted_and_not_awaited_before_it(own_unit: bool, tmp_path: Path):
    evaluator = ImpedanceEvaluator(ImpedanceParameters())
    evaluator.note_units({} if own_unit else system_of(tmp_path, "push.start=8", "push.duration=2").units)
    over = [t for t, seen in rows_of_a_push(10.0) if evaluator(t, seen) or evaluator.over]
    assert over[0] == pytest.approx(16.0, abs=0.02)
    settled = evaluator.outcome().metrics["settling_time"].value
    assert settled == pytest.approx(1.0, abs=0.02)


def test_another_push_than_the_parameters_say_is_marked_when_it_acted():
    record = kept("flyer_impedance").record
    for begin in (1.0, 3.0):  # the run's, and that of a unit that takes no notice of it
        _, push, _ = phases_of_push(ImpedanceParameters(begin=begin), record)
        assert (push.begin, push.end) == pytest.approx((1.0, 1.5), abs=0.0 if begin == 1.0 else 0.016)


def test_the_compliant_robot_yields_more_than_twice_as_far(tmp_path: Path):
    compliant = run(FlyerImpedance, tmp_path / "r", "behaviour=compliant")
    assert compliant.outcome.success, compliant.outcome.reason
    error = "greatest_position_error"
    assert metric(compliant, error) > 2.0 * kept("flyer_impedance").metric(error)


@pytest.mark.slow
def test_a_published_twist_agrees_with_the_model(tmp_path: Path):
    """All twelve pushes are the campaign's, flyer-impedance."""
    sizes: list[float] = []
    for behaviour in ("rigid", "compliant"):
        ended = run(FlyerImpedance, tmp_path / behaviour, f"behaviour={behaviour}", "kind=torque", "axis=y")
        assert ended.outcome.success, ended.outcome.reason
        sizes.append(metric(ended, "greatest_orientation_error"))
    assert sizes[1] > 2.0 * sizes[0]


def test_with_real_limits_a_push_saturates_the_thrusters_and_the_verdict_says_so(tmp_path: Path, wording: Wording):
    ended = run(FlyerImpedance, tmp_path / "r", "propulsion=limited", "patience=5")
    assert not ended.outcome.success
    wording.check(re.sub(r"\d+(\.\d+)?", "N", ended.outcome.reason))
    assert metric(ended, "saturated_share") > 0.5
    assert "settling_time" not in ended.summary["metrics"]


def test_known_delays_that_make_the_loop_unstable_together_are_refused_before_anything_is_written(
    tmp_path: Path, wording: Wording
):
    with pytest.raises(InitializationError) as refused:
        run(FlyerImpedance, tmp_path / "r", "delay=0.016", "navigation_delay=0.016")
    wording.check(refused.value)
    assert not (tmp_path / "r").exists()


@pytest.mark.slow
def test_a_late_estimate_counts_as_much_as_late_thrust(tmp_path: Path):
    poles = ("pole_margin_impedance", "damping_ratio_impedance", "frequency_impedance")
    given = {"thrust": "delay=0.016", "estimate": "navigation_delay=0.016"}
    runs = [run(FlyerImpedance, tmp_path / name, late, stop=0.2) for name, late in given.items()]
    late_thrust, late_estimate = ([metric(ended, name) for name in poles] for ended in runs)
    assert late_estimate == late_thrust
    assert late_estimate[1] < kept("flyer_impedance").metric(poles[1])


def test_a_delay_that_the_controller_does_not_know_of_makes_it_lose_control_and_the_run_ends_in_time(tmp_path: Path):
    ended = run(FlyerImpedance, tmp_path / "r", "navigation_delay=0.048", "delay_known=false")
    assert ended.failure is None
    assert not ended.outcome.success
    assert "out of control" in ended.outcome.reason


SOFT = "impedance.stiffness_translation=5,0,0,0,67,0,0,0,67"


@pytest.mark.parametrize(
    ("given", "faults"),
    [
        ((SOFT,), 1),
        (("robot.lower_J=2,2,2", "robot.upper_J=-1,-1,-1"), 2),
        (("force=1000", "axis=w", "duration=-1"), 3),
    ],
)
def test_values_that_are_bad_or_have_no_effect_are_refused(
    tmp_path: Path, given: tuple[str, ...], faults: int, wording: Wording
):
    with pytest.raises(InvalidParameter) as refused:
        run(FlyerImpedance, tmp_path / "r", *given)
    assert len(refused.value.faults) == faults
    wording.check(refused.value)
    assert not (tmp_path / "r").exists()


def with_controller(unit: str, **values: Any) -> System:
    fmus = {**FlyerImpedance.units, "impedance": unit}
    return FlyerImpedance().build(ImpedanceParameters(**values), 0, lambda name: fmu(fmus[name]))


def test_a_controller_of_joints_is_refused_where_there_are_none(wording: Wording):
    with pytest.raises(InvalidParameter) as refused:
        FlyerImpedance().check_unit_values(with_controller("ArmImpedanceController"), ())
    wording.check(refused.value)


def test_limits_of_a_controllers_own_are_reported_where_thrust_has_none():
    assert with_controller("AdmittanceController", propulsion=Propulsion.LIMITED).notes == []
    (note,) = with_controller("AdmittanceController", propulsion=Propulsion.IDEAL).notes
    assert "clips its own commands at impedance.f_max" in note


def test_a_value_that_another_one_gives_its_effect_is_taken(tmp_path: Path):
    assert run(FlyerImpedance, tmp_path / "r", SOFT, "impedance.behaviour=custom", stop=0.1).failure is None


@pytest.mark.parametrize(
    ("behaviour", "factor", "apart"),
    [
        ("rigid", "mass_factor=1.3", 0.010),
        pytest.param("compliant", "model_mass_factor=1.3", 0.010, marks=pytest.mark.slow),
    ],
)
def test_a_robot_that_is_not_what_its_controller_assumes_departs_from_the_impedance_model(
    tmp_path: Path, behaviour: str, factor: str, apart: float
):
    ended = run(FlyerImpedance, tmp_path / "r", f"behaviour={behaviour}", factor)
    assert not ended.outcome.success
    assert "departed from the impedance model" in ended.outcome.reason
    assert metric(ended, "disagreement_position") > apart


@pytest.mark.slow
def test_robot_and_controller_that_are_both_heavier_agree(tmp_path: Path):
    ended = run(FlyerImpedance, tmp_path / "r", "mass_factor=1.3", "model_mass_factor=1.3")
    assert metric(ended, "disagreement_position") < 0.007


def test_nothing_published_stands_beside_another_robot():
    published = FlyerImpedance().published
    assert published(ImpedanceParameters())
    assert not published(ImpedanceParameters(arm_factor=1.2))


def test_controllers_expect_the_flappers_lag_of_nozzles():
    assert [expected_lag(p) for p in Propulsion] == [0.0, 0.02, 0.0386]


@pytest.mark.slow
def test_a_push_is_borne_by_nozzles_and_a_stuck_one_is_reported(tmp_path: Path):
    small = ("propulsion=nozzles", "force=0.3", "patience=10")
    whole = run(FlyerImpedance, tmp_path / "whole", *small)
    assert metric(whole, "greatest_orientation_error") < 0.03
    stuck = run(FlyerImpedance, tmp_path / "stuck", *small, "stuck_nozzle=1")
    assert stuck.outcome.reason.endswith("; nozzle 1 was stuck closed")
    assert metric(stuck, "greatest_orientation_error") > metric(whole, "greatest_orientation_error")


STUCK = ("propulsion=nozzles", "stuck_nozzle=5")
ASSUMED = "what its controllers assumed"


@pytest.mark.parametrize(
    ("given", "reported"),
    [
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
def test_what_the_controllers_do_not_know_is_found_from_the_values_that_the_units_got(
    given: tuple[str, ...], reported: str, tmp_path: Path
):
    assert model_mismatch(system_of(tmp_path, *given).units) == (f"; {reported}" if reported else "")
