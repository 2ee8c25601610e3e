"""What a robot makes of a knock or a bump: one whose fingers follow the hand, and one that looks after a release."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.flyer_offer import Offer, offer
from support.scenarios.flyer_runs import metric, run

from handover.controllers.free_flyer.handover_state_machine import HandoverPhase
from handover.controllers.free_flyer.impedance_controller import Behaviour
from handover.plants.free_flyer.hand.hand_and_object import Holder
from handover.scenarios.robots.free_flyer.handover.handovers import HumanToRobot, RobotToHuman

SHORT, LONG = 0.15, 0.5


@cache
def knocked(duration: float, **decision: Any) -> Offer:
    """Return what comes of an offer during which 1 N along z acts for a time."""
    return offer(np.array([0.0, 0.0, 1.0]), duration, Behaviour.RIGID, **decision)


def test_a_knock_that_drops_the_object_is_survived_by_gradual_fingers():
    gradual = knocked(SHORT, gradual=True)
    assert knocked(SHORT).dropped
    assert not gradual.dropped
    assert gradual.fastest > 0.059  # felt as a pull by the threshold
    assert 0.0 < gradual.widest < 0.2
    assert gradual.ended is HandoverPhase.CHECK_VELOCITY


def test_an_object_dropped_by_a_knock_is_caught_again_and_the_failed_delivery_noticed():
    at_once, verified = knocked(SHORT), knocked(SHORT, verify=True)
    assert verified.dropped
    assert (at_once.holder, at_once.failed) == (Holder.FREE, 0)
    assert (verified.holder, verified.failed) == (Holder.GRIPPER, 1)
    assert verified.ended is not HandoverPhase.GIVEN_UP


@pytest.mark.slow
def test_a_long_knock_is_taken_for_a_pull_and_sends_the_object_off():
    """Its gripper turns away from the object before it closes, and empty fingers do not tell who has it."""
    assert knocked(LONG, gradual=True).dropped
    lost = knocked(LONG, verify=True)
    assert lost.dropped
    assert (lost.holder, lost.failed) == (Holder.FREE, 0)
    assert lost.ended is HandoverPhase.RETREAT


@pytest.mark.slow
def test_a_person_hands_over_with_a_gradual_gripper_in_another_place(tmp_path: Path):
    given = "behaviour=compliant", "gradual=true", "p_WG_handover=0.2,-0.2,0.15"
    ended = run(HumanToRobot, tmp_path / "r", *given, seed=2)
    assert ended.outcome.success, ended.outcome.reason
    assert metric(ended, "transfer_time") < 5.0


@pytest.mark.slow
def test_a_delivery_that_failed_by_a_persons_bump_is_noticed_and_made_good(tmp_path: Path):
    """With one attempt it fails, see the causes of failure."""
    ended = run(RobotToHuman, tmp_path / "r", "skill=0", "verify=true", seed=9)
    assert ended.outcome.success, ended.outcome.reason
    assert metric(ended, "failed_deliveries") == 1
