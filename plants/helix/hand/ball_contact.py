"""Contact of a ball with a gripper's fingers and palm and with a person's hand: the compiled kernel.

A body of the gripper is a capsule (a segment with a radius; the gripper's palm is one of length zero), the hand's
surface a shallow cup, the lower part of a hollow sphere, with a flat rim around it. A ball that goes d into a body
is pushed along the normal n with the force of Hunt and Crossley for a linear spring,

    f_n = max(0, k d (1 - lambda v_n)),  v_n = n . (v_O - v_body),

and along the surface by friction with a spring xi of Cundall and Strack, which lets it stick and slip,

    f_t = -k xi - c v_t,  |f_t| <= mu f_n,  xi' = v_t while it sticks,  c = sqrt(k m_O) / 2.

The hand's soft skin resists rolling likewise, M = -k r^2 theta - c_r w with |M| <= r (mu_r f_n + mu_H f_hold) and
theta' = w while it sticks (K. Iwashita, M. Oda, J. Eng. Mech. 124 (1998)). As long as the person holds the ball, thumb
and fingers press it with f_hold to the palm, which raises the palm's f_n, and with it its friction. The ball, a solid
sphere of mass m_O, moves and turns freely, I = 2/5 m_O r^2. A person holds the hand as a mass on a damped spring about
the place where it is held out, m_H x'' = f_H - c_H x' - k_H x. Finger tips that come to the hand's surface press on it
without friction; the hand's own fingers, and the backs of links, touch nothing.

K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975); P. A. Cundall, O. D. L. Strack, Geotechnique 29 (1979).
"""

import math
from typing import NamedTuple

from handover.cosim.blocks.ports import Floats
from handover.plants.helix import se3
from handover.plants.helix.compiled import compiled, compiled_once
from handover.plants.helix.se3 import Vector, add, cross, dot, scale, subtract, vector

CAPSULES = 7
"""Bodies of the gripper: two links of each of three fingers, the second of which has the tip, then the palm."""

_DEEPEST = 0.02
"""How deep a finger tip may be in the hand's surface before it counts as under the hand, m."""


class ContactNumbers(NamedTuple):
    """What does not change; all are numbers, so that an array can carry them into the kernel.

    Attributes:
        ball_mass: m_O, kg.
        ball_radius: r, m.
        gravity: along -z of W, m/s2.
        finger_stiffness: k of the gripper's bodies, N/m.
        finger_friction: mu of them.
        hand_stiffness: k of the hand's skin, N/m.
        hand_friction: mu of it.
        rolling_friction: mu_r of it, the part of the ball's radius by which its pressure is out of the middle.
        dissipation: lambda, s/m.
        cup_radius: of the sphere of which the hand's cup is a part, m.
        cup_cosine: cosine of the cup's half angle, seen from that sphere's middle.
        palm_radius: how far the flat rim reaches from the cup's axis, m.
        arm_mass: m_H, kg.
        arm_stiffness: k_H, N/m.
        arm_damping: c_H, N s/m.
    """

    ball_mass: float
    ball_radius: float
    gravity: float
    finger_stiffness: float
    finger_friction: float
    hand_stiffness: float
    hand_friction: float
    rolling_friction: float
    dissipation: float
    cup_radius: float
    cup_cosine: float
    palm_radius: float
    arm_mass: float
    arm_stiffness: float
    arm_damping: float


@compiled
def _touch(
    k: float,
    mu: float,
    c: ContactNumbers,
    depth: float,
    n: Vector,
    v: Vector,
    xi: Vector,
    h: float,
) -> tuple[float, Vector, Vector]:
    """Return f_n, the force on the ball and the new xi, of a contact with the relative velocity v of its surfaces."""
    v_n = dot(v, n)
    f_n = max(0.0, k * depth * (1.0 - c.dissipation * v_n))
    v_t = subtract(v, scale(v_n, n))
    xi = add(subtract(xi, scale(dot(xi, n), n)), scale(h, v_t))
    damping = 0.5 * math.sqrt(k * c.ball_mass)
    f_t = add(scale(-k, xi), scale(-damping, v_t))
    size, most = math.sqrt(dot(f_t, f_t)), mu * f_n
    if size > most:
        f_t = scale(most / size, f_t)
        xi = scale(-1.0 / k, f_t)
    return f_n, add(scale(f_n, n), f_t), xi


