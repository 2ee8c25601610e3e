"""What the person did wrong in a handover in microgravity, by ground truth, and the causes of failures."""

import enum
import math
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    Vector,
    add,
    add_scaled,
    column,
    dot,
    inverse_rotate,
    norm,
    quaternion,
    rotate,
    rotation_matrix,
    scale,
    subtract,
    vector,
)
from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.plants.free_flyer.hand.parameters import Params as PersonParams

_TOUCH = 0.3
"""Force from which a hand has bumped the object, or a push has met the gripper, N (assumed; tremor gives less)."""
_AT_ONCE = 0.1
"""Time within which an object is free that the hand lets go of, s (assumed; a few steps)."""
_SHORTLY = 3.0
"""Time for which a bump may be what the robot felt, s (assumed)."""
_NEEDED = ("activity", "f_G", "f_H", "p_WH", "p_WO", "q_WO", "gripper_angle")


class Cause(enum.IntEnum):
    """Why a handover failed, for counting; the reason says it in words."""

    NONE = 0
    NOT_FETCHED = 1
    OUT_OF_REACH = 2
    MISSED_BY_HAND = 3
    PUSHED_BESIDE = 4
    NOT_FELT = 5
    NOT_TRIED = 6
    BUMPED = 7
    RELEASED_UNHELD = 8
    LET_GO_EARLY = 9
    RECEPTIONS_FAILED = 10
    SLIPPED = 11
    DELIVERIES_FAILED = 12
    OUT_OF_TIME = 13
    OTHER = 14
    NOT_SETTLED = 15
    NOT_RETREATED = 16
    TORN_OUT = 17

    @property
    def words(self) -> str:
        """The cause in plain words."""
        return self.name.lower().replace("_", " ")


@dataclass
class Miss:
    """A hand that closed beside the object: when, s, and the object's end from it along and across the sight, m."""

    t: float
    depth: float
    aside: float

    @property
    def words(self) -> str:
        """By how much and in which direction."""
        if abs(self.depth) < self.aside:
            return f"{1000.0 * self.aside:.0f} mm to the side"
        short = "short of it" if self.depth > 0.0 else "beyond it"
        return f"{1000.0 * abs(self.depth):.0f} mm in depth, {short}"


@cache
def _angle_object() -> float:
    """Return the angle of the gripper closed on the object, rad."""
    opened, empty = float(_of_person("angle_open")), float(_of_person("angle_empty"))
    return empty + (opened - empty) * float(_of_person("object_size")[2] / _of_person("aperture"))


def _force(signals: Signals, name: str) -> float:
    """Return the force on the gripper, `f_G`, or on the hand, `f_H`, N."""
    return math.hypot(*signals.plain(f"person.{name}"))


def _of_person(name: str) -> Floats:
    return np.array(vars(PersonParams())[name], dtype=np.float64)


