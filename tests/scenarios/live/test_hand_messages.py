"""Samples of a hand: what is taken of them, and what is refused for which reason."""

import json
from typing import Any

import numpy as np
import pytest
from support.wording import Wording

from handover.plants.free_flyer.hand.hand_kinematics import CLOSED, STRAIGHT
from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.live.hand_messages import (
    LONGEST,
    MOST_A_SECOND,
    DeviceClock,
    HandStream,
    InvalidHandMessage,
    parse_hand_message,
)

LED = LedHand("person", (-0.4, 0.1, -0.05), 0.9)
SAMPLE: dict[str, Any] = {"p_WH": [-0.3, 0.0, 0.1], "q_WH": [1, 0, 0, 0], "closed": False, "stamp": 5}


def text(**other: Any) -> str:
    return json.dumps({name: value for name, value in {**SAMPLE, **other}.items() if value is not None})


def test_a_sample_sets_the_four_inputs_of_a_hand_and_its_joints_say_whether_it_grasps_unless_that_is_said():
    sample = parse_hand_message(text(closed=True, q_WH=[0.999, 0.0, 0.0, 0.0], device="mouse", sent=5.08))
    entries = sample.entries(LED)
    assert {name: len(value) for name, value in entries.items()} == LED.inputs
    assert entries["person.q_WH_track"] == (1.0, 0.0, 0.0, 0.0)
    assert entries["person.finger_track"] == CLOSED
    assert entries["person.closed_track"] == (1.0,)
    assert (sample.stamp, sample.device, sample.sent) == (5.0, "mouse", 5.08)
    assert parse_hand_message(text()).angles == STRAIGHT
    bent = [0.9 * angle for angle in CLOSED]
    assert parse_hand_message(text(closed=None, angles=bent)).closed
    assert not parse_hand_message(text(closed=None, angles=[0.1] * 14)).closed
    reported = parse_hand_message(text(closed=False, angles=bent))
    assert (reported.closed, reported.angles) == (False, tuple(bent))


@pytest.mark.parametrize(
    "sent",
    [
        pytest.param("{", id="cut off"),
        pytest.param("[]", id="a list"),
        pytest.param("{}", id="nothing"),
        pytest.param(" " * (LONGEST + 1), id="too long"),
        pytest.param(text(p_WH=[0.0, 0.0]), id="two coordinates"),
        pytest.param(text(p_WH=[0.0, 0.0, float("nan")]), id="no number"),
        pytest.param(text(p_WH=[0.0, 0.0, True]), id="a switch for a number"),
        pytest.param(text(q_WH=[0, 0, 0, 0]), id="no rotation"),
        pytest.param(text(stamp=float("inf")), id="a stamp for ever"),
        pytest.param(text(stamp=-1e308, sent=1e308), id="a stamp of no clock"),
        pytest.param(text(closed=1), id="a number for a switch"),
        pytest.param(text(closed=None), id="neither closed nor angles"),
        pytest.param(text(angles=[0.0] * 13), id="an angle too few"),
        pytest.param(text(angles=[0.0] * 3 + [2.0] + [0.0] * 10), id="a joint bent too far"),
        pytest.param(text(angles=[0.0] * 13 + [-0.1]), id="a joint bent backwards"),
        pytest.param(text(device="m" * 61), id="a long name"),
        pytest.param(text(sent=4.9), id="sent before it was seen"),
        pytest.param(text(sent="soon"), id="a text for a time"),
        pytest.param(text(q_WH=[2, 0, 0, 0], sent=4.9), id="two faults at once"),
        pytest.param(text(p_WH=[0.0, 0.0, 10**400]), id="a huge number"),
    ],
)
def test_what_is_no_sample_is_refused_with_the_reason(sent: str, wording: Wording):
    with pytest.raises(InvalidHandMessage) as refused:
        parse_hand_message(sent)
    wording.check(refused.value)


class Stream:
    """The samples of a device, by this computer's clock, which goes as the test says."""

    def __init__(self) -> None:
        self.now = 100.0
        self._stream = HandStream(LED, lambda: self.now)

    def take(self, stamp: float, after: float = 0.1, **other: Any) -> float:
        """Take a sample that comes after some time; return its stamp by this computer's clock."""
        self.now += after
        return self._stream.take(text(stamp=stamp, **other))[1]

    def refuse(self, stamp: float, after: float = 0.1, **other: Any) -> InvalidHandMessage:
        with pytest.raises(InvalidHandMessage) as refused:
            self.take(stamp, after, **other)
        return refused.value


def test_a_hand_wanted_beyond_reach_before_or_far_ahead_is_refused_and_the_next_one_taken(wording: Wording):
    stream = Stream()
    wording.check(stream.refuse(4.9, p_WH=[0.6, 0.1, -0.05]))
    stream.take(5.0)
    for stamp in (4.8, 4.9, 5.0):
        assert "not after the one before, 5 s" in str(stream.refuse(stamp))
    stream.take(5.4)
    wording.check(stream.refuse(1e11, after=0.5))
    stream.take(5.9, after=0.0)
    stream.take(125.9, after=120.0)  # it was silent for so long


@pytest.mark.parametrize(("first", "then"), [(5.0, 3605.0), (3605.0, 5.0), (1e12, 5.0)])
def test_a_device_whose_clock_is_set_is_refused_once(first: float, then: float):
    stream = Stream()
    stream.take(first)
    stream.refuse(then)
    for k in range(1, 4):
        assert stream.take(then + 0.1 * k) == pytest.approx(stream.now)


def test_stamps_that_stray_one_at_a_time_are_refused_and_all_others_taken():
    stream = Stream()
    for k in range(40):
        if k % 9 == 8:
            stream.refuse(5e5 + k, after=1.0)
        else:
            stream.take(float(k), after=1.0)


def test_a_flood_is_refused_until_it_ebbs(wording: Wording):
    stream = Stream()
    for k in range(MOST_A_SECOND):
        stream.take(k / MOST_A_SECOND, after=0.0)
    wording.check(stream.refuse(1.0, after=0.0))
    stream.take(1.1, after=1.1)


def test_stamps_of_another_clock_are_converted_to_this_one_also_of_a_device_that_looks_at_pictures_first():
    rng = np.random.default_rng(0)
    clock, ages = DeviceClock(), list[float]()
    for k in range(200):
        seen = 0.016 * k
        stamp = clock.monotonic(seen - 1e4, seen + 0.0005 + float(rng.exponential(0.01)))
        ages.append(seen - stamp)
    assert np.abs(ages[50:]).max() < 0.002
    clock = DeviceClock()
    ages = [t - clock.monotonic(t - 0.08, t, sent=t - 0.001) for t in np.arange(0.0, 1.0, 0.03)]
    assert ages == pytest.approx([0.079] * len(ages), abs=1e-9)
