"""The sequence of a free-flyer's handovers. [Fernandes2020] chapter 3, figures 3.1 to 3.3."""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.controllers.free_flyer.handover_parameters import (
    NAME,
    HandoverTask,
    InvalidHandoverParameters,
    Params,
)
from handover.controllers.free_flyer.ports import PERIOD
from handover.controllers.free_flyer.rotations import rotation_matrix, unit_quaternion
from handover.controllers.free_flyer.velocity_monitor import PullMonitor, VelocityMonitor
from handover.cosim.blocks.plain_rotation import (
    Quaternion,
    Vector,
    add,
    angle_between,
    cross,
    distance,
    rotate,
    vector,
)
from handover.cosim.blocks.ports import Vector3, Vector4, output, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Metre, MetrePerSecond, Number, Radian, RadianPerSecond

__all__ = [
    "HandoverPhase",
    "HandoverStateMachine",
    "HandoverTask",
    "Inputs",
    "InvalidHandoverParameters",
    "Outputs",
    "Params",
]


class HandoverPhase(enum.IntEnum):
    """States of figure 3.1, and its two ends."""

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
    light: bool = output("signal light: its beginning tells the person that the robot is ready")
    failed_receptions: int = output("times that the gripper closed on nothing", minimum=0.0)
    speed_G: MetrePerSecond = output("speed of the gripper, low-passed, as it is monitored", minimum=0.0)


