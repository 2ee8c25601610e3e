"""Verdicts on handovers by two robots that verify their releases, from staged signals."""

from typing import Any

import numpy as np
from support.scenarios.staged_signals import staged

from handover.controllers.free_flyer.handover_state_machine import HandoverPhase as Phase
from handover.cosim.system.signals import Signals
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.robots.free_flyer.parameters import TeamParameters
from handover.scenarios.robots.free_flyer.two_robots.team_evaluation import TeamCause, TeamEvaluator

UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])


def signals(phase: Phase, grippers: int, hands: int = 0, *, failed: int = 0, closed: bool = False) -> Signals:
    """Return what there is to see while both robots are in a phase, by bit masks of who holds the object."""
    held = {"p_WO": np.zeros(3), "q_WO": UNTURNED, "grippers_holding": grippers, "hands_holding": hands}
    values: dict[str, dict[str, Any]] = {"decision": {"phase_1": phase, "phase_2": phase}, "person": held}
    for i, side in ((1, 1.0), (2, -1.0)):
        decided = {"closure": float(closed), "speed": 0.01, "failed_receptions": 0, "failed_deliveries": failed}
        values["decision"] |= {f"{name}_{i}": value for name, value in decided.items()}
        values["person"] |= {f"f_G_{i}": np.zeros(3), f"f_H_{i}": np.zeros(3)}
        values |= {f"robot_{i}": {"p_WG": np.array([0.28, 0.25 * side, 0.0])}, f"thrusters_{i}": {"saturated": False}}
    return staged(values)


def released() -> TeamEvaluator:
    """Return the evaluator of a run in which both let go of an object that nobody else held, 2 s ago."""
    evaluator = TeamEvaluator(TeamParameters(verify=True))
    evaluator(20.0, signals(Phase.SIGNAL, 3, closed=True))
    evaluator(21.0, signals(Phase.CHECK_VELOCITY, 3, closed=True))
    evaluator(22.0, signals(Phase.RELEASE_OBJECT, 3))
    evaluator(22.2, signals(Phase.VERIFY_RELEASE, 0))
    evaluator(24.2, signals(Phase.VERIFY_RELEASE, 0, closed=True))
    return evaluator


def test_what_both_close_on_again_was_not_lost_and_may_be_given_once_more():
    evaluator = released()
    assert not evaluator.over
    evaluator(24.4, signals(Phase.VERIFY_RELEASE, 3, closed=True))
    evaluator(24.6, signals(Phase.MOVE_TO_HANDOVER, 3, failed=1, closed=True))
    evaluator(30.0, signals(Phase.SIGNAL, 3, failed=1, closed=True))
    evaluator(31.0, signals(Phase.CHECK_VELOCITY, 3, 3, failed=1, closed=True))
    evaluator(32.5, signals(Phase.RELEASE_OBJECT, 3, 3, failed=1))
    evaluator(33.0, signals(Phase.VERIFY_RELEASE, 0, 3, failed=1))
    evaluator(34.5, signals(Phase.DEACTIVATE_IMPEDANCE, 0, 3, failed=1))
    evaluator(40.0, signals(Phase.DONE, 0, 3, failed=1))
    evaluator(41.0, signals(Phase.DONE, 0, 3, failed=1))
    assert evaluator.over
    outcome = evaluator.outcome()
    assert outcome.success, outcome.reason
    assert outcome.reason.endswith("after 1 failed delivery, and it was never lost")
    facts = {name: m.value for name, m in outcome.metrics.items()}
    assert facts["failed_deliveries"] == 1
    assert facts["time_to_release"] == 2.5
    assert facts["transfer_time"] == 13.0


def test_what_neither_closes_on_again_was_released_unheld_and_what_nobody_notices_is_no_success():
    evaluator = released()
    evaluator(24.6, signals(Phase.DEACTIVATE_IMPEDANCE, 0))
    assert evaluator.over
    assert cause(evaluator) is TeamCause.RELEASED_UNHELD
    evaluator = released()
    evaluator(24.4, signals(Phase.VERIFY_RELEASE, 3, closed=True))
    evaluator(24.6, signals(Phase.DEACTIVATE_IMPEDANCE, 3))
    evaluator(24.8, signals(Phase.RETREAT, 0, 3))
    evaluator(30.0, signals(Phase.DONE, 0, 3))
    assert cause(evaluator) is TeamCause.OTHER


def test_what_one_alone_closes_on_again_is_a_failed_delivery_and_none_that_it_held_on_to():
    evaluator = released()
    evaluator(24.4, signals(Phase.VERIFY_RELEASE, 2, closed=True))
    evaluator(24.6, signals(Phase.MOVE_TO_HANDOVER, 2, failed=1, closed=True))
    evaluator(24.7, signals(Phase.GIVEN_UP, 2, failed=2, closed=True))
    evaluator(26.0, signals(Phase.GIVEN_UP, 2, failed=2, closed=True))
    assert evaluator.over
    assert cause(evaluator) is TeamCause.DELIVERIES_FAILED


def test_an_object_torn_out_of_closed_grippers_fails_even_if_they_catch_it_again():
    evaluator = TeamEvaluator(TeamParameters())
    evaluator(20.0, signals(Phase.SIGNAL, 3, closed=True))
    evaluator(21.0, signals(Phase.CHECK_VELOCITY, 3, 3, closed=True))
    evaluator(21.1, signals(Phase.CHECK_VELOCITY, 2, 3, closed=True))
    evaluator(21.2, signals(Phase.CHECK_VELOCITY, 3, 3, closed=True))
    evaluator(22.0, signals(Phase.RELEASE_OBJECT, 3, 3))
    evaluator(22.4, signals(Phase.RELEASE_OBJECT, 0, 3))
    evaluator(30.0, signals(Phase.DONE, 0, 3))
    evaluator(31.0, signals(Phase.DONE, 0, 3))
    assert cause(evaluator) is TeamCause.TORN_OUT
    assert "gripper 1 at 21.1 s" in evaluator.outcome().reason


def cause(evaluator: TeamEvaluator) -> TeamCause:
    return TeamCause(int(evaluator.outcome().metrics["decided_by"].value))


def test_causes_that_one_robot_has_too_have_its_numbers():
    shared = {cause for cause in TeamCause if cause.name in Cause.__members__}
    assert {cause for cause in TeamCause if cause <= max(Cause)} == shared
    assert all(cause == Cause[cause.name] for cause in shared)
