"""Verdicts on handovers in microgravity, from staged signals."""

from typing import Any

import numpy as np
import pytest
from support.scenarios.staged_signals import staged
from support.wording import Wording

from handover.controllers.free_flyer.handover_state_machine import HandoverPhase as Phase
from handover.cosim.system.signals import Signals
from handover.plants.free_flyer.hand.hand_and_object import Holder
from handover.scenarios.robots.free_flyer.handover.handover_evaluation import HandoverEvaluator
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.robots.free_flyer.parameters import Hand, HandoverParameters

PLACE = np.array([0.0, -0.07, 0.0])


def signals(phase: Phase, holder: Holder, *, away: float = 0.0, on_hand: bool = True, **seen: Any) -> Signals:
    """Return what there is to see, with the gripper so far from its place along z; at rest by default."""
    loop = {"pole_radius": 0.99, "damping_ratio": 0.3, "pole_frequency": 2.7}
    speed, force = seen.get("speed", 0.0), np.array([seen.get("force", 0.0), 0.0, 0.0])
    robot = {"p_WG": PLACE + np.array([0.0, 0.0, away]), "v_WG": np.array([0.0, 0.0, speed])}
    person = {"holder": holder, "f_G": force, "f_H": -force * on_hand, "gripper_angle": seen.get("angle", 0.6)}
    decision = {"phase": phase, "speed_G": speed, "p_WG_goal": np.array(seen.get("goal", PLACE))}
    decision |= {"failed_receptions": seen.get("failed", 0), "failed_deliveries": seen.get("undelivered", 0)}
    if "hand" in seen:
        person["p_WH"] = np.array(seen["hand"])
        robot |= {"p_WB": PLACE + np.array([0.3, 0.0, away]), "q_WB": np.array([1.0, 0.0, 0.0, 0.0])}
    values: dict[str, dict[str, Any]] = {"robot": robot, "thrusters": {"saturated": seen.get("saturated", False)}}
    values |= {"impedance": loop, "pose": loop, "person": person}
    return staged(values | {"decision": decision | {"closure": float(seen.get("closed", False))}})


def follow(evaluator: HandoverEvaluator, *moments: tuple[float, Signals]) -> HandoverEvaluator:
    for t, seen in moments:
        evaluator(t, seen)
    return evaluator


def given() -> list[tuple[float, Signals]]:
    """Return the moments of a handover from the robot to a person."""
    return [
        (0.0, signals(Phase.OPEN_GRIPPER, Holder.FREE, away=0.4)),
        (8.0, signals(Phase.GRASP_OBJECT, Holder.FREE, away=0.4)),
        (9.0, signals(Phase.GRASP_OBJECT, Holder.GRIPPER, away=0.4)),
        (20.0, signals(Phase.ACTIVATE_IMPEDANCE, Holder.GRIPPER, away=0.02, speed=0.005)),
        (21.0, signals(Phase.SIGNAL, Holder.GRIPPER)),
        (22.0, signals(Phase.CHECK_VELOCITY, Holder.GRIPPER)),
        (23.0, signals(Phase.CHECK_VELOCITY, Holder.BOTH, speed=0.05, away=0.03)),
        (23.5, signals(Phase.RELEASE_OBJECT, Holder.BOTH, speed=0.06, away=0.05, saturated=True)),
        (24.0, signals(Phase.RELEASE_OBJECT, Holder.HAND, away=0.04)),
        (30.0, signals(Phase.DONE, Holder.HAND, away=0.4)),
        (31.0, signals(Phase.DONE, Holder.HAND, away=0.4)),
    ]


def to_person() -> HandoverEvaluator:
    return HandoverEvaluator(HandoverParameters(), ("HAND",))


