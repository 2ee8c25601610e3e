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


@pytest.mark.parametrize(
    ("accept", "beside", "tilt", "ends"),
    [
        (0.01, 0.004, 0.0, Phase.GRASP),
        (0.0, 0.004, 0.0, Phase.GIVEN_UP),
        (0.01, 0.012, 0.0, Phase.GIVEN_UP),
        (0.01, 0.004, 0.8, Phase.GIVEN_UP),
    ],
)
def test_a_gripper_that_gets_no_nearer_closes_where_that_may_do(accept: float, beside: float, tilt: float, ends: Phase):
    direction = np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    phases, verdict = phases_of(Params(threshold_accept=accept, patience=10), beside, 20, direction)
    assert phases[-1] is ends
    assert Phase.GRASP not in phases[:10]
    assert verdict is (Verdict.NONE if ends is Phase.GRASP else Verdict.NO_PROGRESS)
    at_the_ball, _ = phases_of(Params(settle_steps=3), 0.002, 8)
    assert at_the_ball[at_the_ball.index(Phase.DESCEND) + 3] is Phase.GRASP