@compiled
def _roll(most: float, c: ContactNumbers, w: Vector, theta: Vector, h: float) -> tuple[Vector, Vector]:
    """Return the moment, `most` at most, by which the hand resists turning with w, and the new theta."""
    k = c.hand_stiffness * c.ball_radius * c.ball_radius
    theta = add(theta, scale(h, w))
    damping = 0.5 * c.ball_radius * math.sqrt(k * c.ball_mass)
    moment = add(scale(-k, theta), scale(-damping, w))
    size = math.sqrt(dot(moment, moment))
    if size > most:
        moment = scale(most / size, moment)
        theta = scale(-1.0 / k, moment)
    return moment, theta


@compiled
def _nearest(p: Vector, a: Vector, b: Vector) -> float:
    """Return the share of the way from a to b of the segment's point that is nearest to p."""
    along = subtract(b, a)
    square = dot(along, along)
    if square == 0.0:
        return 0.0
    return min(max(dot(subtract(p, a), along) / square, 0.0), 1.0)


@compiled
def _depth_in_hand(p: Vector, radius: float, bottom: Vector, c: ContactNumbers) -> tuple[float, Vector]:
    """Return how deep a sphere is in the hand's surface, whose cup's lowest point is given, and the normal."""
    to_middle = subtract(add(bottom, (0.0, 0.0, c.cup_radius)), p)
    distance = math.sqrt(dot(to_middle, to_middle))
    if distance > 0.0 and to_middle[2] >= c.cup_cosine * distance:
        depth = distance + radius - c.cup_radius
        return (depth if depth < radius + _DEEPEST else -1.0), scale(1.0 / distance, to_middle)
    beside = math.hypot(to_middle[0], to_middle[1])
    rim = bottom[2] + c.cup_radius * (1.0 - c.cup_cosine)
    depth = rim + radius - p[2]
    return (depth if beside <= c.palm_radius and depth < _DEEPEST else -1.0), (0.0, 0.0, 1.0)


