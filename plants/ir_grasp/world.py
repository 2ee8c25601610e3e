"""Hand, object and table of the grasp scene as bodies in contact, advanced by 1 ms at a time.

`follow` is how the arm's wrist follows its command. One elastic tendon with the tension T = k max(0, sigma L - sum r q)
closes all joints of the soft hand; `resting_posture` gives the joints that it leads to in free space.
"""

import math
from collections.abc import Sequence
from itertools import accumulate, pairwise
from operator import mul
from typing import Final

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.ground import MovingGround, Pair
from handover.plants.ir_grasp.hand import FINGERS, MAX_ANGLE, MIN_ANGLE, PALM, SENSOR_PLACE, Finger, finger_points
from handover.plants.ir_grasp.objects import Disc
from handover.plants.ir_grasp.parameters import Params
from handover.plants.ir_grasp.pymunk_edge import Motion, PymunkBody, PymunkEdge


def follow(
    error: tuple[float, float], velocity: tuple[float, float], speed: float, acceleration: float, lag: float, dt: float
) -> tuple[float, float]:
    """Return the velocity for the coming dt of a point that is to go by `error`, in m and m/s, or rad and rad/s.

    It heads for its goal with the speed min(v_max, e / lag, sqrt(a e)), e what is left to go: from full speed it brakes
    with a / 2, then with at most a, and settles exponentially. The velocity changes by at most a dt.
    """
    left = math.hypot(*error)
    wanted = min(speed, left / lag, math.sqrt(acceleration * left)) / left if left > 0.0 else 0.0
    d_x, d_y = wanted * error[0] - velocity[0], wanted * error[1] - velocity[1]
    change = math.hypot(d_x, d_y)
    share = 1.0 if change <= acceleration * dt else acceleration * dt / change
    return velocity[0] + share * d_x, velocity[1] + share * d_y


PULLEYS: Final = np.array([r for f in FINGERS for r in f.pulleys])
"""Radii r at which the tendon passes the joints, (8,), in m."""

STIFFNESS: Final = np.array([k for f in FINGERS for k in f.stiffness])
"""Stiffness K of the joints, (8,), in N m/rad."""

GEARS: Final = tuple(
    f.flexion * (r - after) for f in FINGERS for r, after in zip(f.pulleys, (*f.pulleys[1:], 0.0), strict=True)
)
"""Tendon that a phalanx takes up by turning alone, 8, in m/rad; also the torque on it at a tension of 1 N."""

_PALM_GEAR = sum(f.flexion * f.pulleys[0] for f in FINGERS)
_RELAXED = sum(f.flexion * f.pulleys[0] * f.spread for f in FINGERS)


def tendon_excursion(angles: list[float], yaw: float) -> float:
    """Return sum r q in m, by the orientations of the 8 phalanges and of the hand, in rad."""
    return sum(map(mul, GEARS, angles)) - _PALM_GEAR * yaw - _RELAXED


def resting_posture(sigma: float, stiffness: float, travel: float) -> Floats:
    """Return the joint angles, (8,), in rad, of the hand at rest in free space.

    There K q = r T at each joint between its limits, and sum r q + T / k = sigma L, whose left side rises with T.

    Args:
        sigma: closure, 0 to 1.
        stiffness: k of the tendon, in N/m.
        travel: L, what the motor takes up at closure 1, in m.
    """

    def posture(T: float) -> Floats:
        return np.clip(PULLEYS * T / STIFFNESS, MIN_ANGLE, MAX_ANGLE)

    low, high = 0.0, stiffness * sigma * travel
    for _ in range(80):
        middle = (low + high) / 2.0
        if float(PULLEYS @ posture(middle)) + middle / stiffness < sigma * travel:
            low = middle
        else:
            high = middle
    return posture(low)


DT: Final = 1e-3
"""Internal time step, in s."""

Command = tuple[float, float, float, float]
"""Wrist's position in m, orientation in rad, closure."""

Snapshot = tuple[float, tuple[Motion, ...], int]
"""Closure, then the motions of palm, object and phalanges, then the steps made since the start."""

Ray = tuple[float, float]
"""Cosine and sine of the angle between a ray and the direction that a sensor looks in."""

_ITERATIONS = 10
_HAND, _OBJECT = 1, 2  # groups whose own shapes do not collide
_NAMED_FINGERS = tuple(zip(("thumb", "index", "ring"), FINGERS, strict=True))
_DISTAL = tuple(int(i) - 1 for i in accumulate(len(f.lengths) for f in FINGERS))  # among the phalanges
_STILL = (0.0, 0.0, 0.0)