@dataclass
class PersonsDeeds:
    """Follows the person through a run; without the outputs that it needs, nothing is known.

    Attributes:
        misses: times that the hand closed and did not get the object.
        made_good: how many of them were before it last got it, and so are no cause of what failed later.
        pulled: whether the person has pulled or pushed since the last signal.
        met: greatest force on the gripper in that, N; what the hand feels has the inertia of the object in it.
        led: whether a track, or somebody outside, leads the hand, which tells no activity.
        by_track: whether it is a track.
        opened: since when it has been wanted open, s, and how far the object was from G then, m; None while closed.
        nearest: of such a hand to the object's end, or of the object in it to G, since the last signal, m.
        tried: whether such a hand was closed since the last signal.
        beside: how far from G, across the fingers, the object was at the last push, m; None before.
        known: whether the outputs that it needs are there; None before the first instant.
        activity: what the person does.
        code: the same as a number.
        closing: the last hand that closed, and whether it got the object, in `got`; `grasping`: it is closed.
        bump: when an open hand bumped the object hardest of late, s, and how hard, N.
        let_go: when the person last let go, s, and who held the object just before.
        closed: when the gripper's fingers last closed as far as the object is thick, s.
        angle: of the gripper, rad.
    """

    misses: list[Miss] = field(default_factory=list[Miss])
    made_good: int = 0
    pulled: bool = False
    met: float = 0.0
    led: bool = False
    by_track: bool = False
    opened: tuple[float, float] | None = None
    nearest: float = math.inf
    tried: bool = False
    beside: float | None = None
    known: bool | None = None
    activity: str = ""
    code: int = -1
    closing: Miss | None = None
    got: bool = False
    grasping: bool = False
    bump: tuple[float, float] | None = None
    let_go: tuple[float, str] | None = None
    closed: float | None = None
    angle: float = math.inf

    def signalled(self) -> None:
        """Begin to count what the person does anew."""
        self.pulled, self.met, self.nearest, self.tried = False, 0.0, math.inf, False

    def follow(self, t: float, signals: Signals, holder: str, held_before: str) -> None:
        """Follow the person by the outputs of an instant; `held_before` is who held the object at the last one."""
        if self.known is None:
            self.known = all(f"person.{name}" in signals for name in _NEEDED)
            self.led &= "person.closed_goal" in signals
        if not self.known:
            return
        code, before = signals.plain("person.activity"), self.activity
        activity = before if code == self.code else signals.text("person.activity")
        self.code, angle = code, signals.plain("person.gripper_angle")
        if angle <= _angle_object() + 1e-6 < self.angle:
            self.closed = t
        self.angle = angle
        if activity in ("PULL", "PUSH"):
            self.pulled, self.met = True, max(self.met, _force(signals, "f_G"))
        elif activity in ("REACH", "GRASP") and holder == "GRIPPER":
            self._follow_bump(t, _force(signals, "f_H"))
        if activity == "PUSH":
            self.beside = self._aside_of_fingers(signals)
        if self.led:
            if signals.plain("person.closed_goal"):
                self.opened, self.tried = None, True
            elif self.opened is None:
                self.opened = (t, norm(_line_from_fingers(signals)))
            if holder in ("GRIPPER", "HAND"):
                self.nearest = min(self.nearest, self._from_transfer(signals, holder))
        self._follow_grasp(t, signals, activity, holder)
        if activity == "LET_GO" != before:
            self.let_go = (t, held_before)
        self.activity = activity

    def released(self, t: float, seen: str, pushed: float) -> tuple[Cause, str]:
        """Return why a robot that had `seen` something let go of an object that nobody had taken, lost at t.

        It was last pushed by hand at `pushed`, s.
        """
        opened = f"the robot opened its gripper though the person did not hold the object, which was lost at {t:.1f} s"
        if self.let_go is not None and self.let_go[1] == "BOTH":
            return Cause.RELEASED_UNHELD, f"{opened}: the person had let go of it at {self.let_go[0]:.1f} s, unfelt"
        if self.bump is not None and t - self.bump[0] < _SHORTLY:
            bumped = f"what it felt was the open hand, which bumped the object with {self.bump[1]:.1f} N"
            return Cause.BUMPED, f"{opened}: {bumped} at {self.bump[0]:.1f} s"
        if t - pushed < _SHORTLY:
            return Cause.RELEASED_UNHELD, f"{opened}: what it felt was the push by hand on itself, until {pushed:.1f} s"
        felt = ", but ".join(filter(None, ("" if self.pulled else "nobody had pulled", seen)))
        return Cause.RELEASED_UNHELD, f"{opened}: {self._missed() or felt or 'why is unknown'}"

    def dropped(self, t: float) -> tuple[Cause, str]:
        """Return why the hand lost the object at t, of which the gripper had no hold."""
        if self.opened is not None and 0.0 <= t - self.opened[0] < _SHORTLY:
            opened, apart = self.opened
            how = "the track that leads the hand opened it" if self.by_track else "the hand was opened"
            text = f"{how} at {opened:.1f} s, with the object in it"
            return Cause.LET_GO_EARLY, f"{text} {1000.0 * apart:.0f} mm from the gripper's fingers"
        if self.let_go is None or abs(self.let_go[0] - t) > _AT_ONCE:
            return Cause.SLIPPED, f"the object slipped out of the hand at {t:.1f} s"
        let_go = f"the person let go of the object at {t:.1f} s"
        if self.closed is not None and self.closed > t:
            return Cause.LET_GO_EARLY, f"{let_go}, {self.closed - t:.2f} s before the fingers closed"
        if self.closed is not None and self.beside is not None:
            return Cause.PUSHED_BESIDE, f"{let_go}, {1000.0 * self.beside:.0f} mm beside the fingers, which had closed"
        return Cause.LET_GO_EARLY, f"{let_go}, when the fingers had not closed"

    def unfelt(self, touch: str, fastest: float, threshold: float) -> tuple[Cause, str]:
        """Return why the robot felt no pull or push: its gripper's highest speed and threshold, m/s."""
        missed = self._missed()
        if missed:
            return Cause.MISSED_BY_HAND, missed
        if self.activity and not self.pulled and not self.led:
            return Cause.NOT_TRIED, f"the person did not {touch}"
        if self.beside is not None and self.met < _TOUCH and touch == "push":
            return (
                Cause.PUSHED_BESIDE,
                f"the push went past the gripper, {1000.0 * self.beside:.0f} mm beside its fingers",
            )
        speed = math.ceil(1000.0 * fastest) / 1000.0
        return Cause.NOT_FELT, f"the {touch} stayed below the threshold: {speed:.3f} of {threshold:.3f} m/s"

    def untouched(self, touch: str, asked: float, track_end: float | None) -> tuple[Cause, str]:
        """Return why a hand that is led did not answer the signal of `asked`, s; a track ends at `track_end`."""
        if track_end is not None and track_end < asked:
            text = f"the track that leads the hand ended at {track_end:.1f} s, before the signal at {asked:.1f} s"
            return Cause.NOT_TRIED, text
        hand = "the hand that a track leads" if self.by_track else "the hand"
        if not math.isfinite(self.nearest):
            return Cause.NOT_TRIED, f"{hand} did not {touch}"
        what = hand if touch == "pull" else f"the object in {hand}"
        whom = "the object's end" if touch == "pull" else "the gripper"
        nearest = f"{1000.0 * self.nearest:.0f} mm"
        if touch == "pull" and not self.tried:
            return Cause.NOT_TRIED, f"{hand} was never closed; the nearest that it came to {whom} was {nearest}"
        return Cause.NOT_TRIED, f"{what} came no nearer than {nearest} to {whom}"

    def from_fingers(self, signals: Signals) -> float | None:
        """Return how far the object's centre line is from G, m, where the outputs tell it."""
        return norm(_line_from_fingers(signals)) if self.known else None

    def receptions(self) -> str:
        """Return what made receptions fail, if it is known."""
        return "" if self.beside is None else f": the object was {1000.0 * self.beside:.0f} mm beside the fingers"

    def _missed(self) -> str:
        misses = self.misses[self.made_good :]
        if not misses:
            return ""
        last, n = misses[-1], len(misses)
        often = f", the last of {n} times" if n > 1 else ""
        return f"the hand missed the object by {last.words}{often}"

    def _follow_grasp(self, t: float, signals: Signals, activity: str, holder: str) -> None:
        """Note a hand that closes, and, when its pull is over, or it opens, whether it had got the object.

        Of one that is led only what it does to an object in the gripper: elsewhere it may close for a push.
        """
        closed = bool(signals.plain("person.closed_goal")) if self.led else activity == "PULL"
        if closed and not self.grasping:
            depth, aside = self._from_end(signals)
            self.closing = Miss(t, depth, aside) if holder == "GRIPPER" or not self.led else None
            self.got = False
        if closed:
            self.got = self.got or holder in ("HAND", "BOTH")
            self.made_good = len(self.misses) if self.got else self.made_good
        elif self.grasping and self.closing is not None and not self.got:
            self.misses.append(self.closing)
        self.grasping = closed

    def _follow_bump(self, t: float, force: float) -> None:
        """Keep the hardest bump of the open hand of late."""
        last = self.bump
        if force > _TOUCH and (last is None or t - last[0] > _SHORTLY or force > last[1]):
            self.bump = (t, force)

    def _from_transfer(self, signals: Signals, holder: str) -> float:
        """Return how far a hand is from the object's end, or from G the object that it holds, m."""
        return norm(_line_from_fingers(signals)) if holder == "HAND" else math.hypot(*self._from_end(signals))

    def _from_end(self, signals: Signals) -> tuple[float, float]:
        """Return how far the object's end is from the hand along and across the line of sight, m."""
        R_WO = rotation_matrix(quaternion(signals["person.q_WO"]))
        end = rotate(R_WO, vector(_of_person("p_OH")))
        apart = subtract(add(vector(signals["person.p_WO"]), end), vector(signals["person.p_WH"]))
        sight = vector(_of_person("line_of_sight"))
        depth = dot(apart, sight)
        return depth, norm(add_scaled(apart, -depth, sight))

    def _aside_of_fingers(self, signals: Signals) -> float:
        """Return how far G is from the object's centre line, across the axis x of the gripper, m."""
        _, y, z = _line_from_fingers(signals)
        return math.hypot(y, z)


def _line_from_fingers(signals: Signals) -> Vector:
    """Return the point of the object's centre line that is nearest to G, as seen from G and in its axes, m."""
    axis = column(rotation_matrix(quaternion(signals["person.q_WO"])), 1)
    half = 0.5 * float(_of_person("object_size")[1])
    apart = subtract(vector(signals["robot.p_WG"]), vector(signals["person.p_WO"]))
    along = min(max(dot(apart, axis), -half), half)
    R_WG = rotation_matrix(quaternion(signals["robot.q_WG"]))
    return inverse_rotate(R_WG, subtract(scale(along, axis), apart))