class HandoverStateMachine:
    """Runs a handover through the states of figure 3.1.

    - Robot to human, figure 3.2: OPEN_GRIPPER, MOVE_TO_OBJECT (at the end straight ahead, for what is touched floats
      away), GRASP_OBJECT, MOVE_TO_HANDOVER, ACTIVATE_IMPEDANCE, SIGNAL, CHECK_VELOCITY until the gripper is faster than
      release_velocity, RELEASE_OBJECT, DEACTIVATE_IMPEDANCE, RETREAT, DONE.
    - Human to robot, figure 3.3: OPEN_GRIPPER, MOVE_TO_HANDOVER, ACTIVATE_IMPEDANCE, SIGNAL, CHECK_VELOCITY until it
      is faster than receive_velocity, CLOSE_GRIPPER, CHECK_ANGLE; above angle_threshold it holds the object and goes on
      as above, else the reception has failed: OPEN_GRIPPER, and from SIGNAL again.
    - Collaborative, sec. 5.5: robot to human up to RELEASE_OBJECT, then, from ACTIVATE_IMPEDANCE, human to robot.
    - Hold: ACTIVATE_IMPEDANCE, to the end.

    Conditions of this implementation besides: impedance control begins only at rest near the handover place
    (gate_error, gate_speed), and the light only once the gripper is at rest again under it and within `tolerance`,
    after a failure too, since a transient trips the threshold with no person there. The threshold counts from the light
    on, once the speed was below it. Unless `gated`, none of this holds, as the thesis names no such condition:
    impedance control begins within gate_error of the place, at any speed, the light follows at once, and the threshold
    counts from its end. The gripper's velocity is v + w x R p_BG. GIVEN_UP, holding the pose and not moving the
    gripper, is entered after `patience` in a phase, after `attempts` failures, and when an object that was fetched is
    not between the fingers.

    Where it is `gradual`, CHECK_VELOCITY moves the fingers, by how the gripper's speed v lies between a part of the
    threshold and the threshold a itself: s = (v / a - gradual_share) / (1 - gradual_share), from 0 to 1. While it gives
    and is pulled (`PullMonitor`), the closure is 1 - s, and the object is released once the fingers have opened by
    free_angle from what they held, or hold nothing: where the pull ends before that, they close again. While it
    receives, the closure is the largest s since v was last below that part, and the threshold decides as ever.

    Raises:
        InvalidHandoverParameters: by the constructor, for goals out of reach, or thresholds or times that cannot work;
            all are named.
        InvalidOrientation: the estimated attitude is zero or not finite.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("phase", "p_WG_goal", "q_WG_goal", "impedance", "pose", "closure", "light", "failed_receptions", "speed_G"),
        ("p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas", "gripper_angle"),
    )
    period: ClassVar[Fraction] = PERIOD

    def __init__(self, params: Params) -> None:
        params.check()
        self._params = params
        self._T = float(self.period)
        self._release, self._receive = params.velocities()
        self._p_BG = vector(params.p_BG)
        q_handover = unit_quaternion(params.q_WG_handover, NAME, "q_WG_handover")
        self._handover: tuple[Vector, Quaternion] = (vector(params.p_WG_handover), q_handover)
        self._retreat: tuple[Vector, Quaternion] = (vector(params.p_WG_retreat), q_handover)
        q_object = unit_quaternion(params.q_WG_object, NAME, "q_WG_object")
        self._standoff: tuple[Vector, Quaternion] = (vector(params.standoff()), q_object)
        self._object: tuple[Vector, Quaternion] = (vector(params.object_goal()), q_object)
        holds = params.task is HandoverTask.HOLD
        self._monitor = VelocityMonitor(params.filter_time, self._T)
        self._phase = HandoverPhase.ACTIVATE_IMPEDANCE if holds else HandoverPhase.OPEN_GRIPPER
        self._goal: tuple[Vector, Quaternion] | None = self._handover if holds else None
        self._impedance = holds
        self._closure = 0.0
        self._receiving = params.task is HandoverTask.HUMAN_TO_ROBOT
        self._failed = 0
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
            HandoverPhase.CLOSE_GRIPPER: self._close_gripper,
            HandoverPhase.CHECK_ANGLE: self._check_angle,
            HandoverPhase.DEACTIVATE_IMPEDANCE: self._deactivate_impedance,
            HandoverPhase.RETREAT: self._retreat_from_handover,
        }

    def outputs(self, t: float, u: Inputs) -> Outputs:
        """Return what a step would give; nothing is decided."""
        before = self.get_state()
        y = self.step(t, self._T, u)
        self.set_state(before)
        return y

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Measure, decide, and return the commands that hold until t + dt; at most one transition."""
        q_WB = unit_quaternion(u.q_WB_meas, NAME, "q_WB_meas")
        r = rotate(rotation_matrix(q_WB), self._p_BG)
        self._monitor.measure(add(vector(u.v_WB_meas), cross(vector(u.w_WB_meas), r)))
        self._pulled = self._pull.measure(self._monitor.speed, self._params.gradual_share * self._threshold)
        here = add(vector(u.p_WB_meas), r), q_WB
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
            impedance=self._impedance,
            pose=not self._impedance,
            closure=self._closure,
            light=self._phase is HandoverPhase.SIGNAL,
            failed_receptions=self._failed,
            speed_G=self._monitor.speed,
        )

    def get_state(self) -> bytes:
        """Return phase, goal, counters and the monitor's filter."""
        counters = (self._failed, self._steps, self._settled)
        switches = (self._impedance, self._closure, self._receiving, self._held_angle)
        return pack_state(
            (int(self._phase), self._goal, counters, switches, self._monitor.get_state(), self._pull.get_state())
        )

    def set_state(self, state: bytes) -> None:
        """Restore a state of this machine or of one with equal parameters."""
        phase, self._goal, counters, switches, monitor, pull = unpack_state(state)
        self._phase = HandoverPhase(phase)
        self._failed, self._steps, self._settled = counters
        self._impedance, self._closure, self._receiving, self._held_angle = switches
        self._monitor.set_state(monitor)
        self._pull.set_state(pull)

    def _count_settled(self, here: tuple[Vector, Quaternion]) -> None:
        """Count the steps for which the gripper has been at rest at its goal."""
        p, (p_WG, q_WG), goal = self._params, here, self._goal
        away = math.inf if goal is None else distance(goal[0], p_WG)
        self._near = away < p.gate_error
        if goal is None or self._monitor.speed >= p.gate_speed:
            self._settled = 0
            return
        to_handover = self._phase is HandoverPhase.MOVE_TO_HANDOVER
        near = self._near if to_handover else away < p.tolerance
        self._settled = self._settled + 1 if near and angle_between(goal[1], q_WG) < p.tolerance_angle else 0

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

    def _enter(self, phase: HandoverPhase, here: tuple[Vector, Quaternion]) -> None:
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
        if not self._receiving and not self._holds_something(angle):  # lost during the move
            return HandoverPhase.GIVEN_UP
        return HandoverPhase.ACTIVATE_IMPEDANCE if self._may_hand_over() else None

    def _activate_impedance(self, angle: float) -> HandoverPhase | None:  # noqa: ARG002
        p = self._params
        waits = p.task is HandoverTask.COLLABORATIVE and self._receiving and not self._lasted(p.pause)
        if p.task is HandoverTask.HOLD or waits or not self._may_hand_over():
            return None
        return HandoverPhase.SIGNAL

    def _signal(self, angle: float) -> HandoverPhase | None:
        self._held_angle = angle
        self._moved_by_a_person()
        return HandoverPhase.CHECK_VELOCITY if self._lasted(self._params.signal_time) else None

    def _check_velocity(self, angle: float) -> HandoverPhase | None:
        if self._params.gradual:
            return self._follow_the_hand(angle)
        if not self._moved_by_a_person():
            return None
        return HandoverPhase.CLOSE_GRIPPER if self._receiving else HandoverPhase.RELEASE_OBJECT

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

    def _release_object(self, angle: float) -> HandoverPhase | None:  # noqa: ARG002
        if not self._lasted(self._params.gripper_time):
            return None
        if self._params.task is HandoverTask.COLLABORATIVE:
            self._receiving = True
            return HandoverPhase.ACTIVATE_IMPEDANCE
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

    def _holds_something(self, angle: float) -> bool:
        return angle > self._params.angle_threshold

    @property
    def _threshold(self) -> float:
        return self._receive if self._receiving else self._release

    def _moved_by_a_person(self, share: float = 1.0) -> bool:
        """Return whether the gripper is faster than a part of its threshold."""
        threshold = share * self._threshold
        return self._monitor.exceeds(threshold) if self._params.gated else self._monitor.speed > threshold
