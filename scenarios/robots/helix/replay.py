"""A Helix handover in space: arm, gripper, ball, hand, the cameras, and the estimates of ball and gripper."""

from collections.abc import Iterable

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.geometry import Pinhole, rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.helix.arm.tendon_parameters import Params as ArmParams
from handover.plants.helix.cameras.shapes import BOWL_WALL, Limbs, gripper, hand
from handover.plants.helix.cameras.stereo_camera import Params as CameraParams
from handover.plants.helix.hand.bowl import Bowl
from handover.scenarios.experiment.replay import Body, Line, Mesh, Replay, ball, circle, merged, prism, rod, turned

_ARM, _PLATE, _COLLAR, _METAL, _FINGER = "#9aa7b5", "#5f6b7a", "#e2e6e8", "#77736f", "#3f74c8"
_BOWL, _TABLE = "#c9b28a", "#8d8478"
_SKIN, _SLEEVE, _BALL, _CAMERA = "#dba98a", "#54708f", "#3fb54a", "#7d5a3c"
_ESTIMATES = (
    ("ball, estimated", "servo.p_WO_est", "#c2487f"),
    ("gripper, estimated", "servo.p_WG_est", "#d1602b"),
)
"""Label, signal and colour of what the controller estimates: with a red-green deficiency, too, each colour differs from
that of what it lies on, and from those of the cameras and of a push."""
_NOTE = "Where things were; pink and orange: where the controller took ball and gripper to be."

_PLATE_THICKNESS, _PLATE_RADIUS = 0.008, 1.15
"""Thickness, m, and radius over that of the arm (assumed)."""

_PUSH, _PER_NEWTON = "#8357a8", 0.3
"""Colour of a person's push, and its length, m/N."""

_MOUNT_RADIUS = 2.2
"""Radius of the mount that the arm hangs from, over that of a plate (assumed)."""

_FRUSTUM = 0.09
"""Length at which a camera's frustum is drawn, m."""
_PICTURE_CORNERS = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
"""Corners of a picture, in halves of its width and height from its middle."""

_OCTAGON = np.radians(np.arange(22.5, 360.0, 45.0))


def replay_handover(record: Record, watching: Iterable[Pinhole] = (), bowl: Bowl | None = None) -> Replay:
    """Return the scene of a run over its time, with the cameras that watch it, and a bowl if there is one."""
    arm = Line(label="arm", colour=_ARM, points=record["arm.backbone"], radii=np.full(25, CameraParams().arm_radius))
    table = [] if bowl is None else _bowl(bowl)
    cameras, estimates = [_frustum(camera) for camera in watching], _estimates(record)
    return Replay(
        bodies=[*_plates(record), _collar(record), *_gripper_body(record), *_hand_body(record), _ball(record), *table],
        lines=[arm, *_fingers(record), *_forearm(record), *estimates, *_hand_push(record)],
        fixed=cameras,
        eye=(-0.35, -1.25, 0.35),
        phases="servo.phase" if "servo.phase" in record else "",
        follow="gripper",
        notes=(_NOTE,) if estimates else (),
        window=_window(record, cameras, [body.p_WB + p for body in table for p in body.mesh.vertices]),
    )


def _hand_push(record: Record) -> list[Line]:
    """Return a line along the force with which a person pushes the gripper in a live page, if the run let it."""
    if "arm.f_P" not in record:
        return []
    p_WG, along = record["arm.p_WG"], _PER_NEWTON * record["arm.f_P"]
    shown = np.where(np.any(along != 0.0, axis=1, keepdims=True), along, np.nan)
    return [Line(label="force of the push", colour=_PUSH, points=np.stack([p_WG, p_WG + shown], axis=1), width=6.0)]


def _ball(record: Record) -> Body:
    mesh = ball(CameraParams().ball_radius)
    return Body(label="ball", colour=_BALL, mesh=mesh, p_WB=record["hand.p_WO"])


