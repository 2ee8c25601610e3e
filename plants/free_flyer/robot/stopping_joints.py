"""A flying arm whose joints have end stops, dry friction and locks: which of them stand still, and since when."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from handover.cosim.blocks.plain_rotation import (
    Quaternion,
    Vector,
    add,
    add_cross,
    add_scaled,
    cross,
    inverse_rotate,
    quaternion_multiply,
    rotate,
    rotation_matrix,
    subtract,
)
from handover.plants.free_flyer.rigid_body import Wrenches
from handover.plants.free_flyer.robot.arm import Joints
from handover.plants.free_flyer.robot.articulated_body import ArticulatedBody, State

_ROUNDS = 60
_NEAR = 1e-13
"""Of an angle in rad or a speed in rad/s at an event."""
_AT = 1e-9
"""Rad from a limit at which a joint is there."""
_SHORT = 1e-9
"""Share of a step that is too short for a joint to have moved before it is stopped."""


@dataclass(frozen=True)
class JointLimits:
    """Of each joint: its range in rad, dry friction in N m, viscous friction in N m s/rad."""

    lower: Joints
    upper: Joints
    friction: Joints
    drag: Joints


@dataclass(frozen=True)
class Motion:
    """Pose and velocity of base and gripper in W, angles and speeds of the joints."""

    p_WB: Vector
    q_WB: Quaternion
    v_WB: Vector
    w_WB: Vector
    p_WG: Vector
    q_WG: Quaternion
    v_WG: Vector
    w_WG: Vector
    q_J: Joints
    v_J: Joints


class StoppingJoints:
    """Advances an articulated body whose joints stop: at their limits, by dry friction, and where they are locked.

    A joint that stands still is held, without an equation, as long as stop, friction or lock can give the mean torque
    that this takes over a step: friction as much as it has, a stop any that pushes inwards, a lock any. Else it starts,
    against its friction. A step ends early where a joint reaches a limit or, having friction, turns back; the joint is
    there to rounding. A stop's blow is inelastic: an impulse between two neighbouring links, so that linear and angular
    momentum stay what they are and energy can but fall. Stops that it would have to pull are let go.

    Args:
        body: base and arm.
        limits: of the joints.
        q_J: angles of the joints, rad.
        pose: p_WB and q_WB.
        velocity: v_WB and w_WB in W; the joints are at rest.
    """

    def __init__(
        self,
        body: ArticulatedBody,
        limits: JointLimits,
        q_J: Joints,
        pose: tuple[Vector, Quaternion],
        velocity: tuple[Vector, Vector],
    ) -> None:
        self.body, self._limits = body, limits
        (p, q), (v, w), R = pose, velocity, rotation_matrix(pose[1])
        posture = body.posture(q_J)
        r, w_B = rotate(R, posture.p_BC), inverse_rotate(R, w)
        h = (body.inertia(posture)[:, :3] @ w_B).tolist()
        L = rotate(R, (h[0], h[1], h[2]))
        self.state: State = (add(p, r), q, add_cross(v, w, r), L, q_J, tuple(h[3:]))
        self.still = tuple(True for _ in q_J)
        self.locked = False

    @property
    def _moving(self) -> list[int]:
        return [j for j, still in enumerate(self.still) if not still]

    @property
    def energy(self) -> float:
        """Kinetic energy, in J."""
        return self.body.energy(self.state, self._moving)

    @property
    def rate(self) -> float:
        """The most by which anything turns: base and joints together, in rad/s."""
        _, q, _, L, q_J, pi = self.state
        L_B = inverse_rotate(rotation_matrix(q), L)
        w, v_J = self.body.velocities(self.body.posture(q_J), L_B, pi, self._moving)
        return math.hypot(*w) + sum(map(abs, v_J))

    def motion(self) -> Motion:
        """Return pose and velocity of base and gripper."""
        p, q, v, L, q_J, pi = self.state
        posture, R = self.body.posture(q_J), rotation_matrix(q)
        w_B, v_J = self.body.velocities(posture, inverse_rotate(R, L), pi, self._moving)
        v_B, w_G = subtract((0.0, 0.0, 0.0), cross(w_B, c := posture.p_BC)), w_B
        for shift, rate in zip(posture.shifts, v_J, strict=True):
            v_B = add_scaled(v_B, -rate, shift)
        v_G = add_cross(v_B, w_B, posture.p_BG)
        for a, o, rate in zip(posture.axes, posture.origins, v_J, strict=True):
            v_G = add_scaled(v_G, rate, cross(a, subtract(posture.p_BG, o)))
            w_G = add_scaled(w_G, rate, a)
        p_WB = subtract(p, rotate(R, c))
        return Motion(
            p_WB=p_WB,
            q_WB=q,
            v_WB=add(v, rotate(R, v_B)),
            w_WB=rotate(R, w_B),
            p_WG=add(p_WB, rotate(R, posture.p_BG)),
            q_WG=quaternion_multiply(q, posture.q_BG),
            v_WG=add(v, rotate(R, v_G)),
            w_WG=rotate(R, w_G),
            q_J=q_J,
            v_J=v_J,
        )

    def lock(self) -> None:
        """Lock all joints where they are, by an inelastic blow."""
        self.locked = True
        self._stop(self.state, range(len(self.still)))

    def advance(self, h: float, wrench: Wrenches, tau_J: Joints) -> None:
        """Advance by h seconds with wrenches (f_B, tau_B in B; f_G, tau_G in W) and torques on the joints held."""
        left = h
        while left > 1e-12 * h:
            left -= self._advance_to_event(left, wrench, tau_J)

    def _advance_to_event(self, h: float, wrench: Wrenches, tau_J: Joints) -> float:
        """Advance by h seconds or until a joint is stopped; return the time it took."""
        rates = self.body.settle(self.state, self._moving)[1] if any(self._limits.friction) else (0.0,) * len(tau_J)
        signs = [0.0 if still else math.copysign(1.0, v) for still, v in zip(self.still, rates, strict=True)]
        pinned: set[int] = set()
        while True:
            if (start := self._starting(h, wrench, tau_J, signs, pinned)) is not None:
                signs[start[0]] = start[1]
                continue
            after = partial(self._after, wrench, tau_J, signs)
            end, time, event = after(h), h, None
            while time > _SHORT * h and (hit := self._hit(*end, signs)) is not None:
                event, time = hit, self._time_of(hit, time, after, signs[hit])
                end = after(time)
            if event is None or time > _SHORT * h:
                break
            pinned.add(event)
            signs[event] = 0.0
        self.state, self.still = end[0], tuple(sign == 0.0 for sign in signs)
        if event is not None:
            self._land(event)
        return time

    def _after(self, wrench: Wrenches, tau_J: Joints, signs: Sequence[float], h: float) -> tuple[State, Joints]:
        """Return state and speeds of the joints h seconds later, if those without sign are held."""
        moving = [j for j, sign in enumerate(signs) if sign]
        return self.body.settle(self._step(h, wrench, tau_J, signs)[0], moving)

    def _step(self, h: float, wrench: Wrenches, tau_J: Joints, signs: Sequence[float]) -> tuple[State, Joints]:
        friction = zip(tau_J, signs, self._limits.friction, strict=True)
        torque = tuple(tau - sign * most for tau, sign, most in friction)
        moving = [j for j, sign in enumerate(signs) if sign]
        return self.body.runge_kutta_step(self.state, h, wrench, torque, self._limits.drag, moving)

    def _starting(
        self, h: float, wrench: Wrenches, tau_J: Joints, signs: Sequence[float], pinned: set[int]
    ) -> tuple[int, float] | None:
        """Return the joint that nothing can hold over h seconds, and the direction in which it starts."""
        held = [j for j, sign in enumerate(signs) if not sign and j not in pinned and not self._fixed(j)]
        if not held:
            return None
        moving = [j for j, sign in enumerate(signs) if sign]
        end, loads = self._step(h, wrench, tau_J, signs)
        (_, _, _, _, _, after), _ = self.body.settle(end, moving)
        before = self.state[5]
        worst, found = 1e-15, None
        for j in held:
            needed = (after[j] - before[j]) / h - loads[j]
            low, high = self._holding(j)
            beyond = max(low - needed, needed - high)
            if beyond > worst:
                worst, found = beyond, (j, 1.0 if needed < low else -1.0)
        return found

    def _fixed(self, j: int) -> bool:
        return self.locked or self._limits.lower[j] == self._limits.upper[j]

    def _holding(self, j: int) -> tuple[float, float]:
        """Return the range of torque that friction and stops can give to a joint that stands still."""
        friction, angle = self._limits.friction[j], self.state[4][j]
        low = -math.inf if angle >= self._limits.upper[j] else -friction
        high = math.inf if angle <= self._limits.lower[j] else friction
        return low, high

    def _hit(self, state: State, v_J: Joints, signs: Sequence[float]) -> int | None:
        """Return a joint that has passed a limit or turned back against friction."""
        for j, sign in enumerate(signs):
            if sign and self._room(j, state, v_J, sign) < -_NEAR:
                return j
        return None

    def _room(self, j: int, state: State, v_J: Joints, sign: float) -> float:
        """Return how far a joint is from being stopped, negative beyond: an angle, or a speed where that is less."""
        angle = state[4][j]
        room = min(angle - self._limits.lower[j], self._limits.upper[j] - angle)
        return min(room, sign * v_J[j]) if self._limits.friction[j] > 0.0 else room

    def _time_of(self, j: int, time: float, after: Callable[[float], tuple[State, Joints]], sign: float) -> float:
        """Return when a joint, beyond a stop after `time`, gets there, by false position (Illinois)."""

        def room(t: float) -> float:
            return self._room(j, *after(t), sign)

        low, high, f_low, f_high, side = 0.0, time, room(0.0), room(time), 0
        for _ in range(_ROUNDS):
            if f_low <= _NEAR:
                return low
            middle = high - f_high * (high - low) / (f_high - f_low)
            f = room(middle)
            if abs(f) <= _NEAR:
                return middle
            if f < 0.0:
                high, f_high, f_low, side = middle, f, f_low * (0.5 if side < 0 else 1.0), -1
            else:
                low, f_low, f_high, side = middle, f, f_high * (0.5 if side > 0 else 1.0), 1
        return high

    def _land(self, j: int) -> None:
        """Stop a joint at the limit that it has reached, or where it turns back."""
        p, q, v, L, q_J, pi = self.state
        for limit in (self._limits.lower[j], self._limits.upper[j]):
            if abs(q_J[j] - limit) <= _AT:
                self._stop((p, q, v, L, (*q_J[:j], limit, *q_J[j + 1 :]), pi), [j])
                return
        self.still = tuple(still or i == j for i, still in enumerate(self.still))
        self.state, _ = self.body.settle(self.state, self._moving)

    def _stop(self, state: State, joints: Sequence[int]) -> None:
        """Stop joints by a blow, which those that are locked or at a stop pass on; dry friction is no match for it."""
        struck = {*joints, *(j for j, still in enumerate(self.still) if still and self._can_take_a_blow(j))}
        while True:
            moving = [j for j in range(len(self.still)) if j not in struck]
            after, v_J = self.body.settle(state, moving)
            pulled = [
                j for j in struck if not self._fixed(j) and self._pulls(j, after[4][j], after[5][j] - state[5][j])
            ]
            if not pulled:
                break
            struck -= {pulled[0]}
        self.still = tuple(j in struck or abs(v) <= _NEAR for j, v in enumerate(v_J))
        self.state, _ = self.body.settle(after, self._moving)

    def _can_take_a_blow(self, j: int) -> bool:
        return self._fixed(j) or math.inf in map(abs, self._holding(j))

    def _pulls(self, j: int, angle: float, impulse: float) -> bool:
        """Return whether an impulse on a joint at a stop, N m s, is one that the stop would have to pull for."""
        return impulse < 0.0 if angle <= self._limits.lower[j] else impulse > 0.0