def initial_snapshot(p: Params) -> Snapshot:
    """Return the scene at the start: everything at rest, the fingers as the tendon has them in free space."""
    q = resting_posture(p.sigma_0, p.tendon_stiffness, p.tendon_travel)
    palm = (float(p.p_WH_0[0]), float(p.p_WH_0[1]), p.yaw_H_0, *_STILL)
    thing = (float(p.p_WO_0[0]), float(p.p_WO_0[1]), p.solid.yaw + p.yaw_O_0, *_STILL)
    return p.sigma_0, (palm, thing, *_phalanges(p, q)), 0


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
    the ground's motion where it has one (`MovingGround`).

    Args:
        params: of the scene.
        snapshot: where everything is and how it moves.
    """

    def __init__(self, params: Params, snapshot: Snapshot) -> None:
        self._params = params
        self._edge = PymunkEdge(DT, _ITERATIONS)
        self._sigma, (palm, thing, *phalanges), self._steps = snapshot
        self._ground = MovingGround(params.ground_spans, DT)
        self._wrist = palm
        self._palm = self._edge.add_driven(palm)
        self._edge.add_polygon(self._palm, PALM, params.grip_friction, _HAND)
        self._ground_body = self._edge.add_driven((0.0, 0.0, 0.0, *_STILL)) if self._ground.ever_moves else None
        self._thing = self._add_thing(thing)
        self._first_phalanx = 2 if self._ground_body is None else 3  # among the bodies
        self._phalanges: list[PymunkBody] = []
        for f in FINGERS:
            self._add_finger(f, phalanges[len(self._phalanges) :][: len(f.lengths)])

    @property
    def snapshot(self) -> Snapshot:
        """Where everything is and how it moves."""
        return self._sigma, (self._wrist, *(b.motion for b in (self._thing, *self._phalanges))), self._steps

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
        """Position in m and orientation in rad of the object."""
        return (*self._thing.position, self._thing.angle)

    @property
    def ground(self) -> Pair:
        """How far the ground under the object has moved since the start, in m."""
        return self._ground.way(self._steps)

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
        return self._edge.touching(self._thing)

    def overlaps(self) -> list[tuple[str, float]]:
        """Return which of the hand's bodies are in the object, and how deep, in m."""
        names = ["palm"] + [f"{n} phalanx {i + 1}" for n, f in _NAMED_FINGERS for i in range(len(f.lengths))]
        depths = [self._edge.overlap(b, self._thing) for b in (self._palm, *self._phalanges)]
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

    def cast_rays(self, finger: int, rays: Sequence[Ray], reach: float) -> list[tuple[float, float]]:
        """Return what rays from a finger's sensor meet within reach: distance in m, cosine of the angle of incidence.

        Args:
            finger: 0 thumb, 1 index, 2 ring.
            rays: cosine and sine of their angles from the sensor's direction.
            reach: in m.
        """
        f, body, solid = FINGERS[finger], self._phalanges[_DISTAL[finger]], self._params.solid
        (x, y), (x_O, y_O), yaw_O = body.position, self._thing.position, self._thing.angle
        x, y = x - x_O, y - y_O
        if math.hypot(x, y) > solid.reach + reach + f.lengths[-1]:
            return []
        c, s = math.cos(yaw_O), math.sin(yaw_O)
        x, y = c * x + s * y, c * y - s * x  # the middle of the phalanx, in O
        angle, r, along = body.angle - yaw_O, f.radii[-1], (SENSOR_PLACE - 0.5) * f.lengths[-1]
        c, s = math.cos(angle), math.sin(angle)
        n_x, n_y = -f.flexion * s, f.flexion * c
        x, y = x + along * c + r * n_x, y + along * s + r * n_y  # the sensor's window
        met: list[tuple[float, float]] = []
        for d_c, d_s in rays:
            d_x, d_y = d_c * n_x - d_s * n_y, d_s * n_x + d_c * n_y
            # a ray starts r behind the window, in the phalanx: the pad may be in the object by a little
            hit = solid.intersect(x - r * d_x, y - r * d_y, d_x, d_y)
            if hit is not None and hit[0] - r <= reach:
                met.append((hit[0] - r, hit[1]))
        return met

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
        p, solid = self._params, self._params.solid
        mass = p.mass_O or solid.mass
        thing = self._edge.add_body(mass, mass * solid.gyration, motion)
        for part in solid.parts:
            if isinstance(part, Disc):
                self._edge.add_circle(thing, part.radius, 1.0, _OBJECT)
            else:
                self._edge.add_polygon(thing, part.corners, 1.0, _OBJECT)
        weight = p.table_friction * mass * p.gravity
        self._edge.add_ground_friction(thing, weight, weight * solid.friction_arm, self._ground_body)
        return thing

    def _add_finger(self, f: Finger, motions: Sequence[Motion]) -> None:
        p = self._params
        before, joint, rest = self._palm, f.base, f.spread
        for motion, length, radius, stiffness in zip(motions, f.lengths, f.radii, f.stiffness, strict=True):
            inertia = p.phalanx_mass * (length**2 / 12.0 + radius**2 / 4.0)
            body = self._edge.add_body(p.phalanx_mass, inertia, motion)
            ends = ((-length / 2.0, 0.0), (length / 2.0, 0.0))
            self._edge.add_capsule(body, ends, radius, p.grip_friction, _HAND)
            low, high = sorted((rest + f.flexion * MIN_ANGLE, rest + f.flexion * MAX_ANGLE))
            self._edge.add_hinge((before, body), (joint, ends[0]), (low, high), rest, stiffness, p.joint_damping)
            self._phalanges.append(body)
            before, joint, rest = body, ends[1], 0.0