def test_an_object_that_always_was_in_a_hand_is_handed_over():
    evaluator = follow(to_person(), *given())
    assert evaluator.over
    outcome = evaluator.outcome()
    assert outcome.success, outcome.reason
    facts = {name: m.value for name, m in outcome.metrics.items()}
    assert facts["transfer_time"] == pytest.approx(3.0)
    assert facts["transfer_speed"] == pytest.approx(0.06)
    assert facts["transfer_displacement_z"] == pytest.approx(0.05)
    assert facts["transfer_displacement_x"] == 0.0
    assert facts["arrival_error"] == pytest.approx(0.02)
    assert facts["saturated_share"] == pytest.approx(1 / 11)
    assert facts["phase_grasp_object"] == 8.0


def waits(phase: Phase, holder: Holder, *times: float, **seen: Any) -> list[tuple[float, Signals]]:
    """Return moments at which the same is seen."""
    return [(t, signals(phase, holder, **seen)) for t in times]


FREE, GRIPPER, HAND = Holder.FREE, Holder.GRIPPER, Holder.HAND
ON_ITS_WAY = (Phase.MOVE_TO_HANDOVER, GRIPPER, 20.0, 60.0)

FAILED: dict[str, tuple[int, list[tuple[float, Signals]], Cause]] = {
    "what slips out of closed fingers with no hand at it": (
        4,
        waits(Phase.CHECK_VELOCITY, FREE, 20.5, closed=True),
        Cause.SLIPPED,
    ),
    "a pull that never came": (
        6,
        waits(Phase.CHECK_VELOCITY, GRIPPER, 40.0, 60.0, speed=0.0123) + waits(Phase.GIVEN_UP, GRIPPER, 82.0, 83.0),
        Cause.NOT_FELT,
    ),
    "a robot that did not arrive": (
        3,
        waits(*ON_ITS_WAY, away=0.31) + waits(Phase.GIVEN_UP, GRIPPER, 70.0, away=0.31),
        Cause.OUT_OF_REACH,
    ),
    "a gripper that closed beside the object": (2, waits(Phase.GIVEN_UP, FREE, 12.0, away=0.4), Cause.NOT_FETCHED),
    "a robot that gave up on the way to the object": (  # the gripper is 0.6 m from its handover place, along z
        0,
        waits(Phase.MOVE_TO_OBJECT, FREE, 1.0, 30.0, away=0.6, goal=(0.0, -0.07, 0.9))
        + waits(Phase.GIVEN_UP, FREE, 61.0, away=0.6),
        Cause.OUT_OF_REACH,
    ),
    "a robot that was in its place but not at rest": (
        3,
        waits(*ON_ITS_WAY, speed=0.0103, away=0.03) + waits(Phase.GIVEN_UP, GRIPPER, 70.0),
        Cause.NOT_SETTLED,
    ),
    "a robot that was at rest in its place but not for long": (
        3,
        waits(*ON_ITS_WAY, speed=0.004, away=0.03) + waits(Phase.GIVEN_UP, GRIPPER, 70.0),
        Cause.NOT_SETTLED,
    ),
    "an object that changed hands before the robot gave up": (
        8,
        waits(Phase.RETREAT, HAND, 25.0, 40.0, away=0.02) + waits(Phase.GIVEN_UP, HAND, 55.0),
        Cause.NOT_RETREATED,
    ),
    "a gripper that still holds what it released": (
        7,
        waits(Phase.RELEASE_OBJECT, GRIPPER, 23.5, speed=0.06)
        + waits(Phase.VERIFY_RELEASE, GRIPPER, 24.0)
        + waits(Phase.GIVEN_UP, GRIPPER, 26.0, undelivered=1),
        Cause.DELIVERIES_FAILED,
    ),
    "an object that is still in both hands at the end": (8, waits(Phase.DONE, Holder.BOTH, 30.0), Cause.OTHER),
    "a run that was cut short": (6, [], Cause.OUT_OF_TIME),
    "an object that floated free, even if it was caught": (
        8,
        waits(Phase.RELEASE_OBJECT, FREE, 23.8) + given()[8:],
        Cause.SLIPPED,
    ),
}
"""How many moments of a handover that succeeds come before others, these, and why it failed."""