@compiled_once(__name__, se3.__name__)
def advance(
    numbers: Floats,
    ball: Floats,
    arm: Floats,
    xi: Floats,
    ends: Floats,
    end_rates: Floats,
    radii: Floats,
    bottom: Floats,
    bottom_rate: Floats,
    f_hold: float,
    h: float,
    steps: int,
    told: Floats,
) -> None:
    """Advance ball and hand by steps h (semi-implicit Euler), while gripper and place of the hand move evenly.

    All are plain arrays and numbers, so that machine code which is kept depends on no module's name.

    Args:
        numbers: those of `ContactNumbers`, (15,).
        ball: p_WO, v_WO and angular velocity, in W, (3, 3); advanced.
        arm: displacement of the hand from where it is held out, and its rate, in W, (2, 3); advanced.
        xi: springs of the friction with the gripper's bodies and with the hand, m, then theta, rad:
            (CAPSULES + 2, 3); advanced.
        ends: of the capsules in W at the start, (CAPSULES, 2, 3), m; advanced.
        end_rates: their velocities, m/s.
        radii: of the capsules, (CAPSULES,), m.
        bottom: lowest point of the hand's cup in W at the start, were it not displaced, (3,), m; advanced.
        bottom_rate: its velocity, m/s.
        f_hold: force with which the person presses the ball to the palm, N.
        h: length of a step, s.
        steps: their number.
        told: filled with means over the steps: force on the gripper and on the hand in W, (2, 3), N; then the sum of
            f_n of the gripper's bodies on the ball, that of the hand, and that of finger tips on the hand: (3, 3).
    """
    c = ContactNumbers(
        numbers[0],
        numbers[1],
        numbers[2],
        numbers[3],
        numbers[4],
        numbers[5],
        numbers[6],
        numbers[7],
        numbers[8],
        numbers[9],
        numbers[10],
        numbers[11],
        numbers[12],
        numbers[13],
        numbers[14],
    )
    inertia = 0.4 * c.ball_mass * c.ball_radius * c.ball_radius
    for i in range(3):
        for j in range(3):
            told[i, j] = 0.0
    for _ in range(steps):
        p, v, w = vector(ball, 0), vector(ball, 1), vector(ball, 2)
        x, x_rate = vector(arm, 0), vector(arm, 1)
        low = (bottom[0] + x[0], bottom[1] + x[1], bottom[2] + x[2])
        low_rate = (bottom_rate[0] + x_rate[0], bottom_rate[1] + x_rate[1], bottom_rate[2] + x_rate[2])
        on_gripper, on_hand, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        by_gripper, by_hand, by_tips = 0.0, 0.0, 0.0
        for i in range(CAPSULES):
            a, b = vector(ends[i], 0), vector(ends[i], 1)
            s = _nearest(p, a, b)
            away = subtract(p, add(scale(1.0 - s, a), scale(s, b)))
            distance = math.sqrt(dot(away, away))
            depth = c.ball_radius + radii[i] - distance
            if depth > 0.0 and distance > 0.0:
                n = scale(1.0 / distance, away)
                of_body = add(scale(1.0 - s, vector(end_rates[i], 0)), scale(s, vector(end_rates[i], 1)))
                arm_to = scale(-c.ball_radius, n)
                f_n, f, new = _touch(
                    c.finger_stiffness,
                    c.finger_friction,
                    c,
                    depth,
                    n,
                    subtract(add(v, cross(w, arm_to)), of_body),
                    vector(xi, i),
                    h,
                )
                by_gripper += f_n
                on_gripper, torque = subtract(on_gripper, f), add(torque, cross(arm_to, f))
                xi[i, 0], xi[i, 1], xi[i, 2] = new
            else:
                xi[i, 0], xi[i, 1], xi[i, 2] = 0.0, 0.0, 0.0
        on_ball = scale(-1.0, on_gripper)
        depth, n = _depth_in_hand(p, c.ball_radius, low, c)
        if depth > 0.0:
            arm_to = scale(-c.ball_radius, n)
            f_n, f, new = _touch(
                c.hand_stiffness,
                c.hand_friction,
                c,
                depth,
                n,
                subtract(add(v, cross(w, arm_to)), low_rate),
                vector(xi, CAPSULES),
                h,
            )
            by_hand = f_n
            on_hand, on_ball, torque = subtract(on_hand, f), add(on_ball, f), add(torque, cross(arm_to, f))
            xi[CAPSULES, 0], xi[CAPSULES, 1], xi[CAPSULES, 2] = new
            most = c.ball_radius * (c.rolling_friction * f_n + c.hand_friction * f_hold)
            moment, turned = _roll(most, c, w, vector(xi, CAPSULES + 1), h)
            on_hand, on_ball = add(on_hand, scale(f_hold, n)), subtract(on_ball, scale(f_hold, n))
            torque = add(torque, moment)
            xi[CAPSULES + 1, 0], xi[CAPSULES + 1, 1], xi[CAPSULES + 1, 2] = turned
        else:
            for i in range(3):
                xi[CAPSULES, i], xi[CAPSULES + 1, i] = 0.0, 0.0
        for i in range(1, CAPSULES - 1, 2):
            tip = vector(ends[i], 1)
            depth, n = _depth_in_hand(tip, radii[i], low, c)
            if depth > 0.0:
                v_n = dot(subtract(vector(end_rates[i], 1), low_rate), n)
                f_n = max(0.0, c.hand_stiffness * depth * (1.0 - c.dissipation * v_n))
                by_tips += f_n
                on_gripper, on_hand = add(on_gripper, scale(f_n, n)), subtract(on_hand, scale(f_n, n))
        for i in range(3):
            fall = -c.gravity if i == 2 else 0.0
            ball[1, i] += h * (on_ball[i] / c.ball_mass + fall)
            ball[0, i] += h * ball[1, i]
            ball[2, i] += h * torque[i] / inertia
            arm[1, i] += h * (on_hand[i] - c.arm_damping * arm[1, i] - c.arm_stiffness * arm[0, i]) / c.arm_mass
            arm[0, i] += h * arm[1, i]
            bottom[i] += h * bottom_rate[i]
            told[0, i] += on_gripper[i] / steps
            told[1, i] += on_hand[i] / steps
        told[2, 0] += by_gripper / steps
        told[2, 1] += by_hand / steps
        told[2, 2] += by_tips / steps
        for i in range(CAPSULES):
            for j in range(2):
                for m in range(3):
                    ends[i, j, m] += h * end_rates[i, j, m]
