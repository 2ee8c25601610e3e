"""The free-flyer in space: with a person, the object and the hand that takes it, or pushed at its gripper."""

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.replay import Body, Line, Mesh, Replay, faceted, hull
from handover.scenarios.free_flyer.parameters import ImpedanceParameters
from handover.scenarios.free_flyer.plots import phases_of_push
from handover.scenarios.free_flyer.scene import FINGER_WIDTH, Solid, finger_points, jaw_gap, person_at, robot_at

_PUSH, _TWIST, _PATH = "#d1602b", "#8357a8", "#b58a1b"
_PER_NEWTON, _PER_NEWTON_METRE = 0.04, 0.08
"""Lengths of arrows, m/N and m/(N m)."""
_ARROW_HEAD, _CLEAR, _AXIS_LENGTH = 0.7, 0.035, 0.12
"""Share of an arrow before its head, its distance from G, m, and length of the axes of a frame, m."""
_AXES = ("#c0392b", "#2e8b57", "#2f6db5")


def replay_handover(record: Record) -> Replay:
    """Return robot, object and hand over a run's time."""
    return Replay(
        bodies=[*_robot(record, jaw_gap(record)), *_person(record)],
        lines=_fingers(record),
        eye=(-0.9, -1.05, 0.65),
        phases="decision.phase",
        notes=("No up and no down: in microgravity. The person's arm is not shown.",),
    )


def replay_push(parameters: ImpedanceParameters, record: Record) -> Replay:
    """Return the robot, its gripper's place of rest, and what pushes it."""
    path = Line(label="path of the gripper", colour=_PATH, points=record["robot.p_WG"][:, None], trail=True)
    return Replay(
        bodies=_robot(record, np.zeros(len(record.time))),
        lines=[path, *push_arrows(record)],
        fixed=frame_at("place of rest", np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])),
        eye=(-1.0, -1.15, 0.6),
        phases=phases_of_push(parameters, record),
        notes=(f"Arrows: {1000 * _PER_NEWTON:.0f} mm a newton, {1000 * _PER_NEWTON_METRE:.0f} mm a newton metre.",),
    )


def push_arrows(record: Record) -> list[Line]:
    """Return arrows of the push and the twist, where there are any."""
    pushes = (
        ("push", _PUSH, _PER_NEWTON * record["push.f_G"]),
        ("twist", _TWIST, _PER_NEWTON_METRE * record["push.tau_G"]),
    )
    return [_arrow(label, colour, record, along) for label, colour, along in pushes if np.any(along)]


def _robot(record: Record, gap: Floats) -> list[Body]:
    """Return cube, arm with palm, and jaws with a gap between them, shape (rows,), m."""
    p_WB, q_WB = record["robot.p_WB"], record["robot.q_WB"]
    cube, arm, palm, *jaws = robot_at(record, 0, 0.0)
    bodies = [
        Body(label=label, colour=part.colour, mesh=_own(part, p_WB[0], q_WB[0]), p_WB=p_WB, q_WB=q_WB)
        for label, part in (("robot", cube), ("arm", arm), ("gripper", palm))
    ]
    z_B = Rotation.from_quat(q_WB, scalar_first=True).as_matrix()[:, :, 2]
    for jaw, side in zip(jaws, (0.5, -0.5), strict=True):
        p_WJ = p_WB + side * gap[:, None] * z_B
        bodies.append(Body(label="gripper", colour=jaw.colour, mesh=_own(jaw, p_WB[0], q_WB[0]), p_WB=p_WJ, q_WB=q_WB))
    return bodies


def _person(record: Record) -> list[Body]:
    """Return the object and the palm of the hand."""
    parts = zip(("object", "hand"), ("O", "H"), person_at(record, 0), strict=False)
    return [
        Body(
            label=label,
            colour=part.colour,
            mesh=_own(part, record[f"person.p_W{frame}"][0], record[f"person.q_W{frame}"][0]),
            p_WB=record[f"person.p_W{frame}"],
            q_WB=record[f"person.q_W{frame}"],
        )
        for label, frame, part in parts
    ]


def _fingers(record: Record) -> list[Line]:
    """Return thumb and fingers."""
    p_WH = record["person.p_WH"]
    R_WH = Rotation.from_quat(record["person.q_WH"], scalar_first=True).as_matrix()
    bent = [finger_points(angles) for angles in record["person.finger"]]
    colour = person_at(record, 0)[1].colour
    fingers: list[Line] = []
    for chain in zip(*bent, strict=True):
        points = p_WH[:, None] + np.einsum("rij,rnj->rni", R_WH, np.array(chain))
        radii = np.full(points.shape[1], FINGER_WIDTH / 2)
        fingers.append(Line(label="hand", colour=colour, points=points, radii=radii))
    return fingers


def _own(solid: Solid, p_WB: Floats, q_WB: Floats) -> Mesh:
    """Return a solid's mesh in its body's frame, from the body's pose at the same time."""
    return faceted(hull(np.round((solid.corners - p_WB) @ rotation_of(q_WB), 9)))


def _arrow(label: str, colour: str, record: Record, along: Floats) -> Line:
    """Return an arrow, shape (rows, 3), beside the jaws: one that points at the robot ends there, others begin there.

    It is hidden while it has no length.
    """
    p_WG, length = record["robot.p_WG"], np.linalg.norm(along, axis=1, keepdims=True)
    shown = np.where(length > 0.0, along, np.nan)
    ahead = shown / np.where(length > 0.0, length, 1.0)
    inwards = np.einsum("ij,ij->i", along, record["robot.p_WB"] - p_WG)[:, None] > 0.0
    first = p_WG + np.where(inwards, -shown - _CLEAR * ahead, _CLEAR * ahead)
    points = np.stack([first + share * shown for share in (0.0, _ARROW_HEAD, _ARROW_HEAD, 1.0)], axis=1)
    return Line(label=label, colour=colour, points=points, radii=np.array([0.006, 0.006, 0.018, 0.0005]))


def frame_at(label: str, p_WF: Floats) -> list[Line]:
    """Return the axes of a frame with the world's orientation."""
    axes = np.eye(3) * _AXIS_LENGTH
    return [
        Line(label=label, colour=colour, points=np.array([[p_WF, p_WF + axis]]), width=5.0)
        for colour, axis in zip(_AXES, axes, strict=True)
    ]
