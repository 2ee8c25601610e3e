"""Starts of a handover in which the ball, or the hand that holds it, is in the arm or its gripper.

The arm hangs straight at the start, with its gripper open. The units simulate how ball, palm and fingers touch, not how
they come out of each other.
"""

from collections.abc import Mapping

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.system import PlacedUnit
from handover.plants.helix.gripper_fingers import KNUCKLE, LINK_RADIUS, PALM_RADIUS, finger_joints
from handover.plants.helix.hand.partner_parameters import place_aside
from handover.scenarios.experiment.starts import array_of, penetration_fault

_OF_ARM = {"tendon_length", "d_gripper", "d"}
_OF_HAND = {"p_WO_0", "p_OH", "room", "ball_radius", "palm_radius"}
_HANGING = np.diag([1.0, -1.0, -1.0])
"""Orientation of the gripper of an arm that hangs straight: z_G points down."""
_RIM = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)


def start_faults(units: Mapping[str, PlacedUnit]) -> list[str]:
    """Return where ball or palm would start in the arm or the gripper, with depth and the way out.

    The palm is a disc without thickness, of which its middle and 48 points are looked at. What a unit in the place of
    arm or hand does not have is not checked.
    """
    arm, hand = units.get("arm"), units.get("hand")
    if arm is None or not arm.description.parameters.keys() >= _OF_ARM:
        return []
    if hand is None or not hand.description.parameters.keys() >= _OF_HAND:
        return []
    offered, room = array_of(hand, "p_WO_0"), float(array_of(hand, "room")[0])
    p_WO = offered + place_aside(offered, room)
    radius, palm = float(array_of(hand, "ball_radius")[0]), float(array_of(hand, "palm_radius")[0])
    rim = np.stack([np.cos(_RIM), np.sin(_RIM), np.zeros(len(_RIM))], axis=1)
    disc = p_WO + array_of(hand, "p_OH") + palm * np.vstack([np.zeros(3), 0.5 * rim, rim])
    faults: list[str] = []
    for what, points, around in (("the ball", p_WO[np.newaxis], radius), ("the palm", disc, 0.0)):
        found = [(where, *_deepest(points, around, a, b, r)) for where, a, b, r in _capsules(arm)]
        where, depth, out = max(found, key=lambda one: one[1])
        faults.append(penetration_fault(f"{hand.name}.p_WO_0", f"{what} would start", where, depth, out))
    way = f", or let {hand.name}.room be larger than {room:g} m"
    return [fault + way for fault in faults if fault]


def _capsules(arm: PlacedUnit) -> list[tuple[str, Floats, Floats, float]]:
    """Return the hanging arm with its open gripper: names, both ends in W and radii of capsules, m."""
    wrist = np.array([0.0, 0.0, -float(np.sum(array_of(arm, "tendon_length")))])
    p_WG = wrist - np.array([0.0, 0.0, float(array_of(arm, "d_gripper")[0])])
    knuckle = p_WG + np.array([0.0, 0.0, KNUCKLE])
    links = [
        ("the gripper's finger", joints[i], joints[i + 1], LINK_RADIUS)
        for joints in finger_joints(p_WG, _HANGING, 0.0)
        for i in range(2)
    ]
    body = float(array_of(arm, "d")[0])
    return [("the arm", np.zeros(3), wrist, body), ("the gripper's palm", wrist, knuckle, PALM_RADIUS), *links]


def _deepest(points: Floats, around: float, a: Floats, b: Floats, radius: float) -> tuple[float, Floats]:
    """Return how deep the deepest of some balls, of one radius, is in a capsule from a to b, m, and the way out."""
    along = b - a
    share = np.clip((points - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    apart = points - (a + share[:, np.newaxis] * along)
    distances = np.linalg.norm(apart, axis=1)
    i = int(np.argmin(distances))
    out = apart[i] / distances[i] if distances[i] > 0.0 else np.array([1.0, 0.0, 0.0])
    return around + radius - float(distances[i]), out
