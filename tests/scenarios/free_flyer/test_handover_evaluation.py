"""Verdicts on handovers in microgravity, from staged signals."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from handover.controllers.free_flyer.handover_state_machine import HandoverPhase as Phase
from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.system.signals import Signals
from handover.plants.free_flyer.hand.hand_and_object import Holder
from handover.scenarios.free_flyer.handover.handover_evaluation import HandoverEvaluator
from handover.scenarios.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.free_flyer.parameters import Hand, HandoverParameters

PLACE = np.array([0.0, -0.07, 0.0])


def signals(
    phase: Phase,
    holder: Holder,
    *,
    speed: float = 0.0,
    away: float = 0.0,
    failed: int = 0,
    undelivered: int = 0,
    saturated: bool = False,
    force: float = 0.0,
    on_hand: bool = True,
    angle: float = 0.6,
    goal: Sequence[float] | None = None,
    closed: bool = False,
    hand: Sequence[float] | None = None,
) -> Signals:
    loop = {"pole_radius": [0.99], "damping_ratio": [0.3], "pole_frequency": [2.7]}
    values: dict[str, dict[str, Any]] = {
        "robot": {"p_WG": PLACE + np.array([0.0, 0.0, away]), "v_WG": np.array([0.0, 0.0, speed])},
        "thrusters": {"saturated": [saturated]},
        "impedance": loop,
        "pose": loop,
        "decision": {
            "phase": [int(phase)],
            "speed_G": [speed],
            "p_WG_goal": PLACE if goal is None else np.array(goal),
            "failed_receptions": [failed],
            "failed_deliveries": [undelivered],
            "closure": [float(closed)],
        },
        "person": {
            "holder": [int(holder)],
            "f_G": np.array([force, 0.0, 0.0]),
            "f_H": np.array([-force if on_hand else 0.0, 0.0, 0.0]),
            "gripper_angle": [angle],
        },
    }
    if hand is not None:
        values["person"]["p_WH"] = np.array(hand)
        values["robot"] |= {"p_WB": PLACE + np.array([0.3, 0.0, away]), "q_WB": np.array([1.0, 0.0, 0.0, 0.0])}
    items = {"phase": Phase, "holder": Holder}
    units: dict[str, dict[str, tuple[NDArray[Any], ...]]] = {
        unit: {name: (np.array(value),) for name, value in ys.items()} for unit, ys in values.items()
    }
    ports = {
        unit: {
            name: FmuPort(
                name=name,
                kind=Kind.ENUMERATION if name in items else Kind.REAL,
                causality=Causality.OUTPUT,
                fmi_type="",
                references=(),
                shape=ys[name].shape if isinstance(ys[name], np.ndarray) else (),
                items=tuple((i.name, int(i)) for i in items[name]) if name in items else (),
            )
            for name in ys
        }
        for unit, ys in values.items()
    }
    return Signals(units, ports, None)


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


def test_an_object_that_floated_free_was_not_handed_over_even_if_it_was_caught():
    moments = given()
    moments.insert(8, (23.8, signals(Phase.RELEASE_OBJECT, Holder.FREE)))
    outcome = follow(to_person(), *moments).outcome()
    assert not outcome.success
    assert "lost at 23.8 s" in outcome.reason


@pytest.mark.parametrize("rebound", [0, 1, 2])
def test_an_object_torn_out_of_the_closed_gripper_fails_whether_it_was_caught_again_or_not(rebound: int):
    moments = given()
    torn = [
        (23.1, signals(Phase.CHECK_VELOCITY, Holder.HAND, closed=True)),
        (23.2, signals(Phase.CHECK_VELOCITY, Holder.BOTH, closed=True)),
        (23.3, signals(Phase.CHECK_VELOCITY, Holder.HAND, closed=True)),
    ]
    outcome = follow(to_person(), *moments[:7], *torn[: 1 + rebound], *moments[7:]).outcome()
    assert not outcome.success
    assert outcome.metrics["decided_by"].value == Cause.TORN_OUT
    assert "at 23.1 s" in outcome.reason


def test_what_slips_out_of_closed_fingers_with_no_hand_at_it_is_not_torn_out():
    moments = [*given()[:4], (20.5, signals(Phase.CHECK_VELOCITY, Holder.FREE, closed=True))]
    assert follow(to_person(), *moments).outcome().metrics["decided_by"].value == Cause.SLIPPED


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


def test_a_pull_that_never_came_is_reported_with_the_greatest_speed():
    waiting = [(t, signals(Phase.CHECK_VELOCITY, Holder.GRIPPER, speed=0.0123)) for t in (40.0, 60.0)]
    ends = [(t, signals(Phase.GIVEN_UP, Holder.GRIPPER)) for t in (82.0, 83.0)]
    evaluator = follow(to_person(), *given()[:6], *waiting, *ends)
    assert evaluator.over
    outcome = evaluator.outcome()
    assert not outcome.success
    assert "never felt a pull within the patience of 60 s after its signal" in outcome.reason
    assert "below the threshold: 0.013 of 0.059 m/s" in outcome.reason
    assert Cause(int(outcome.metrics["decided_by"].value)) is Cause.NOT_FELT
    assert "transfer_time" not in outcome.metrics


def test_a_robot_that_did_not_arrive_says_how_near_it_came():
    far = [(t, signals(Phase.MOVE_TO_HANDOVER, Holder.GRIPPER, away=0.31)) for t in (20.0, 60.0)]
    evaluator = follow(to_person(), *given()[:3], *far, (70.0, signals(Phase.GIVEN_UP, Holder.GRIPPER, away=0.31)))
    assert "came no nearer than 0.31 m" in evaluator.outcome().reason


def test_a_gripper_that_closed_beside_the_object_is_reported():
    evaluator = follow(to_person(), *given()[:2], (12.0, signals(Phase.GIVEN_UP, Holder.FREE, away=0.4)))
    assert "found nothing" in evaluator.outcome().reason


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


def test_the_staged_failure_must_have_been_noticed():
    assert received(failed=1).outcome().success
    assert received(failed=2, empty=2).outcome().success  # the person failed once more
    outcome = received(failed=0, empty=0).outcome()
    assert not outcome.success
    assert "0 failed receptions where 1 was staged" in outcome.reason
    led = received(failed=0, empty=0, hand=Hand.OUTSIDE).outcome()  # nobody stages what somebody's own hand does
    assert "0 failed receptions where 1 was asked of the hand that is led" in led.reason


@pytest.mark.parametrize(("failed", "empty", "taken"), [(2, 1, "for empty"), (1, 2, "for full")])
def test_a_robot_that_takes_a_full_gripper_for_an_empty_one_fails_and_the_reverse(failed: int, empty: int, taken: str):
    outcome = received(failed, empty).outcome()
    assert not outcome.success
    assert f"the robot took its gripper {taken}" in outcome.reason


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


def test_a_push_in_vain_is_kept_apart_from_the_one_that_counts():
    evaluator = follow(asked_again(), (40.0, signals(Phase.CLOSE_GRIPPER, Holder.BOTH, failed=1, speed=0.03)))
    (transfer,) = evaluator.transfers
    assert (transfer.signalled, transfer.asked) == (11.0, 30.0)
    assert (transfer.in_vain, transfer.felt, transfer.speed) == ([20.0], 40.0, 0.03)


def test_a_wait_after_a_failed_reception_is_distinguished_from_the_last_signal():
    reason = follow(asked_again(), (92.0, signals(Phase.GIVEN_UP, Holder.HAND, failed=1))).outcome().reason
    assert "never felt a push within the patience of 60 s after its signal" in reason
    assert "below the threshold: 0.004 of 0.021 m/s" in reason


def test_a_robot_that_gave_up_on_the_way_to_the_object_is_reported_of_the_place_of_the_object():
    goal = (0.0, -0.07, 0.9)  # the gripper is 0.6 m from its handover place, in the direction of z
    way = [(t, signals(Phase.MOVE_TO_OBJECT, Holder.FREE, away=0.6, goal=goal)) for t in (1.0, 30.0)]
    outcome = follow(to_person(), *way, (61.0, signals(Phase.GIVEN_UP, Holder.FREE, away=0.6))).outcome()
    assert outcome.reason == (
        "the robot gave up in phase MOVE_TO_OBJECT, which was not over within the patience of 60 s: the gripper came "
        "no nearer than 0.30 m to its place at (0.00, -0.07, 0.90) m, of which 0.01 m count as there; nobody holds it"
    )
    assert Cause(int(outcome.metrics["decided_by"].value)) is Cause.OUT_OF_REACH


@pytest.mark.parametrize(
    ("speed", "words"),
    [
        (0.0103, "there: never slower than 0.0103 m/s, where less than 0.01 m/s is rest"),
        (0.004, "there for long enough"),
    ],
)
def test_a_robot_that_was_in_its_place_but_not_at_rest_is_not_called_out_of_reach(speed: float, words: str):
    there = [(t, signals(Phase.MOVE_TO_HANDOVER, Holder.GRIPPER, speed=speed, away=0.03)) for t in (20.0, 60.0)]
    ends = (70.0, signals(Phase.GIVEN_UP, Holder.GRIPPER))
    outcome = follow(to_person(), *given()[:3], *there, ends).outcome()
    assert outcome.reason.endswith(f"by the robot's estimate never at rest and aligned {words}; the robot holds it")
    assert Cause(int(outcome.metrics["decided_by"].value)) is Cause.NOT_SETTLED


def test_an_object_that_changed_hands_before_the_robot_gave_up_was_handed_over():
    retreat = [(t, signals(Phase.RETREAT, Holder.HAND, away=0.02)) for t in (25.0, 40.0)]
    outcome = follow(to_person(), *given()[:8], *retreat, (55.0, signals(Phase.GIVEN_UP, Holder.HAND))).outcome()
    assert not outcome.success
    assert outcome.metrics["handed_over"].value == 1.0
    assert Cause(int(outcome.metrics["decided_by"].value)) is Cause.NOT_RETREATED
    assert outcome.reason.startswith("the object changed hands, but then the robot gave up in phase RETREAT after 30 s")


def test_an_object_that_is_still_in_both_hands_at_the_end_was_not_delivered():
    outcome = follow(to_person(), *given()[:8], (30.0, signals(Phase.DONE, Holder.BOTH))).outcome()
    assert not outcome.success
    assert "both hold it" in outcome.reason


def test_a_run_that_was_cut_short_says_where():
    outcome = follow(to_person(), *given()[:6]).outcome()
    assert not outcome.success
    assert "stopped at 22.0 s in phase CHECK_VELOCITY" in outcome.reason


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


def test_a_gripper_that_acts_with_nobody_at_it_is_counted():
    alone = [
        (10.0, signals(Phase.SIGNAL, Holder.GRIPPER)),
        (11.0, signals(Phase.CHECK_VELOCITY, Holder.GRIPPER, speed=0.06, force=0.1, on_hand=False)),
        (11.1, signals(Phase.RELEASE_OBJECT, Holder.GRIPPER, speed=0.07)),
    ]
    assert follow(to_person(), *alone).outcome().metrics["unprovoked"].value == 1
    assert follow(to_person(), *given()).outcome().metrics["unprovoked"].value == 0


def test_a_gripper_whose_object_the_open_hand_bumps_is_not_alone():
    bumped = [
        (10.0, signals(Phase.SIGNAL, Holder.GRIPPER)),
        (11.0, signals(Phase.CHECK_VELOCITY, Holder.GRIPPER, speed=0.002)),
        (11.1, signals(Phase.CHECK_VELOCITY, Holder.GRIPPER, speed=0.05, force=2.0)),
        (11.2, signals(Phase.RELEASE_OBJECT, Holder.GRIPPER, speed=0.07)),
    ]
    metrics = follow(to_person(), *bumped).outcome().metrics
    assert metrics["unprovoked"].value == 0
    assert metrics["transfer_rest_speed"].value == 0.002


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
    assert outcome.success, outcome.reason
    assert outcome.reason == "the person had the object at 34.0 s after 1 failed delivery, and it was never lost"
    assert outcome.metrics["failed_deliveries"].value == 1
    assert outcome.metrics["disturbed_deliveries"].value == 0
    assert outcome.metrics["transfer_felt_after"].value == pytest.approx(3.5)


def test_an_object_that_floated_off_while_the_robot_looked_is_lost():
    evaluator = follow(to_person(), *looked(Holder.FREE, undelivered=0))
    evaluator = follow(evaluator, (26.0, signals(Phase.DEACTIVATE_IMPEDANCE, Holder.FREE)))
    assert evaluator.over
    assert "lost at 24.0 s" in evaluator.outcome().reason


def test_a_robot_that_misjudges_what_it_closed_on_has_not_delivered():
    taken = follow(to_person(), *looked(Holder.GRIPPER, undelivered=0), (30.0, signals(Phase.DONE, Holder.GRIPPER)))
    assert "took its gripper for empty" in taken.outcome().reason


def test_a_robot_that_closes_on_what_the_person_holds_disturbs_the_delivery():
    evaluator = follow(to_person(), *looked(Holder.HAND, Holder.BOTH))
    assert evaluator.transfers[0].done is None
    assert evaluator.outcome().metrics["disturbed_deliveries"].value == 1
