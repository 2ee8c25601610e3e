"""A person who takes an object from a free-flying robot, gives it one, or only pushes it.

The effort of the arm that pulls or pushes follows from the speed that it gets to.
"""

import enum

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    Quaternion,
    Vector,
    add,
    add_scaled,
    column,
    distance,
    dot,
    lerp,
    nlerp,
    normalize,
    quaternion,
    quaternion_multiply,
    rotate,
    rotation_matrix,
    subtract,
    vector,
)
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.plants.free_flyer.hand.parameters import ContactParams, Motion, StartHolder
from handover.plants.free_flyer.hand.sight import CLOSING, ROUNDING, Perception, Sight
from handover.plants.hand_motion import minimum_jerk

_LENGTHENING = 1.3
"""Greatest force of an arm that is drawn back against its effort, over its force at rest (assumed)."""


class Effort:
    """Motion of the hand along an axis by an arm of mass m that exerts a force F against a load f.

        m dv/dt = F - f,  F = F_a g(v / v_0),  g(x) = min(1 - x, 1.3),

    F_a the force at rest, v_0 the speed of a hand that nothing resists: a hand that comes free is no faster than v_0.
    A single muscle's curve sags below this line (Hill), but that of a whole arm, of many muscles and joints, is close
    to straight. The rule is linearly implicit, hence stable at any step. At `length` the person stops the hand; there
    the arm's spring holds.

    Args:
        mass: m, in kg.

    Attributes:
        speed: of the hand along the axis, m/s.
        travelled: way along the axis, m.
    """

    def __init__(self, mass: float) -> None:
        self._mass = mass
        self.speed, self.travelled = 0.0, 0.0

    def begin(self) -> None:
        """Start from rest."""
        self.speed, self.travelled = 0.0, 0.0

    def advance(self, dt: float, force: float, free_speed: float, length: float, load: float) -> None:
        """Move for dt by a force at rest F_a against a load, both in N along the axis."""
        share, slope = 1.0 - self.speed / free_speed, force / free_speed
        if share > _LENGTHENING:
            share, slope = _LENGTHENING, 0.0
        self.speed += dt * (force * share - load) / (self._mass + dt * slope)
        self.travelled += dt * self.speed
        if self.travelled >= length:
            self.speed, self.travelled = 0.0, length


def force_at_rest(effort: float, clock: float, rise: float, end: float, fall: float) -> float:
    """Return F_a, N: it rises to the effort in the time `rise`, and from `end` falls to nothing in the time `fall`."""
    return effort * minimum_jerk(clock / rise) * (1.0 - minimum_jerk((clock - end) / fall))


_PEAK = 1.875
"""Highest speed of a minimum-jerk course over its mean speed: 15/8, of 30 s^2 - 60 s^3 + 30 s^4 at s = 1/2 (Flash and
Hogan, 1985)."""
_MIN_DURATION = 0.3
"""Seconds that each movement of a reach takes at least (assumed)."""
_READY = 0.15
"""Metres before what it grasps from which a hand comes on along its fingers, which reach 0.11 m
(assumed)."""
_OVERLAP = 0.4
"""Part of the shorter of a reach's two movements for which they overlap; their sum is no faster than either
(assumed)."""
_EASING = 3.0
"""Seconds in which a person who has pulled in vain eases off before letting go, half of the patience at most
(assumed)."""


class Activity(enum.IntEnum):
    """What the person does."""

    WAIT = 0
    REACH = 1
    GRASP = 2
    PULL = 3
    OFFER = 4
    PUSH = 5
    LET_GO = 6
    WITHDRAW = 7
    REST = 8


