"""Hand, object and grip between a person and a free-flyer in microgravity, after [Fernandes2020] secs. 3.1-3.2, 4.3."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    ZERO,
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
from handover.cosim.blocks.units import (
    Metre,
    MetrePerSecond,
    Newton,
    NewtonMetre,
    Number,
    Radian,
    RadianPerSecond,
    Second,
)
from handover.plants.free_flyer.hand.attachment import Attachment, Frame, Palm
from handover.plants.free_flyer.hand.contacts import (
    MovedGripper,
    MovedHand,
    exchange_forces,
    seen_from_bar,
    touches_of,
)
from handover.plants.free_flyer.hand.finger_contact import Angles, HandFingers
from handover.plants.free_flyer.hand.floating_object import FloatingObject
from handover.plants.free_flyer.hand.flyer_gripper import FlyerGripper
from handover.plants.free_flyer.hand.flyer_hand import FlyerHand
from handover.plants.free_flyer.hand.gripper_contact import GripperSolids
from handover.plants.free_flyer.hand.hand_guide import HandGuide, pose_of_tracker
from handover.plants.free_flyer.hand.hand_kinematics import CLOSED, STRAIGHT
from handover.plants.free_flyer.hand.hand_track import HandPose, read_track
from handover.plants.free_flyer.hand.parameters import Driver, InvalidHandParameters, Motion, Params, StartHolder
from handover.plants.free_flyer.hand.person import Activity, FlyerPerson
from handover.plants.free_flyer.hand.sight import Perception
from handover.plants.hand_motion import minimum_jerk

__all__ = [
    "Activity",
    "Driver",
    "HandAndObject",
    "Holder",
    "Inputs",
    "InvalidHandParameters",
    "Motion",
    "Outputs",
    "Params",
    "StartHolder",
]


class Holder(enum.IntEnum):
    """Who holds the object."""

    FREE = 0
    GRIPPER = 1
    HAND = 2
    BOTH = 3


@dataclass(kw_only=True)
class Inputs:
    """What the robot does; its gripper's place in the default wiring's start."""

    p_WG: Vector3[Metre] = port(np.array([0.0, -0.07, 0.0]), "position of the gripper in the world")
    q_WG: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "orientation of the gripper in the world")
    v_WG: Vector3[MetrePerSecond] = port(np.zeros(3), "velocity of the gripper in the world")
    w_WG: Vector3[RadianPerSecond] = port(np.zeros(3), "angular velocity of the gripper in the world")
    closure: Number = port(0.0, "closure commanded to the gripper: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    light: bool = port(False, "the robot's signal light is on")
    p_WH_track: Vector3[Metre] = port(np.array([-0.40, 0.10, -0.05]), "wanted position of the hand, by a hand tracker")
    q_WH_track: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "wanted orientation of the hand, by it")
    finger_track: Vector14[Radian] = port(np.zeros(14), "wanted angles of the joints, by it, as the output finger")
    closed_track: bool = port(False, "by the tracker the hand grasps")
    age: Second = port(0.0, "age of what the tracker says", minimum=0.0)


@dataclass(kw_only=True)
class Outputs:
    """What the gripper feels, where object and hand are, in the world, and who holds the object."""

    f_G: Vector3[Newton] = output("force on the gripper at G, mean over the step")
    tau_G: Vector3[NewtonMetre] = output("torque on the gripper about G, mean over the step")
    p_WO: Vector3[Metre] = output("position of the object's centre")
    q_WO: Vector4[Number] = output("orientation of the object")
    v_WO: Vector3[MetrePerSecond] = output("velocity of the object's centre")
    p_WH: Vector3[Metre] = output("position of the middle of the palm of the hand")
    q_WH: Vector4[Number] = output("orientation of the hand, along the object's axes when it holds it as offered")
    finger: Vector14[Radian] = output("angles of the joints: thumb 2, then 3 of each finger, each from its base")
    gripper_angle: Radian = output("angle between the gripper's fingers")
    holder: Holder = output("who holds the object")
    activity: Activity = output("what the person does")
    f_H: Vector3[Newton] = output("force on the hand, mean over the step")
    p_WH_goal: Vector3[Metre] = output("position at which person or tracker want the hand")
    q_WH_goal: Vector4[Number] = output("orientation in which they want it")
    finger_goal: Vector14[Radian] = output("angles to which they want the joints")
    closed_goal: bool = output("they want the hand to grasp")


_HOLDERS = {
    (False, False): Holder.FREE,
    (True, False): Holder.GRIPPER,
    (False, True): Holder.HAND,
    (True, True): Holder.BOTH,
}
"""By whether the gripper and whether the hand holds it."""
_ENDS = {0.0: STRAIGHT, 1.0: CLOSED}
"""Angles of a hand that is open or closed."""


class HandAndObject:
    """A person's hand and the object that a free-flyer gives or takes, joined by springs in one unit.

    - `FloatingObject`: a rigid box of 0.1 kg in microgravity. `FlyerGripper` holds it by a stiff spring in all six
      directions that slides at its limits, or has it pressed against its palm. A hand that holds it is joined to its
      course by the arm's and wrist's springs, which yield at the force that a person tolerates (`FlyerHand`).
    - `FlyerPerson` moves the hand's course and decides when the fingers close; it pulls and pushes by an effort against
      the force on the hand (`Effort`). `HandTremor` is added to the course. A fist pushes the palm by the arm's spring.
    - `HandFingers`: 14 joints whose phalanges, capsules, stop at the object, and push it by springs where they cannot
      give way; so does the gripper (`GripperSolids`), if the hand is not a fist. They have no friction: what holds an
      object is the hand's grip as a whole. A person who closes the hand ends at the touch, without pressing.
    - In place of that person, `driven_by` a track (`HandTrack`, a file) or the inputs of a hand tracker lead the hand
      (`HandGuide`) and its joints, which then press what they close on. It takes hold when it is to grasp and thumb and
      fingers enclose the object, and lets go when it is not to; as a fist it pushes the palm. An object that it loses
      beyond the reach of its arm it takes again only after it has opened. Tracking that is older than age_max, or not
      finite, is lost: the hand stops, as it is, and keeps what it holds. The hand lags behind its inputs, and not
      behind a file, where it looks ahead. A track reacts to nothing: neither light nor robot. There is no tremor but
      its own, and activity stays WAIT.

    One unit, because a bare 0.1 kg object that two units exchange by forces is unstable at a few milliseconds. Here the
    gripper's displacement goes in and its wrench, the mean over the step, is put out: stable at 16 and 32 ms. In a
    system this unit comes after the robot. The gripper is interpolated from the last step's pose to this one's; its
    wrench acts on the robot in the next step.

    Raises:
        InvalidHandParameters: by the constructor, for parameters that contradict each other. By the first step, if the
            gripper starts in the hand or has the free object in its palm or its closed fingers.
        InvalidTrack: by the constructor, for a track that cannot be followed.
        TurnsTooFast: see `RigidBody`.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("gripper", TerminalKind.MOTION, "p_WG", "q_WG", "v_WG", "w_WG"),
        terminal("contact", TerminalKind.WRENCH, "f_G", "tau_G"),
        terminal("object", TerminalKind.POSE, "p_WO", "q_WO"),
        terminal("hand", TerminalKind.POSE, "p_WH", "q_WH"),
    )
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        params.check()
        self._p = params
        self._person = FlyerPerson(params)
        self._track = read_track(Path(params.track), params.age_max) if params.driven_by is Driver.TRACK else None
        self._guide: HandGuide | None = None
        steady = params
        if params.driven_by is not Driver.PERSON:
            self._guide = HandGuide(params, self._person.p, self._person.q, self._person.holding)
            steady = replace(params, tremor_rms=0.0, drift_rms=0.0)
        self._hand = FlyerHand(steady, self._person.p, self._person.q)
        self._gripper = FlyerGripper(params)
        self._solids = GripperSolids(params)
        self._object = FloatingObject(params.object_mass, vector(params.object_size))
        self._fingers = HandFingers(vector(params.object_size), params.finger_rate)
        self._robot: Frame | None = None
        self._f_G, self._tau_G, self._f_H = ZERO, ZERO, ZERO
        self._goal = HandPose(self._hand.p, self._hand.q, self._wanted_angles(), self._person.holding)
        body = self._object.body
        if params.object_with is StartHolder.HAND:
            body.q = self._hand.q
            body.p = subtract(self._hand.p, rotate(rotation_matrix(body.q), self._hand.p_OH))
            self._hand.take_or_leave(self._hand.gets(True, body), body)
            self._fingers.settle(CLOSED, self._seen_from_object(self._hand.course))
        else:
            body.p = vector(params.p_WO_0)
            body.q = normalize(quaternion(params.q_WO_0))

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where everything is; no time passes."""
        return self._outputs()

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt with u held."""
        G = Frame(vector(u.p_WG), quaternion(u.q_WG), vector(u.v_WG), vector(u.w_WG))
        if self._robot is None:
            self._check_overlap(G)
        before, body, hand = self._robot or G, self._object.body, self._hand
        course, fist = self._moved_hand(t, dt, u, before)
        f_hand, tau_hand = ZERO, ZERO
        if fist:
            course, f_hand, p_GF = hand.press(dt, course, G)
            tau_hand = cross(p_GF, f_hand)
        is_far = hand.hold is None and distance(course.p, body.p) > self._fingers.reach
        self._fingers.advance(dt, self._goal.angles, None if is_far else self._seen_from_object(course))
        if not fist:
            H = course if hand.hold is None else hand.carried_by(body)
            f_hand, tau_hand = self._solids.press(self._fingers.bones(), H, G, self._gripper.angle)
        self._exchange_forces(dt, before, G, course)
        if f_hand != ZERO or tau_hand != ZERO:
            self._f_G, self._tau_G = add(self._f_G, f_hand), add(self._tau_G, tau_hand)
            self._f_H = subtract(self._f_H, f_hand)
        if self._may_bump():
            course = hand.kept_off(dt, course, body)
        hand.arrive(course, body)
        self._robot = G
        return self._outputs()

    def get_state(self) -> bytes:
        """Return the complete state."""
        b, grip, G = self._object.body, self._gripper.grip, self._robot
        fingers = (self._fingers.wanted, self._fingers.angles)
        g, guide = self._goal, self._guide
        led = (g.p, g.q, g.angles, g.closed), None if guide is None else guide.get_state()
        parts = (self._person.get_state(), self._hand.get_state(), self._gripper.angle, fingers, led)
        held = None if grip is None else (grip.r, grip.place, grip.turn)
        robot = None if G is None else (G.p, G.q, G.v, G.w)
        return pack_state(((b.p, b.q, b.v, b.spin), parts, held, robot, (self._f_G, self._tau_G, self._f_H)))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this unit or of one with equal parameters."""
        b = self._object.body
        (b.p, b.q, b.v, b.spin), parts, held, robot, (self._f_G, self._tau_G, self._f_H) = unpack_state(state)
        person, hand, self._gripper.angle, (self._fingers.wanted, self._fingers.angles), (goal, guide) = parts
        self._goal = HandPose(*goal)
        if self._guide is not None:
            self._guide.set_state(guide)
        self._person.set_state(person)
        self._hand.set_state(hand)
        self._gripper.grip = None if held is None else Attachment(self._gripper.stiffness, *held)
        self._robot = None if robot is None else Frame(*robot)

    def _moved_hand(self, t: float, dt: float, u: Inputs, before: Frame) -> tuple[Frame, bool]:
        """Let who moves the hand do so for dt; return its course if nothing obstructs it, and whether it is a fist."""
        body, person, hand, guide = self._object.body, self._person, self._hand, self._guide
        if guide is None:
            person.act(dt, self._perception(u.light, before))
            self._gripper.act(dt, u.closure, before, body)
            hand.take_or_leave(hand.gets(person.holding and person.fingers == 1.0, body), body)
            course = hand.move(dt, person.p, person.q)
            self._goal = HandPose(course.p, course.q, self._wanted_angles(), person.holding)
            return course, person.pushes_with_fist
        if self._track is not None:
            guide.follow(dt, self._track.at(t + dt), self._track.at(t + dt + guide.lag(dt)))
        else:
            guide.follow(dt, _tracked(u, self._p.age_max))
        self._goal = guide.goal
        self._gripper.act(dt, u.closure, before, body)
        encloses = hand.hold is None and self._fingers.encloses(self._seen_from_object(hand.course))
        hand.take_or_leave(hand.grasps(guide.goal.closed, encloses), body)
        return hand.move(dt, guide.p, guide.q), guide.goal.closed

    def _check_overlap(self, G: Frame) -> None:
        p, faults = self._p, list[str]()
        apart, least = distance(self._hand.p, G.p), p.fist_radius + p.palm_width
        if apart < least:
            faults.append(
                f"the hand starts in the gripper, {least - apart:.3g} m deep: p_WH_0 is {apart:.3g} m from G, "
                f"and must be {least:.3g} m at least"
            )
        if self._gripper.touches(G, self._object.body):
            faults.append("the object starts in the gripper's palm; move p_WO_0 or the robot's start")
        if self._gripper.crushes(G, self._object.body):
            faults.append(
                f"the object starts between fingers that are closed further than it is thick: angle_0 {p.angle_0:g} "
                f"rad; open them to {p.angle_object:.3g} rad at least, or move p_WO_0 or the robot's start"
            )
        if faults:
            raise InvalidHandParameters(faults)

    def _perception(self, light: bool, G: Frame) -> Perception:
        b, hand = self._object.body, self._hand
        return Perception(
            light=light,
            angle=self._gripper.angle,
            G=G,
            O=Frame(b.p, b.q),
            gripped=self._gripper.grip is not None,
            held=hand.hold is not None,
            p_WH=hand.calm,
            q_WH=hand.q,
            p_OH=hand.p_OH,
            q_OH=hand.q_OH,
            f_H=self._f_H,
        )

    def _exchange_forces(self, dt: float, before: Frame, after: Frame, course: Frame) -> None:
        """Let object, gripper and hand act on each other for dt; find their mean wrenches."""
        gripper = MovedGripper(self._gripper, before, after)
        hand = MovedHand(self._hand, course, self._touches)
        wrenches, forces = exchange_forces(dt, self._p.substep, self._object, [gripper], [hand])
        ((self._f_G, self._tau_G),), (self._f_H,) = wrenches, forces

    def _wanted_angles(self) -> Angles:
        """Return the angles to which the person wants to close the joints."""
        if self._person.fingers in _ENDS:
            return _ENDS[self._person.fingers]
        closed = minimum_jerk(self._person.fingers)
        return tuple([closed * angle for angle in CLOSED])

    def _touches(self, H: Frame) -> list[Palm]:
        """Return what a hand at H, that holds nothing, does to the object."""
        force = 0.0 if self._guide is None else self._p.finger_force
        return touches_of(self._p, self._hand, self._fingers, self._object.body, H, force, self._may_bump())

    def _may_bump(self) -> bool:
        """Return whether a person's open hand reaches for the object, so that its palm may meet it."""
        return self._guide is None and self._person.reaches

    def _seen_from_object(self, H: Frame) -> Frame:
        """Return a hand that is at H, or that holds the object, as seen from the object."""
        return seen_from_bar(self._hand, self._object.body, H)

    def _outputs(self) -> Outputs:
        """Return the outputs as pieces of one array, which costs less than an array each."""
        b, hand = self._object.body, self._hand
        g = self._goal
        a = np.array([*self._f_G, *self._tau_G, *b.p, *b.q, *b.v, *hand.p, *hand.q, *self._f_H, *g.p, *g.q])
        return Outputs(
            f_G=a[0:3],
            tau_G=a[3:6],
            p_WO=a[6:9],
            q_WO=a[9:13],
            v_WO=a[13:16],
            p_WH=a[16:19],
            q_WH=a[19:23],
            finger=np.array(self._fingers.angles),
            gripper_angle=self._gripper.angle,
            holder=_HOLDERS[self._gripper.grip is not None, hand.hold is not None],
            activity=self._person.activity,
            f_H=a[23:26],
            p_WH_goal=a[26:29],
            q_WH_goal=a[29:33],
            finger_goal=np.array(g.angles),
            closed_goal=g.closed,
        )


def _tracked(u: Inputs, age_max: float) -> HandPose | None:
    """Return the pose that a hand tracker says, none if it has lost the hand."""
    if not u.age <= age_max:
        return None
    return pose_of_tracker(u.p_WH_track, u.q_WH_track, u.finger_track, u.closed_track)
