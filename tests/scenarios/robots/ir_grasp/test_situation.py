import dataclasses
from typing import Any

import numpy as np
import pytest
from support.wording import Wording

from handover.controllers.ir_grasp.parameters import Correction, Strategy
from handover.plants.ir_grasp.hand import PALM
from handover.plants.ir_grasp.objects import SOLIDS, Thing, outlines
from handover.scenarios.robots.ir_grasp.parameters import Expected, Parameters, Situation

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


def test_perturbations_are_within_their_bounds_never_towards_the_hand_and_vision_is_off_by_its_deviations():
    p = Parameters()
    drawn = [Situation.draw(p, seed) for seed in range(500)]
    shifts = np.array([s.p_WO for s in drawn])
    lengths = np.linalg.norm(shifts, axis=1)
    assert p.shift_least <= lengths.min() < p.shift_least + 0.001
    assert p.shift_most - 0.001 < lengths.max() <= p.shift_most
    assert shifts[:, 0].min() >= -1e-12
    assert abs(np.mean(shifts[:, 1])) < 0.005
    assert max(abs(s.turn) for s in drawn) == pytest.approx(p.turn_most, rel=0.02)
    off = np.array([[*s.p_WH_pregrasp, s.yaw] for s in drawn])
    assert np.std(off, axis=0) == pytest.approx([p.vision_position, p.vision_position, p.vision_yaw], rel=0.12)


def test_vision_places_the_hand_by_what_it_believes():
    p = Parameters(thing=Thing.DISC, disc_radius=0.047, perturbed=False, **EXACT)
    believed = dataclasses.replace(p, expected=Expected.DISC, expected_radius=0.033)
    cylinder = Situation.draw(Parameters(perturbed=False, **EXACT), 0).p_WH_pregrasp
    assert Situation.draw(believed, 0).p_WH_pregrasp == pytest.approx(cylinder)
    assert Situation.draw(p, 0).p_WH_pregrasp == pytest.approx(cylinder - [0.014, 0.0])
    bar = dataclasses.replace(p, expected=Expected.BAR, expected_size=np.array([0.11, 0.03]))
    assert Situation.draw(bar, 0).p_WH_pregrasp == pytest.approx(cylinder - [0.055 - 0.033, 0.0])
    across = dataclasses.replace(bar, expected_yaw=np.pi / 2.0)
    assert Situation.draw(across, 0).p_WH_pregrasp == pytest.approx(cylinder - [0.015 - 0.033, 0.0])


def test_the_belief_of_a_turned_bar_keeps_the_truth():
    p = Parameters(thing=Thing.PAPER_BOX_B, expected_yaw=0.4)
    assert p.expected_solid.parts == p.solid.parts == SOLIDS[Thing.PAPER_BOX_B].parts
    assert p.expected_solid.yaw == pytest.approx(SOLIDS[Thing.PAPER_BOX_B].yaw + 0.4)
    assert Situation.draw(p, 3).turn == Situation.draw(Parameters(), 3).turn


@pytest.mark.parametrize("perturbed", [False, True])
def test_a_shift_or_a_turn_replaces_what_is_drawn(perturbed: bool):
    s = Situation.draw(Parameters(perturbed=perturbed, shift=np.array([0.0, -0.07])), 5)
    assert (s.p_WO.tolist(), s.turn) == ([0.0, -0.07], 0.0)
    s = Situation.draw(Parameters(perturbed=perturbed, turn=1.1), 5)
    assert (s.p_WO.tolist(), s.turn) == ([0.0, 0.0], 1.1)
    same = Situation.draw(Parameters(perturbed=perturbed), 5)
    assert (same.p_WH_start == s.p_WH_start).all()  # what vision is off by is the same


CROSSING: dict[str, Any] = {"thing": Thing.POLYGON, "corners": np.zeros((8, 2)), "corner_count": 4}
CROSSING["corners"][:4] = 1e-3 * np.array([[0, 0], [40, 40], [40, 0], [0, 40]])


@pytest.mark.parametrize(
    ("faults", "given"),
    [
        (2, {**CROSSING, "shift_least": 0.06, "shift_most": 0.05}),
        (1, {"literal": True, "correction": Correction.FAST}),
        (0, {"literal": True, "correction": Correction.PAPER}),
    ],
)
def test_contradictions_are_refused(faults: int, given: dict[str, Any], wording: Wording):
    found = Parameters(**given).faults()
    assert len(found) == faults
    for fault in found:
        wording.check(fault)
