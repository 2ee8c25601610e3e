"""Two robots that hand over as one: what both must be ready for, and what a person's pull is and is not."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_outputs_change_nothing, assert_passed_on
from support.wording import Wording

from handover.controllers.free_flyer.handover_team import (
    HandoverPhase,
    HandoverTask,
    HandoverTeam,
    Inputs,
    InvalidTeamParameters,
    Outputs,
    Params,
)
from handover.controllers.free_flyer.ports import ARM
from handover.cosim.blocks.ports import Floats

P = HandoverPhase
T = 0.016
OPEN, HOLDING, EMPTY = 1.2, 0.79, 0.60
FIRST, SECOND = np.array([0.28, 0.25, 0.0]), np.array([0.28, -0.25, 0.0])


@dataclass
class World:
    """Two robots that reach their goals at once, and grippers that close at once, unless a hook has it otherwise."""

    team: HandoverTeam
    before: Callable[["World"], None] = lambda _: None
    p: list[Floats] = field(default_factory=lambda: [np.array([0.7, -0.5, 0.1]), np.array([0.7, -1.1, 0.0])])
    v: list[Floats] = field(default_factory=lambda: [np.zeros(3), np.zeros(3)])
    closed: list[float] = field(default_factory=lambda: [HOLDING, HOLDING])
    follows: list[bool] = field(default_factory=lambda: [True, True])
    ys: list[Outputs] = field(default_factory=list[Outputs])
    us: list[Inputs] = field(default_factory=list[Inputs])

    def step(self) -> Outputs:
        self.before(self)
        angles = [OPEN, OPEN]
        if self.ys:
            y = self.ys[-1]
            goals, closures = (y.p_WG_goal_1, y.p_WG_goal_2), (y.closure_1, y.closure_2)
            self.p = [g if f else p for g, f, p in zip(goals, self.follows, self.p, strict=True)]
            angles = [a if c > 0.5 else OPEN for a, c in zip(self.closed, closures, strict=True)]
        u = Inputs(
            p_WB_meas_1=self.p[0] - ARM,
            p_WB_meas_2=self.p[1] - ARM,
            v_WB_meas_1=self.v[0],
            v_WB_meas_2=self.v[1],
            gripper_angle_1=angles[0],
            gripper_angle_2=angles[1],
        )
        self.us.append(u)
        self.ys.append(self.team.step(len(self.ys) * T, T, u))
        return self.ys[-1]

    def run(self, seconds: float) -> Outputs:
        for _ in range(round(seconds / T)):
            self.step()
        return self.ys[-1]

    def until(self, phase: HandoverPhase) -> Outputs:
        while self.step().phase_1 is not phase:
            assert len(self.ys) * T < 100.0
        return self.ys[-1]

    def phases(self) -> list[HandoverPhase]:
        found = [y.phase_1 for y in self.ys]
        return [p for i, p in enumerate(found) if i == 0 or p is not found[i - 1]]


def world(task: HandoverTask, before: Callable[[World], None] = lambda _: None, **params: Any) -> World:
    return World(HandoverTeam(Params(task=task, **params)), before)


def moved(*speeds: Sequence[float]) -> Callable[[World], None]:
    """A person who moves each gripper with a velocity, 0.5 s after the robots began to check, for 0.4 s."""
    waited = [0.0]

    def act(w: World) -> None:
        checking = bool(w.ys) and P.CHECK_VELOCITY in (w.ys[-1].phase_1, w.ys[-1].phase_2)
        waited[0] = waited[0] + T if checking else 0.0
        w.v = [np.array(v) if 0.5 < waited[0] < 0.9 else np.zeros(3) for v in speeds]

    return act


GIVEN = [P.MOVE_TO_OBJECT, P.GRASP_OBJECT, P.MOVE_TO_HANDOVER, P.ACTIVATE_IMPEDANCE, P.SIGNAL, P.CHECK_VELOCITY]
END = [P.DEACTIVATE_IMPEDANCE, P.RETREAT, P.DONE]


def test_both_give_the_object_at_their_places():
    w = world(HandoverTask.ROBOT_TO_HUMAN, moved([-0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]))
    at = np.array(w.p)
    w.run(25.0)
    assert w.phases() == [P.OPEN_GRIPPER, *GIVEN, P.RELEASE_OBJECT, *END]
    first, at_object, giving = (
        np.array(next((y.p_WG_goal_1, y.p_WG_goal_2) for y in w.ys if y.phase_1 is phase))
        for phase in (P.OPEN_GRIPPER, P.GRASP_OBJECT, P.SIGNAL)
    )
    np.testing.assert_array_equal(first, at)
    np.testing.assert_allclose(at_object, [[0.38, -0.55, 0.0], [0.38, -1.05, 0.0]])
    np.testing.assert_allclose(giving, [[0.28, 0.25, 0.0], [0.28, -0.25, 0.0]])
    np.testing.assert_allclose(w.ys[-1].p_WG_goal_1 - w.ys[-1].p_WG_goal_2, [0.0, 0.5, 0.0])


def test_what_turns_or_squeezes_the_object_releases_nothing():
    for v in ([0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.3]):
        w = world(HandoverTask.ROBOT_TO_HUMAN, moved(v, [-x for x in v]))
        w.until(P.CHECK_VELOCITY)
        assert w.run(3.0).phase_1 is P.CHECK_VELOCITY


@pytest.mark.parametrize(("speed", "released"), [(0.10, False), (0.14, True)])
def test_one_gripper_alone_must_be_twice_as_fast(speed: float, released: bool):
    """The middle has half of its velocity; the rigid threshold is 0.059 m/s."""
    w = world(HandoverTask.ROBOT_TO_HUMAN, moved([-speed, 0.0, 0.0], [0.0, 0.0, 0.0]))
    w.until(P.CHECK_VELOCITY)
    y = w.run(1.5)
    assert (y.closure_1, y.closure_2) == ((0.0, 0.0) if released else (1.0, 1.0))


def test_they_wait_for_the_one_that_is_late_or_still_moves():
    w = world(HandoverTask.ROBOT_TO_HUMAN)
    w.until(P.MOVE_TO_HANDOVER)
    w.follows[1] = False
    y = w.run(10.0)
    assert (y.phase_1, y.phase_2) == (P.MOVE_TO_HANDOVER, P.MOVE_TO_HANDOVER)
    w.follows[1] = True
    w.v = [np.array([0.0, 0.02, 0.0]), np.array([0.0, -0.02, 0.0])]  # the middle is at rest
    assert w.run(5.0).phase_1 is P.MOVE_TO_HANDOVER
    w.v = [np.zeros(3)] * 2
    w.until(P.SIGNAL)


def test_both_open_again_after_one_received_nothing():
    push = moved([0.05, 0.0, 0.0], [0.05, 0.0, 0.0])

    def person(w: World) -> None:
        push(w)
        w.closed[1] = HOLDING if w.ys and w.ys[-1].failed_receptions_1 else EMPTY

    w = world(HandoverTask.HUMAN_TO_ROBOT, person)
    y = w.run(25.0)
    received = [P.SIGNAL, P.CHECK_VELOCITY, P.CLOSE_GRIPPER, P.CHECK_ANGLE]
    moves = [P.OPEN_GRIPPER, P.MOVE_TO_HANDOVER, P.ACTIVATE_IMPEDANCE]
    assert w.phases() == [*moves, *received, P.OPEN_GRIPPER, *received, *END]
    assert (y.failed_receptions_1, y.failed_receptions_2) == (1, 1)
    opened = [y for y in w.ys if y.phase_1 is P.OPEN_GRIPPER and y.failed_receptions_1]
    assert {(y.closure_1, y.closure_2) for y in opened} == {(0.0, 0.0)}


def test_both_give_up_where_they_are_when_one_has_lost_the_object():
    w = world(HandoverTask.ROBOT_TO_HUMAN)
    w.until(P.MOVE_TO_HANDOVER)
    w.follows, w.closed[0] = [False, False], EMPTY
    at = [np.array(p) for p in w.p]
    y = w.run(0.1)
    assert (y.phase_1, y.phase_2) == (P.GIVEN_UP, P.GIVEN_UP)
    np.testing.assert_allclose([y.p_WG_goal_1, y.p_WG_goal_2], at)


@pytest.mark.parametrize(
    ("closed", "failed"), [((EMPTY, EMPTY), 0), ((EMPTY, HOLDING), 1), ((HOLDING, EMPTY), 1), ((HOLDING, HOLDING), 1)]
)
def test_a_release_has_failed_if_either_gripper_closes_on_the_object_again(closed: tuple[float, float], failed: int):
    w = world(HandoverTask.ROBOT_TO_HUMAN, moved([-0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]), verify=True)
    w.until(P.VERIFY_RELEASE)
    w.closed = list(closed)
    while w.ys[-1].phase_1 is P.VERIFY_RELEASE:
        w.step()
    y = w.ys[-1]
    assert (y.phase_1, y.phase_2) == ((P.MOVE_TO_HANDOVER,) * 2 if failed else (P.DEACTIVATE_IMPEDANCE,) * 2)
    assert (y.failed_deliveries_1, y.failed_deliveries_2) == (failed, failed)


def test_they_yield_on_until_they_no_longer_follow_the_pull():
    w = world(HandoverTask.ROBOT_TO_HUMAN, moved([-0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]))
    w.until(P.RELEASE_OBJECT)
    w.follows, w.before = [False, False], lambda _: None  # type: ignore
    w.p = [p - np.array([0.05, 0.0, 0.0]) for p in w.p]
    w.v = [np.array([-0.1, 0.0, 0.0])] * 2
    y = w.run(3.0)
    assert (y.phase_1, y.impedance_1, y.closure_1) == (P.RELEASE_OBJECT, True, 0.0)
    w.v = [np.array([0.01, 0.0, 0.0])] * 2
    assert w.run(0.4).phase_1 is P.DEACTIVATE_IMPEDANCE  # by the low-passed velocity


def test_each_for_itself_one_lets_go_alone():
    w = world(HandoverTask.ROBOT_TO_HUMAN, moved([-0.1, 0.0, 0.0], [0.0, 0.0, 0.0]), together=False)
    w.until(P.CHECK_VELOCITY)
    y = w.run(1.5)
    assert (y.closure_1, y.closure_2) == (0.0, 1.0)
    assert (y.phase_1, y.phase_2) == (P.RELEASE_OBJECT, P.CHECK_VELOCITY)


@pytest.mark.parametrize("together", [True, False])
def test_a_restored_state_continues_alike(together: bool):
    w = world(HandoverTask.ROBOT_TO_HUMAN, moved([-0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]), together=together)
    w.run(12.0)
    assert P.RETREAT in w.phases()
    make = partial(HandoverTeam, Params(task=HandoverTask.ROBOT_TO_HUMAN, together=together))
    assert_passed_on(make, w.us, 6, T)
    assert_outputs_change_nothing(make, w.us[0])


def test_faults_name_the_robot_that_they_are_of(wording: Wording):
    with pytest.raises(InvalidTeamParameters) as e:
        HandoverTeam(Params(task=HandoverTask.ROBOT_TO_HUMAN, p_WO_0=np.array([0.1, -1.3, 0.0]), gate_speed=0.5))
    wording.check(e.value)
