"""A hand that follows poses from a tracker, live or recorded, with limited speed and acceleration."""

import math

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Quaternion,
    Vector,
    add,
    add_scaled,
    from_rotation_vector,
    norm,
    normalize,
    quaternion,
    quaternion_inverse,
    quaternion_multiply,
    relative_quaternion,
    rotation_matrix,
    rotation_vector,
    scale,
    subtract,
    vector,
)
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.plants.free_flyer.hand.hand_kinematics import CLOSED, STRAIGHT
from handover.plants.free_flyer.hand.hand_track import HandPose
from handover.plants.free_flyer.hand.parameters import Params

_BRAKING = 0.8
"""Share of the acceleration by which a hand counts on braking, so that it does not overshoot in steps (assumed)."""
_RIGHT_ANGLE = math.pi / 2.0


def pose_of_tracker(p: Floats, q: Floats, angles: Floats, closed: bool) -> HandPose | None:
    """Return a tracker's pose, none if it is not finite or its quaternion, (4,), is far from the norm 1."""
    if not (np.all(np.isfinite(p)) and np.all(np.isfinite(angles)) and 0.5 < float(np.linalg.norm(q)) < 2.0):
        return None
    return HandPose(vector(p), normalize(quaternion(q)), tuple(angles.tolist()), closed)


class HandGuide:
    """The course of a hand after wanted poses; e is how far it is from one, b the bandwidth, a and v_max its limits.

        v_goal = e min(b, sqrt(2 0.8 a / |e|), v_max / |e|),  |v' - v| <= a dt,  p' = p + dt v',

    with v' as near to v_goal as its limit lets it: a low-pass of 1 / b, which lags by that time, and a wanted pose that
    jumps moves the hand no faster than an arm moves. Attitude likewise, by the rotation vector. Without a wanted pose,
    the hand brakes, and stays with its fingers as they are; before the first one they are closed if it is, or straight.

    Roll, pitch and yaw seen from q_WH_0 are limited to +-90 degrees each. [Fernandes2020] sec. 4.2.1
    """

    def __init__(self, params: Params, p: Vector, q: Quaternion, closed: bool) -> None:
        self._p = params
        self._neutral = q
        self._v, self._w = ZERO, ZERO
        self.p, self.q = p, q
        self.goal = HandPose(p, q, CLOSED if closed else STRAIGHT, closed)

    def lag(self, dt: float) -> float:
        """Return the time by which a hand that is led in steps of dt lags, s."""
        return 1.0 / min(self._p.hand_bandwidth, 1.0 / dt) - dt

    def follow(self, dt: float, goal: HandPose | None, ahead: HandPose | None = None) -> None:
        """Advance by dt towards a pose, or stop where there is none.

        Where it is known what will be wanted a lag later, as of a recorded track, the hand is led by that, `ahead`.
        """
        p = self._p
        most = (p.hand_acceleration_max * dt, p.hand_turning_acceleration_max * dt)
        if goal is None:
            self._v, self._w = _changed(self._v, ZERO, most[0]), _changed(self._w, ZERO, most[1])
        else:
            self.goal = HandPose(goal.p, _limited(self._neutral, goal.q), goal.angles, goal.closed)
            there = self.goal if ahead is None else ahead
            q = _limited(self._neutral, there.q)
            b = min(p.hand_bandwidth, 1.0 / dt)
            v = _approach(subtract(there.p, self.p), b, p.hand_speed_max, p.hand_acceleration_max)
            turn = rotation_vector(quaternion_multiply(q, quaternion_inverse(self.q)))
            w = _approach(turn, b, p.hand_turning_max, p.hand_turning_acceleration_max)
            self._v, self._w = _changed(self._v, v, most[0]), _changed(self._w, w, most[1])
        self.p = add_scaled(self.p, dt, self._v)
        self.q = normalize(quaternion_multiply(from_rotation_vector(scale(dt, self._w)), self.q))

    def get_state(self) -> bytes:
        """Return the complete state."""
        g = self.goal
        return pack_state(((self.p, self.q, self._v, self._w), (g.p, g.q, g.angles, g.closed)))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this guide or of one with equal parameters."""
        (self.p, self.q, self._v, self._w), goal = unpack_state(state)
        self.goal = HandPose(*goal)


def _approach(e: Vector, bandwidth: float, v_max: float, a_max: float) -> Vector:
    """Return the velocity at which a distance e is to be closed."""
    far = norm(e)
    if far == 0.0:
        return ZERO
    return scale(min(bandwidth, math.sqrt(2.0 * _BRAKING * a_max / far), v_max / far), e)


def _changed(v: Vector, goal: Vector, most: float) -> Vector:
    """Return the velocity that is nearest to a goal and differs from v by at most that."""
    change = subtract(goal, v)
    far = norm(change)
    return goal if far <= most else add(v, scale(most / far, change))


def _limited(neutral: Quaternion, q: Quaternion) -> Quaternion:
    """Return an orientation with roll, pitch and yaw (about x, then y, then z) from a neutral one within 90 degrees."""
    R = rotation_matrix(relative_quaternion(neutral, q))
    roll, yaw = math.atan2(R[7], R[8]), math.atan2(R[3], R[0])
    if abs(roll) <= _RIGHT_ANGLE and abs(yaw) <= _RIGHT_ANGLE:
        return q
    pitch = math.asin(min(max(-R[6], -1.0), 1.0))
    roll, yaw = (min(max(angle, -_RIGHT_ANGLE), _RIGHT_ANGLE) for angle in (roll, yaw))
    about_x, about_y, about_z = (
        from_rotation_vector(v) for v in ((roll, 0.0, 0.0), (0.0, pitch, 0.0), (0.0, 0.0, yaw))
    )
    turned = quaternion_multiply(about_z, quaternion_multiply(about_y, about_x))
    return quaternion_multiply(neutral, turned)
