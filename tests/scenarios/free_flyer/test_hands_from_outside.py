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
from handover.scenarios.free_flyer.handover.handovers import (
    Collaborative,
    FailedReception,
    FlyerHandover,
    HandoverOfTask,
    HumanToRobot,
    RobotToHuman,
)
from handover.scenarios.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.free_flyer.two_robots.two_robots import TwoRobots

INPUTS_OF_HAND = ("p_WH_track", "q_WH_track", "finger_track", "closed_track", "age")
ALL = (RobotToHuman, HumanToRobot, FailedReception, Collaborative, HandoverOfTask)


def built(scenario: type[Experiment[Any]], *given: str) -> System:
    """Return a scenario's system."""
    return scenario().build(parse_parameters(scenario, given), 0, lambda name: fmu(scenario.units[name]))


@pytest.mark.parametrize("scenario", ALL)
def test_the_five_inputs_of_a_hand_come_from_outside_and_nothing_else(scenario: type[FlyerHandover]):
    outside, simulated = built(scenario, "hand=outside"), built(scenario)
    assert [str(end) for end in outside.externals] == [f"person.{name}" for name in INPUTS_OF_HAND]
    assert not simulated.externals
    assert outside.connections == simulated.connections
    outside.check()


def test_an_object_in_a_hand_that_nothing_leads_stays_in_it_and_the_verdict_blames_no_simulated_person(tmp_path: Path):
    ended = run(HumanToRobot, tmp_path / "run", "hand=outside", "patience=15")
    assert "the object in the hand came no nearer than" in ended.outcome.reason
    assert metric(ended, "decided_by") == Cause.NOT_TRIED
    record = Record(tmp_path / "run" / "signals.parquet")
    assert set(record["person.holder"].tolist()) == {2}
    assert (record["person.age"] > 0.2).all()
    assert np.ptp(record["person.p_WH"], axis=0).max() == 0.0
    assert record["person.activity"].max() == 0


@pytest.mark.slow
def test_a_hand_that_nothing_leads_does_not_take_the_object(tmp_path: Path):
    ended = run(RobotToHuman, tmp_path / "run", "hand=outside", "patience=20")
    assert "the hand was never closed; the nearest that it came" in ended.outcome.reason
    assert metric(ended, "decided_by") == Cause.NOT_TRIED


def test_the_command_says_that_nobody_leads_it(tmp_path: Path):
    for led, told in (("simulated", False), ("outside", True)):
        given = ["run", "flyer_robot_to_human", "-p", f"hand={led}", "--stop", "0.1", "--no-report"]
        done = CliRunner().invoke(main, [*given, "--out", str(tmp_path / led)])
        assert ("nobody leads the hand" in done.output) is told, done.output


def test_what_only_a_simulated_person_has_is_refused_with_the_reason(tmp_path: Path, wording: Wording):
    given = ["hand=outside", "skill=0.5", "interface_delay=0.1", f"hand_track={tmp_path / 't.csv'}", "strength=3"]
    with pytest.raises(InvalidParameter) as refused:
        built(RobotToHuman, *given)
    assert [fault.partition(":")[0] for fault in refused.value.faults] == ["hand_track", "skill", "interface_delay"]
    wording.check(refused.value)


def test_two_hands_cannot_come_from_outside(wording: Wording):
    with pytest.raises(InvalidParameter) as refused:
        built(TwoRobots, "hand=outside")
    wording.check(refused.value)
