"""The sequence of a free-flyer's handovers, its phases and ports. [Fernandes2020] chapter 3, figures 3.1 to 3.3."""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np

from handover.controllers.free_flyer.flyer_controller import SampledController
from handover.controllers.free_flyer.handover_parameters import (
    NAME,
    HandoverTask,
    InvalidHandoverParameters,
    Params,
)
from handover.controllers.free_flyer.ports import unit_quaternion
from handover.controllers.free_flyer.velocity_monitor import PullMonitor, VelocityMonitor
from handover.cosim.blocks.plain_rotation import (
    Quaternion,
    Vector,
    add,
    angle_between,
    cross,
    distance,
    rotate,
    rotation_matrix,
    vector,
)
from handover.cosim.blocks.ports import Vector3, Vector4, output, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, MetrePerSecond, Number, Radian, RadianPerSecond

__all__ = [
    "HandoverPhase",
    "HandoverStateMachine",
    "HandoverTask",
    "Inputs",
    "InvalidHandoverParameters",
    "Outputs",
    "Params",
    "Pose",
    "gripper_motion",
]


class HandoverPhase(enum.IntEnum):
    """States of figure 3.1, its two ends, and what the thesis has not: a look whether what was released is gone."""

    OPEN_GRIPPER = 0
    MOVE_TO_OBJECT = 1
    GRASP_OBJECT = 2
    MOVE_TO_HANDOVER = 3
    ACTIVATE_IMPEDANCE = 4
    SIGNAL = 5
    CHECK_VELOCITY = 6
    RELEASE_OBJECT = 7
    CLOSE_GRIPPER = 8
    CHECK_ANGLE = 9
    DEACTIVATE_IMPEDANCE = 10
    RETREAT = 11
    DONE = 12
    GIVEN_UP = 13
    VERIFY_RELEASE = 14


@dataclass(kw_only=True)
class Inputs:
    """The navigation's estimate of the base, and the gripper's angle."""

    p_WB_meas: Vector3[Metre] = port(np.zeros(3), "estimated position of the centre of mass")
    q_WB_meas: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "estimated attitude")
    v_WB_meas: Vector3[MetrePerSecond] = port(np.zeros(3), "estimated velocity of the centre of mass, in the world")
    w_WB_meas: Vector3[RadianPerSecond] = port(np.zeros(3), "estimated angular velocity, in the world")
    gripper_angle: Radian = port(0.0, "angle between the gripper's main links")