class FlyerPerson:
    """Moves a hand in minimum-jerk reaches, and pulls and pushes by an `Effort`, as the robot's actions allow.

    A reach is two minimum-jerk movements that overlap: to a place before its goal, and on along the straight fingers,
    as people come at what they grasp. A straight one would sweep object and gripper with the fingers, wherever they are
    higher than the hand rests. A hand leaves likewise, back along its fingers first.

    TAKE: REACH for the object's end p_OH, GRASP, PULL until the gripper has let go, WITHDRAW with the object, REST.
    GIVE: OFFER, to p_OG in front of the palm, PUSH against it until the gripper moves, LET_GO when it holds, WITHDRAW.
    PUSH: OFFER and PUSH with the fist beside the fingers, until the gripper moves; WITHDRAW with what the hand holds.

    A signal is the rising edge of the light. At later ones the person does motion_again; who was to TAKE and then GIVE,
    and has not yet got the object, takes first. What the person sees is acted on after a reaction time, drawn at each
    signal; a signal that comes in the middle of something waits until that is done, and so does one whose motion is not
    possible: TAKE with the object in the hand or out of reach, GIVE with it elsewhere.

    Each attempt has its errors of sight and of timing (`Sight`). Whether the fingers get the object is decided where
    they close, not here: a person who sees a closed hand empty, or a push that meets nothing, tries again, `attempts`
    times in all. By an error of timing the pull begins before the fingers are closed, and the hand lets go, or
    withdraws, before the gripper holds, or has let go. A hasty person withdraws with the object a reaction after having
    got it, whatever the gripper does, and lets go of it a reaction after the gripper began to close.
    """

    def __init__(self, params: ContactParams) -> None:
        self._p = params
        self._rng = np.random.default_rng([params.seed, 1])
        pull = np.asarray(params.pull_direction) / np.linalg.norm(params.pull_direction)
        self._pull = vector(pull)
        self.rest = vector(params.p_WH_0)
        self._rest_q = normalize(quaternion(np.asarray(params.q_WH_0)))
        self._end = vector(params.p_OH)
        self._offered = vector(params.p_OG)
        self.activity = Activity.WAIT
        self.p, self.q = self.rest, self._rest_q  # where the arm wants the hand, without tremor
        self.holding = params.object_with is StartHolder.HAND
        self.fingers = 1.0 if self.holding else 0.0  # 0 straight, 1 closed
        self._motion = Motion.NONE
        self._from, self._from_q = self.p, self.q
        self._near = max(_MIN_DURATION, _PEAK * _READY / params.reach_speed)  # duration of a reach's part at its goal
        self._far = 1.0  # and of the other one
        self._clock = 0.0  # seconds in this activity
        self._since = 0.0  # seconds for which the condition that ends it has held
        self._in_vain = 0.0  # seconds for which a closed hand has been empty, or a push at its end
        self._tries = 0  # since the signal
        self._sight = Sight(params)
        self._effort, self._axis = Effort(params.arm_mass), self._pull
        self._saw_light, self._called, self._answered = False, False, False
        self._got = self.holding  # whether the person has ever had the object
        self._reaction = params.reaction_time
        self._acts = {
            Activity.WAIT: self._waits,
            Activity.REACH: self._reaches,
            Activity.GRASP: self._grasps,
            Activity.PULL: self._pulls,
            Activity.OFFER: self._offers,
            Activity.PUSH: self._pushes,
            Activity.LET_GO: self._lets_go,
            Activity.WITHDRAW: self._withdraws,
            Activity.REST: self._waits,
        }

    @property
    def pushes_with_fist(self) -> bool:
        """Whether the hand is to be a fist that may touch the gripper."""
        return self._motion is Motion.PUSH and self.activity in (Activity.OFFER, Activity.PUSH, Activity.WITHDRAW)

    @property
    def reaches(self) -> bool:
        """Whether the hand is open, or closing, and its palm may meet the object."""
        return self.activity in (Activity.REACH, Activity.GRASP)

    def act(self, dt: float, there: Perception) -> None:
        """Advance by dt with what is there at its beginning."""
        seen = self._sight.look(dt, there)
        if seen.light and not self._saw_light:
            self._called = True
            spread = self._p.reaction_spread * float(self._rng.standard_normal())
            self._reaction = self._p.reaction_time * max(0.1, 1.0 + spread)
            if self.activity in (Activity.WAIT, Activity.REST):
                self._since = 0.0
        self._saw_light = seen.light
        self._clock += dt
        if self.holding and not seen.held and self.activity is not Activity.PULL:
            self.holding = False
            self._begin(Activity.WITHDRAW, seen)
        self._acts[self.activity](dt, seen)
        step = dt / self._p.grasp_time
        closed = self.holding or self.activity is Activity.GRASP or self.pushes_with_fist
        fingers = self.fingers + step if closed else self.fingers - step
        self.fingers = 1.0 if fingers > 1.0 - ROUNDING else 0.0 if fingers < ROUNDING else fingers

    def get_state(self) -> bytes:
        """Return the complete state."""
        where = (int(self.activity), int(self._motion), self.p, self.q, self._from, self._from_q, self._axis)
        signal = (self._saw_light, self._called, self._answered, self._got, self._reaction)
        effort = (self._effort.travelled, self._effort.speed)
        course = (self.holding, self.fingers, self._far, self._clock, self._since, *effort)
        tries = (self._tries, self._in_vain)
        return pack_state((where, signal, course, tries, self._sight.get_state(), self._rng.bit_generator))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this person or of one with equal parameters."""
        where, signal, course, tries, sight, self._rng.bit_generator.state = unpack_state(state)
        self._tries, self._in_vain = tries
        self._sight.set_state(sight)
        activity, motion, self.p, self.q, self._from, self._from_q, self._axis = where
        self.activity, self._motion = Activity(activity), Motion(motion)
        self._saw_light, self._called, self._answered, self._got, self._reaction = signal
        self.holding, self.fingers, self._far, self._clock, self._since = course[:5]
        self._effort.travelled, self._effort.speed = course[5:]

    def _begin(self, activity: Activity, seen: Perception) -> None:
        """Start an activity: courses go from where the hand is, or the arm wants it if it holds something."""
        if activity is Activity.LET_GO or not self.holding:
            self.p, self.q = seen.p_WH, seen.q_WH
        self.activity = activity
        self._got |= activity is Activity.WITHDRAW and self.holding
        self._clock, self._since, self._in_vain = 0.0, 0.0, 0.0
        self._effort.begin()
        if activity in (Activity.REACH, Activity.OFFER):
            self._tries += 1
            self._sight.begin_attempt()
        self._from, self._from_q = self.p, self.q
        goals = {Activity.REACH: self._at_object, Activity.OFFER: self._at_palm, Activity.WITHDRAW: self._at_rest}
        if activity in goals:
            goal, q = goals[activity](seen)
            leaves = activity is Activity.WITHDRAW
            a, b = (goal, _ready(self.p, self.q)) if leaves else (self.p, _ready(goal, q))
            self._far = max(_MIN_DURATION, _PEAK * distance(a, b) / self._p.reach_speed)

    def _waits(self, dt: float, seen: Perception) -> None:
        if not self._called:
            return
        self._since += dt
        self._motion = self._p.motion_again if self._answered and not self._still_takes else self._p.motion
        if self._since < self._reaction - ROUNDING or not self._can(seen):
            return
        self._called, self._answered, self._tries = False, True, 0
        starts = {Motion.TAKE: Activity.REACH, Motion.GIVE: Activity.OFFER, Motion.PUSH: Activity.OFFER}
        if self._motion in starts:
            self._begin(starts[self._motion], seen)

    @property
    def _still_takes(self) -> bool:
        """Whether the person was to take the object and then give it, and has not yet got it."""
        return self._p.motion is Motion.TAKE and self._p.motion_again is Motion.GIVE and not self._got

    def _can(self, seen: Perception) -> bool:
        if self._motion is Motion.NONE:
            return True
        takes = self._motion is Motion.TAKE
        if self._motion is not Motion.PUSH and takes is self.holding:
            return False
        goal, _ = self._at_object(seen) if takes else self._at_palm(seen)
        return distance(goal, self.rest) <= self._p.arm_reach

    def _reaches(self, dt: float, seen: Perception) -> None:  # noqa: ARG002
        self._approach(*self._at_object(seen))
        if self._has_taken(self._duration):
            self._begin(Activity.GRASP, seen)

    def _grasps(self, dt: float, seen: Perception) -> None:  # noqa: ARG002
        self.p, self.q = self._at_object(seen)
        if self._has_taken(self._p.grasp_time - self._sight.lead):
            self._begin(Activity.PULL, seen)
            self.holding = True

    def _pulls(self, dt: float, seen: Perception) -> None:
        self._pull_on(dt, seen)
        empty = self.fingers == 1.0 and not seen.held
        if self._is_in_vain(empty, dt):
            self.holding = False
            self._try_again(Activity.REACH, seen)
        elif self._has_taken(self._p.patience):
            self._let_go(seen)
        elif seen.held and self._has_seen(self._sight.takes_for_free(seen), dt):
            self._begin(Activity.WITHDRAW, seen)

    def _offers(self, dt: float, seen: Perception) -> None:  # noqa: ARG002
        self._approach(*self._at_palm(seen))
        if self._has_taken(self._duration):
            self._begin(Activity.PUSH, seen)
            self._axis = column(seen.G.R, 0)

    def _pushes(self, dt: float, seen: Perception) -> None:
        p = self._p
        moved = seen.angle < p.angle_open - CLOSING
        if not moved:
            self._push_on(dt, seen)
        gives = self._motion is Motion.GIVE
        if gives and self._sight.takes_for_gripped(seen):
            if self._has_seen(True, dt):
                self._let_go(seen)
            return
        empty = seen.angle < p.angle_object - 0.5 * CLOSING
        if self._is_in_vain(not moved and self._effort.travelled >= p.push_distance, dt):
            self._try_again(Activity.OFFER, seen)
        elif self._has_seen(empty if gives else moved, dt) or self._has_taken(p.patience):
            self._begin(Activity.WITHDRAW, seen)

    def _lets_go(self, dt: float, seen: Perception) -> None:  # noqa: ARG002
        if self._has_taken(self._p.grasp_time):
            self._begin(Activity.WITHDRAW, seen)

    def _withdraws(self, dt: float, seen: Perception) -> None:  # noqa: ARG002
        self._leave(*self._at_rest(seen))
        if self._has_taken(self._duration):
            self._begin(Activity.REST, seen)

    def _let_go(self, seen: Perception) -> None:
        self._begin(Activity.LET_GO, seen)
        self.holding = False

    def _try_again(self, activity: Activity, seen: Perception) -> None:
        """Begin the motion again after an attempt in vain, as often as the person cares to."""
        self._begin(activity if self._tries < self._p.attempts else Activity.WITHDRAW, seen)

    def _is_in_vain(self, there: bool, dt: float) -> bool:
        """Return whether what tells a failed attempt has been seen for the time of a reaction."""
        self._in_vain = self._in_vain + dt if there else 0.0
        return there and self._in_vain >= self._reaction - ROUNDING

    def _has_taken(self, duration: float) -> bool:
        """Return whether the activity has lasted that long."""
        return self._clock >= duration - ROUNDING

    def _has_seen(self, there: bool, dt: float) -> bool:
        """Return whether something has been there for the time of a reaction."""
        self._since = self._since + dt if there else 0.0
        return there and self._since >= self._reaction - ROUNDING

    @property
    def _duration(self) -> float:
        """Duration of a reach, s."""
        return self._far + self._near - _OVERLAP * min(self._far, self._near)

    def _approach(self, p: Vector, q: Quaternion) -> None:
        """Follow a course to a goal that may move, by way of the place before it."""
        far = minimum_jerk(self._clock / self._far)
        near = minimum_jerk(1.0 + (self._clock - self._duration) / self._near)
        ready = _ready(p, q)
        self.p = add_scaled(lerp(self._from, ready, far), near, subtract(p, ready))
        self.q = nlerp(self._from_q, q, far)

    def _leave(self, p: Vector, q: Quaternion) -> None:
        """Follow a course to a goal, by way of the place before where it begins."""
        near = minimum_jerk(self._clock / self._near)
        far = minimum_jerk(1.0 + (self._clock - self._duration) / self._far)
        ready = _ready(self._from, self._from_q)
        self.p = add_scaled(lerp(self._from, ready, near), far, subtract(p, ready))
        self.q = nlerp(self._from_q, q, far)

    def _pull_on(self, dt: float, seen: Perception) -> None:
        p = self._p
        self._exert(dt, self._pull, 1.0, p.pull_ramp, p.pull_speed, p.pull_distance, seen)

    def _push_on(self, dt: float, seen: Perception) -> None:
        p = self._p
        self._exert(dt, self._axis, p.push_share, p.push_ramp, p.push_speed, p.push_distance, seen)

    def _exert(
        self,
        dt: float,
        axis: Vector,
        share: float,
        rise: float,
        free_speed: float,
        length: float,
        seen: Perception,
    ) -> None:
        """Move along an axis by a share of the effort, against what the hand feels, until the length is reached."""
        effort = share * self._sight.strength * self._p.effort
        fall = min(_EASING, 0.5 * self._p.patience)
        force = force_at_rest(effort, self._clock, rise, self._p.patience - fall, fall)
        self._effort.advance(dt, force, free_speed, length, -dot(seen.f_H, axis))
        self.p = add_scaled(self._from, self._effort.travelled, axis)

    def _at_object(self, seen: Perception) -> tuple[Vector, Quaternion]:
        """Return the hand's pose at the object's end, as it is believed to be: the object's axes."""
        return add(add(seen.O.p, self._sight.error), rotate(seen.O.R, self._end)), seen.O.q

    def _at_palm(self, seen: Perception) -> tuple[Vector, Quaternion]:
        """Return the hand's believed pose where a push begins: with the object, p_OG before the palm, or as a fist."""
        p, G, p_WG = self._p, seen.G, add(seen.G.p, self._sight.error)
        front = p.palm_depth - p.offer_gap
        q = quaternion_multiply(G.q, seen.q_OH)
        if self._motion is Motion.PUSH:
            return add(p_WG, rotate(G.R, (front - p.fist_radius, p.fist_offset, 0.0))), q
        x, y, z = subtract(seen.p_OH, self._offered)
        place = (front - 0.5 * float(p.object_size[0]) + x, y, z)
        return add(p_WG, rotate(G.R, place)), q

    def _at_rest(self, seen: Perception) -> tuple[Vector, Quaternion]:  # noqa: ARG002
        return self.rest, self._rest_q


def _ready(p: Vector, q: Quaternion) -> Vector:
    """Return the place before a pose of the hand, back along x, from which it comes at what it grasps there."""
    return add_scaled(p, -_READY, column(rotation_matrix(q), 0))