def _plates(record: Record) -> list[Body]:
    """Return the arm's mount, and the plates at its segments' ends as on the calibrated arm, normal to the backbone."""
    backbone, lengths = record["arm.backbone"], ArmParams().tendon_length
    ends = np.concatenate([[0.0], np.cumsum(lengths)[:-1]]) / float(np.sum(lengths)) * (backbone.shape[1] - 1)
    radius = _PLATE_RADIUS * CameraParams().arm_radius
    outline = circle(radius)
    mesh = prism(outline, -_PLATE_THICKNESS / 2, _PLATE_THICKNESS / 2)
    low, high = _PLATE_THICKNESS / 2, CameraParams().arm_radius * 1.1  # the tube's rounded end lies within
    mount = prism(circle(_MOUNT_RADIUS * radius), low, high)
    plates = [Body(label="arm", colour=_PLATE, mesh=mount, p_WB=backbone[:1, 0])]
    for k in np.rint(ends).astype(int):
        along = backbone[:, k + 1] - backbone[:, max(k - 1, 0)]
        plates.append(Body(label="arm", colour=_PLATE, mesh=mesh, p_WB=backbone[:, k], q_WB=_turned_to(along)))
    return plates


def _turned_to(along: Floats) -> Floats:
    """Return orientations, shape (rows, 4), that turn -z of W the shortest way to directions, shape (rows, 3)."""
    z = along / np.linalg.norm(along, axis=1, keepdims=True)
    about = np.cross([0.0, 0.0, -1.0], z)  # the arm hangs, so that no direction is opposite
    q = np.column_stack([1.0 - z[:, 2], about])
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def _collar(record: Record) -> Body:
    """Return the eight-sided ring with the markers at the wrist."""
    apothem = CameraParams().apothem
    corners = apothem / np.cos(np.pi / 8.0) * np.column_stack([np.cos(_OCTAGON), np.sin(_OCTAGON)])
    half = apothem * np.tan(np.pi / 8.0)
    mesh = prism(corners, -half, half)
    return Body(label="marker ring", colour=_COLLAR, mesh=mesh, p_WB=record["arm.p_WR"], q_WB=record["arm.q_WR"])


def _gripper_body(record: Record) -> list[Body]:
    """Return stem and knuckle, which stay as they are in G; the plant draws them first."""
    stem = gripper(np.array([0.0, 0.0, -ArmParams().d_gripper]), np.zeros(3), np.eye(3), 0.0)
    mesh = _solid(stem.points[:2], stem.radii[:2])
    return [Body(label="gripper", colour=_METAL, mesh=mesh, p_WB=record["arm.p_WG"], q_WB=record["arm.q_WG"])]


def _fingers(record: Record) -> list[Line]:
    """Return the three fingers, each from its root over its joint to its tip."""

    def limbs(row: int) -> Limbs:
        p_WG, R_WG = record_at["p_WG"][row], rotation_of(record_at["q_WG"][row])
        return gripper(record_at["p_WR"][row], p_WG, R_WG, float(record_at["grip"][row]))

    record_at = {name: record[f"arm.{name}"] for name in ("p_WR", "p_WG", "q_WG", "grip")}
    # (rows, 9, 3, 3): root to joint, joint to pad, pad to tip, three times
    seen = np.array([limbs(row).points[2:] for row in range(len(record.time))])
    r = limbs(0).radii[2:]
    fingers: list[Line] = []
    for k in range(0, len(r), 3):
        points = np.stack([seen[:, k, 0], seen[:, k, 2], seen[:, k + 2, 2]], axis=1)
        radii = np.array([r[k, 0], r[k, 2], r[k + 2, 2]])
        fingers.append(Line(label="gripper", colour=_FINGER, points=points, radii=radii))
    return fingers


