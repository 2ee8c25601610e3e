"""A participant's practice: how much of it is over, the device's test in it, and when its object is out of reach.

The test has places to which the hand is moved, directions in which it is turned, and fists. The thesis shows for its
own device that the simulated hand follows along and about each axis, and closes, figures 4.21 to 4.27: a hand was moved
and turned twice to the ends of what the device sees, and closed twice. Here a person moves it to the ends along each
axis, turns it both ways about each, one after the other, and closes it twice; how long each took is kept with the
session. A finger on a screen does not turn the hand, and a script does not: of them that is not asked.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.cosim.blocks.plain_rotation import quaternion, rotation_vector
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.study.folder.session_folder import SessionFolder
from handover.scenarios.study.plan.led_hands import led_hand_of
from handover.scenarios.study.session.trial import Trial

_ENDS = (("x", (0.18, 0.0, 0.0)), ("y", (0.0, 0.15, 0.0)), ("z", (0.0, 0.0, 0.12)))
"""Ways along each axis of W from where the hand rests to the places to which it is moved, m (assumed)."""
_TURNS = (("roll", (1.0, 0.0, 0.0)), ("pitch", (0.0, 1.0, 0.0)), ("yaw", (0.0, 0.0, 1.0)))
"""Axes in W, about which the hand is turned from where it rests: x away from the person, y to the left, z up."""
_CLOSE, _ANGLE, _STAY = 0.03, 0.4, 0.3
"""How near to a place, m, how far turned, rad, and for how long, s, it counts as reached (assumed)."""
_FISTS = 2
_TURNING = ("mouse", "gamepad", "webcam", "tracker")
"""Devices that turn the hand."""


@dataclass(frozen=True)
class Reached:
    """A place of the test that was reached, a turn, or a fist.

    Attributes:
        name: such as "+x", "-roll", or "fist".
        seconds: from when it was asked for.
    """

    name: str
    seconds: float


class DeviceTest:
    """Asks for one place after the other, by what the run shows of the hand.

    Args:
        device: by which the hand is led.
        led: the hand.

    Attributes:
        reached: what was done.
    """

    def __init__(self, device: str, led: LedHand) -> None:
        turns = [(f"{sign}{axis}", None) for axis, _ in _TURNS for sign in "+-"] if device in _TURNING else []
        self._unit = led.unit
        self._asked = [*_places(np.array(led.p_WH_0)), *turns, *(("fist", None) for _ in range(_FISTS))]
        self.reached: list[Reached] = []
        self._since, self._there = 0.0, 0.0
        self._last: float | None = None
        self._was_closed = False

    @property
    def target(self) -> dict[str, Any]:
        """What is asked for: name, place in W, m, None for a turn and a fist, and what is done of all."""
        done, of = len(self.reached), len(self._asked)
        if done == of:
            return {"name": "", "place": None, "done": done, "of": of}
        name, place = self._asked[done]
        return {"name": name, "place": None if place is None else place.tolist(), "done": done, "of": of}

    @property
    def shown(self) -> dict[str, Any]:
        """What is kept of the test."""
        return {
            "asked": [name for name, _ in self._asked],
            "reached": [{"name": r.name, "seconds": round(r.seconds, 3)} for r in self.reached],
        }

    def observe(self, t: float, row: Record) -> bool:
        """Take in the run at time t of the practice, s; return whether something else is asked for than before."""
        first, self._last, dt = self._last is None, t, 0.0 if self._last is None else max(0.0, t - self._last)
        if len(self.reached) == len(self._asked):
            return first
        name, place = self._asked[len(self.reached)]
        closed = bool(row[f"{self._unit}.closed_goal"][0])
        if name == "fist":
            is_done, self._was_closed = closed and not self._was_closed, closed
        else:
            near = self._is_near(row, place) if place is not None else _is_turned(row[f"{self._unit}.q_WH"][0], name)
            self._there = self._there + dt if near else 0.0
            is_done, self._was_closed = self._there >= _STAY, closed
        if not is_done:
            return first
        self.reached.append(Reached(name, t - self._since))
        self._since, self._there = t, 0.0
        return True

    def _is_near(self, row: Record, place: Floats) -> bool:
        return float(np.linalg.norm(row[f"{self._unit}.p_WH"][0] - place)) < _CLOSE


def _places(rest: Floats) -> list[tuple[str, Floats | None]]:
    """Return the ends along each axis from where the hand rests, in W, m."""
    return [(f"{sign}{axis}", rest + s * np.array(way)) for axis, way in _ENDS for sign, s in (("+", 1.0), ("-", -1.0))]


def _is_turned(q_WH: Floats, name: str) -> bool:
    """Return whether the hand is turned from its rest, where its axes are those of W, as far as is asked for."""
    turned = float(np.dot(rotation_vector(quaternion(q_WH)), dict(_TURNS)[name[1:]]))
    return (turned if name[0] == "+" else -turned) >= _ANGLE


PRACTICE = "handover.scenarios.robots.free_flyer.handover.hand_practice:HandPractice"
_LOST_FROM = 0.7
"""How far from its first place the object of the practice is lost, m; the practice then begins anew (assumed)."""
_SHORTEST = 1.0
"""Practice that is left and not begun any more, s."""


class Practice:
    """The practice of one session, which may go on over several runs.

    Args:
        session: whose it is.

    Attributes:
        session: likewise.
        done: simulated time that was practised in runs that have ended, s.
        test: of the device.
    """

    def __init__(self, session: SessionFolder) -> None:
        self.session = session
        self.done = 0.0
        self.test = DeviceTest(session.session.device, led_hand_of(PRACTICE, ()))

    @property
    def left(self) -> float:
        """Simulated time that is left, s."""
        return self.session.plan.practice - self.done

    @property
    def goes_on(self) -> bool:
        """Whether there is time left for one more run."""
        return self.left > _SHORTEST

    @property
    def parameters(self) -> list[str]:
        """Those of its next run."""
        return [f"duration={max(_SHORTEST, self.left)!r}"]

    def count(self, row: Record | None) -> None:
        """Count a run that has ended, by its last row."""
        self.done += 0.0 if row is None else float(row.time[0])

    def observe(self, row: Record) -> bool:
        """Take in the run under way; return whether something else is asked for than before."""
        return self.test.observe(self.done + float(row.time[0]), row)

    @property
    def shown(self) -> dict[str, object]:
        """What is kept of it."""
        return {"practised": round(self.done, 3), **self.test.shown}


def is_lost(trial: Trial) -> bool:
    """Return whether the object of the practice is where no hand can get it."""
    row = trial.newest
    if row is None or trial.first_place is None:
        return False
    return float(np.linalg.norm(row[f"{trial.led.unit}.p_WO"][0] - trial.first_place)) > _LOST_FROM
