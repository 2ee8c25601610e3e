from dataclasses import replace

import numpy as np
import pytest
from support.scenarios.helix_signals import P_WG, P_WR, PICTURE, port, views_and_ports

from handover.controllers.helix.servo.visual_servo import Phase, Verdict
from handover.cosim.blocks.variable import Kind
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.plants.helix.hand.partner_parameters import Holder
from handover.scenarios.helix.cameras import camera_of, camera_parameters
from handover.scenarios.helix.disturbances import Cover
from handover.scenarios.helix.evaluation import HandoverEvaluator
from handover.scenarios.helix.parameters import Parameters


def signals(
    phase: Phase,
    holder: Holder = Holder.HAND,
    beside: float = 0.0,
    along: float = 0.0,
    sees_ball: bool = True,
    verdict: Verdict = Verdict.NONE,
    hand_force: float = 0.2,
    error: float = 0.01,
    touching: bool = True,
) -> Signals:
    """Return what a gripper that hangs down, and a ball at a place in its frame, would show."""
    units, ports = views_and_ports(phase, holder, beside, along, sees_ball, hand_force, error, touching)
    units["servo"]["verdict"] = (np.array([int(verdict)]),)
    items = tuple((v.name, int(v)) for v in Verdict)
    ports["servo"]["verdict"] = port("verdict", Kind.ENUMERATION, items=items)
    return Signals(units, ports, PICTURE)


def follow(*seen: tuple[float, Signals], parameters: Parameters | None = None) -> HandoverEvaluator:
    evaluator = HandoverEvaluator(parameters or Parameters())
    for t, at_t in seen:
        evaluator(t, at_t)
    evaluator.finish(seen[-1][1])
    return evaluator


def test_a_gripper_that_closed_beside_the_ball_fails_and_says_how_far():
    beside = [signals(phase, beside=0.04, along=-0.01) for phase in (Phase.GRASP, Phase.HOLD, Phase.HOLD)]
    evaluator = follow((8.0, beside[0]), (18.0, beside[1]), (20.1, beside[2]))
    assert evaluator.over
    outcome = evaluator.outcome()
    assert not outcome.success
    assert "0.040 m beside its axis and -0.010 m along it" in outcome.reason
    assert "grasp_offset_lateral" not in outcome.metrics


@pytest.mark.parametrize(
    ("verdict", "why"),
    [
        (Verdict.LOST_RING, "lost ring: "),
        (Verdict.LOST_BALL, "lost ball: "),
        (Verdict.LIMITS, "limits of the command: "),
        (Verdict.OUT_OF_REACH, "out of reach: "),
        (Verdict.NO_PROGRESS, "no progress: "),
    ],
)
def test_a_run_that_was_given_up_says_why(verdict: Verdict, why: str):
    given_up = signals(Phase.GIVEN_UP, verdict=verdict)
    evaluator = follow((8.0, signals(Phase.APPROACH)), (9.0, given_up))
    assert evaluator.over
    assert not evaluator.outcome().success
    assert evaluator.outcome().reason.startswith(f"{why}the gripper stays 0.010 m from its goal; ball at ")


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


def test_a_ball_that_fell_from_the_gripper_fails():
    taken = signals(Phase.HOLD, Holder.GRIPPER)
    outcome = follow((18.0, taken), (19.1, signals(Phase.HOLD, Holder.FREE, along=0.3))).outcome()
    assert not outcome.success
    assert "the gripper did not keep it" in outcome.reason


def test_a_ball_that_is_pushed_out_of_the_hand_fails_at_once():
    evaluator = follow((5.0, signals(Phase.APPROACH)), (5.1, signals(Phase.APPROACH, Holder.FREE, beside=0.05)))
    assert evaluator.over
    outcome = evaluator.outcome()
    assert not outcome.success
    assert "the ball was pushed out of the hand at 5.1 s" in outcome.reason


