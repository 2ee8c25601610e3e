"""What a robot that looks whether a released object is gone makes of a knock, and of a person who bumps it."""

from pathlib import Path

import numpy as np
from flyer_offer import offer
from flyer_runs import metric, run

from handover.controllers.free_flyer.handover_state_machine import HandoverPhase
from handover.controllers.free_flyer.impedance_controller import Behaviour
from handover.plants.free_flyer.hand.hand_and_object import Holder
from handover.scenarios.free_flyer.handover.handovers import RobotToHuman

ALONG_Z = np.array([0.0, 0.0, 1.0])


def test_an_object_dropped_by_a_knock_is_caught_again_and_the_failed_delivery_noticed():
    knock = ALONG_Z, 0.15, Behaviour.RIGID
    at_once, verified = offer(*knock), offer(*knock, verify=True)
    assert at_once.dropped
    assert verified.dropped
    assert (at_once.holder, at_once.failed) == (Holder.FREE, 0)
    assert (verified.holder, verified.failed) == (Holder.GRIPPER, 1)
    assert verified.ended is not HandoverPhase.GIVEN_UP


def test_an_object_that_a_hard_knock_sends_off_is_taken_for_delivered():
    """Its gripper turns away from the object before it closes, and empty fingers do not tell who has it."""
    lost = offer(ALONG_Z, 0.5, Behaviour.RIGID, verify=True)
    assert (lost.holder, lost.failed) == (Holder.FREE, 0)
    assert lost.ended is HandoverPhase.RETREAT


def test_a_delivery_that_failed_by_a_persons_bump_is_noticed_and_made_good(tmp_path: Path):
    clumsy = "skill=0"
    ended = run(RobotToHuman, tmp_path / "r", clumsy, "verify=true", seed=9)
    assert ended.outcome.success, ended.outcome.reason
    assert metric(ended, "failed_deliveries") == 1
    assert not run(RobotToHuman, tmp_path / "without", clumsy, seed=9).outcome.success


def test_a_skilled_person_is_not_disturbed_by_a_robot_that_looks(tmp_path: Path):
    for strength in ("1", "4"):
        ended = run(RobotToHuman, tmp_path / strength, f"strength={strength}", "verify=true")
        assert ended.outcome.success, ended.outcome.reason
        assert metric(ended, "failed_deliveries") == metric(ended, "disturbed_deliveries") == 0
