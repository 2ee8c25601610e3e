"""What helps who leads a hand in a handover while it goes on: where the hand is to be, and what is to be done there."""

from collections.abc import Mapping, Sequence

import numpy as np

from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.free_flyer.hand.parameters import Params
from handover.scenarios.experiment.live_inputs import HandHint

_HOLD = np.array([0.0, 0.045, 0.0])
"""Where the middle of a hand that takes the object is best, seen from its centre, m: its fingers close on it there from
3 cm around (tried: 30 mm across the object to all sides, 55 mm and 25 mm along it)."""
_AROUND, _ALONG = 0.028, 0.024
_NEAR = 0.5
"""Distance from where the hand is to be, m, from which on its direction is shown."""
_NEEDED = (
    "person.holder",
    "person.p_WH",
    "person.p_WO",
    "person.q_WO",
    "person.closed_goal",
    "robot.p_WG",
    "robot.q_WG",
)


def hand_hint(record: Record, receivers: Sequence[str], thresholds: Mapping[str, float]) -> HandHint | None:
    """Return what helps in the last row of a record; None where it lacks outputs that this is made of.

    Args:
        record: of a handover.
        receivers: who is to have the object in turn, `HAND` or `GRIPPER`.
        thresholds: speed of the gripper from which the robot feels a pull or a push, by receiver, m/s.
    """
    if not all(name in record for name in _NEEDED):
        return None
    holder = record.items("person.holder").get(int(record["person.holder"][-1]), "")
    p_WH, closed = record["person.p_WH"][-1], bool(record["person.closed_goal"][-1])
    if receivers[0] == "HAND" and holder in ("GRIPPER", "BOTH"):
        return _taking(record, p_WH, holder, _felt(record, thresholds["HAND"]), closed=closed)
    if receivers[-1] == "GRIPPER" and holder in ("HAND", "BOTH"):
        return _giving(record, p_WH, holder, _felt(record, thresholds["GRIPPER"]))
    if holder == "HAND":
        return HandHint(p_WH, None, holds=True, advice="You have it: draw your hand back.")
    if holder == "GRIPPER":
        return HandHint(p_WH, None, advice="The gripper has it: open your hand, and draw it back.")
    return HandHint(p_WH, None, advice="The robot fetches the object." if receivers[0] == "HAND" else "")


def _felt(record: Record, threshold: float) -> str:
    """Return how fast the robot sees its gripper move, of what it needs to feel a pull or a push."""
    if "decision.speed_G" not in record:
        return ""
    return f": it moves at {float(record['decision.speed_G'][-1]):.3f} of {threshold:.3f} m/s"


def _taking(record: Record, p_WH: Floats, holder: str, felt: str, *, closed: bool) -> HandHint | None:
    if holder == "BOTH":
        return HandHint(p_WH, None, holds=True, advice=f"You hold it: pull until the gripper opens{felt}.")
    R_WO, p_WO = rotation_of(record["person.q_WO"][-1]), record["person.p_WO"][-1]
    goal = p_WO + R_WO @ _HOLD
    p_goal_H_O: Floats = (p_WH - goal) @ R_WO
    within = bool(np.hypot(p_goal_H_O[0], p_goal_H_O[2]) <= _AROUND and abs(p_goal_H_O[1]) <= _ALONG)
    if float(np.linalg.norm(goal - p_WH)) > _NEAR:
        return HandHint(p_WH, None, advice="The robot brings the object: once it waits, lead your hand there.")
    if closed:
        return HandHint(p_WH, goal, advice="Your hand closed on nothing: open it.")
    advice = "Within reach: after the yellow flash, close the hand." if within else "Lead your hand to the ring."
    return HandHint(p_WH, goal, within_reach=within, advice=advice)


def _giving(record: Record, p_WH: Floats, holder: str, felt: str) -> HandHint:
    if holder == "BOTH":
        return HandHint(p_WH, None, holds=True, advice="The gripper has it, too: open your hand.")
    gripper, half = Params(), 0.5 * float(np.array(Params().object_size)[1])
    axis, p_WG = rotation_of(record["person.q_WO"][-1])[:, 1], record["robot.p_WG"][-1]
    p_WO = record["person.p_WO"][-1]
    to_gripper = p_WG - p_WO
    to_gripper -= float(np.clip(axis @ to_gripper, -half, half)) * axis  # from the nearest point of its centre line
    to_gripper_G: Floats = to_gripper @ rotation_of(record["robot.q_WG"][-1])
    within = bool(abs(to_gripper_G[0]) <= gripper.capture_axial and abs(to_gripper_G[2]) <= gripper.capture_lateral)
    if float(np.linalg.norm(to_gripper)) > _NEAR:
        return HandHint(p_WH, None, holds=True, advice="You hold the object: the robot comes to take it.")
    here, there = (
        f"Between the fingers: press it against the gripper{felt}.",
        "After the yellow flash, lead it to the ring.",
    )
    return HandHint(p_WH, p_WH + to_gripper, within_reach=within, holds=True, advice=here if within else there)
