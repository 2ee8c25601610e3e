"""A large object between two free-flyers and a person with two hands, proposed by [Fernandes2020] sec. 6.3."""

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Vector,
    add,
    cross,
    distance,
    normalize,
    quaternion,
    rotate,
    rotation_matrix,
    subtract,
    vector,
)
from handover.cosim.blocks.ports import Vector3, Vector4, Vector14, output, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, MetrePerSecond, Newton, NewtonMetre, Number, Radian, RadianPerSecond
from handover.plants.free_flyer.hand.attachment import Attachment, Frame, Palm
from handover.plants.free_flyer.hand.contacts import (
    MovedGripper,
    MovedHand,
    exchange_forces,
    seen_from_bar,
    touches_of,
)
from handover.plants.free_flyer.hand.floating_object import FloatingObject, Wrench
from handover.plants.free_flyer.hand.flyer_gripper import FlyerGripper
from handover.plants.free_flyer.hand.gripper_contact import GripperSolids
from handover.plants.free_flyer.hand.hand_kinematics import CLOSED, STRAIGHT
from handover.plants.free_flyer.hand.parameters import Motion, StartHolder
from handover.plants.free_flyer.hand.person import Activity
from handover.plants.free_flyer.large_object.hand_pair import HandPair
from handover.plants.free_flyer.large_object.parameters import InvalidLargeObjectParameters, Params

__all__ = [
    "Activity",
    "Holding",
    "Inputs",
    "InvalidLargeObjectParameters",
    "LargeObjectAndHands",
    "Motion",
    "Outputs",
    "Params",
    "StartHolder",
]


class Holding(enum.IntEnum):
    """Which of two hold the object, as a bit mask: 1 the first, 2 the second."""

    NONE = 0
    FIRST = 1
    SECOND = 2
    BOTH = 3


_STARTS = np.array([0.28, 0.25, 0.0]), np.array([0.28, -0.25, 0.0])