def _hand_body(record: Record) -> list[Body]:
    """Return palm and fingers, which keep their shape; the hand turns about z with its forearm."""
    p_WH = record["hand.p_WH"]
    seen = np.array([hand(p).points[2:] - p for p in p_WH])
    pointing = seen[:, -2, 2] - seen[:, 0, 0]
    yaw = np.unwrap(np.arctan2(pointing[:, 1], pointing[:, 0]))
    R_HW = Rotation.from_euler("z", -float(yaw[0])).as_matrix()
    mesh = _solid(seen[0] @ np.transpose(R_HW), hand(p_WH[0]).radii[2:])
    q_WH = Rotation.from_euler("z", yaw[:, None]).as_quat(scalar_first=True)
    return [Body(label="hand", colour=_SKIN, mesh=mesh, p_WB=p_WH, q_WB=q_WH)]


def _forearm(record: Record) -> list[Line]:
    p_WH = record["hand.p_WH"]
    ends = [0, 2]
    seen, radii = np.array([hand(p).points[:2, ends] for p in p_WH]), hand(p_WH[0]).radii[:2, ends]
    return [
        Line(label="hand", colour=colour, points=seen[:, k], radii=radii[k]) for k, colour in ((0, _SKIN), (1, _SLEEVE))
    ]


def _estimates(record: Record) -> list[Line]:
    """Return those estimates of ball and gripper that the controller gives, from when it has them."""
    known = (record["servo.phase"] > 0 if "servo.phase" in record else np.full(len(record.time), True))[:, None]
    return [
        Line(label=label, colour=colour, points=np.where(known, record[signal], np.nan)[:, None], width=5.0)
        for label, signal, colour in _ESTIMATES
        if signal in record
    ]


def _frustum(camera: Pinhole) -> Line:
    """Return the edges of the front part of a camera's frustum."""
    u, v = camera.c
    depth = _FRUSTUM * np.array([[s * u / camera.f[0], t * v / camera.f[1], 1.0] for s, t in _PICTURE_CORNERS])
    corners = camera.p_WC + depth @ np.transpose(camera.R_WC)
    eye, (a, b, c, d) = camera.p_WC, corners
    edges = np.array([[eye, a, b, eye, c, d, eye, a, d, c, b]])
    return Line(label="cameras", colour=_CAMERA, points=edges, width=2.0)


def _solid(points: Floats, radii: Floats) -> Mesh:
    """Return limbs, shapes (m, 3, 3) and (m, 3), as one body."""
    return merged([rod(p, r) for p, r in zip(points, radii, strict=True)])


def _bowl(bowl: Bowl) -> list[Body]:
    """Return the bowl, inside and outside, and the disc on which it stands; they stay where they are."""
    inner = bowl.profile(9) - np.array([0.0, bowl.p_WD[2]])
    outer = inner[::-1] + np.array([[BOWL_WALL, 0.0]])
    outer[:-1, 1] -= BOWL_WALL * np.linspace(0.0, 1.0, len(outer))[:-1]
    outer[-1] = [0.0, inner[0, 1] - BOWL_WALL]
    shell = turned(np.vstack([inner, outer]))
    low = -bowl.depth - BOWL_WALL
    disc = prism(circle(1.2 * bowl.radius, 32), low - 0.012, low)
    at = bowl.p_WD[None]
    return [
        Body(label="bowl", colour=_BOWL, mesh=shell, p_WB=at),
        Body(label="bowl", colour=_TABLE, mesh=disc, p_WB=at),
    ]


def _window(record: Record, cameras: list[Line], others: list[Floats]) -> Floats:
    """Return corners around arm, gripper, ball, hand, cameras and other points; the forearm runs out of it."""
    seen = [record[s].reshape(-1, 3) for s in ("arm.backbone", "arm.p_WG", "hand.p_WO", "hand.p_WH")]
    reach = 0.12  # of the gripper's fingers and of the hand, with some room
    around = [np.vstack([p - reach, p + reach]) for p in seen]
    points = np.vstack([*around, *(c.points[0] for c in cameras), *others])
    return np.array([points.min(axis=0), points.max(axis=0)])
