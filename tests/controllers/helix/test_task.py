"""When the servo's task closes the gripper, goes on, or is given up, for places that a test sets."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handover.controllers.helix.servo.servo_parameters import Params
from handover.controllers.helix.servo.task import Phase, Task, Verdict
from handover.cosim.blocks.ports import Floats

BALL = np.array([0.16, 0.0, -0.6])
DOWN = np.array([0.0, 0.0, -1.0])


def tracked(beside: float, direction: Floats = DOWN) -> Any:
    """Return a tracker with a gripper beside the ball, a millimetre above its middle."""
    at = {
        "ball": SimpleNamespace(position=BALL, seen=True),
        "wrist": SimpleNamespace(position=BALL - 0.1 * direction, seen=True),
        "direction": SimpleNamespace(position=direction),
    }
    return SimpleNamespace(**at, p_WG=BALL + np.array([beside, 0.0, 0.001]), unseen_O=0.0, unseen_R=0.0)


def phases_of(params: Params, beside: float, steps: int, direction: Floats = DOWN) -> tuple[list[Phase], Verdict]:
    """Return the phases of a task whose gripper stays beside the ball, and why it was given up."""
    task = Task(params, tracked(beside, direction))
    found: list[Phase] = []
    for n in range(steps):
        task.decide(0.5 * n, lambda: Verdict.NO_PROGRESS)
        found.append(task.phase)
    return found, task.verdict


def test_a_gripper_at_the_ball_closes_after_settle_steps():
    phases, verdict = phases_of(Params(settle_steps=3), 0.002, 8)
    assert phases[phases.index(Phase.DESCEND) + 3] is Phase.GRASP
    assert verdict is Verdict.NONE


@pytest.mark.parametrize(
    ("accept", "beside", "ends"),
    [(0.01, 0.004, Phase.GRASP), (0.0, 0.004, Phase.GIVEN_UP), (0.01, 0.012, Phase.GIVEN_UP)],
)
def test_a_gripper_that_gets_no_nearer_closes_where_that_may_do(accept: float, beside: float, ends: Phase):
    phases, verdict = phases_of(Params(threshold_accept=accept, patience=10), beside, 20)
    assert phases[-1] is ends
    assert Phase.GRASP not in phases[:10]
    assert verdict is (Verdict.NONE if ends is Phase.GRASP else Verdict.NO_PROGRESS)


def test_a_gripper_that_is_tilted_too_much_does_not_close_for_want_of_progress():
    tilted = np.array([np.sin(0.8), 0.0, -np.cos(0.8)])
    phases, verdict = phases_of(Params(patience=10), 0.004, 20, tilted)
    assert phases[-1] is Phase.GIVEN_UP
    assert verdict is Verdict.NO_PROGRESS