@pytest.mark.parametrize("case", FAILED)
def test_a_handover_that_failed_says_why(case: str, wording: Wording):
    before, moments, cause = FAILED[case]
    outcome = follow(to_person(), *given()[:before], *moments).outcome()
    assert not outcome.success
    assert Cause(int(outcome.metrics["decided_by"].value)) is cause
    assert outcome.metrics["handed_over"].value == (cause is Cause.NOT_RETREATED)
    wording.check(outcome.reason)


@pytest.mark.parametrize("rebound", [0, 1, 2])
def test_an_object_torn_out_of_the_closed_gripper_fails_whether_it_was_caught_again_or_not(rebound: int):
    course = ((23.1, HAND), (23.2, Holder.BOTH), (23.3, HAND))[: 1 + rebound]
    torn = [(t, signals(Phase.CHECK_VELOCITY, holder, closed=True)) for t, holder in course]
    outcome = follow(to_person(), *given()[:7], *torn, *given()[7:]).outcome()
    assert not outcome.success
    assert outcome.metrics["decided_by"].value == Cause.TORN_OUT
    assert "at 23.1 s" in outcome.reason


@pytest.mark.parametrize(("x", "inside"), [(0.35, 0.1025), (0.162, 0.0145), (0.14, 0.0)])
def test_how_deep_a_hand_was_in_the_robots_cube_is_added_to_the_verdict(x: float, inside: float):
    moments = given()
    moments.insert(6, (22.5, signals(Phase.CHECK_VELOCITY, Holder.GRIPPER, hand=(x, -0.07, 0.03))))
    outcome = follow(to_person(), *moments).outcome()
    assert outcome.success
    assert outcome.metrics["hand_in_cube"].value == pytest.approx(inside, abs=5e-4)
    assert ("inside a robot's cube" in outcome.reason) == (inside > 0.0)


def test_a_lost_object_ends_the_run_soon():
    evaluator = follow(to_person(), *given()[:4], (20.5, signals(Phase.ACTIVATE_IMPEDANCE, Holder.FREE)))
    assert not evaluator.over
    assert follow(evaluator, (21.6, signals(Phase.SIGNAL, Holder.FREE))).over


def received(failed: int, empty: int = 1, hand: Hand = Hand.SIMULATED) -> HandoverEvaluator:
    evaluator = HandoverEvaluator(HandoverParameters(hand=hand), ("GRIPPER",), failures=1)
    return follow(
        evaluator,
        (0.0, signals(Phase.MOVE_TO_HANDOVER, Holder.HAND)),
        (10.0, signals(Phase.ACTIVATE_IMPEDANCE, Holder.HAND)),
        (11.0, signals(Phase.SIGNAL, Holder.HAND)),
        (12.0, signals(Phase.CHECK_VELOCITY, Holder.HAND)),
        *[(13.0 + i, signals(p, Holder.HAND)) for i in range(empty) for p in (Phase.CHECK_ANGLE, Phase.OPEN_GRIPPER)],
        (20.0, signals(Phase.CLOSE_GRIPPER, Holder.BOTH, failed=failed)),
        (21.0, signals(Phase.CHECK_ANGLE, Holder.GRIPPER, failed=failed)),
        (25.0, signals(Phase.DONE, Holder.GRIPPER, failed=failed)),
        (26.0, signals(Phase.DONE, Holder.GRIPPER, failed=failed)),
    )


def test_the_staged_failure_must_have_been_noticed(wording: Wording):
    assert received(failed=1).outcome().success
    assert received(failed=2, empty=2).outcome().success  # the person failed once more
    for unnoticed in (
        received(failed=0, empty=0),
        received(failed=0, empty=0, hand=Hand.OUTSIDE),  # nobody stages what somebody's own hand does
        received(failed=2, empty=1),  # a robot that takes a full gripper for an empty one
        received(failed=1, empty=2),
    ):
        assert not unnoticed.outcome().success
        wording.check(unnoticed.outcome().reason)


