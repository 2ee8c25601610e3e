"""Samples of a hand as a page or a tracker sends them, and what is wrong with those that are none.

The form of messages and answers is in `docs/guides/live.md`, "A tracker of your own".
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from msgspec import Meta

from handover.cosim.typed_data import InvalidData, checked, decoded
from handover.plants.free_flyer.hand.hand_kinematics import CLOSED, JOINT_MAX, JOINTS, STRAIGHT
from handover.scenarios.experiment.live_inputs import LedHand

LONGEST = 2000
"""Characters; no sample is longer."""
MOST_A_SECOND = 250
"""Samples that are taken within a second; a tracker gives a hundred or so."""
_ROUNDING = 1e-6
"""Metres and radians by which a sample may be beyond its limits."""
_UNIT = 0.01
"""How far a quaternion's norm may be from 1."""
_CLOCK_JUMP = 10.0
"""How much more or less a device's clock may have gone on than this computer's since the sample before, s (assumed)."""
_WINDOW = 600
"""Over how many samples the clock of a device is compared with this computer's."""


class InvalidHandMessage(ValueError):
    """What came is not a sample of a hand, or not one that may be used."""


_Joint = Annotated[float, Meta(ge=-_ROUNDING, le=JOINT_MAX + _ROUNDING)]


Stamp = Annotated[float, Meta(ge=-1e12, le=1e12)]
"""A time by a device's clock, s."""


@dataclass(frozen=True)
class _SentSample:
    """A sample as it came; a text's members are these."""

    p_WH: tuple[float, float, float]
    q_WH: tuple[float, float, float, float]
    stamp: Stamp
    closed: bool | None = None
    angles: Annotated[tuple[_Joint, ...], Meta(min_length=JOINTS, max_length=JOINTS)] | None = None
    device: Annotated[str, Meta(max_length=60)] = ""
    sent: Stamp | None = None


class HandSample(NamedTuple):
    """A hand as a device sees it: pose in W, m, scalar first; joints, rad; whether it grasps; when seen and sent, s."""

    p_WH: tuple[float, ...]
    q_WH: tuple[float, ...]
    angles: tuple[float, ...]
    closed: bool
    stamp: float
    device: str = ""
    sent: float | None = None

    @classmethod
    def at_rest(cls, led: LedHand, stamp: float = 0.0) -> "HandSample":
        """Return a hand where it rests, open, its axes those of W."""
        return cls(led.p_WH_0, (1.0, 0.0, 0.0, 0.0), STRAIGHT, closed=False, stamp=stamp)

    def entries(self, led: LedHand) -> dict[str, Sequence[float]]:
        """Return what an `SharedInputs` takes of it."""
        values = {
            "p_WH_track": self.p_WH,
            "q_WH_track": self.q_WH,
            "finger_track": self.angles,
            "closed_track": (float(self.closed),),
        }
        return {f"{led.unit}.{name}": entries for name, entries in values.items()}


def hand_start(led: LedHand, wanted: HandSample) -> dict[str, Any]:
    """Return, as JSON can hold it, where a hand is wanted as a device begins to lead it, and how far it goes."""
    pose = {"p_WH": list(wanted.p_WH), "q_WH": list(wanted.q_WH), "angles": list(wanted.angles)}
    return {**pose, "closed": wanted.closed, "centre": list(led.p_WH_0), "radius": led.reach}


def parse_hand_message(text: str) -> HandSample:
    """Return the sample that a text says.

    Raises:
        InvalidHandMessage: it says none.
    """
    if len(text) > LONGEST:
        raise InvalidHandMessage(f"a sample has {LONGEST} characters at most, this one {len(text)}")
    try:
        content: Any = decoded(text, object)
    except InvalidData as e:
        raise InvalidHandMessage(str(e)) from e
    return hand_sample(content)


def hand_sample(content: Any) -> HandSample:
    """Return the sample that an object says.

    Raises:
        InvalidHandMessage: it says none.
    """
    try:
        sent = checked(content, _SentSample)
    except InvalidData as e:
        raise InvalidHandMessage(f"not an object with p_WH, q_WH, closed or angles, and stamp: {e}") from e
    faults = list[str]()
    norm = math.hypot(*sent.q_WH)
    if abs(norm - 1.0) > _UNIT:
        faults.append(f"q_WH: expected a quaternion of norm 1, not {norm:.3g}")
    if sent.sent is not None and sent.sent < sent.stamp:
        faults.append(f"sent: {sent.sent:.6g} s is before stamp, {sent.stamp:.6g} s")
    if sent.closed is None and sent.angles is None:
        faults.append("closed or angles: one of them is needed")
    if faults:
        raise InvalidHandMessage("; ".join(faults))
    angles = (CLOSED if sent.closed else STRAIGHT) if sent.angles is None else sent.angles
    return HandSample(
        sent.p_WH,
        tuple(x / norm for x in sent.q_WH),
        tuple(min(max(a, 0.0), JOINT_MAX) for a in angles),
        _grasps(angles) if sent.closed is None else sent.closed,
        sent.stamp,
        sent.device,
        sent.sent,
    )


