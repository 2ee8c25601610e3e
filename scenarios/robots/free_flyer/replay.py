"""The free-flyer in space: with a person, the object and the hand that takes it, or pushed at its gripper."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.free_flyer.hand.hand_kinematics import PALM_BONES, PALM_RADIUS
from handover.plants.free_flyer.large_object.parameters import Params as LargeObjectParams
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.replay import Body, Line, Mesh, PersonView, Replay, ball, faceted, hull
from handover.scenarios.robots.free_flyer.parameters import ROBOTS, ImpedanceParameters, TeamParameters, Wrench
from handover.scenarios.robots.free_flyer.push.push_plots import phases_of_push
from handover.scenarios.robots.free_flyer.scene import (
    EDGE,
    FINGER_WIDTH,
    Solid,
    finger_points,
    hand_at,
    jaw_gap,
    large_object_at,
    person_at,
    robot_at,
)

_PUSH, _TWIST, _PATH = "#d1602b", "#8357a8", "#b58a1b"
_PER_NEWTON, _PER_NEWTON_METRE = 0.04, 0.08
"""Lengths of arrows, m/N and m/(N m)."""
_ARROW_HEAD, _CLEAR, _AXIS_LENGTH = 0.7, 0.035, 0.12
"""Share of an arrow before its head, its distance from G, m, and length of the axes of a frame, m."""
_ROOM, _CUBE_ROOM = 0.08, 0.55 * EDGE
"""Metres around the ways of gripper, object and hand, some hand's length, and of the cube."""
_LAMP, _LIGHT = "#5b6470", "#ffc400"
_LAMP_RADIUS = 0.028
_LAMP_PLACE = np.array([-EDGE / 2, 0.0, 0.10])
"""The signal light: at the face that looks at the person, in B, m (assumed; drawn large, for it is to be seen)."""
_SEEN_BY_PERSON = PersonView((-1.0, 0.10, 0.42), np.array([[-0.55, -0.42, -0.26], [0.36, 0.34, 0.26]]))
"""From behind the hand's rest, over gripper and object to the robot (assumed)."""
_AXES = ("#c0392b", "#2e8b57", "#2f6db5")


def replay_handover(record: Record) -> Replay:
    """Return robot, object and hand over a run's time."""
    return Replay(
        bodies=[*_robot(record, jaw_gap(record)), *_lamp(record), *_person(record)],
        lines=[*_light(record), *_fingers(record), *hand_pushes(record)],
        eye=(-0.9, -1.05, 0.65),
        phases="decision.phase",
        weightless=True,
        follow="object",
        window=_around(record, _WAYS),
        notes=("No up and no down: in microgravity. The person's arm is not shown.",),
        person_view=_SEEN_BY_PERSON,
    )


def replay_practice(record: Record) -> Replay:
    """Return object and hand over a run's time."""
    return Replay(
        bodies=_person(record),
        lines=_fingers(record),
        eye=(-0.9, -1.05, 0.65),
        weightless=True,
        follow="object",
        window=_around(record, {way: _ROOM for way in _WAYS if way.startswith("person.")}),
        notes=("No up and no down: in microgravity. The person's arm is not shown.",),
        person_view=_SEEN_BY_PERSON,
    )


def replay_team(parameters: TeamParameters, record: Record) -> Replay:
    """Return two robots, the object with its handles, and the hands that the person uses, over a run's time."""
    hands = [f"_{h}" for h in parameters.hand_numbers]
    robots = [body for r in ROBOTS for body in _robot(record, jaw_gap(record, f"_{r}"), f"_{r}")]
    thing, *handles = large_object_at(record, 0, parameters.hands)
    parts = [_body(record, "object", "O", thing), *(_body(record, "handles", "O", handle) for handle in handles)]
    palms = [_palm(record, h) for h in hands]
    ways: dict[str, float | Floats] = {f"robot_{r}.p_WB": _CUBE_ROOM for r in ROBOTS}
    ways |= {f"person.p_WH{h}": _ROOM for h in hands}
    ways["person.p_WO"] = 0.6 * np.array(LargeObjectParams().object_size)
    return Replay(
        bodies=[*robots, *parts, *palms],
        lines=[
            *(finger for h in hands for finger in _fingers(record, h)),
            *(arrow for r in ROBOTS for arrow in hand_pushes(record, f"robot_{r}")),
        ],
        eye=(-1.2, -1.3, 1.3),
        phases="decision.phase_1",
        weightless=True,
        follow="object",
        window=_around(record, ways),
        notes=("No up and no down: in microgravity. The person's arms are not shown.",),
    )


