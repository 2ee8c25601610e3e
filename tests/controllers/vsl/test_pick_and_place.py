"""The pick and place's planner: which part of the task comes when, how soft, and what it refuses."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support.restored_states import assert_continues
from support.wording import Wording

from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.pick_and_place import (
    PHASES,
    Inputs,
    InvalidTask,
    Outputs,
    Params,
    PickAndPlace,
    TaskPhase,
)

SHORT = Params(settle=0.1, wait=0.1)


def task(params: Params, at_most: int = 3000) -> list[Outputs]:
    """Return what it commands in each period until it is done, and once more."""
    unit, ys = PickAndPlace(params), list[Outputs]()
    while len(ys) < at_most and not (ys and ys[-1].done):
        ys.append(unit.step(0.02 * len(ys), 0.02, Inputs()))
    return ys


def test_the_parts_come_in_their_order_with_their_pressures_and_vacuum():
    ys = task(SHORT)
    phases = [y.phase for y in ys]
    assert sorted(phases) == phases
    assert list(dict.fromkeys(phases)) == list(range(len(PHASES)))
    stiff = {PHASES[y.phase] for y in ys if y.p_cmd[0] == SHORT.p_carry}
    assert stiff == {"lift", "carry"}
    assert {PHASES[y.phase] for y in ys if y.vacuum} == {"grasp", "lift", "carry", "soften", "lower"}
    assert all(y.p_cmd[0] in (SHORT.p_contact, SHORT.p_carry) for y in ys)


def test_the_tip_goes_at_its_speeds_by_the_joint_velocities_to_where_it_is_wanted():
    p, ys = SHORT, task(SHORT)
    kinematics = VslKinematics(p.L_1, p.L_2, p.L_3, Elbow.UP)
    for y in ys:
        np.testing.assert_allclose(kinematics.forward(y.q_ref), y.p_WG_goal, atol=1e-12)
    for before, y in pairwise(ys):
        moved = float(np.linalg.norm(y.p_WG_goal - before.p_WG_goal)) / 0.02
        if y.phase == before.phase and y.phase in (TaskPhase.DESCEND, TaskPhase.LOWER):
            assert moved == pytest.approx(p.V_contact, rel=0.01)
        elif y.phase == before.phase and y.phase in (TaskPhase.LIFT, TaskPhase.CARRY, TaskPhase.LEAVE):
            assert moved == pytest.approx(p.V, rel=0.02)
            np.testing.assert_allclose(y.qd_ref * 0.02, y.q_ref - before.q_ref, atol=2e-4)
    lowest = [y.p_WG_goal for y in ys if y.phase in (TaskPhase.GRASP, TaskPhase.RELEASE)]
    np.testing.assert_allclose(lowest[0], p.p_WP - [0.0, 0.0, p.press])
    np.testing.assert_allclose(lowest[-1], p.p_WQ - [0.0, 0.0, p.press])


def test_without_waiting_each_rest_takes_a_period():
    phases = [y.phase for y in task(replace(SHORT, wait=0.0))]
    assert [phases.count(phase) for phase in (TaskPhase.GRASP, TaskPhase.SOFTEN, TaskPhase.RELEASE)] == [1, 1, 1]
    assert list(dict.fromkeys(phases)) == list(range(len(PHASES)))


def test_joint_1_turns_on_behind_the_foot():
    """atan2 jumps by a turn where y = 0 and x < 0: joint 1 goes on, also while the arm rests and lets down."""
    behind = replace(SHORT, p_WP=np.array([-0.30, 0.08, 0.06]), p_WQ=np.array([-0.30, -0.08, 0.06]))
    ys = task(behind)
    theta_1 = np.array([y.q_ref[0] for y in ys])
    assert np.max(np.abs(np.diff(theta_1))) < 0.02
    assert theta_1[-1] == pytest.approx(2.0 * np.pi + np.arctan2(-0.08, -0.30))
    for before, y in pairwise(ys):
        if before.phase == y.phase == TaskPhase.CARRY:
            np.testing.assert_allclose(y.qd_ref * 0.02, y.q_ref - before.q_ref, atol=2e-4)


def test_it_waits_above_the_object_until_it_may_go():
    unit = PickAndPlace(SHORT)
    for k in range(50):
        y = unit.step(0.02 * k, 0.02, Inputs(go=False))
        assert (y.phase, y.vacuum) == (TaskPhase.SETTLE, False)
    assert unit.step(1.0, 0.02, Inputs()).phase == TaskPhase.DESCEND
    assert unit.step(1.02, 0.02, Inputs(go=False)).phase == TaskPhase.DESCEND


def test_a_restored_state_goes_on_bit_for_bit():
    assert_continues(lambda: PickAndPlace(SHORT), lambda _: Inputs(), [20, 60], 100, 0.02)


def test_a_task_that_cannot_be_done_is_refused_with_all_faults(wording: Wording):
    for params in (
        replace(SHORT, p_WQ=np.array([0.6, 0.0, 0.06])),
        replace(SHORT, p_WP=np.array([0.25, 0.0, 0.06]), p_WQ=np.array([-0.25, 0.0, 0.06])),
        replace(SHORT, p_WP=np.array([1e9, 0.0, 0.06])),
        replace(SHORT, p_WQ=SHORT.p_WP),
        replace(SHORT, wait=-1.0),
    ):
        with pytest.raises(InvalidTask) as caught:
            PickAndPlace(params)
        wording.check(caught.value)