@dataclass(kw_only=True)
class Inputs:
    """What both robots do; their grippers' places in the default wiring's start. The first is the one at +y."""

    p_WG_1: Vector3[Metre] = port(_STARTS[0], "position of the first robot's gripper in the world")
    q_WG_1: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "its orientation in the world")
    v_WG_1: Vector3[MetrePerSecond] = port(np.zeros(3), "its velocity in the world")
    w_WG_1: Vector3[RadianPerSecond] = port(np.zeros(3), "its angular velocity in the world")
    closure_1: Number = port(0.0, "closure commanded to it: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    light_1: bool = port(False, "the first robot's signal light is on")
    p_WG_2: Vector3[Metre] = port(_STARTS[1], "position of the second robot's gripper in the world")
    q_WG_2: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "its orientation in the world")
    v_WG_2: Vector3[MetrePerSecond] = port(np.zeros(3), "its velocity in the world")
    w_WG_2: Vector3[RadianPerSecond] = port(np.zeros(3), "its angular velocity in the world")
    closure_2: Number = port(0.0, "closure commanded to it: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    light_2: bool = port(False, "the second robot's signal light is on")


@dataclass(kw_only=True)
class Outputs:
    """What the grippers feel, where object and hands are, in the world, and who holds the object."""

    f_G_1: Vector3[Newton] = output("force on the first gripper at its G, mean over the step")
    tau_G_1: Vector3[NewtonMetre] = output("torque on the first gripper about its G, mean over the step")
    f_G_2: Vector3[Newton] = output("force on the second gripper at its G, mean over the step")
    tau_G_2: Vector3[NewtonMetre] = output("torque on the second gripper about its G, mean over the step")
    p_WO: Vector3[Metre] = output("position of the object's centre")
    q_WO: Vector4[Number] = output("orientation of the object")
    v_WO: Vector3[MetrePerSecond] = output("velocity of the object's centre")
    w_WO: Vector3[RadianPerSecond] = output("angular velocity of the object")
    p_WH_1: Vector3[Metre] = output("position of the middle of the first hand's palm")
    q_WH_1: Vector4[Number] = output("orientation of the first hand, along the object's axes when it holds a handle")
    f_H_1: Vector3[Newton] = output("force on the first hand, mean over the step")
    finger_1: Vector14[Radian] = output("angles of its joints: thumb 2, then 3 of each finger, each from its base")
    p_WH_2: Vector3[Metre] = output("position of the middle of the second hand's palm")
    q_WH_2: Vector4[Number] = output("orientation of the second hand")
    f_H_2: Vector3[Newton] = output("force on the second hand, mean over the step")
    finger_2: Vector14[Radian] = output("angles of its joints")
    gripper_angle_1: Radian = output("angle between the first gripper's fingers")
    gripper_angle_2: Radian = output("angle between the second gripper's fingers")
    grippers_holding: Holding = output("which grippers hold the object")
    hands_holding: Holding = output("which hands hold it")
    activity: Activity = output("what the person does")


class LargeObjectAndHands:
    """A rigid box with four handles, which two free-flyers grip and a person takes, or gives, with one hand or two.

    - `FloatingObject`: the box, held by up to four springs. `FlyerGripper`: each robot's, at its own handle, p_OG plus
      or minus half of grip_spacing along y; `FlyerHand` and `HandFingers`: each hand, at p_OH plus or minus half of
      hand_spacing. They are those of `HandAndObject`, as is what they do to each other in a step (`exchange_forces`).
    - `HandPair`: the person reaches for both handles, closes, and pulls or pushes with both arms, at the signal of both
      robots. The second hand closes and opens hand_delay later; one that missed its handle makes the person try again.
    - Motion PUSH: two fists push the grippers' palms, without the object.

    Only handles are touched: nothing collides with the box, nor the robots with each other. A hand that is not used
    rests beside the other one.

    One unit for the reason that `HandAndObject` is one. In a system it comes after the robots. Their grippers are
    interpolated from the last step's pose to this one's; wrenches act on them in the next step.

    Raises:
        InvalidLargeObjectParameters: by the constructor, for parameters that contradict each other. By the first step,
            if a gripper starts in a hand or has a handle in its palm or its closed fingers.
        TurnsTooFast: see `RigidBody`.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("gripper_1", TerminalKind.MOTION, p_WG="p_WG_1", q_WG="q_WG_1", v_WG="v_WG_1", w_WG="w_WG_1"),
        terminal("contact_1", TerminalKind.WRENCH, f_G="f_G_1", tau_G="tau_G_1"),
        terminal("gripper_2", TerminalKind.MOTION, p_WG="p_WG_2", q_WG="q_WG_2", v_WG="v_WG_2", w_WG="w_WG_2"),
        terminal("contact_2", TerminalKind.WRENCH, f_G="f_G_2", tau_G="tau_G_2"),
    )
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        params.check()
        self._p = params
        one = params.of_handle
        self._pair = HandPair(params)
        self._grippers = [FlyerGripper(one, place) for place in params.grip_places]
        self._solids = GripperSolids(one)
        self._object = FloatingObject(params.object_mass, vector(params.object_size))
        self._robots: list[Frame] | None = None
        self._on_grippers: list[Wrench] = [(ZERO, ZERO)] * 2
        self._on_hands: list[Vector] = [ZERO] * params.hands
        body, person = self._object.body, self._pair.person
        if params.object_with is StartHolder.HAND:
            body.q = person.q
            body.p = subtract(person.p, rotate(rotation_matrix(body.q), vector(params.p_OH)))
            for hand, fingers in zip(self._pair.hands, self._pair.fingers, strict=True):
                hand.take_or_leave(hand.gets(True, body), body)
                fingers.settle(CLOSED, seen_from_bar(hand, body, hand.course))
        else:
            body.p = vector(params.p_WO_0)
            body.q = normalize(quaternion(params.q_WO_0))

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where everything is; no time passes."""
        return self._outputs()

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Advance from t by dt with u held."""
        Gs = [
            Frame(vector(u.p_WG_1), quaternion(u.q_WG_1), vector(u.v_WG_1), vector(u.w_WG_1)),
            Frame(vector(u.p_WG_2), quaternion(u.q_WG_2), vector(u.v_WG_2), vector(u.w_WG_2)),
        ]
        if self._robots is None:
            self._check_overlap(Gs)
        before, body, pair = self._robots or Gs, self._object.body, self._pair
        pair.act(dt, (u.light_1, u.light_2), self._grippers, before, body, reduce(add, self._on_hands, ZERO))
        for gripper, closure, G in zip(self._grippers, (u.closure_1, u.closure_2), before, strict=True):
            gripper.act(dt, closure, G, body)
        courses = pair.move(dt, body)
        pressed = [self._press(dt, i, course, Gs) for i, course in enumerate(courses)]
        courses = [course for course, _ in pressed]
        self._exchange_forces(dt, before, Gs, courses)
        for i, (_, presses) in enumerate(pressed):
            for n, (f, tau) in enumerate(presses):
                f_G, tau_G = self._on_grippers[n]
                self._on_grippers[n] = add(f_G, f), add(tau_G, tau)
                self._on_hands[i] = subtract(self._on_hands[i], f)
        for hand, course in zip(pair.hands, courses, strict=True):
            hand.arrive(hand.kept_off(dt, course, body) if pair.person.reaches else course, body)
        self._robots = Gs
        return self._outputs()

    def get_state(self) -> bytes:
        """Return the complete state."""
        b = self._object.body
        grips = [(g.angle, None if (a := g.grip) is None else (a.r, a.place, a.turn)) for g in self._grippers]
        robots = None if self._robots is None else [(G.p, G.q, G.v, G.w) for G in self._robots]
        forces = self._on_grippers, self._on_hands
        return pack_state(((b.p, b.q, b.v, b.spin), self._pair.get_state(), grips, robots, forces))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this unit or of one with equal parameters."""
        b = self._object.body
        (b.p, b.q, b.v, b.spin), pair, grips, robots, (on_grippers, on_hands) = unpack_state(state)
        self._pair.set_state(pair)
        for gripper, (angle, grip) in zip(self._grippers, grips, strict=True):
            gripper.angle = angle
            gripper.grip = None if grip is None else Attachment(gripper.stiffness, *grip)
        self._robots = None if robots is None else [Frame(*G) for G in robots]
        self._on_grippers, self._on_hands = list(on_grippers), list(on_hands)

    def _press(self, dt: float, i: int, course: Frame, Gs: Sequence[Frame]) -> tuple[Frame, list[Wrench]]:
        """Let a hand meet both grippers, as a fist or with its fingers; return its course and what it does to each."""
        pair, body, presses = self._pair, self._object.body, list[Wrench]()
        hand, fingers = pair.hands[i], pair.fingers[i]
        fist = pair.person.pushes_with_fist
        if fist:
            for n, at in enumerate(Gs):
                course, f, p_GF = hand.press(dt, course, at, n)
                presses.append((f, cross(p_GF, f)))
        fingers.advance(dt, pair.wanted_angles(i), seen_from_bar(hand, body, course))
        if not fist:
            H = course if hand.hold is None else hand.carried_by(body)
            meetings = zip(Gs, self._grippers, strict=True)
            presses = [self._solids.press(fingers.bones(), H, at, gripper.angle) for at, gripper in meetings]
        return course, presses

    def _exchange_forces(
        self, dt: float, before: Sequence[Frame], Gs: Sequence[Frame], courses: Sequence[Frame]
    ) -> None:
        grippers = [MovedGripper(g, b, G) for g, b, G in zip(self._grippers, before, Gs, strict=True)]
        hands = [
            MovedHand(hand, course, lambda H, i=i: self._touches(i, H))
            for i, (hand, course) in enumerate(zip(self._pair.hands, courses, strict=True))
        ]
        self._on_grippers, self._on_hands = exchange_forces(dt, self._p.substep, self._object, grippers, hands)

    def _touches(self, i: int, H: Frame) -> list[Palm]:
        pair = self._pair
        return touches_of(
            self._p, pair.hands[i], pair.fingers[i], self._object.body, H, force=0.0, reaches=pair.person.reaches
        )

    def _check_overlap(self, Gs: Sequence[Frame]) -> None:
        p, body, faults = self._p, self._object.body, list[str]()
        for i, (gripper, G) in enumerate(zip(self._grippers, Gs, strict=True), 1):
            for hand in self._pair.hands:
                apart, least = distance(hand.p, G.p), p.fist_radius + p.palm_width
                if apart < least:
                    faults.append(
                        f"a hand starts in gripper {i}, {least - apart:.3g} m deep: {apart:.3g} m from its G, of which "
                        f"p_WH_0 must leave {least:.3g} m at least"
                    )
            if gripper.touches(G, body):
                faults.append(f"a handle starts in the palm of gripper {i}; move p_WO_0 or the robot's start")
            if gripper.crushes(G, body):
                faults.append(
                    f"a handle starts between the fingers of gripper {i}, which are closed further than it is thick: "
                    f"angle_0 {p.angle_0:g} rad; open them to {p.angle_object:.3g} rad at least, or move p_WO_0 or "
                    "the robot's start"
                )
        if faults:
            raise InvalidLargeObjectParameters(faults)

    def _outputs(self) -> Outputs:
        b, pair, (first, second) = self._object.body, self._pair, self._grippers
        (f_1, tau_1), (f_2, tau_2) = self._on_grippers
        hand, other = pair.hands[0], pair.hands[-1]
        rests = self._p.hands == 1
        idle = add(
            pair.person.rest, rotate(rotation_matrix(quaternion(self._p.q_WH_0)), (0.0, -self._p.hand_spacing, 0.0))
        )
        return Outputs(
            f_G_1=np.array(f_1),
            tau_G_1=np.array(tau_1),
            f_G_2=np.array(f_2),
            tau_G_2=np.array(tau_2),
            p_WO=np.array(b.p),
            q_WO=np.array(b.q),
            v_WO=np.array(b.v),
            w_WO=np.array(b.w),
            p_WH_1=np.array(hand.p),
            q_WH_1=np.array(hand.q),
            f_H_1=np.array(self._on_hands[0]),
            finger_1=np.array(pair.fingers[0].angles),
            p_WH_2=np.array(idle if rests else other.p),
            q_WH_2=np.array(quaternion(self._p.q_WH_0) if rests else other.q),
            f_H_2=np.zeros(3) if rests else np.array(self._on_hands[1]),
            finger_2=np.array(STRAIGHT if rests else pair.fingers[1].angles),
            gripper_angle_1=first.angle,
            gripper_angle_2=second.angle,
            grippers_holding=Holding((first.grip is not None) + 2 * (second.grip is not None)),
            hands_holding=Holding((hand.hold is not None) + 2 * (not rests and other.hold is not None)),
            activity=pair.person.activity,
        )
