from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.scenarios.helix_signals import P_WG, P_WR, PICTURE, port, views_and_ports
from support.wording import Wording

from handover.controllers.helix.servo.visual_servo import Phase, Verdict
from handover.cosim.blocks.variable import Kind
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit, System
from handover.fmus.build import cached
from handover.plants.helix.hand.partner_parameters import Holder
from handover.scenarios.robots.helix.cameras import camera_of, camera_parameters
from handover.scenarios.robots.helix.disturbances import Cover
from handover.scenarios.robots.helix.evaluation import HandoverEvaluator, model_mismatch
from handover.scenarios.robots.helix.parameters import Parameters


def signals(phase: Phase, holder: Holder = Holder.HAND, **shown: Any) -> Signals:
    """Return what a gripper that hangs down, and a ball at a place in its frame, would show."""
    return Signals(*views_and_ports(phase, holder, **shown), PICTURE)


def follow(*seen: tuple[float, Signals], parameters: Parameters | None = None) -> HandoverEvaluator:
    evaluator = HandoverEvaluator(parameters or Parameters())
    for t, at_t in seen:
        evaluator(t, at_t)
    evaluator.finish(seen[-1][1])
    return evaluator


def test_a_gripper_that_closed_beside_the_ball_fails_and_says_how_far(wording: Wording):
    beside = [signals(phase, beside=0.04, along=-0.01) for phase in (Phase.GRASP, Phase.HOLD, Phase.HOLD)]
    evaluator = follow((8.0, beside[0]), (18.0, beside[1]), (20.1, beside[2]))
    assert evaluator.over
    outcome = evaluator.outcome()
    assert not outcome.success
    wording.check(outcome.reason)
    assert "grasp_offset_lateral" not in outcome.metrics


def test_a_run_that_was_given_up_says_why(wording: Wording):
    for verdict in list(Verdict)[1:]:
        evaluator = follow((8.0, signals(Phase.APPROACH)), (9.0, signals(Phase.GIVEN_UP, verdict=verdict)))
        assert evaluator.over
        assert not evaluator.outcome().success
        wording.check(evaluator.outcome().reason)


def test_a_gripper_that_opened_again_is_timed_from_its_last_closing_and_has_no_more_patience():
    course = [(5.0, Phase.GRASP), (7.0, Phase.APPROACH), (9.0, Phase.DESCEND), (11.0, Phase.GRASP)]
    evaluator = follow(*((t, signals(phase)) for t, phase in course))
    assert evaluator.outcome().metrics["arm_time"].value == 11.0
    evaluator = follow(*((t, signals(phase)) for t, phase in [*course[:2], (61.0, Phase.APPROACH)]))
    assert evaluator.over


def test_offsets_are_those_of_the_moment_when_the_hand_let_go():
    taken = signals(Phase.HOLD, Holder.GRIPPER, beside=-0.012, along=0.02)
    later = signals(Phase.HOLD, Holder.GRIPPER, beside=-0.001)
    outcome = follow((8.0, signals(Phase.GRASP)), (18.0, taken), (19.1, later)).outcome()
    assert outcome.success
    assert outcome.metrics["grasp_offset_lateral"].value == pytest.approx(0.012)
    assert outcome.metrics["grasp_offset_axial"].value == pytest.approx(0.02)


def test_a_ball_that_fell_fails(wording: Wording):
    """From the gripper, or pushed out of the hand, which ends the run at once."""
    fallen = signals(Phase.HOLD, Holder.FREE, along=0.3)
    pushed = signals(Phase.APPROACH, Holder.FREE, beside=0.05)
    for seen in (
        ((18.0, signals(Phase.HOLD, Holder.GRIPPER)), (19.1, fallen)),
        ((5.0, signals(Phase.APPROACH)), (5.1, pushed)),
    ):
        evaluator = follow(*seen)
        assert evaluator.over
        assert not evaluator.outcome().success
        wording.check(evaluator.outcome().reason)


def test_an_arm_that_presses_harder_than_the_person_bears_fails(wording: Wording):
    for force, success in ((4.9, True), (5.1, False)):
        taken = [(t, signals(Phase.HOLD, Holder.GRIPPER)) for t in (18.0, 19.1)]
        outcome = follow((9.0, signals(Phase.GRASP, hand_force=force)), *taken).outcome()
        assert outcome.success is success
        assert outcome.metrics["hand_force"].value == pytest.approx(force)
        wording.check(outcome.reason)
    untouched, pressed = (
        follow((1.0, signals(Phase.APPROACH, hand_force=5.2, touching=touching))) for touching in (False, True)
    )
    assert (untouched.over, pressed.over) == (False, True)
    assert untouched.outcome().metrics["hand_force"].value == pytest.approx(5.2)


