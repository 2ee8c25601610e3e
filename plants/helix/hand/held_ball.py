"""The ball between a person's hand and the gripper's fingers, moved by what touches it."""

import math
from typing import Any, NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.gripper_fingers import KNUCKLE, LINK_RADIUS, PALM_RADIUS, finger_joints
from handover.plants.helix.hand.ball_contact import CAPSULES, ContactNumbers, advance
from handover.plants.helix.hand.partner_parameters import Params

_LONGEST_STEP, _STEPS = 5e-4, 8.0
"""Longest internal step, s, and how many steps the shortest time constant takes at least."""
_RADII = np.append(np.full(CAPSULES - 1, LINK_RADIUS), PALM_RADIUS)


class Contact(NamedTuple):
    """What touched in a step, as means over it.

    Attributes:
        f_G: force on the gripper, in W, shape (3,), N.
        f_H: force on the hand, in W, shape (3,), N.
        by_gripper: sum of the normal forces of the gripper's bodies on the ball, N.
        by_hand: normal force of the hand on the ball, N.
    """

    f_G: Floats
    f_H: Floats
    by_gripper: float
    by_hand: float


class HeldBall:
    """Ball and hand as bodies, after `ball_contact`. At first the ball lies still in the hand.

    Attributes:
        p_WO: position of the ball, in W, shape (3,), m.
        v_WO: its velocity, m/s.
    """

    def __init__(self, params: Params) -> None:
        self._numbers = tuple(numbers_of(params))
        self._step = internal_step(params)
        weight = params.ball_mass * params.gravity
        self._rest = np.array([0.0, 0.0, -weight / params.hold_stiffness])
        depth = (weight + params.hold_force) / params.palm_stiffness - self._rest[2]
        self._p_OK = np.array(  # the cup's lowest point, were the hand not displaced, seen from the ball at rest
            [0.0, 0.0, depth - params.ball_radius]
        )
        self._ball = np.zeros((3, 3))  # position, velocity, angular velocity
        self._hand = np.array([self._rest, np.zeros(3)])  # displacement of the hand, and its rate
        self._xi = np.zeros((CAPSULES + 2, 3))
        self._ends: Floats | None = None  # of the capsules, where the last contact left them
        self._low = np.zeros(3)  # the cup's lowest point, were the hand not displaced

    @property
    def p_WO(self) -> Floats:
        """Position of the ball, in W, shape (3,), m."""
        return np.array(self._ball[0])

    @property
    def v_WO(self) -> Floats:
        """Velocity of the ball, in W, shape (3,), m/s."""
        return np.array(self._ball[1])

    @property
    def displacement(self) -> Floats:
        """How far the hand gives way beyond what the ball's weight alone does, in W, shape (3,), m."""
        return self._hand[0] - self._rest

    def lie(self, p_WO: Floats, v_WO: Floats) -> None:
        """Lie still in the hand with the ball at p_WO, which moves with v_WO; both in W, shape (3,)."""
        self._ball[:] = p_WO, v_WO, np.zeros(3)
        self._hand[:] = self._rest, np.zeros(3)
        self._xi[:] = 0.0
        self._ends = None
        self._low[:] = p_WO + self._p_OK

    def move(self, p_WG: Floats, R_WG: Floats, grip: float, p_WO_held: Floats, f_hold: float, dt: float) -> Contact:
        """Advance by dt, in which the gripper and the place where the hand holds the ball out come to where they are.

        Args:
            p_WG: position of the gripper at the end of the step, in W, shape (3,), m.
            R_WG: its orientation then, shape (3, 3).
            grip: its closure then.
            p_WO_held: where the ball would lie at the end of the step if nothing but the hand touched it, in W, m.
            f_hold: force with which the person presses the ball to the palm, N.
            dt: step, s.
        """
        ends = _bodies(p_WG, R_WG, grip)
        before = ends if self._ends is None else self._ends
        steps = max(1, math.ceil(dt / self._step - 1e-9))
        low, forces, pressures = p_WO_held + self._p_OK, np.zeros((2, 3)), np.zeros(2)
        rates, low_rate = (ends - before) / dt, (low - self._low) / dt
        self._ends = np.array(before)
        moved = (self._ball, self._hand, self._xi, self._ends, rates, _RADII, self._low, low_rate)
        advance(self._numbers, *moved, f_hold, dt / steps, steps, forces, pressures)
        self._ends[:], self._low[:] = ends, low
        by_gripper, by_hand = pressures.tolist()
        return Contact(forces[0], forces[1], by_gripper, by_hand)

    def get_state(self) -> Any:
        """Return the complete state."""
        return self._ball, self._hand, self._xi, self._low, self._ends

    def set_state(self, state: Any) -> None:
        """Restore what `get_state` gave."""
        ball, hand, xi, low, ends = state
        self._ball[:], self._hand[:], self._xi[:], self._low[:] = ball, hand, xi, low
        self._ends = None if ends is None else np.array(ends)


def _bodies(p_WG: Floats, R_WG: Floats, grip: float) -> Floats:
    """Return the ends of the gripper's bodies in W, shape (CAPSULES, 2, 3), m: links of the fingers, then the palm."""
    joints = finger_joints(p_WG, R_WG, grip)
    links = np.stack([joints[:, :2], joints[:, 1:]], axis=1).reshape(CAPSULES - 1, 2, 3)
    palm = p_WG - KNUCKLE * R_WG[:, 2]
    return np.concatenate([links, np.broadcast_to(palm, (1, 2, 3))])


def internal_step(p: Params) -> float:
    """Return the longest internal step, s: an eighth of the shortest time constant, 0.5 ms at most.

    Time constants are sqrt(m_O / k) of the ball on its stiffest contact, and m_H / c_H of the hand. With steps longer
    than twice either, a ball or a hand that is hardly moved flies off.
    """
    ball = math.sqrt(p.ball_mass / max(p.finger_stiffness, p.palm_stiffness))
    hand = p.hand_mass / p.hold_damping if p.hold_damping > 0.0 else math.inf
    return min(_LONGEST_STEP, ball / _STEPS, hand / _STEPS)


def numbers_of(p: Params) -> ContactNumbers:
    """Return parameters as the kernel takes them."""
    return ContactNumbers(
        ball_mass=p.ball_mass,
        ball_radius=p.ball_radius,
        gravity=p.gravity,
        finger_stiffness=p.finger_stiffness,
        finger_friction=p.finger_friction,
        hand_stiffness=p.palm_stiffness,
        hand_friction=p.palm_friction,
        rolling_friction=p.palm_rolling_friction,
        dissipation=p.dissipation,
        cup_radius=p.cup_radius,
        cup_cosine=math.cos(p.cup_angle),
        palm_radius=p.palm_radius,
        arm_mass=p.hand_mass,
        arm_stiffness=p.hold_stiffness,
        arm_damping=p.hold_damping,
    )


# Loads the machine code, or makes it: hosts grant loading more time than a step.
HeldBall(Params()).move(np.zeros(3), np.eye(3), 0.0, np.zeros(3), 0.0, _LONGEST_STEP)
