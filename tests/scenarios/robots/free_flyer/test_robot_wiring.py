"""Metrics of the controllers' closed loops, of those controllers that give them."""

from pathlib import Path
from typing import Any

import pytest
from support.scenarios.flyer_runs import run
from support.scenarios.staged_signals import staged
from support.wording import Wording

from handover.cosim.exceptions import InitializationError
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.robots.free_flyer.handover.handovers import RobotToHuman
from handover.scenarios.robots.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.robots.free_flyer.robot_wiring import stability_metrics
from handover.scenarios.robots.free_flyer.two_robots.two_robots import TwoRobots


def test_a_controller_that_does_not_give_its_poles_has_no_metrics_of_them():
    poles = {"pole_radius": 0.9, "damping_ratio": 0.7, "pole_frequency": 2.0, "slowest_decay": 0.2}
    signals = staged({"pose": poles, "impedance": {"pole_radius": 0.9}})
    metrics = stability_metrics(signals, ("impedance", "pose"))
    assert set(metrics) == {f"{m}_pose" for m in ("pole_margin", "slowest_decay", "damping_ratio", "frequency")}
    assert metrics["pole_margin_pose"].value == pytest.approx(0.1)
    assert metrics["slowest_decay_pose"].value == 0.2


@pytest.mark.parametrize(
    ("scenario", "robot"), [(RobotToHuman, "robot"), (FlyerImpedance, "robot"), (TwoRobots, "robot_2")]
)
def test_an_arm_that_nothing_drives_is_refused(
    tmp_path: Path, scenario: type[Experiment[Any]], robot: str, wording: Wording
):
    with pytest.raises(InvalidParameter) as refused:
        run(scenario, tmp_path / "run", f"{robot}.joints=2")
    wording.check(refused.value)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "given",
    [
        ("pose.mass=48", "model_mass_factor=3", "behaviour=compliant"),
        pytest.param(("delay=0.05", "navigation_delay=0.05"), marks=pytest.mark.slow),
    ],
)
def test_a_unit_that_does_not_start_names_what_was_set(tmp_path: Path, given: tuple[str, ...], wording: Wording):
    with pytest.raises(InitializationError) as refused:
        run(RobotToHuman, tmp_path / "run", *given)
    wording.check(refused.value)


def test_an_arm_with_fixed_joints_needs_no_drive(tmp_path: Path):
    run(FlyerImpedance, tmp_path / "run", "robot.joints=2", "robot.tolerance_J=0", stop=0.1)