_WAYS: dict[str, float | Floats] = {
    "robot.p_WB": _CUBE_ROOM,
    "robot.p_WG": _ROOM,
    "person.p_WO": _ROOM,
    "person.p_WH": _ROOM,
}


def _around(record: Record, ways: Mapping[str, float | Floats]) -> Floats:
    """Return the corners of boxes around bodies on their ways, shape (n, 3), m, by half their sides along W's axes."""
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    return np.vstack([record[name] + room * corner for name, room in ways.items() for corner in corners])


def replay_push(parameters: ImpedanceParameters, record: Record) -> Replay:
    """Return the robot, its gripper's place of rest, and what pushes it."""
    path = Line(label="path of the gripper", colour=_PATH, points=record["robot.p_WG"][:, None], trail=True)
    return Replay(
        bodies=_robot(record, np.zeros(len(record.time))),
        lines=[path, *push_arrows(parameters.kind, record), *hand_pushes(record)],
        fixed=frame_at("place of rest", np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])),
        eye=(-1.0, -1.15, 0.6),
        phases=phases_of_push(parameters, record),
        weightless=True,
        follow="robot",
        notes=(f"Arrows: {1000 * _PER_NEWTON:.0f} mm a newton, {1000 * _PER_NEWTON_METRE:.0f} mm a newton metre.",),
    )


def push_arrows(kind: Wrench, record: Record) -> list[Line]:
    """Return an arrow of the push or the twist, and of the other if there is any."""
    pushes = (
        (Wrench.FORCE, "push", _PUSH, _PER_NEWTON * record["push.f_G"]),
        (Wrench.TORQUE, "twist", _TWIST, _PER_NEWTON_METRE * record["push.tau_G"]),
    )
    return [_arrow(label, colour, record, along) for of, label, colour, along in pushes if of is kind or np.any(along)]


def hand_pushes(record: Record, robot: str = "robot") -> list[Line]:
    """Return arrows of the forces with which a person pushes a robot in a live page, if the run let it."""
    arrows: list[Line] = []
    for frame, force, point in (("B", "f_P", "p_BP"), ("G", "f_Q", "p_GQ")):
        if f"{robot}.{force}" not in record or f"{robot}.{point}" not in record:
            continue
        R_WF = Rotation.from_quat(record[f"{robot}.q_W{frame}"], scalar_first=True).as_matrix()
        p_WP = record[f"{robot}.p_W{frame}"] + np.einsum("rij,rj->ri", R_WF, record[f"{robot}.{point}"])
        along = _PER_NEWTON * record[f"{robot}.{force}"]
        shown = np.where(np.any(along != 0.0, axis=1, keepdims=True), along, np.nan)
        arrows.append(_arrow_at("force of the push", _TWIST, p_WP, shown))
    return arrows


def _robot(record: Record, gap: Floats, suffix: str = "") -> list[Body]:
    """Return cube, arm with palm, and jaws with a gap between them, shape (rows,), m, of one robot, or one of two."""
    robot, one = f"robot{suffix}", suffix.replace("_", " ")
    p_WB, q_WB = record[f"{robot}.p_WB"], record[f"{robot}.q_WB"]
    cube, arm, palm, *jaws = robot_at(record, 0, 0.0, robot)
    bodies = [
        Body(label=f"{label}{one}", colour=part.colour, mesh=_own(part, p_WB[0], q_WB[0]), p_WB=p_WB, q_WB=q_WB)
        for label, part in (("robot", cube), ("arm", arm), ("gripper", palm))
    ]
    z_B = Rotation.from_quat(q_WB, scalar_first=True).as_matrix()[:, :, 2]
    for jaw, side in zip(jaws, (0.5, -0.5), strict=True):
        p_WJ = p_WB + side * gap[:, None] * z_B
        mesh = _own(jaw, p_WB[0], q_WB[0])
        bodies.append(Body(label=f"gripper{one}", colour=jaw.colour, mesh=mesh, p_WB=p_WJ, q_WB=q_WB))
    return bodies


