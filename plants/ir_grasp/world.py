"""Hand, objects and table of the grasp scene as bodies in contact, advanced by 1 ms at a time."""

import math
from collections.abc import Sequence
from itertools import accumulate, pairwise
from typing import Final

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.actuation import GEARS, follow, resting_posture, tendon_excursion
from handover.plants.ir_grasp.ground import MovingGround
from handover.plants.ir_grasp.hand import FINGERS, MAX_ANGLE, MIN_ANGLE, PALM, SENSOR_PLACE, Finger, finger_points
from handover.plants.ir_grasp.parameters import Params
from handover.plants.ir_grasp.pymunk_edge import Motion, PymunkBody, PymunkEdge, convex_parts
from handover.plants.ir_grasp.shapes import Disc, Point, Polygon

DT: Final = 1e-3
"""Internal time step, in s."""

Command = tuple[float, float, float, float]
"""Wrist's position in m, orientation in rad, closure."""

Snapshot = tuple[float, tuple[Motion, ...], int]
"""Closure, then the motions of palm, object, second object if there is one, and phalanges, then the steps made since
the start. Positions are those of centres of mass."""

Ray = tuple[float, float]
"""Cosine and sine of the angle between a ray and the direction that a sensor looks in."""

_ITERATIONS = 10  # of pymunk's solver, its default
_OBJECT_FRICTION = 1.0  # of object and second object with one another (assumed)
_HAND, _OBJECT, _OTHER = 1, 2, 3  # groups whose own shapes do not collide
_NAMED_FINGERS = tuple(zip(("thumb", "index", "ring"), FINGERS, strict=True))
_DISTAL = tuple(int(i) - 1 for i in accumulate(len(f.lengths) for f in FINGERS))  # among the phalanges
_STILL = (0.0, 0.0, 0.0)


def initial_snapshot(p: Params) -> Snapshot:
    """Return the scene at the start: everything at rest, the fingers as the tendon has them in free space."""
    q = resting_posture(p.sigma_0, p.tendon_stiffness, p.tendon_travel, p.joint_stiffness)
    palm = (float(p.p_WH_0[0]), float(p.p_WH_0[1]), p.yaw_H_0, *_STILL)
    solid = p.solid
    yaw = solid.yaw + p.yaw_O_0
    x, y = _moved(solid.centre_of_mass, (float(p.p_WO_0[0]), float(p.p_WO_0[1])), yaw)
    others = [(float(p.p_WX_0[0]), float(p.p_WX_0[1]), 0.0, *_STILL)] if p.other_radius > 0.0 else []
    return p.sigma_0, (palm, (x, y, yaw, *_STILL), *others, *_phalanges(p, q)), 0


def _moved(p: Point, origin: Point, yaw: float) -> Point:
    """Return origin + R(yaw) p."""
    if p == (0.0, 0.0):
        return origin
    c, s = math.cos(yaw), math.sin(yaw)
    return origin[0] + c * p[0] - s * p[1], origin[1] + s * p[0] + c * p[1]