def _grasps(angles: Sequence[float]) -> bool:
    """Return whether a hand with these joints grasps: they are bent more than half as far as of a closed one."""
    return sum(angles) > 0.5 * sum(CLOSED)


class DeviceClock:
    """Turns stamps of a device's clock into those of this computer's monotonic clock.

    The least of arrival minus sending over the last samples is taken for the difference of the clocks; so ages are too
    short by the shortest time that a sample takes from the device to here, on one computer less than a millisecond.
    Where a device does not tell when it sends, that is its stamp, and what it takes to see a hand is not known.
    """

    def __init__(self) -> None:
        self._differences: list[float] = []

    def monotonic(self, stamp: float, arrival: float, sent: float | None = None) -> float:
        """Return the monotonic time, s, of a stamp, s.

        Args:
            stamp: by the device's clock, s.
            arrival: when the sample arrived, monotonic time, s.
            sent: when it was sent, by the device's clock, s; None where the device does not tell.
        """
        self._differences.append(arrival - (stamp if sent is None else sent))
        del self._differences[:-_WINDOW]
        return stamp + min(self._differences)


class HandStream:
    """Samples of one device, one after the other, as far as they may be used.

    Args:
        led: the hand.
        clock: this computer's monotonic clock.
    """

    def __init__(self, led: LedHand, clock: Callable[[], float] = time.monotonic) -> None:
        self._led, self._clock = led, clock
        self._device_clock = DeviceClock()
        self._last: tuple[float, float] | None = None  # stamp and arrival
        self._after_jump: tuple[float, float] | None = None  # stamp and arrival of a sample far from the one before
        self._arrivals: list[float] = []

    def take(self, text: str) -> tuple[HandSample, float]:
        """Return a sample, and its stamp by this computer's clock, s.

        Raises:
            InvalidHandMessage: it is none, is wanted beyond reach, is older than the one before, or one too many.
        """
        arrival = self._clock()
        self._arrivals = [t for t in self._arrivals if arrival - t < 1.0]
        if len(self._arrivals) >= MOST_A_SECOND:
            raise InvalidHandMessage(f"{MOST_A_SECOND} samples a second are taken at most")
        self._arrivals.append(arrival)
        return self.check(parse_hand_message(text), arrival)

    def check(self, sample: HandSample, arrival: float) -> tuple[HandSample, float]:
        """Return a sample that arrived at the monotonic time `arrival`, s, and its stamp by this computer's clock, s.

        Raises:
            InvalidHandMessage: it is wanted beyond reach, is not after the one before, or far ahead of it.
        """
        far = math.dist(sample.p_WH, self._led.p_WH_0)
        if far > self._led.reach + _ROUNDING:
            rest, reach = list(self._led.p_WH_0), self._led.reach
            raise InvalidHandMessage(f"p_WH: {far:.3g} m from where the hand rests, {rest} m; it reaches {reach:g} m")
        if self._last is not None:
            self._check_stamp(sample.stamp, arrival, *self._last)
        self._last, self._after_jump = (sample.stamp, arrival), None
        return sample, self._device_clock.monotonic(sample.stamp, arrival, sample.sent)

    def _check_stamp(self, stamp: float, arrival: float, last: float, last_arrival: float) -> None:
        """Raise InvalidHandMessage for a stamp that does not follow the last one.

        Two in succession that follow each other, though far from the last one, show that the device's clock was set
        or this computer slept: then its clock is measured anew.
        """
        since, passed = stamp - last, arrival - last_arrival
        jumped = abs(since - passed) > _CLOCK_JUMP
        if since > 0.0 and since - passed <= _CLOCK_JUMP:
            return
        before, self._after_jump = self._after_jump, (stamp, arrival) if jumped else None
        if jumped and before is not None and 0.0 < stamp - before[0] <= arrival - before[1] + _CLOCK_JUMP:
            self._device_clock = DeviceClock()
            return
        if since <= 0.0:
            raise InvalidHandMessage(f"stamp: {stamp:.6g} s is not after the one before, {last:.6g} s")
        raise InvalidHandMessage(
            f"stamp: {stamp:.6g} s is {since:.3g} s after the one before, which came {passed:.3g} s ago"
        )
