"""What hands and grippers do to a floating object in a step, and it to them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Vector,
    add,
    cross,
    distance,
    dot,
    inverse_rotate,
    lerp,
    nlerp,
    relative_quaternion,
    rotate,
    rotation_matrix,
    scale,
    subtract,
)
from handover.plants.free_flyer.hand.attachment import Frame, Palm
from handover.plants.free_flyer.hand.finger_contact import HandFingers
from handover.plants.free_flyer.hand.floating_object import FloatingObject, Wrench
from handover.plants.free_flyer.hand.flyer_gripper import FlyerGripper
from handover.plants.free_flyer.hand.flyer_hand import FlyerHand
from handover.plants.free_flyer.hand.parameters import ContactParams
from handover.plants.free_flyer.rigid_body import RigidBody

_SAME_WAY = 0.5
"""Cosine of the angle between two pushes above which phalanx and palm of a hand push as one (assumed)."""


@dataclass(frozen=True)
class MovedGripper:
    """A gripper that moves from one frame to another in a step."""

    gripper: FlyerGripper
    before: Frame
    after: Frame


@dataclass(frozen=True)
class MovedHand:
    """A hand whose course leads to a frame in a step; `touches` is what one that holds nothing does at a frame."""

    hand: FlyerHand
    course: Frame
    touches: Callable[[Frame], list[Palm]]


def exchange_forces(
    dt: float, substep: float, thing: FloatingObject, grippers: Sequence[MovedGripper], hands: Sequence[MovedHand]
) -> tuple[list[Wrench], list[Vector]]:
    """Let an object, grippers and hands act on each other for dt, in parts of at most `substep`, both in s.

    Returns:
        Of each gripper force and torque about G, of each hand the force on it, in W, means over dt.
    """
    count, body = max(1, math.ceil(dt / substep - 1e-6)), thing.body
    on_grippers: list[Wrench] = [(ZERO, ZERO)] * len(grippers)
    on_hands: list[Vector] = [ZERO] * len(hands)
    for i in range(1, count + 1):
        last, s = i == count, i / count
        frames = [g.after if last else _between(g.before, g.after, s) for g in grippers]
        arms = [h.course if last else _between(h.hand.course, h.course, s) for h in hands]
        grips = [(n, a) for n, g in enumerate(grippers) if (a := g.gripper.grip) is not None]
        holds = [(n, a) for n, h in enumerate(hands) if (a := h.hand.hold) is not None]
        held = [*((a, frames[n]) for n, a in grips), *((a, arms[n]) for n, a in holds)]
        palms = [(n, p) for n, g in enumerate(grippers) if (p := g.gripper.palm(frames[n], body)) is not None]
        touches = [(n, p) for n, h in enumerate(hands) for p in h.touches(arms[n])]
        if not held and not palms and not touches:
            thing.advance(dt / count, [], [])
            continue
        R, p_GO = rotation_matrix(body.q), [subtract(body.p, G.p) for G in frames]
        wrenches, pushes = thing.advance(dt / count, held, [p for _, p in (*palms, *touches)])
        for (n, palm), push in zip(palms, pushes, strict=False):
            on_grippers[n] = _reacted(on_grippers[n], push, ZERO, add(p_GO[n], rotate(R, palm.r)))
        for (n, _), push in zip(touches, pushes[len(palms) :], strict=True):
            on_hands[n] = subtract(on_hands[n], push)
        for (n, a), (f, tau) in zip(grips, wrenches, strict=False):
            on_grippers[n] = _reacted(on_grippers[n], f, tau, add(p_GO[n], rotate(R, a.r)))
        for (n, _), (f, _) in zip(holds, wrenches[len(grips) :], strict=True):
            on_hands[n] = subtract(on_hands[n], f)
    s = 1.0 / count
    return [(scale(s, f), scale(s, tau)) for f, tau in on_grippers], [scale(s, f) for f in on_hands]


def touches_of(
    params: ContactParams, hand: FlyerHand, fingers: HandFingers, body: RigidBody, H: Frame, force: float, reaches: bool
) -> list[Palm]:
    """Return what a hand at H, that holds nothing, does to the object: by phalanges, and, as it reaches, by its palm.

    Where a hand that reaches bumps the object, the thumb stands before the palm: what pushes as the palm does is a part
    of that push.

    Args:
        params: of the contacts.
        hand: of a person.
        fingers: of that hand.
        body: the object.
        H: where the hand is.
        force: what a phalanx presses with at most by its joint, N.
        reaches: whether the hand is open and reaches for the object, so that its palm may meet it.
    """
    if hand.hold is not None:
        return []
    touches = list[Palm]()
    if distance(H.p, add(body.p, rotate(rotation_matrix(body.q), hand.middle))) <= fingers.reach:
        seen = seen_from_bar(hand, body, H)
        touches = fingers.touches(seen, params.finger_stiffness, params.finger_damping, params.arm_force_max, force)
        if hand.middle != ZERO:
            touches = [replace(touch, r=add(hand.middle, touch.r)) for touch in touches]
    bump = hand.palm(H, body) if reaches else None
    if bump is None:
        return touches
    return [*(touch for touch in touches if dot(touch.n, bump.n) < _SAME_WAY), bump]


def seen_from_bar(hand: FlyerHand, body: RigidBody, H: Frame) -> Frame:
    """Return a hand that is at H, or that holds the object, as seen from the middle of what it is to hold, in O."""
    if hand.hold is not None:
        return Frame(subtract(hand.p_OH, hand.middle), hand.q_OH)
    R = rotation_matrix(body.q)
    p, v, w = (inverse_rotate(R, a) for a in (subtract(H.p, body.p), H.v, H.w))
    return Frame(subtract(p, hand.middle), relative_quaternion(body.q, H.q), v, w)


def _reacted(sum_so_far: Wrench, f_O: Vector, tau_O: Vector, arm: Vector) -> Wrench:
    """Return a wrench on a gripper with the reaction to one on the object added, which acts at `arm` from G."""
    f, tau = sum_so_far
    return subtract(f, f_O), subtract(subtract(tau, tau_O), cross(arm, f_O))


def _between(a: Frame, b: Frame, s: float) -> Frame:
    return Frame(lerp(a.p, b.p, s), nlerp(a.q, b.q, s), lerp(a.v, b.v, s), lerp(a.w, b.w, s))