@dataclass(kw_only=True)
class Outputs:
    """Where the gripper is to be, which controller is on, and what gripper and light do."""

    phase: HandoverPhase = output("what the robot is doing")
    p_WG_goal: Vector3[Metre] = output("where the gripper is to be")
    q_WG_goal: Vector4[Number] = output("orientation that it is to have")
    impedance: bool = output("impedance control is on")
    pose: bool = output("pose control is on")
    closure: Number = output("gripper command: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    light: bool = output("signal light: it begins when the robot is ready")
    failed_receptions: int = output("times that the gripper closed on nothing", minimum=0.0)
    failed_deliveries: int = output(
        "times that what it had released was still between the fingers, or what it had not was gone", minimum=0.0
    )
    speed_G: MetrePerSecond = output("speed of the gripper, low-passed, as it is monitored", minimum=0.0)


Pose = tuple[Vector, Quaternion]
"""Position, m, and orientation of a gripper, in W."""


class HandoverStateMachine(SampledController[Inputs, Outputs]):
    """Runs a handover through the states of figure 3.1.

    - Robot to human, figure 3.2: OPEN_GRIPPER, MOVE_TO_OBJECT (at the end straight ahead, for what is touched floats
      away), GRASP_OBJECT, MOVE_TO_HANDOVER, ACTIVATE_IMPEDANCE, SIGNAL, CHECK_VELOCITY. Once the gripper is faster than
      release_velocity: RELEASE_OBJECT, DEACTIVATE_IMPEDANCE, RETREAT, DONE.
    - Human to robot, figure 3.3: OPEN_GRIPPER, MOVE_TO_HANDOVER, ACTIVATE_IMPEDANCE, SIGNAL, CHECK_VELOCITY. Once the
      gripper is faster than receive_velocity: CLOSE_GRIPPER, CHECK_ANGLE. Above angle_threshold it holds the object and
      goes on as above. Else the reception has failed: OPEN_GRIPPER, and from SIGNAL again.
    - Collaborative, sec. 5.5: robot to human up to RELEASE_OBJECT, then, from ACTIVATE_IMPEDANCE, human to robot.
    - Hold: ACTIVATE_IMPEDANCE, to the end.

    Conditions of this implementation besides: impedance control begins only at rest near the handover place
    (gate_error, gate_speed). The light goes on only once the gripper is at rest again under it and within `tolerance`.
    That holds after a failure, too, since a transient trips the threshold with no person there. The threshold counts
    from the light on, once the speed was below it. Unless `gated`, none of this applies, as the thesis names no such
    condition. Impedance control then begins within gate_error of the place, at any speed, the light follows at once,
    and the threshold counts from its end. The gripper's velocity is v + w x R p_BG.

    GIVEN_UP holds the pose and does not move the gripper. It is entered after `patience` in a phase and after
    `attempts` failures. It is entered, too, when an object that was fetched is not between the fingers, which have not
    released it. From MOVE_TO_HANDOVER on that is a failed delivery, except in CHECK_VELOCITY of a gradual gripper,
    which takes it for a release.

    Where it is to `verify`, which the thesis does not, RELEASE_OBJECT lasts until the fingers have opened by
    free_angle, and VERIFY_RELEASE follows: verify_wait later they close once more. In both the robot coasts, without
    control, so that an object that floats stays between the fingers. Where they hold something, the person has not
    taken the object. The delivery has failed, and begins again from MOVE_TO_HANDOVER, as a collaborative reception does
    then. Pose control brings back a robot that turns fast, where impedance control within limits of thrust does not.
    Where they hold nothing, the object is the person's or has floated away. By its navigation and its gripper's angle
    the robot cannot tell the two apart, and takes it for delivered.

    Where it is `gradual`, CHECK_VELOCITY moves the fingers, by how the gripper's speed v lies between a part of the
    threshold and the threshold a itself: s = (v / a - gradual_share) / (1 - gradual_share), from 0 to 1. While it gives
    and is pulled (`PullMonitor`), the closure is 1 - s. The object is released once the fingers have opened by
    free_angle from what they held, or hold nothing. Where the pull ends before that, they close again. While it
    receives, the closure is the largest s since v was last below that part, and the threshold decides as ever.

    Raises:
        InvalidHandoverParameters: by the constructor, for goals out of reach, or thresholds or times that cannot work;
            all are named.
        InvalidOrientation: the estimated attitude is zero or not finite.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        (y.name for y in fields(Outputs)), tuple(u.name for u in fields(Inputs))
    )
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("estimate", TerminalKind.MOTION, "p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas"),
        terminal("goal", TerminalKind.POSE, "p_WG_goal", "q_WG_goal"),
    )

    def __init__(self, params: Params) -> None:
        params.check()
        self._params = params
        self._T = float(self.period)
        self._release, self._receive = params.velocities()
        self._p_BG = vector(params.p_BG)
        q_handover = unit_quaternion(params.q_WG_handover, NAME, "q_WG_handover")
        self._handover: Pose = (vector(params.p_WG_handover), q_handover)
        self._retreat: Pose = (vector(params.p_WG_retreat), q_handover)
        q_object = unit_quaternion(params.q_WG_object, NAME, "q_WG_object")
        self._standoff: Pose = (vector(params.standoff()), q_object)
        self._object: Pose = (vector(params.object_goal()), q_object)
        holds = params.task is HandoverTask.HOLD
        self._monitor = VelocityMonitor(params.filter_time, self._T)
        self._phase = HandoverPhase.ACTIVATE_IMPEDANCE if holds else HandoverPhase.OPEN_GRIPPER
        self._goal: Pose | None = self._handover if holds else None
        self._impedance = holds
        self._closure = 0.0
        self._receiving = params.task is HandoverTask.HUMAN_TO_ROBOT
        self._failed = 0
        self._failed_deliveries = 0
        self._pull = PullMonitor(params.pull_acceleration, params.braking, params.filter_time, self._T)
        self._pulled = False  # as of this step
        self._held_angle = 0.0  # of the closed gripper under the light
        self._steps = 0  # in this phase
        self._settled = 0  # steps in a row at rest and in place
        self._near = False  # within gate_error of the goal, as of this step
        self._rules = {
            HandoverPhase.OPEN_GRIPPER: self._open_gripper,
            HandoverPhase.MOVE_TO_OBJECT: self._move_to_object,
            HandoverPhase.GRASP_OBJECT: self._grasp_object,
            HandoverPhase.MOVE_TO_HANDOVER: self._move_to_handover,
            HandoverPhase.ACTIVATE_IMPEDANCE: self._activate_impedance,
            HandoverPhase.SIGNAL: self._signal,
            HandoverPhase.CHECK_VELOCITY: self._check_velocity,
            HandoverPhase.RELEASE_OBJECT: self._release_object,
            HandoverPhase.VERIFY_RELEASE: self._verify_release,
            HandoverPhase.CLOSE_GRIPPER: self._close_gripper,
            HandoverPhase.CHECK_ANGLE: self._check_angle,
            HandoverPhase.DEACTIVATE_IMPEDANCE: self._deactivate_impedance,
            HandoverPhase.RETREAT: self._retreat_from_handover,
        }

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Measure, decide, and return the commands that hold until t + dt; at most one transition."""
        p_WG, q_WG, v_WG = gripper_motion(u, self._p_BG, NAME)
        self._monitor.measure(v_WG)
        self._pulled = self._pull.measure(self._monitor.speed, self._params.gradual_share * self._threshold)
        here = p_WG, q_WG
        if self._goal is None:
            self._goal = here
        self._count_settled(here)
        rule = self._rules.get(self._phase)
        following = rule(u.gripper_angle) if rule else None
        if following is None and rule and self._is_late():
            following = HandoverPhase.GIVEN_UP
        self._steps += 1
        if following is not None:
            self._enter(following, here)
        p_WG, q_WG = self._goal
        return Outputs(
            phase=self._phase,
            p_WG_goal=np.array(p_WG),
            q_WG_goal=np.array(q_WG),
            impedance=self._impedance and not self._coasts,
            pose=not self._impedance,
            closure=self._closure,
            light=self._phase is HandoverPhase.SIGNAL,
            failed_receptions=self._failed,
            failed_deliveries=self._failed_deliveries,
            speed_G=self._monitor.speed,
        )

    def get_state(self) -> bytes:
        """Return phase, goal, counters and the monitor's filter."""
        counters = (self._failed, self._failed_deliveries, self._steps, self._settled)
        switches = (self._impedance, self._closure, self._receiving, self._held_angle)
        return pack_state(
            (int(self._phase), self._goal, counters, switches, self._monitor.get_state(), self._pull.get_state())
        )

    def set_state(self, state: bytes) -> None:
        """Restore a state of this machine or of one with equal parameters."""
        phase, self._goal, counters, switches, monitor, pull = unpack_state(state)
        self._phase = HandoverPhase(phase)
        self._failed, self._failed_deliveries, self._steps, self._settled = counters
        self._impedance, self._closure, self._receiving, self._held_angle = switches
        self._monitor.set_state(monitor)
        self._pull.set_state(pull)

    def _count_settled(self, here: Pose) -> None:
        """Count the steps for which the gripper has been at rest at its goal."""
        self._near, settled = self._in_place(self._goal, here, self._monitor.speed)
        self._settled = self._settled + 1 if settled else 0

    def _in_place(self, goal: Pose | None, here: Pose, speed: float) -> tuple[bool, bool]:
        """Return whether a gripper is within gate_error of its goal, and whether it rests in its place there."""
        p, (p_WG, q_WG) = self._params, here
        away = math.inf if goal is None else distance(goal[0], p_WG)
        near = away < p.gate_error
        if goal is None or speed >= p.gate_speed:
            return near, False
        close = near if self._phase is HandoverPhase.MOVE_TO_HANDOVER else away < p.tolerance
        return near, close and angle_between(goal[1], q_WG) < p.tolerance_angle

    @property
    def _coasts(self) -> bool:
        """Whether no controller is to act, lest the robot leave what it has just released behind."""
        released = (HandoverPhase.RELEASE_OBJECT, HandoverPhase.VERIFY_RELEASE)
        return self._params.verify and self._phase in released

    def _arrived(self) -> bool:
        return self._settled * self._T >= self._params.settle_time - self._T / 2.0 and self._settled > 0

    def _may_hand_over(self) -> bool:
        """Return whether it may yield and signal: at rest in its place, or, if it is not gated, near enough to it."""
        return self._arrived() if self._params.gated else self._near

    def _lasted(self, time: float) -> bool:
        return self._steps * self._T >= time - self._T / 2.0

    def _is_late(self) -> bool:
        holds = self._params.task is HandoverTask.HOLD
        return not holds and self._lasted(self._params.patience)

    def _enter(self, phase: HandoverPhase, here: Pose) -> None:
        goals = {
            HandoverPhase.MOVE_TO_OBJECT: self._standoff,
            HandoverPhase.MOVE_TO_HANDOVER: self._handover,
            HandoverPhase.RETREAT: self._retreat,
            HandoverPhase.GIVEN_UP: here,
        }
        closures = {
            HandoverPhase.OPEN_GRIPPER: 0.0,
            HandoverPhase.GRASP_OBJECT: 1.0,
            HandoverPhase.RELEASE_OBJECT: 0.0,
            HandoverPhase.CLOSE_GRIPPER: 1.0,
        }
        switches = {
            HandoverPhase.MOVE_TO_HANDOVER: False,
            HandoverPhase.ACTIVATE_IMPEDANCE: True,
            HandoverPhase.DEACTIVATE_IMPEDANCE: False,
            HandoverPhase.GIVEN_UP: False,
        }
        self._phase, self._steps, self._settled = phase, 0, 0
        self._goal = goals.get(phase, self._goal)
        self._closure = closures.get(phase, self._closure)
        self._impedance = switches.get(phase, self._impedance)
        if phase is HandoverPhase.SIGNAL:
            self._monitor.disarm()

    def _open_gripper(self, angle: float) -> HandoverPhase | None:  # noqa: ARG002
        if not self._lasted(self._params.gripper_time):
            return None
        if self._impedance:  # after a failed reception: signal again, once it has come to rest after the push
            return HandoverPhase.SIGNAL if self._may_hand_over() else None
        return HandoverPhase.MOVE_TO_HANDOVER if self._receiving else HandoverPhase.MOVE_TO_OBJECT

    def _move_to_object(self, angle: float) -> HandoverPhase | None:  # noqa: ARG002
        if not self._arrived():
            return None
        if self._goal != self._object:
            self._goal, self._settled = self._object, 0
            return None
        return HandoverPhase.GRASP_OBJECT

    def _grasp_object(self, angle: float) -> HandoverPhase | None:
        if not self._lasted(self._params.gripper_time):
            return None
        return HandoverPhase.MOVE_TO_HANDOVER if self._holds_something(angle) else HandoverPhase.GIVEN_UP

    def _move_to_handover(self, angle: float) -> HandoverPhase | None:
        if self._has_lost_object(angle):
            return self._fail_delivery_for_good()
        return HandoverPhase.ACTIVATE_IMPEDANCE if self._may_hand_over() else None

    def _activate_impedance(self, angle: float) -> HandoverPhase | None:
        p = self._params
        if self._has_lost_object(angle):
            return self._fail_delivery_for_good()
        waits = p.task is HandoverTask.COLLABORATIVE and self._receiving and not self._lasted(p.pause)
        if p.task is HandoverTask.HOLD or waits or not self._may_hand_over():
            return None
        return HandoverPhase.SIGNAL

    def _signal(self, angle: float) -> HandoverPhase | None:
        if self._has_lost_object(angle):
            return self._fail_delivery_for_good()
        self._held_angle = angle
        share = self._params.gradual_share if self._params.gradual else 1.0
        self._monitor.arm_below(share * self._threshold)
        return HandoverPhase.CHECK_VELOCITY if self._lasted(self._params.signal_time) else None

    def _check_velocity(self, angle: float) -> HandoverPhase | None:
        if self._params.gradual:
            return self._follow_the_hand(angle)
        if self._moved_by_a_person():
            return HandoverPhase.CLOSE_GRIPPER if self._receiving else HandoverPhase.RELEASE_OBJECT
        return self._fail_delivery_for_good() if self._has_lost_object(angle) else None

    def _follow_the_hand(self, angle: float) -> HandoverPhase | None:
        """Move the fingers with the pull or push; what follows once the object is released, or pushed in."""
        p, threshold = self._params, self._threshold
        share = min(max((self._monitor.speed / threshold - p.gradual_share) / (1.0 - p.gradual_share), 0.0), 1.0)
        moved = self._moved_by_a_person(p.gradual_share)
        if self._receiving:
            felt = share if moved else 0.0
            self._closure = max(felt, self._closure) if felt > 0.0 else 0.0
            return HandoverPhase.CLOSE_GRIPPER if felt == 1.0 else None
        self._closure = 1.0 - share if moved and self._pulled else 1.0
        is_free = angle > self._held_angle + p.free_angle or not self._holds_something(angle)
        return HandoverPhase.RELEASE_OBJECT if is_free else None

    def _release_object(self, angle: float) -> HandoverPhase | None:
        p = self._params
        if p.verify and angle > self._held_angle + p.free_angle:
            return HandoverPhase.VERIFY_RELEASE
        return self._follow_delivery() if self._lasted(p.gripper_time) else None

    def _verify_release(self, angle: float) -> HandoverPhase | None:
        p = self._params
        if not self._lasted(p.verify_wait):
            return None
        self._closure = 1.0
        if not self._lasted(p.verify_wait + p.gripper_time):
            return None
        if not self._holds_something(angle):
            self._closure = 0.0
            return self._follow_delivery()
        self._failed_deliveries += 1
        given_up = self._failed_deliveries >= p.attempts
        return HandoverPhase.GIVEN_UP if given_up else HandoverPhase.MOVE_TO_HANDOVER

    def _follow_delivery(self) -> HandoverPhase:
        """Return what follows the release of an object that the person is taken to have."""
        if self._params.task is HandoverTask.COLLABORATIVE:
            self._receiving = True
            return HandoverPhase.MOVE_TO_HANDOVER if self._params.verify else HandoverPhase.ACTIVATE_IMPEDANCE
        return HandoverPhase.DEACTIVATE_IMPEDANCE

    def _close_gripper(self, angle: float) -> HandoverPhase | None:  # noqa: ARG002
        return HandoverPhase.CHECK_ANGLE if self._lasted(self._params.gripper_time) else None

    def _check_angle(self, angle: float) -> HandoverPhase | None:
        if self._holds_something(angle):
            return HandoverPhase.DEACTIVATE_IMPEDANCE
        self._failed += 1
        return HandoverPhase.GIVEN_UP if self._failed >= self._params.attempts else HandoverPhase.OPEN_GRIPPER

    def _deactivate_impedance(self, angle: float) -> HandoverPhase | None:  # noqa: ARG002
        return HandoverPhase.RETREAT if self._lasted(self._params.settle_time) else None

    def _retreat_from_handover(self, angle: float) -> HandoverPhase | None:  # noqa: ARG002
        return HandoverPhase.DONE if self._arrived() else None

    def _has_lost_object(self, angle: float) -> bool:
        """Return whether the object that it brings is not between the fingers, which have not released it."""
        return self._params.fetches and not self._receiving and not self._holds_something(angle)

    def _fail_delivery_for_good(self) -> HandoverPhase:
        """Count a delivery that cannot be repeated, since the object is gone."""
        self._failed_deliveries += 1
        return HandoverPhase.GIVEN_UP

    def _holds_something(self, angle: float) -> bool:
        return angle > self._params.angle_threshold

    @property
    def _threshold(self) -> float:
        return self._receive if self._receiving else self._release

    def _moved_by_a_person(self, share: float = 1.0) -> bool:
        """Return whether the gripper is faster than a part of its threshold."""
        threshold = share * self._threshold
        return self._monitor.exceeds(threshold) if self._params.gated else self._monitor.speed > threshold


def gripper_motion(u: Inputs, p_BG: Vector, block: str) -> tuple[Vector, Quaternion, Vector]:
    """Return p_WG, q_WG and v_WG = v + w x R p_BG by the estimate of the base.

    Raises:
        InvalidOrientation: the estimated attitude, of a block's input, is zero or not finite.
    """
    q_WB = unit_quaternion(u.q_WB_meas, block, "q_WB_meas")
    r = rotate(rotation_matrix(q_WB), p_BG)
    return add(vector(u.p_WB_meas), r), q_WB, add(vector(u.v_WB_meas), cross(vector(u.w_WB_meas), r))
