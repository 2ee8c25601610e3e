"""What helps who leads a hand in a live page: where it says that closing gets the object, the plant agrees."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from support.plants.hand_scene import IDLE, Scene

from handover.cosim.blocks.plain_rotation import Vector
from handover.cosim.record.reader import Record
from handover.plants.free_flyer.hand.hand_and_object import Driver, Holder, StartHolder
from handover.plants.free_flyer.hand.hand_kinematics import CLOSED
from handover.scenarios.experiment.live_inputs import HandHint
from handover.scenarios.robots.free_flyer.handover.handovers import hand_hint

LED = replace(IDLE, driven_by=Driver.OUTSIDE, object_with=StartHolder.FREE, angle_0=0.79)
BEST = np.array([0.0, 0.045, 0.0])


class Row:
    """The last row of a record, of what a unit gives and gets."""

    def __init__(self, scene: Scene, closed: bool) -> None:
        y, u = scene.y, scene.u
        self._values: Mapping[str, Any] = {
            **{f"person.{name}": getattr(y, name) for name in ("p_WH", "p_WO", "q_WO", "holder")},
            "person.closed_goal": closed,
            "robot.p_WG": u.p_WG,
            "robot.q_WG": u.q_WG,
            "decision.speed_G": 0.045,
        }

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> Any:
        return np.array([self._values[name]])

    def items(self, _name: str) -> Mapping[int, str]:
        return {holder.value: holder.name for holder in Holder}


def hint_of(scene: Scene, receivers: tuple[str, ...], closed: bool = False) -> HandHint:
    hint = hand_hint(cast(Record, Row(scene, closed)), receivers, {"HAND": 0.059, "GRIPPER": 0.021})
    assert hint is not None
    return hint


@pytest.mark.parametrize(
    ("aside", "within"),
    [
        ((-0.025, 0.0, 0.0), True),
        ((0.018, 0.0, 0.02), True),
        ((0.0, 0.022, 0.0), True),
        ((-0.06, 0.0, 0.0), False),
        ((0.0, 0.054, 0.0), False),
        ((0.0, 0.0, -0.054), False),
    ],
)
def test_a_hand_within_reach_gets_the_object_as_it_closes_and_one_that_is_not_misses(aside: Vector, within: bool):
    scene, there = Scene(LED), BEST + np.array(aside)
    scene.go(0.4, p_WH_track=there - np.array([0.25, 0.0, 0.0]), closure=1.0)
    assert not hint_of(scene, ("HAND",)).within_reach
    for share in np.linspace(0.0, 1.0, 10):
        scene.go(0.08, p_WH_track=there - np.array([0.25 * (1.0 - share), 0.0, 0.0]))
    scene.go(0.3)
    hint = hint_of(scene, ("HAND",))
    assert hint.goal is not None
    assert hint.p_WH - hint.goal == pytest.approx(np.array(aside), abs=1e-3)
    assert hint.within_reach == within
    scene.go(0.8, closed_track=True, finger_track=np.array(CLOSED))
    assert (scene.y.holder == Holder.BOTH) == within
    hint = hint_of(scene, ("HAND",), closed=True)
    assert (hint.holds, "0.045 of 0.059 m/s" in hint.advice) == (within, within)


def test_the_object_in_a_hand_is_within_reach_between_the_fingers():
    scene = Scene(replace(LED, object_with=StartHolder.HAND), np.array([-0.1, 0.0, 0.0]))
    scene.go(0.1, closed_track=True)
    hint = hint_of(scene, ("GRIPPER",), closed=True)
    assert (hint.holds, hint.within_reach) == (True, False)
    assert hint.goal is not None
    scene.u.p_WG = scene.u.p_WG - (hint.goal - hint.p_WH)  # the gripper comes as far as the hand would go
    assert hint_of(scene, ("GRIPPER",), closed=True).within_reach
