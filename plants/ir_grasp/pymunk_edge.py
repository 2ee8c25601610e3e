"""Typed interface to pymunk: rigid bodies in a plane without gravity, hinges, friction on the ground."""

import math
from array import array
from collections.abc import Iterable, Sequence

import pymunk
from pymunk import batch
from pymunk.autogeometry import convex_decomposition
from pymunk.constraints import DampedRotarySpring, GearJoint, PivotJoint, RotaryLimitJoint

Point = tuple[float, float]

Motion = tuple[float, float, float, float, float, float]
"""Of a body: position of its centre of mass in m, orientation in rad, velocity in m/s, angular velocity in rad/s."""

_TORQUE = batch.BodyFields.TORQUE
_SLOP = 1e-4  # m; overlap that contacts keep, so that they persist (assumed)


def convex_parts(corners: Sequence[Point]) -> list[list[Point]]:
    """Return convex polygons whose union is a simple polygon with corners counter-clockwise."""
    parts = convex_decomposition([*corners, corners[0]], 0.0)
    return [[(p.x, p.y) for p in part[:-1]] for part in parts]


class PymunkBody:
    """A rigid body in the plane; made by `PymunkEdge`."""

    def __init__(self, body: pymunk.Body) -> None:
        self.body = body
        self.shapes: list[pymunk.Shape] = []
        self._driven = (body.velocity.x, body.velocity.y), body.angular_velocity

    @property
    def position(self) -> Point:
        """Position of the centre of mass, in m."""
        return self.body.position

    @property
    def angle(self) -> float:
        """Orientation in rad, not wrapped."""
        return self.body.angle

    @property
    def motion(self) -> Motion:
        """Position, orientation and velocities."""
        b = self.body
        (x, y), (v_x, v_y) = b.position, b.velocity
        return x, y, b.angle, v_x, v_y, b.angular_velocity

    def drive(self, velocity: Point, rate: float) -> None:
        """Set the velocity in m/s and the angular velocity in rad/s of a driven body, which keeps them."""
        last, last_rate = self._driven
        if velocity != last:
            self.body.velocity = velocity
        if rate != last_rate:
            self.body.angular_velocity = rate
        self._driven = velocity, rate