def test_a_robot_that_received_in_vain_too_often_says_how_often(wording: Wording):
    outcome = follow(
        HandoverEvaluator(HandoverParameters(), ("GRIPPER",)),
        *waits(Phase.SIGNAL, HAND, 11.0),
        *waits(Phase.CHECK_VELOCITY, HAND, 12.0),
        *waits(Phase.CHECK_ANGLE, HAND, 21.0, failed=4),
        *waits(Phase.GIVEN_UP, HAND, 22.0, failed=5),
    ).outcome()
    assert outcome.metrics["decided_by"].value == Cause.RECEPTIONS_FAILED
    wording.check(outcome.reason)


def asked_again() -> HandoverEvaluator:
    """Return an evaluator that saw a first push at 20 s, without success, and another signal at 30 s."""
    evaluator = HandoverEvaluator(HandoverParameters(), ("GRIPPER",), failures=1)
    return follow(
        evaluator,
        (10.0, signals(Phase.ACTIVATE_IMPEDANCE, Holder.HAND)),
        (11.0, signals(Phase.SIGNAL, Holder.HAND)),
        (12.0, signals(Phase.CHECK_VELOCITY, Holder.HAND, speed=0.09)),
        (20.0, signals(Phase.CLOSE_GRIPPER, Holder.HAND, speed=0.1)),
        (21.0, signals(Phase.CHECK_ANGLE, Holder.HAND)),
        (22.0, signals(Phase.OPEN_GRIPPER, Holder.HAND, failed=1)),
        (30.0, signals(Phase.SIGNAL, Holder.HAND, failed=1)),
        (31.0, signals(Phase.CHECK_VELOCITY, Holder.HAND, failed=1, speed=0.004)),
    )


def test_a_push_in_vain_is_kept_apart_from_the_one_that_counts(wording: Wording):
    evaluator = follow(asked_again(), (40.0, signals(Phase.CLOSE_GRIPPER, Holder.BOTH, failed=1, speed=0.03)))
    (transfer,) = evaluator.transfers
    assert (transfer.signalled, transfer.asked) == (11.0, 30.0)
    assert (transfer.in_vain, transfer.felt, transfer.speed) == ([20.0], 40.0, 0.03)
    wording.check(follow(asked_again(), (92.0, signals(Phase.GIVEN_UP, Holder.HAND, failed=1))).outcome().reason)


def test_the_speed_at_rest_is_that_before_anybody_touches_the_gripper():
    waits = [
        (10.0, signals(Phase.SIGNAL, Holder.HAND, speed=0.02)),
        (11.0, signals(Phase.CHECK_VELOCITY, Holder.HAND, speed=0.004)),
        (12.0, signals(Phase.CHECK_VELOCITY, Holder.HAND, speed=0.003)),
        (13.0, signals(Phase.CHECK_VELOCITY, Holder.HAND, speed=0.03, force=1.0)),
        (13.1, signals(Phase.CHECK_VELOCITY, Holder.HAND, speed=0.035)),
        (13.2, signals(Phase.CLOSE_GRIPPER, Holder.HAND, speed=0.04)),
    ]
    metrics = follow(HandoverEvaluator(HandoverParameters(), ("GRIPPER",)), *waits).outcome().metrics
    assert metrics["transfer_rest_speed"].value == 0.004
    assert metrics["transfer_speed"].value == 0.04
    assert metrics["transfer_felt_after"].value == pytest.approx(3.2)
    assert metrics["unprovoked"].value == 0


@pytest.mark.parametrize(
    ("moved", "unprovoked"),
    [
        ([(11.0, {"speed": 0.06, "force": 0.1, "on_hand": False})], 1),
        ([(11.0, {"speed": 0.002}), (11.1, {"speed": 0.05, "force": 2.0})], 0),  # the open hand bumps its object
    ],
)
def test_a_gripper_that_acts_with_nobody_at_it_is_counted(moved: list[tuple[float, Any]], unprovoked: int):
    alone = [
        *waits(Phase.SIGNAL, GRIPPER, 10.0),
        *[(t, signals(Phase.CHECK_VELOCITY, GRIPPER, **seen)) for t, seen in moved],
        *waits(Phase.RELEASE_OBJECT, GRIPPER, 11.2, speed=0.07),
    ]
    metrics = follow(to_person(), *alone).outcome().metrics
    assert metrics["unprovoked"].value == unprovoked
    assert unprovoked or metrics["transfer_rest_speed"].value == 0.002
    assert follow(to_person(), *given()).outcome().metrics["unprovoked"].value == 0