def _phalanges(p: Params, q: Floats) -> list[Motion]:
    motions: list[Motion] = []
    angles = iter(q.tolist())
    for f, points in zip(FINGERS, finger_points(p.p_WH_0, p.yaw_H_0, q), strict=True):
        heading = p.yaw_H_0 + f.spread
        for start, end in pairwise(points.tolist()):
            heading += f.flexion * next(angles)
            motions.append(((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0, heading, *_STILL))
    return motions


class GraspWorld:
    """The physics of the grasp scene, from a snapshot on.

    What follows depends on the snapshot and the commands alone, bit for bit. A snapshot does not hold the contacts'
    last impulses, from which the solver starts, so a world made from one moves slightly differently from then on than
    the world that it was taken from.

    The palm follows the wrist's command whatever pushes (`follow`). The tendon, T = k max(0, sigma L - sum r q), turns
    each joint with r T against its spring and damper. Object and table: dry friction, isotropic and uniform, against
    the ground's motion where it has one (`MovingGround`). A second object, a disc, stands on the table at rest.

    Args:
        params: of the scene.
        snapshot: where everything is and how it moves.
    """

    def __init__(self, params: Params, snapshot: Snapshot) -> None:
        self._params = params
        self._edge = PymunkEdge(DT, _ITERATIONS)
        self._sigma, (palm, thing, *rest), self._steps = snapshot
        self._solid = params.solid
        self._centre = self._solid.centre_of_mass
        self._ground = MovingGround(params.ground_spans, DT)
        self._wrist = palm
        self._palm = self._edge.add_driven(palm)
        self._edge.add_polygon(self._palm, PALM, params.grip_friction, _HAND)
        self._ground_body = self._edge.add_driven((0.0, 0.0, 0.0, *_STILL)) if self._ground.ever_moves else None
        self._thing = self._add_thing(thing)
        self._other = self._add_other(rest.pop(0)) if params.other_radius > 0.0 else None
        self._first_phalanx = sum(b is not None for b in (self._palm, self._ground_body, self._thing, self._other))
        self._phalanges: list[PymunkBody] = []
        stiffness = params.joint_stiffness.tolist()
        for f in FINGERS:
            those = slice(len(self._phalanges), len(self._phalanges) + len(f.lengths))
            self._add_finger(f, rest[those], stiffness[those])

    @property
    def snapshot(self) -> Snapshot:
        """Where everything is and how it moves."""
        others = () if self._other is None else (self._other,)
        bodies = (self._thing, *others, *self._phalanges)
        return self._sigma, (self._wrist, *(b.motion for b in bodies)), self._steps

    @property
    def sigma(self) -> float:
        """Closure that the motor has reached."""
        return self._sigma

    @property
    def wrist(self) -> tuple[float, float, float]:
        """Position in m and orientation in rad of the wrist."""
        return self._wrist[:3]

    @property
    def thing(self) -> tuple[float, float, float]:
        """Position of O in m and orientation in rad of the object."""
        position, yaw = self._thing.position, self._thing.angle
        if self._centre == (0.0, 0.0):
            return (*position, yaw)
        x, y = self._centre
        return (*_moved((-x, -y), position, yaw), yaw)

    @property
    def other(self) -> Point | None:
        """Position of the second object in m; None if there is none."""
        return None if self._other is None else self._other.position

    @property
    def ground(self) -> Point:
        """How far the ground under the object has moved since the start, in m."""
        return (0.0, 0.0) if self._ground_body is None else self._ground.way(self._steps)

    @property
    def joints(self) -> list[float]:
        """Joint angles, 8, in rad."""
        q: list[float] = []
        angles = self._edge.angles(self._first_phalanx)
        for f in FINGERS:
            before = self._wrist[2] + f.spread
            for angle in angles[len(q) :][: len(f.lengths)]:
                q.append(f.flexion * (angle - before))
                before = angle
        return q

    @property
    def tension(self) -> float:
        """Tension of the tendon, in N."""
        return self._tension(self._edge.angles(self._first_phalanx))

    @property
    def touching(self) -> int:
        """Number of the hand's bodies that touch the object."""
        return self._edge.touching(self._thing, self._other)

    def overlaps(self) -> list[tuple[str, float]]:
        """Return which of the hand's bodies are in the object, and how deep, in m."""
        return self._in_hand(self._thing)

    def overlaps_of_other(self) -> list[tuple[str, float]]:
        """Return what of the hand and the object is in the second object, and how deep, in m."""
        if self._other is None:
            return []
        depth = self._edge.overlap(self._thing, self._other)
        return [*([("object", depth)] if depth > 0.0 else []), *self._in_hand(self._other)]

    def _in_hand(self, body: PymunkBody) -> list[tuple[str, float]]:
        names = ["palm"] + [f"{n} phalanx {i + 1}" for n, f in _NAMED_FINGERS for i in range(len(f.lengths))]
        depths = [self._edge.overlap(b, body) for b in (self._palm, *self._phalanges)]
        return [(name, depth) for name, depth in zip(names, depths, strict=True) if depth > 0.0]

    def advance(self, command: Command) -> None:
        """Advance by 1 ms towards a command."""
        p = self._params
        x, y, yaw, sigma = command
        travel = p.closure_rate * DT
        self._sigma += min(max(sigma - self._sigma, -travel), travel)
        T = self._tension(self._edge.angles(self._first_phalanx))
        self._drive(x, y, yaw)
        if self._ground_body is not None:
            self._ground_body.drive(self._ground.velocity(self._steps), 0.0)
        self._edge.advance(self._first_phalanx, [T * gear for gear in GEARS])
        self._steps += 1

    def cast_rays(self, finger: int, rays: Sequence[Ray], reach: float) -> list[tuple[float, float, int] | None]:
        """Return where rays from a finger's sensor meet the object within reach, None for those that do not.

        Each is the distance in m, the cosine of the angle of incidence, and the face (`Hit`).

        Args:
            finger: 0 thumb, 1 index, 2 ring.
            rays: cosine and sine of their angles from the sensor's direction.
            reach: in m.
        """
        f, body, solid = FINGERS[finger], self._phalanges[_DISTAL[finger]], self._solid
        (x, y), (x_O, y_O, yaw_O) = body.position, self.thing
        x, y = x - x_O, y - y_O
        if math.hypot(x, y) > solid.reach + reach + f.lengths[-1]:
            return [None] * len(rays)
        c, s = math.cos(yaw_O), math.sin(yaw_O)
        x, y = c * x + s * y, c * y - s * x  # the middle of the phalanx, in O
        angle, r, along = body.angle - yaw_O, f.radii[-1], (SENSOR_PLACE - 0.5) * f.lengths[-1]
        c, s = math.cos(angle), math.sin(angle)
        n_x, n_y = -f.flexion * s, f.flexion * c
        x, y = x + along * c + r * n_x, y + along * s + r * n_y  # the sensor's window
        met: list[tuple[float, float, int] | None] = []
        for d_c, d_s in rays:
            d_x, d_y = d_c * n_x - d_s * n_y, d_s * n_x + d_c * n_y
            # a ray starts r behind the window, in the phalanx: the pad may be in the object by a little
            hit = solid.intersect(x - r * d_x, y - r * d_y, d_x, d_y)
            met.append((hit[0] - r, hit[1], hit[2]) if hit is not None and hit[0] - r <= reach else None)
        return met

    def sensor(self, finger: int) -> tuple[Point, Point]:
        """Return where a finger's sensor sits, in m, and the unit vector in which it looks, in W."""
        f, body = FINGERS[finger], self._phalanges[_DISTAL[finger]]
        (x, y), angle = body.position, body.angle
        c, s = math.cos(angle), math.sin(angle)
        n_x, n_y = -f.flexion * s, f.flexion * c
        along, r = (SENSOR_PLACE - 0.5) * f.lengths[-1], f.radii[-1]
        return (x + along * c + r * n_x, y + along * s + r * n_y), (n_x, n_y)

    def phalanges(self) -> list[tuple[float, float, float]]:
        """Return the middle, in m, and the orientation of each phalanx, in rad."""
        return self._edge.poses(self._first_phalanx)

    def _tension(self, angles: list[float]) -> float:
        p = self._params
        slack = tendon_excursion(angles, self._wrist[2]) - self._sigma * p.tendon_travel
        return p.tendon_stiffness * max(0.0, -slack)

    def _drive(self, x: float, y: float, yaw: float) -> None:
        """Give the palm its velocity for the coming step and note where it will be, as pymunk will have it."""
        p = self._params
        at_x, at_y, at_yaw, v_x, v_y, rate = self._wrist
        velocity = follow((x - at_x, y - at_y), (v_x, v_y), p.wrist_speed, p.wrist_acceleration, p.wrist_lag, DT)
        turning = rate
        if yaw != at_yaw or rate != 0.0:
            turning, _ = follow(
                (yaw - at_yaw, 0.0), (rate, 0.0), p.turning_rate, p.turning_acceleration, p.wrist_lag, DT
            )
        self._palm.drive(velocity, turning)
        v_x, v_y = velocity
        self._wrist = at_x + DT * v_x, at_y + DT * v_y, at_yaw + DT * turning, v_x, v_y, turning

    def _add_thing(self, motion: Motion) -> PymunkBody:
        p, solid, (x, y) = self._params, self._solid, self._centre
        mass = solid.mass
        thing = self._edge.add_body(mass, mass * solid.radius_of_gyration_squared, motion)
        for part in solid.parts:
            if isinstance(part, Disc):
                self._edge.add_circle(thing, (-x, -y), part.radius, _OBJECT_FRICTION, _OBJECT)
                continue
            for corners in convex_parts(part.corners) if isinstance(part, Polygon) else [part.corners]:
                self._edge.add_polygon(thing, [(c_x - x, c_y - y) for c_x, c_y in corners], _OBJECT_FRICTION, _OBJECT)
        weight = p.table_friction * mass * p.gravity
        self._edge.add_ground_friction(thing, weight, weight * solid.friction_arm, self._ground_body)
        return thing

    def _add_other(self, motion: Motion) -> PymunkBody:
        p, disc = self._params, Disc(radius=self._params.other_radius)
        other = self._edge.add_body(p.other_mass, p.other_mass * disc.radius_of_gyration_squared, motion)
        self._edge.add_circle(other, disc.centroid, disc.radius, _OBJECT_FRICTION, _OTHER)
        weight = p.table_friction * p.other_mass * p.gravity
        self._edge.add_ground_friction(other, weight, weight * 2.0 * disc.radius / 3.0)
        return other

    def _add_finger(self, f: Finger, motions: Sequence[Motion], stiffnesses: Sequence[float]) -> None:
        p = self._params
        before, joint, rest = self._palm, f.base, f.spread
        for motion, length, radius, stiffness in zip(motions, f.lengths, f.radii, stiffnesses, strict=True):
            inertia = p.phalanx_mass * (length**2 / 12.0 + radius**2 / 4.0)
            body = self._edge.add_body(p.phalanx_mass, inertia, motion)
            ends = ((-length / 2.0, 0.0), (length / 2.0, 0.0))
            self._edge.add_capsule(body, ends, radius, p.grip_friction, _HAND)
            low, high = sorted((rest + f.flexion * MIN_ANGLE, rest + f.flexion * MAX_ANGLE))
            self._edge.add_hinge((before, body), (joint, ends[0]), (low, high), rest, stiffness, p.joint_damping)
            self._phalanges.append(body)
            before, joint, rest = body, ends[1], 0.0
