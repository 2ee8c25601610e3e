"""Handovers whose hand is led by inputs from outside, as of somebody who watches."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from support.scenarios.flyer_runs import fmu, metric, run
from support.wording import Wording

from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.scenarios.cli.command import main
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.robots.free_flyer.handover.handovers import FlyerHandover, HandoverOfTask, RobotToHuman
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.robots.free_flyer.two_robots.two_robots import TwoRobots

INPUTS_OF_HAND = ("p_WH_track", "q_WH_track", "finger_track", "closed_track", "age")


def built(scenario: type[Experiment[Any]], *given: str) -> System:
    """Return a scenario's system."""
    return scenario().build(parse_parameters(scenario, given), 0, lambda name: fmu(scenario.units[name]))


@pytest.mark.parametrize("scenario", [RobotToHuman, HandoverOfTask])
def test_the_five_inputs_of_a_hand_come_from_outside_and_nothing_else(scenario: type[FlyerHandover]):
    outside, simulated = built(scenario, "hand=outside"), built(scenario)
    assert [str(end) for end in outside.externals] == [f"person.{name}" for name in INPUTS_OF_HAND]
    assert not simulated.externals
    assert outside.connections == simulated.connections
    outside.check()


@pytest.mark.slow
def test_a_hand_that_nothing_leads_takes_nothing_and_no_simulated_person_is_blamed(tmp_path: Path):
    ended = run(RobotToHuman, tmp_path / "run", "hand=outside", "patience=15")
    assert "the hand was never closed; the nearest that it came" in ended.outcome.reason
    assert metric(ended, "decided_by") == Cause.NOT_TRIED
    record = Record(tmp_path / "run" / "signals.parquet")
    assert set(record["person.holder"].tolist()) == {0, 1}
    assert (record["person.age"] > 0.2).all()
    assert np.ptp(record["person.p_WH"], axis=0).max() == 0.0
    assert record["person.activity"].max() == 0


def test_the_command_says_that_nobody_leads_it(tmp_path: Path):
    given = ["run", "flyer_robot_to_human", "-p", "hand=outside", "--stop", "0.1", "--no-report"]
    done = CliRunner().invoke(main, [*given, "--out", str(tmp_path / "run")])
    assert "no hand input" in done.output


@pytest.mark.parametrize(
    ("scenario", "given", "faults"),
    [
        (RobotToHuman, ("hand_track=t.csv", "strength=3"), ["hand_track"]),
        (TwoRobots, (), ["hand"]),
    ],
)
def test_what_cannot_lead_the_hand_beside_inputs_from_outside_is_refused(
    scenario: type[Experiment[Any]], given: tuple[str, ...], faults: list[str], wording: Wording
):
    with pytest.raises(InvalidParameter) as refused:
        built(scenario, "hand=outside", *given)
    assert [fault.partition(":")[0] for fault in refused.value.faults] == faults
    wording.check(refused.value)