def _lamp(record: Record) -> list[Body]:
    """Return the lamp by which the robot gives its signal."""
    p_WB, q_WB = record["robot.p_WB"], record["robot.q_WB"]
    mesh = ball(_LAMP_RADIUS).moved(_LAMP_PLACE)
    return [Body(label="signal light", colour=_LAMP, mesh=mesh, p_WB=p_WB, q_WB=q_WB)]


def _light(record: Record) -> list[Line]:
    """Return the lamp's light, a ball around it, which is gone while it is off."""
    R_WB = Rotation.from_quat(record["robot.q_WB"], scalar_first=True).as_matrix()
    ends = _LAMP_PLACE + np.array([[0.0, 0.0, 0.0], [1e-4, 0.0, 0.0]])
    points = record["robot.p_WB"][:, None] + np.einsum("rij,nj->rni", R_WB, ends)
    is_on = record["decision.light"][:, None, None] > 0.5
    return [
        Line(
            label="signal light",
            colour=_LIGHT,
            points=np.where(is_on, points, np.nan),
            radii=np.full(2, 1.15 * _LAMP_RADIUS),
        )
    ]


def _person(record: Record) -> list[Body]:
    """Return the object and the palm of the hand."""
    return [_body(record, "object", "O", person_at(record, 0)[0]), _palm(record)]


def _palm(record: Record, suffix: str = "") -> Body:
    """Return the palm of the hand, or of one with a suffix, as round as it is where it touches an object."""
    ends = np.array([PALM_BONES[0], PALM_BONES[-1]]).reshape(-1, 3)
    mesh = hull(np.vstack([end + ball(PALM_RADIUS).vertices for end in ends]))
    colour = hand_at(record, 0, suffix)[0].colour
    p_WH, q_WH = record[f"person.p_WH{suffix}"], record[f"person.q_WH{suffix}"]
    return Body(label="hand", colour=colour, mesh=mesh, p_WB=p_WH, q_WB=q_WH)


def _body(record: Record, label: str, frame: str, part: Solid) -> Body:
    """Return a part, as it is at the start, that moves with a frame of the person's unit."""
    p_WF, q_WF = record[f"person.p_W{frame}"], record[f"person.q_W{frame}"]
    return Body(label=label, colour=part.colour, mesh=_own(part, p_WF[0], q_WF[0]), p_WB=p_WF, q_WB=q_WF)


def _fingers(record: Record, suffix: str = "") -> list[Line]:
    """Return thumb and fingers of the hand, or of one with a suffix."""
    p_WH = record[f"person.p_WH{suffix}"]
    R_WH = Rotation.from_quat(record[f"person.q_WH{suffix}"], scalar_first=True).as_matrix()
    bent = [finger_points(angles) for angles in record[f"person.finger{suffix}"]]
    colour = hand_at(record, 0, suffix)[0].colour
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
    return _arrow_at(label, colour, first, shown)


def _arrow_at(label: str, colour: str, first: Floats, along: Floats) -> Line:
    """Return an arrow from a point, both of shape (rows, 3), m; it is hidden where its length is not a number."""
    points = np.stack([first + share * along for share in (0.0, _ARROW_HEAD, _ARROW_HEAD, 1.0)], axis=1)
    return Line(label=label, colour=colour, points=points, radii=np.array([0.006, 0.006, 0.018, 0.0005]))


def frame_at(label: str, p_WF: Floats) -> list[Line]:
    """Return the axes of a frame with the world's orientation."""
    axes = np.eye(3) * _AXIS_LENGTH
    return [
        Line(label=label, colour=colour, points=np.array([[p_WF, p_WF + axis]]), width=5.0)
        for colour, axis in zip(_AXES, axes, strict=True)
    ]