@pytest.mark.parametrize(("force", "success"), [(4.9, True), (5.1, False)])
def test_an_arm_that_presses_harder_than_the_person_bears_fails(force: float, success: bool):
    pressed = signals(Phase.GRASP, hand_force=force)
    taken = [(t, signals(Phase.HOLD, Holder.GRIPPER)) for t in (18.0, 19.1)]
    outcome = follow((9.0, pressed), *taken).outcome()
    assert outcome.success is success
    assert outcome.metrics["hand_force"].value == pytest.approx(force)
    assert success or "the arm pressed on the hand with 5.1 N, and a person bears 5 N" in outcome.reason


def moments(evaluator: HandoverEvaluator) -> dict[str, float]:
    """Return the times of the pictures by role; each moment has a left and a right one."""
    pictures = evaluator.pictures()
    assert [p.camera for p in pictures] == ["left", "right"] * (len(pictures) // 2)
    return {p.role: p.t for p in pictures}


def test_pictures_are_of_the_start_the_first_entries_into_phases_and_the_end():
    course = (Phase.WAIT, Phase.APPROACH, Phase.DESCEND, Phase.APPROACH, Phase.DESCEND, Phase.GRASP, Phase.DESCEND)
    evaluator = follow(*((float(t), signals(phase)) for t, phase in enumerate((*course, Phase.GRASP, Phase.HOLD))))
    assert moments(evaluator) == {
        "start": 0.0,
        "approach": 1.0,
        "descent": 2.0,
        "gripper begins to close": 5.0,
        "end": 8.0,
    }


def test_a_run_that_timed_out_has_a_start_and_an_end():
    evaluator = follow((0.0, signals(Phase.APPROACH)), (60.0, signals(Phase.APPROACH)))
    assert moments(evaluator) == {"start": 0.0, "end": 60.0}


def test_a_moment_is_shown_once():
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
    assert len({m.colour for m in (ball, wrist, gripper)}) == 3
    assert (wrist.u, wrist.v) == pytest.approx(tuple(camera.project(P_WR)))
    edge = camera.project(P_WG + 0.025 * camera.R_WC[:, 1])  # a ball's radius below its middle, as the camera sees it
    assert ball.radius == pytest.approx(float(np.linalg.norm(edge - np.array([ball.u, ball.v]))), rel=0.05)


def test_what_vision_does_not_see_is_not_marked():
    picture = follow((0.0, signals(Phase.APPROACH, sees_ball=False))).pictures()[0]
    labels = [m.label for m in picture.marks]
    assert "ball, as measured" not in labels
    assert {"wrist, as measured", "gripper, as measured", "ball, as the controller has it"} <= set(labels)


def of_a_short_controller(closure: float | None, grip: float, holder: Holder = Holder.HAND) -> Signals:
    """Return the like for a controller that gives neither phase nor error nor estimates."""
    views, ports = views_and_ports(Phase.APPROACH, holder, beside=0.04)
    views["servo"], ports["servo"] = {}, {}
    views["arm"]["grip"], ports["arm"]["grip"] = (np.array([grip]),), port("grip", Kind.REAL)
    if closure is not None:
        views["servo"]["closure"], ports["servo"]["closure"] = (np.array([closure]),), port("closure", Kind.REAL)
    return Signals(views, ports, PICTURE)


def test_a_controller_without_phases_is_judged_by_its_gripper():
    moments = (0.0, 0.0, 0.0), (8.0, 1.0, 0.1), (9.0, 1.0, 1.0), (11.1, 1.0, 1.0)
    evaluator = follow(*((t, of_a_short_controller(closure, grip)) for t, closure, grip in moments))
    assert evaluator.phases == {"APPROACH": 0.0, "GRASP": 8.0, "HOLD": 9.0}
    assert evaluator.over
    outcome = evaluator.outcome()
    assert "the gripper closed with the ball 0.040 m beside its axis" in outcome.reason
    assert outcome.metrics["arm_time"].value == 8.0
    assert not {"controller_error", "model_mismatch"} & set(outcome.metrics)
    assert {mark.label for p in evaluator.pictures() for mark in p.marks} <= {
        f"{what}, as measured" for what in ("ball", "wrist", "gripper")
    }
    taken = [(t, of_a_short_controller(1.0, 1.0, Holder.GRIPPER)) for t in (8.0, 9.1)]
    assert follow((0.0, of_a_short_controller(0.0, 0.0)), *taken).outcome().success


def test_a_controller_without_a_gripper_command_is_told_how_near_it_came_to_the_ball():
    evaluator = follow(*((t, of_a_short_controller(None, 0.0)) for t in (0.0, 60.0)))
    assert evaluator.over
    assert "the arm came no nearer than 0.040 m to the ball" in evaluator.outcome().reason


def test_a_run_that_failed_before_its_first_sample_has_no_distance():
    assert "final_distance" not in HandoverEvaluator(Parameters()).outcome().metrics


def test_a_run_that_was_stopped_while_it_waits_is_not_told_that_nothing_was_seen_for_long():
    assert (
        follow((0.0, signals(Phase.WAIT)), (0.3, signals(Phase.WAIT))).outcome().reason.startswith("stopped at 0.3 s")
    )
    late = follow((0.0, signals(Phase.WAIT)), (10.0, signals(Phase.WAIT))).outcome().reason
    assert late.startswith("the cameras did not see ball and ring at once within 10 s")
    blind = signals(Phase.WAIT, sees_ball=False)
    assert follow((0.0, blind), (10.0, blind)).outcome().reason.startswith("the cameras did not see ball within 10 s")


@pytest.mark.parametrize(
    ("error", "seen", "why"),
    [
        (0.3, True, "out of reach or too slow: after 60 s the arm came no nearer than 0.300 m to its goal; "),
        (0.02, True, "no grasp: after 60 s the arm came no nearer than 0.020 m to its goal; "),
        (0.002, True, "no grasp: of late the gripper came within 0.002 m of its goal, but did not stay there; "),
        (0.02, False, "lost ball: of 60 s it was not seen for 60 s; "),
    ],
)
def test_a_run_out_of_time_says_why_by_what_was_so_at_its_end(error: float, seen: bool, why: str):
    begin, end = signals(Phase.APPROACH, error=0.001), signals(Phase.DESCEND, sees_ball=seen, error=error)
    evaluator = HandoverEvaluator(Parameters())
    system = System()
    system.add("servo", cached("VisualServo", 3), threshold_grasp=0.003)
    evaluator.note_units(system.units)
    evaluator(0.0, begin if seen else end)
    for t in range(1, 61):
        evaluator(float(t), end)
    assert evaluator.over
    assert evaluator.outcome().reason.startswith(why)


def test_a_ball_that_the_person_brought_is_told():
    course = ((8.0, signals(Phase.GRASP, beside=0.071)), (20.0, signals(Phase.HOLD, Holder.GRIPPER)))
    brought = follow(*course, parameters=Parameters(help_speed=0.05)).outcome()
    assert brought.success
    assert brought.reason.endswith("it was 0.071 m away as the gripper began to close, and was brought")
    assert "brought" not in follow(*course).outcome().reason


def test_what_the_hand_bears_without_being_touched_is_no_pressing():
    untouched = follow((1.0, signals(Phase.APPROACH, hand_force=5.2, touching=False)))
    assert not untouched.over
    assert untouched.outcome().metrics["hand_force"].value == pytest.approx(5.2)
    pressed = follow((1.0, signals(Phase.APPROACH, hand_force=5.2)))
    assert pressed.over
    assert pressed.outcome().reason.startswith("the arm pressed on the hand with 5.2 N")


def test_control_steps_are_counted_by_the_period_that_the_controller_is_set_to():
    own = System()
    own.add("servo", cached("VisualServo", 3), control_period=0.4)
    another = {"servo": replace(own.units["servo"], start={})}
    ticking = replace(own.units["servo"].description, sampled=True, step=0.1)
    for units, steps in (
        (own.units, 21),
        (another, None),
        ({"servo": replace(own.units["servo"], description=ticking)}, None),
        ({}, None),  # a program takes its place
    ):
        evaluator = HandoverEvaluator(Parameters())
        evaluator.note_units(units)
        evaluator(8.0, signals(Phase.GRASP))
        metrics = evaluator.outcome().metrics
        assert metrics["arm_time"].value == 8.0
        assert (metrics["steps"].value if "steps" in metrics else None) == steps
