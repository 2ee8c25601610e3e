"""The test of a device: the ends along each axis, turns about each, fists, by what a run shows of the hand."""

from typing import Any, cast

import numpy as np
import pytest

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.study.session.practice import DeviceTest

REST = (-0.4, 0.1, -0.05)
LED = LedHand("person", REST, 0.8)
ANGLES = {"roll": 0, "pitch": 1, "yaw": 2}


def row(p: Any, turn: tuple[int, float] = (0, 0.0), *, closed: bool = False) -> Record:
    """Return a row of a run: a hand at p, turned by an angle, rad, about an axis of W."""
    axis, angle = turn
    q = np.zeros(4)
    q[0], q[1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    shown = {"person.p_WH": np.array([p]), "person.q_WH": np.array([q]), "person.closed_goal": np.array([closed])}
    return cast(Record, shown)


def stays(test: DeviceTest, t: float, shown: Record) -> float:
    """Let a hand stay for half a second; return the time after it."""
    for k in range(6):
        test.observe(t + 0.1 * k, shown)
    return t + 0.5


def test_places_turns_and_fists_are_asked_for_one_after_the_other():
    test, t = DeviceTest("mouse", LED), 0.0
    while len(test.reached) < 6:
        t = stays(test, t, row(test.target["place"]))
    for name in ("+roll", "-roll", "+pitch", "-pitch", "+yaw", "-yaw"):
        assert (test.target["name"], test.target["place"]) == (name, None)
        axis, sign = ANGLES[name[1:]], 1.0 if name[0] == "+" else -1.0
        for wrong in ((axis, -sign * 0.6), (axis, sign * 0.3), ((axis + 1) % 3, sign * 0.6)):
            t = stays(test, t, row(REST, wrong))
        assert test.target["name"] == name
        t = stays(test, t, row(REST, (axis, sign * 0.45)))
    for _ in range(2):
        assert test.target["name"] == "fist"
        t = stays(test, t, row(REST))
        t = stays(test, t, row(REST, closed=True))
    assert test.target == {"name": "", "place": None, "done": 14, "of": 14}
    assert [r["name"] for r in test.shown["reached"]] == test.shown["asked"]


def test_the_same_turn_by_the_other_quaternion_counts():
    test, t = DeviceTest("tracker", LED), 0.0
    while len(test.reached) < 6:
        t = stays(test, t, row(test.target["place"]))
    shown = cast(dict[str, Any], row(REST, (0, 0.5)))
    shown["person.q_WH"] = -shown["person.q_WH"]
    stays(test, t, cast(Record, shown))
    assert test.target["name"] == "-roll"


@pytest.mark.parametrize("device", ["touch", "script"])
def test_devices_that_do_not_turn_the_hand_are_not_asked_to(device: str):
    assert DeviceTest(device, LED).shown["asked"] == ["+x", "-x", "+y", "-y", "+z", "-z", "fist", "fist"]