class PymunkEdge:
    """A pymunk space seen from above, in SI units; equal calls in equal order give equal results, bit for bit.

    Args:
        dt: time step, in s.
        iterations: of the contact solver.
    """

    def __init__(self, dt: float, iterations: int) -> None:
        self._dt = dt
        self._space = pymunk.Space()
        self._space.iterations = iterations
        self._space.collision_slop = _SLOP
        self._bodies: list[pymunk.Body] = []  # in pymunk's order
        self._torques = array("d")
        self._shared = batch.Buffer()

    def add_driven(self, motion: Motion) -> PymunkBody:
        """Add a body that moves with the velocities it is given, whatever forces act on it."""
        return self._add(pymunk.Body(body_type=pymunk.Body.KINEMATIC), motion)

    def add_body(self, mass: float, inertia: float, motion: Motion) -> PymunkBody:
        """Add a body of a mass in kg and an inertia in kg m2 about its centre."""
        return self._add(pymunk.Body(mass, inertia), motion)

    def add_circle(self, body: PymunkBody, middle: Point, radius: float, friction: float, group: int) -> None:
        """Add a circle about a point in the body; shapes of a group other than 0 do not collide with each other."""
        self._shape(body, pymunk.Circle(body.body, radius, middle), friction, group)

    def add_capsule(
        self, body: PymunkBody, ends: tuple[Point, Point], radius: float, friction: float, group: int
    ) -> None:
        """Add a capsule between two points in the body."""
        self._shape(body, pymunk.Segment(body.body, *ends, radius), friction, group)

    def add_polygon(self, body: PymunkBody, corners: Sequence[Point], friction: float, group: int) -> None:
        """Add a convex polygon given in the body."""
        self._shape(body, pymunk.Poly(body.body, corners), friction, group)

    def add_hinge(
        self,
        bodies: tuple[PymunkBody, PymunkBody],
        anchors: tuple[Point, Point],
        limits: tuple[float, float],
        rest: float,
        stiffness: float,
        damping: float,
    ) -> None:
        """Join two bodies at a point, given in each, by a damped spring that is relaxed at the relative angle `rest`.

        pymunk lets the relative velocity that a torque makes in a step decay by exp(-c dt / I), which stops joints
        of light bodies. It is given the c' whose decay is 1 / (1 + c dt / I): the damper c by Euler's implicit rule.
        """
        a, b = bodies[0].body, bodies[1].body
        inertia = 1.0 / (1.0 / a.moment + 1.0 / b.moment)
        damping = inertia / self._dt * math.log1p(damping * self._dt / inertia)
        self._space.add(
            PivotJoint(a, b, *anchors),
            RotaryLimitJoint(a, b, *limits),
            DampedRotarySpring(a, b, -rest, stiffness, damping),  # pymunk's spring counts a - b
        )

    def add_ground_friction(
        self, body: PymunkBody, force: float, torque: float, ground_body: PymunkBody | None = None
    ) -> None:
        """Let the ground resist a body's sliding and turning with at most a force in N and a torque in N m.

        The two limits are independent (assumed): on a real table a body that slides turns more easily, its limits
        being about an ellipse of force and torque. The ground is at rest, or a driven body without shapes.
        """
        ground = self._space.static_body if ground_body is None else ground_body.body
        slide = PivotJoint(ground, body.body, (0.0, 0.0), (0.0, 0.0))
        turn = GearJoint(ground, body.body, 0.0, 1.0)
        for joint, limit in ((slide, force), (turn, torque)):
            joint.max_bias = 0.0
            joint.max_force = limit
            self._space.add(joint)

    def poses(self, first: int) -> list[tuple[float, float, float]]:
        """Return positions in m and orientations in rad of the bodies from the first-th added on."""
        return [(x, y, b.angle) for b in self._bodies[first:] for x, y in [b.position]]

    def angles(self, first: int) -> list[float]:
        """Return the orientations of the bodies from the first-th added on, in rad."""
        return [b.angle for b in self._bodies[first:]]

    def advance(self, first: int, torques: Iterable[float]) -> None:
        """Advance by one time step, with torques in N m on the bodies from the first-th added on."""
        self._torques[first:] = array("d", torques)
        batch.set_space_bodies(self._space, _TORQUE, self._shared)
        self._space.step(self._dt)

    def overlap(self, first: PymunkBody, second: PymunkBody) -> float:
        """Return how deep two bodies are in one another, in m; 0 if they are not."""
        hits = [hit for shape in first.shapes for hit in self._space.shape_query(shape) if hit.shape in second.shapes]
        # the sign of a distance depends on which shape pymunk takes first; it gives no contacts of shapes apart
        return max([0.0, *(abs(c.distance) for hit in hits for c in hit.contact_point_set.points)])

    def touching(self, body: PymunkBody, besides: PymunkBody | None = None) -> int:
        """Return how many other bodies are in contact with a body, one not counted."""
        others: set[int] = set()

        def note(arbiter: pymunk.Arbiter) -> None:
            others.update(b.id for b in arbiter.bodies)

        body.body.each_arbiter(note)
        return len(others - {body.body.id} - (set[int]() if besides is None else {besides.body.id}))

    def _add(self, body: pymunk.Body, motion: Motion) -> PymunkBody:
        x, y, angle, v_x, v_y, rate = motion
        body.position, body.angle = (x, y), angle
        body.velocity, body.angular_velocity = (v_x, v_y), rate
        self._space.add(body)
        self._bodies.append(body)
        self._torques = array("d", bytes(8 * len(self._bodies)))
        self._shared.set_float_buf(self._torques)
        return PymunkBody(body)

    def _shape(self, body: PymunkBody, shape: pymunk.Shape, friction: float, group: int) -> None:
        shape.friction = friction
        shape.filter = pymunk.ShapeFilter(group=group)
        self._space.add(shape)
        body.shapes.append(shape)