def moments(evaluator: HandoverEvaluator) -> dict[str, float]:
    """Return the times of the pictures by role; each moment has a left and a right one."""
    pictures = evaluator.pictures()
    assert [p.camera for p in pictures] == ["left", "right"] * (len(pictures) // 2)
    return {p.role: p.t for p in pictures}


def test_pictures_are_of_the_start_the_first_entries_into_phases_and_the_end():
    course = (Phase.WAIT, Phase.APPROACH, Phase.DESCEND, Phase.APPROACH, Phase.DESCEND, Phase.GRASP, Phase.DESCEND)
    evaluator = follow(*((float(t), signals(phase)) for t, phase in enumerate((*course, Phase.GRASP, Phase.HOLD))))
    first = {"start": 0.0, "approach": 1.0, "descent": 2.0, "gripper begins to close": 5.0}
    assert moments(evaluator) == {**first, "end": 8.0}
    timed_out = follow((0.0, signals(Phase.APPROACH)), (60.0, signals(Phase.APPROACH)))
    assert moments(timed_out) == {"start": 0.0, "end": 60.0}
    assert list(moments(follow((0.0, signals(Phase.WAIT))))) == ["start"]


def test_where_the_model_was_is_reported_of_the_moment_at_which_the_gripper_began_to_close():
    metrics = follow((7.9, signals(Phase.DESCEND)), (8.0, signals(Phase.GRASP))).outcome().metrics
    assert metrics["model_travel"].value == pytest.approx(0.0, abs=1e-12)
    assert metrics["model_mismatch"].value == metrics["arm_travel"].value == pytest.approx(np.hypot(0.16, 0.1))
    assert "model_mismatch" not in follow((7.9, signals(Phase.DESCEND))).outcome().metrics


def test_a_covered_lens_is_shown_when_the_first_picture_was_taken_through_it():
    covered = Parameters(cover=Cover.LEFT, cover_from=0.99, cover_for=2.0)
    seen = signals(Phase.WAIT)
    evaluator = follow(*((t, seen) for t in (0.0, 0.98, 0.99, 1.0, 1.02, 4.0)), parameters=covered)
    assert moments(evaluator) == {"start": 0.0, "lens covered": 1.0, "end": 4.0}
    labels = {(p.role, p.camera): [m.label for m in p.marks if "measured" in m.label] for p in evaluator.pictures()}
    assert labels["lens covered", "left"] == []
    assert len(labels["lens covered", "right"]) == len(labels["end", "left"]) == 3


def test_marks_lie_where_the_camera_sees_what_was_measured():
    picture = follow((0.0, signals(Phase.APPROACH))).pictures()[0]
    ball, wrist, gripper = (m for m in picture.marks if m.label.endswith("measured"))
    camera = camera_of("left", camera_parameters())
    assert (ball.shape, wrist.shape, gripper.shape) == ("circle", "cross", "cross")
    assert len({(m.shape, m.colour) for m in picture.marks}) == 6  # each is another one in the legend
    assert (wrist.u, wrist.v) == pytest.approx(tuple(camera.project(P_WR)))
    edge = camera.project(P_WG + 0.025 * camera.R_WC[:, 1])  # a ball's radius below its middle, as the camera sees it
    assert ball.radius == pytest.approx(float(np.linalg.norm(edge - np.array([ball.u, ball.v]))), rel=0.05)
    unseen = follow((0.0, signals(Phase.APPROACH, sees_ball=False))).pictures()[0]
    assert {m.label for m in picture.marks} - {m.label for m in unseen.marks} == {"ball, as measured"}


def of_a_short_controller(closure: float | None, grip: float, holder: Holder = Holder.HAND) -> Signals:
    """Return the like for a controller that gives neither phase nor error nor estimates."""
    views, ports = views_and_ports(Phase.APPROACH, holder, beside=0.04)
    views["servo"], ports["servo"] = {}, {}
    views["arm"]["grip"], ports["arm"]["grip"] = (np.array([grip]),), port("grip", Kind.REAL)
    if closure is not None:
        views["servo"]["closure"], ports["servo"]["closure"] = (np.array([closure]),), port("closure", Kind.REAL)
    return Signals(views, ports, PICTURE)


def test_a_controller_without_phases_is_judged_by_its_gripper(wording: Wording):
    moments = (0.0, 0.0, 0.0), (8.0, 1.0, 0.1), (9.0, 1.0, 1.0), (11.1, 1.0, 1.0)
    evaluator = follow(*((t, of_a_short_controller(closure, grip)) for t, closure, grip in moments))
    assert evaluator.phases == {"APPROACH": 0.0, "GRASP": 8.0, "HOLD": 9.0}
    assert evaluator.over
    outcome = evaluator.outcome()
    wording.check(outcome.reason)
    assert outcome.metrics["arm_time"].value == 8.0
    assert not {"controller_error", "model_mismatch"} & set(outcome.metrics)
    assert all(mark.label.endswith("as measured") for p in evaluator.pictures() for mark in p.marks)
    taken = [(t, of_a_short_controller(1.0, 1.0, Holder.GRIPPER)) for t in (8.0, 9.1)]
    assert follow((0.0, of_a_short_controller(0.0, 0.0)), *taken).outcome().success
    without_command = follow(*((t, of_a_short_controller(None, 0.0)) for t in (0.0, 60.0)))
    assert without_command.over
    wording.check(without_command.outcome().reason)


def test_a_run_out_of_time_says_why_by_what_was_so_at_its_end(wording: Wording):
    for error, seen in ((0.3, True), (0.02, True), (0.002, True), (0.02, False)):
        begin, end = signals(Phase.APPROACH, error=0.001), signals(Phase.DESCEND, sees_ball=seen, error=error)
        evaluator = HandoverEvaluator(Parameters())
        assert "final_distance" not in evaluator.outcome().metrics
        for t in range(61):
            evaluator(float(t), end if t or not seen else begin)
        assert evaluator.over
        wording.check(evaluator.outcome().reason)
    converging = ((float(t), signals(Phase.DESCEND, error=0.001 if t == 35 else 0.04)) for t in range(41))
    early = follow(*converging, parameters=Parameters(patience=40.0)).outcome().reason
    assert all(reported in early for reported in ("time ran out", "0.001 m", "0.040 m", "40 s"))
    for until, sees_ball in ((0.3, True), (10.0, True), (10.0, False)):
        waiting = signals(Phase.WAIT, sees_ball=sees_ball)
        wording.check(follow((0.0, waiting), (until, waiting)).outcome().reason)


def test_a_ball_that_the_person_brought_is_reported(wording: Wording):
    course = ((8.0, signals(Phase.GRASP, beside=0.071)), (20.0, signals(Phase.HOLD, Holder.GRIPPER)))
    for parameters in (Parameters(help_speed=0.05), Parameters()):
        outcome = follow(*course, parameters=parameters).outcome()
        assert outcome.success
        wording.check(outcome.reason)


def test_control_steps_are_counted_by_the_period_that_the_controller_is_set_to():
    system = System()
    system.add("servo", cached("VisualServo", 3), control_period=0.4)
    servo = system.units["servo"]
    ticking = replace(servo, description=replace(servo.description, sampled=True, step=0.1))
    programs: tuple[dict[str, PlacedUnit], ...] = ({"servo": replace(servo, start={})}, {"servo": ticking}, {})
    for units, steps in ((system.units, 21), *((other, None) for other in programs)):
        evaluator = HandoverEvaluator(Parameters())
        evaluator.note_units(units)
        evaluator(8.0, signals(Phase.GRASP))
        metrics = evaluator.outcome().metrics
        assert metrics["arm_time"].value == 8.0
        assert (metrics["steps"].value if "steps" in metrics else None) == steps


HANGING = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.24, 0.0, 0.0, 0.24])


def test_a_model_that_hangs_is_as_far_from_the_arm_as_the_arm_has_gone():
    found = model_mismatch(HANGING, np.array([0.03, 0.04, -0.58]))
    assert found.model_travel == pytest.approx(0.0, abs=1e-12)
    assert found.arm_travel == found.apart == pytest.approx(0.13)


def test_a_model_that_bends_towards_minus_y_of_the_base_is_at_plus_y_of_the_world():
    """R_WB = diag(1, -1, -1)."""
    bent = HANGING + np.array([0.0, -0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    towards, away = (model_mismatch(bent, np.array([0.0, y, -0.65])).apart for y in (0.2, -0.2))
    assert towards < 0.1 < away
