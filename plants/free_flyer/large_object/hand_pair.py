"""A person who leads one hand or two as a pair: what both see and feel, and where each goes."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Quaternion,
    Vector,
    add,
    column,
    cross,
    dot,
    from_rotation_vector,
    lerp,
    nlerp,
    norm,
    normalize,
    quaternion_multiply,
    rotate,
    rotation_matrix,
    scale,
    subtract,
    vector,
)
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.hand.finger_contact import Angles, HandFingers
from handover.plants.free_flyer.hand.flyer_gripper import FlyerGripper
from handover.plants.free_flyer.hand.flyer_hand import FlyerHand
from handover.plants.free_flyer.hand.hand_kinematics import CLOSED
from handover.plants.free_flyer.hand.person import Activity, FlyerPerson
from handover.plants.free_flyer.hand.sight import ROUNDING, Perception, forget_before
from handover.plants.free_flyer.large_object.parameters import Params
from handover.plants.free_flyer.rigid_body import RigidBody
from handover.plants.hand_motion import minimum_jerk

_GIVING = (Activity.OFFER, Activity.PUSH, Activity.LET_GO)


class HandPair:
    """One hand or two that a `FlyerPerson` leads by the middle between them, each at its handle of the object.

    The person's mind is one: it sees the middle between the grippers (`middle_of_grippers`), feels the sum of the
    forces on the hands, pulls with the sum of their efforts, and believes that it has the object when all hands have
    it. A signal is that of both robots, one after the other or at once. A gripper that lags behind the other counts:
    they have let go when both have, and hold when both do; and so does one that has closed on nothing. The second hand
    closes and opens `hand_delay` later. Each hand has its own arm and its own tremor (`FlyerHand`).

    Attributes:
        person: who leads them.
        hands: each with its course and its hold.
        fingers: of each hand.
    """

    def __init__(self, params: Params) -> None:
        self._p, one, places = params, params.of_handle, params.hand_places
        n = len(places)
        self.person = FlyerPerson(replace(one, effort=n * one.effort, arm_mass=n * one.arm_mass))
        seeds = [one.seed, *np.random.SeedSequence([one.seed, 3]).generate_state(n - 1).tolist()]
        self._apart = [subtract(place, vector(params.p_OH)) for place in places]
        starts = self._spread(self.person.p, self.person.q)
        self.hands = [
            FlyerHand(replace(one, p_OH=np.array(place), seed=seed), p, self.person.q, place)
            for place, seed, p in zip(places, seeds, starts, strict=True)
        ]
        self.fingers = [HandFingers(vector(params.handle_size), params.finger_rate) for _ in places]
        self._clock = 0.0
        self._lit = (False, False)
        """Which robots have signalled since both last did."""
        self._grasps = [(0.0, self.person.fingers, self.person.holding)]
        """Since when, s, the fingers of the first hand were how far closed, and were to hold; the oldest is due."""

    def act(
        self,
        dt: float,
        lights: tuple[bool, bool],
        grippers: Sequence[FlyerGripper],
        Gs: Sequence[Frame],
        body: RigidBody,
        f_H: Vector,
    ) -> None:
        """Let the person see grippers at their frames, the object and the force on all hands, and act for dt."""
        gives, hands = self.person.activity in _GIVING, self.hands
        angles, gripped = [g.angle for g in grippers], [g.grip is not None for g in grippers]
        is_empty = min(angles) < self._p.angle_object - ROUNDING
        there = Perception(
            light=self._signalled(lights),
            angle=max(angles) if gives and not is_empty else min(angles),
            G=middle_of_grippers(*Gs),
            O=Frame(body.p, body.q),
            gripped=all(gripped) if gives else any(gripped),
            held=all(hand.hold is not None for hand in hands),
            p_WH=_mean([hand.calm for hand in hands]),
            q_WH=_mean_turn([hand.q for hand in hands]),
            p_OH=_mean([hand.p_OH for hand in hands]),
            q_OH=_mean_turn([hand.q_OH for hand in hands]),
            f_H=f_H,
        )
        self.person.act(dt, there)
        self._clock += dt
        wants = self.person.holding and self.person.fingers == 1.0
        self._grasps.append((self._clock, self.person.fingers, wants))
        forget_before(self._grasps, self._clock - self._p.hand_delay)

    def move(self, dt: float, body: RigidBody) -> list[Frame]:
        """Close or open the hands, and return where their courses lead in dt if nothing obstructs them."""
        places = self._spread(self.person.p, self.person.q)
        courses: list[Frame] = []
        for i, (hand, place) in enumerate(zip(self.hands, places, strict=True)):
            hand.take_or_leave(hand.gets(self._grasp(i)[2], body), body)
            courses.append(hand.move(dt, place, self.person.q))
        return courses

    def wanted_angles(self, i: int) -> Angles:
        """Return the angles to which the person wants to close the joints of a hand, rad."""
        closed = minimum_jerk(self._grasp(i)[1])
        return tuple(closed * angle for angle in CLOSED)

    def get_state(self) -> tuple[object, ...]:
        """Return the complete state."""
        hands = [hand.get_state() for hand in self.hands]
        fingers = [(f.wanted, f.angles) for f in self.fingers]
        return self.person.get_state(), hands, fingers, self._clock, self._grasps, self._lit

    def set_state(self, state: Sequence[Any]) -> None:
        """Restore a state that `get_state` of a pair with equal parameters gave."""
        person, hands, fingers, self._clock, grasps, self._lit = state
        self.person.set_state(person)
        for hand, its in zip(self.hands, hands, strict=True):
            hand.set_state(its)
        for f, its in zip(self.fingers, fingers, strict=True):
            f.wanted, f.angles = its
        self._grasps = list(grasps)

    def _signalled(self, lights: tuple[bool, bool]) -> bool:
        """Return whether both robots have signalled, until the last light is off."""
        if all(self._lit) and not any(lights):
            self._lit = (False, False)
        (a, b), (first, second) = self._lit, lights
        self._lit = a or first, b or second
        return all(self._lit)

    def _grasp(self, i: int) -> tuple[float, float, bool]:
        return self._grasps[-1 if i == 0 else 0]

    def _spread(self, p: Vector, q: Quaternion) -> list[Vector]:
        """Return where the hands are whose middle is at p, q."""
        R = rotation_matrix(q)
        return [add(p, rotate(R, apart)) for apart in self._apart]


def middle_of_grippers(A: Frame, B: Frame) -> Frame:
    """Return the frame midway between two grippers in W, of which A is to stand at +y of B.

    Its orientation is their mean, turned the shortest way until y points from B to A; where A stands at -y, the mean.
    """
    q, apart = nlerp(A.q, B.q, 0.5), subtract(A.p, B.p)
    y, length = column(rotation_matrix(q), 1), norm(apart)
    if length > 0.0:
        axis = cross(y, scale(1.0 / length, apart))
        sine, cosine = norm(axis), dot(y, apart) / length
        if sine > 0.0 and cosine > 0.0:
            turn = from_rotation_vector(scale(math.atan2(sine, cosine) / sine, axis))
            q = normalize(quaternion_multiply(turn, q))
    return Frame(lerp(A.p, B.p, 0.5), q, lerp(A.v, B.v, 0.5), lerp(A.w, B.w, 0.5))


def _mean(places: Sequence[Vector]) -> Vector:
    return scale(1.0 / len(places), reduce(add, places, ZERO))


def _mean_turn(turns: Sequence[Quaternion]) -> Quaternion:
    return turns[0] if len(turns) == 1 else nlerp(turns[0], turns[1], 0.5)
