import dataclasses
from typing import Any

import numpy as np
import pytest

from handover.controllers.ir_grasp.parameters import Strategy
from handover.plants.ir_grasp.hand import PALM
from handover.plants.ir_grasp.objects import SOLIDS, Thing, outlines
from handover.scenarios.ir_grasp.parameters import Parameters, Situation

EXACT: dict[str, Any] = {"vision_position": 0.0, "vision_yaw": 0.0}


def test_strategies_meet_the_same_scene():
    drawn = [Situation.draw(Parameters(strategy=s, literal=l), 7) for s in Strategy for l in (False, True)]
    first = dataclasses.astuple(drawn[0])
    for other in drawn[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(first, dataclasses.astuple(other), strict=True))


def test_a_nominal_object_is_where_vision_saw_it_and_the_palm_a_standoff_before_it():
    s = Situation.draw(Parameters(perturbed=False, standoff=0.05, **EXACT), 1)
    assert s.p_WO.tolist() == [0.0, 0.0]
    assert s.turn == 0.0
    assert s.p_WH_pregrasp == pytest.approx([-0.033 - 0.05 - PALM[1][0], 0.0])
    assert s.p_WH_start == pytest.approx(s.p_WH_pregrasp - [Parameters().run_up, 0.0])


def test_the_hand_comes_before_the_middle_of_what_is_seen():
    p = Parameters(thing=Thing.BABY_CUP_A, perturbed=False, **EXACT)  # its handle points to the side
    body, handle = outlines(SOLIDS[Thing.BABY_CUP_A])
    middle = (handle[:, 0].max() + body[:, 0].min()) / 2.0
    assert middle > 0.005
    assert Situation.draw(p, 0).p_WH_pregrasp[1] == pytest.approx(middle)


def test_perturbations_are_within_their_bounds_and_never_towards_the_hand():
    p = Parameters()
    drawn = [Situation.draw(p, seed) for seed in range(300)]
    shifts = np.array([s.p_WO for s in drawn])
    lengths = np.linalg.norm(shifts, axis=1)
    assert p.shift_least <= lengths.min() < p.shift_least + 0.001
    assert p.shift_most - 0.001 < lengths.max() <= p.shift_most
    assert shifts[:, 0].min() >= -1e-12
    assert abs(np.mean(shifts[:, 1])) < 0.005
    assert max(abs(s.turn) for s in drawn) == pytest.approx(p.turn_most, rel=0.02)


def test_vision_is_off_by_its_deviations():
    p = Parameters()
    drawn = [Situation.draw(p, seed) for seed in range(1000)]
    off = np.array([[*s.p_WH_pregrasp, s.yaw] for s in drawn])
    assert np.std(off, axis=0) == pytest.approx([p.vision_position, p.vision_position, p.vision_yaw], rel=0.1)
