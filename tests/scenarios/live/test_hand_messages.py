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


def test_a_sample_sets_the_four_inputs_of_a_hand():
    sample = parse_hand_message(text(closed=True, q_WH=[0.999, 0.0, 0.0, 0.0], device="mouse"))
    entries = sample.entries(LED)
    assert {name: len(value) for name, value in entries.items()} == LED.inputs
    assert entries["person.q_WH_track"] == (1.0, 0.0, 0.0, 0.0)
    assert entries["person.finger_track"] == CLOSED
    assert entries["person.closed_track"] == (1.0,)
    assert (sample.stamp, sample.device) == (5.0, "mouse")
    assert parse_hand_message(text()).angles == STRAIGHT


def test_joints_say_whether_a_hand_grasps_unless_it_is_said():
    bent = [0.9 * angle for angle in CLOSED]
    assert parse_hand_message(text(closed=None, angles=bent)).closed
    assert not parse_hand_message(text(closed=None, angles=[0.1] * 14)).closed
    told = parse_hand_message(text(closed=False, angles=bent))
    assert not told.closed
    assert told.angles == tuple(bent)


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
        pytest.param(text(closed=1), id="a number for a switch"),
        pytest.param(text(closed=None), id="neither closed nor angles"),
        pytest.param(text(angles=[0.0] * 13), id="an angle too few"),
        pytest.param(text(angles=[0.0] * 3 + [2.0] + [0.0] * 10), id="a joint bent too far"),
        pytest.param(text(angles=[0.0] * 13 + [-0.1]), id="a joint bent backwards"),
        pytest.param(text(device="m" * 61), id="a long name"),
        pytest.param(text(sent=4.9), id="sent before it was seen"),
        pytest.param(text(sent="soon"), id="a text for a time"),
        pytest.param(text(q_WH=[2, 0, 0, 0], sent=4.9), id="two faults at once"),
    ],
)
def test_what_is_no_sample_is_refused_with_the_reason(sent: str, wording: Wording):
    with pytest.raises(InvalidHandMessage) as refused:
        parse_hand_message(sent)
    wording.check(refused.value)


@pytest.mark.parametrize("sent", ["[" * 1500, text(p_WH=[0.0, 0.0, 10**400])])
def test_deep_json_and_huge_numbers_are_no_sample(sent: str):
    with pytest.raises(InvalidHandMessage):
        parse_hand_message(sent)


def test_a_hand_wanted_beyond_reach_or_before_is_refused_and_the_next_one_taken():
    stream = HandStream(LED)
    with pytest.raises(InvalidHandMessage, match=r"p_WH: 1 m from where the hand rests.*it reaches 0\.9 m"):
        stream.take(text(p_WH=[0.6, 0.1, -0.05]))
    stream.take(text())
    for stamp in (5, 4.9):
        with pytest.raises(InvalidHandMessage, match=r"stamp: .* is not after the one before, 5 s"):
            stream.take(text(stamp=stamp))
    stream.take(text(stamp=5.1))


def test_a_stamp_far_ahead_is_refused_and_the_next_one_taken():
    now = [100.0]
    stream = HandStream(LED, lambda: now[0])
    stream.take(text(stamp=5))
    now[0] += 0.5
    with pytest.raises(InvalidHandMessage, match=r"stamp: 1e\+300 s is 1e\+300 s after .*, which came 0\.5 s ago"):
        stream.take(text(stamp=1e300))
    stream.take(text(stamp=5.5))
    now[0] += 120.0  # a device that was silent for so long
    stream.take(text(stamp=125.5))


@pytest.mark.parametrize(("first", "then"), [(5.0, 3605.0), (3605.0, 5.0), (1e12, 5.0)])
def test_a_device_whose_clock_is_set_is_refused_once(first: float, then: float):
    now = [100.0]
    stream = HandStream(LED, lambda: now[0])
    stream.take(text(stamp=first))
    now[0] += 0.1
    with pytest.raises(InvalidHandMessage, match="stamp"):
        stream.take(text(stamp=then))
    for k in range(1, 4):
        now[0] += 0.1
        _, at = stream.take(text(stamp=then + 0.1 * k))
        assert at == pytest.approx(now[0])


def test_stamps_that_stray_one_at_a_time_are_refused_and_all_others_taken():
    now = [100.0]
    stream = HandStream(LED, lambda: now[0])
    for k in range(40):
        now[0] += 1.0
        if k % 9 == 8:
            with pytest.raises(InvalidHandMessage, match="stamp"):
                stream.take(text(stamp=5e5 + k))
        else:
            stream.take(text(stamp=float(k)))


def test_samples_that_come_again_are_refused_however_many():
    now = [100.0]
    stream = HandStream(LED, lambda: now[0])
    stream.take(text(stamp=5))
    for stamp in (4.8, 4.9, 5.0):
        now[0] += 0.1
        with pytest.raises(InvalidHandMessage, match="is not after the one before, 5 s"):
            stream.take(text(stamp=stamp))


def test_a_flood_is_refused_until_it_ebbs():
    now = [100.0]
    stream = HandStream(LED, lambda: now[0])
    for k in range(MOST_A_SECOND):
        stream.take(text(stamp=k / MOST_A_SECOND))
    with pytest.raises(InvalidHandMessage, match="250 samples a second"):
        stream.take(text(stamp=1.0))
    now[0] += 1.1
    stream.take(text(stamp=1.1))


def test_stamps_of_another_clock_are_told_by_this_ones():
    rng = np.random.default_rng(0)
    clock, ages = DeviceClock(), list[float]()
    for k in range(200):
        seen = 0.016 * k
        stamp = clock.monotonic(seen - 1e4, seen + 0.0005 + float(rng.exponential(0.01)))
        ages.append(seen - stamp)
    assert np.abs(ages[50:]).max() < 0.002


def test_a_device_that_looks_at_pictures_first_tells_how_long_that_takes():
    clock = DeviceClock()
    ages = [t - clock.monotonic(t - 0.08, t, sent=t - 0.001) for t in np.arange(0.0, 1.0, 0.03)]
    assert ages == pytest.approx([0.079] * len(ages), abs=1e-9)
    assert parse_hand_message(text(stamp=5, sent=5.08)).sent == 5.08
