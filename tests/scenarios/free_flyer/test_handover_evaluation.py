"""Verdicts on handovers in microgravity, from staged signals."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from handover.controllers.free_flyer.handover_state_machine import HandoverPhase as Phase
from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.fmu.description import FmuPort
from handover.cosim.system.signals import Signals
from handover.plants.free_flyer.hand.hand_and_object import Holder
from handover.scenarios.free_flyer.handover_evaluation import HandoverEvaluator
from handover.scenarios.free_flyer.parameters import HandoverParameters
from handover.scenarios.free_flyer.person_evaluation import Cause

PLACE = np.array([0.0, -0.07, 0.0])


def signals(
    phase: Phase,
    holder: Holder,
    *,
    speed: float = 0.0,
    away: float = 0.0,
    failed: int = 0,
    saturated: bool = False,
    force: float = 0.0,
    angle: float = 0.6,
) -> Signals:
    loop = {"pole_radius": [0.99], "damping_ratio": [0.3], "pole_frequency": [2.7]}
    values: dict[str, dict[str, Any]] = {
        "robot": {"p_WG": PLACE + np.array([0.0, 0.0, away])},
        "thrusters": {"saturated": [saturated]},
        "impedance": loop,
        "pose": loop,
        "decision": {"phase": [int(phase)], "speed_G": [speed], "failed_receptions": [failed]},
        "person": {
            "holder": [int(holder)],
            "f_G": np.array([force, 0.0, 0.0]),
            "f_H": np.array([-force, 0.0, 0.0]),
            "gripper_angle": [angle],
        },
    }
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
                shape=(3,) if name in ("p_WG", "f_G", "f_H") else (),
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
    assert "never felt a pull within 61 s" in outcome.reason
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


def received(failed: int, empty: int = 1) -> HandoverEvaluator:
    evaluator = HandoverEvaluator(HandoverParameters(), ("GRIPPER",), failures=1)
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
    assert "never felt a push within 62 s" in reason
    assert "below the threshold: 0.004 of 0.021 m/s" in reason


def test_a_robot_that_gave_up_on_the_way_to_the_object_is_not_reported_of_the_handover_place():
    way = [(t, signals(Phase.MOVE_TO_OBJECT, Holder.FREE, away=0.6)) for t in (1.0, 30.0)]
    reason = follow(to_person(), *way, (61.0, signals(Phase.GIVEN_UP, Holder.FREE, away=0.6))).outcome().reason
    assert reason == "the robot gave up in phase MOVE_TO_OBJECT; nobody holds it"


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
        (11.0, signals(Phase.CHECK_VELOCITY, Holder.GRIPPER, speed=0.06, force=0.1)),
        (11.1, signals(Phase.RELEASE_OBJECT, Holder.GRIPPER, speed=0.07)),
    ]
    assert follow(to_person(), *alone).outcome().metrics["unprovoked"].value == 1
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