def test_the_angles_of_a_closed_gripper_are_told_apart_by_what_is_in_it():
    moments = [
        (0.0, signals(Phase.CLOSE_GRIPPER, Holder.HAND, angle=1.1)),
        (1.0, signals(Phase.CHECK_ANGLE, Holder.HAND, angle=0.61)),
        (2.0, signals(Phase.CLOSE_GRIPPER, Holder.HAND, angle=1.1)),
        (3.0, signals(Phase.CHECK_ANGLE, Holder.BOTH, angle=0.8)),
        (4.0, signals(Phase.GRASP_OBJECT, Holder.GRIPPER, angle=0.9)),
        (5.0, signals(Phase.MOVE_TO_HANDOVER, Holder.GRIPPER, angle=0.79)),
    ]
    metrics = follow(HandoverEvaluator(HandoverParameters(), ("GRIPPER",)), *moments).outcome().metrics
    assert (metrics["angle_empty"].value, metrics["angle_full"].value) == (0.61, 0.79)


def looked(*holders: Holder, undelivered: int = 1) -> list[tuple[float, Signals]]:
    """Return the moments from the start on: who has the object while the robot looks whether it is gone."""
    n = len(holders)
    return [
        *given()[:7],
        (23.5, signals(Phase.RELEASE_OBJECT, Holder.GRIPPER, speed=0.06)),
        *[(24.0 + 1.5 * k / n, signals(Phase.VERIFY_RELEASE, holder)) for k, holder in enumerate(holders)],
        (25.6, signals(Phase.MOVE_TO_HANDOVER, holders[-1], undelivered=undelivered)),
    ]


def test_an_object_that_the_robot_closed_on_again_is_not_lost_and_the_next_delivery_counts():
    course = (
        (30.0, Phase.SIGNAL, Holder.GRIPPER),
        (33.0, Phase.CHECK_VELOCITY, Holder.BOTH),
        (33.5, Phase.RELEASE_OBJECT, Holder.BOTH),
        (34.0, Phase.VERIFY_RELEASE, Holder.HAND),
        (40.0, Phase.DONE, Holder.HAND),
        (41.0, Phase.DONE, Holder.HAND),
    )
    evaluator = follow(to_person(), *looked(Holder.FREE, Holder.FREE, Holder.GRIPPER))
    assert not evaluator.over
    outcome = follow(evaluator, *[(t, signals(p, h, undelivered=1)) for t, p, h in course]).outcome()
    assert outcome.reason == "the person had the object at 34.0 s after 1 failed delivery, and it was never lost"
    facts = {name: m.value for name, m in outcome.metrics.items()}
    assert (outcome.success, facts["failed_deliveries"], facts["disturbed_deliveries"]) == (True, 1, 0)
    assert facts["transfer_felt_after"] == pytest.approx(3.5)
    disturbed = follow(to_person(), *looked(Holder.HAND, Holder.BOTH))  # it closes on what the person holds
    assert disturbed.transfers[0].done is None
    assert disturbed.outcome().metrics["disturbed_deliveries"].value == 1


def test_what_floated_off_while_the_robot_looked_is_lost_and_what_it_misjudges_is_not_delivered(wording: Wording):
    evaluator = follow(to_person(), *looked(Holder.FREE, undelivered=0))
    evaluator = follow(evaluator, (26.0, signals(Phase.DEACTIVATE_IMPEDANCE, Holder.FREE)))
    assert evaluator.over
    wording.check(evaluator.outcome().reason)
    taken = follow(to_person(), *looked(Holder.GRIPPER, undelivered=0), (30.0, signals(Phase.DONE, Holder.GRIPPER)))
    wording.check(taken.outcome().reason)
