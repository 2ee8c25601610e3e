"""Contact of a ball with a gripper's fingers and palm and with a person's hand: the compiled kernel.

A body of the gripper is a capsule (a segment with a radius; the gripper's palm is one of length zero), the hand's
surface a shallow cup, the lower part of a hollow sphere, with a flat rim around it. A ball that goes d into a body
is pushed along the normal n with the force of Hunt and Crossley for a linear spring,

    f_n = max(0, k d (1 - lambda v_n)),  v_n = n . (v_O - v_body),

and along the surface by friction with a spring xi of Cundall and Strack, which lets it stick and slip,

    f_t = -k xi - c v_t,  |f_t| <= mu f_n,  xi' = v_t while it sticks,  c = sqrt(k m_O) / 2.

The hand's soft skin resists rolling and spinning likewise, M = -k r^2 theta - r^2 c w with
|M| <= r (mu_r f_n + mu f_hold), k and mu the hand's, and theta' = w while it sticks (K. Iwashita, M. Oda, J. Eng.
Mech. 124 (1998)). As long as the person holds the ball, thumb and fingers press it with f_hold to the palm, which
raises the palm's f_n, and with it its friction. The ball, a solid sphere of mass m_O, moves and turns freely,
I = 2/5 m_O r^2. A person holds the hand as a mass on a damped spring about the place where it is held out,
m_H x'' = f_H - c_H x' - k_H x. Finger tips that come to the hand's surface press on it without friction; the hand's
own fingers, and the backs of links, touch nothing.

K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975); P. A. Cundall, O. D. L. Strack, Geotechnique 29 (1979).
"""

import math
from typing import NamedTuple

from handover.cosim.blocks.ports import Floats
from handover.plants.helix import se3
from handover.plants.helix.compiled import compiled, compiled_inline, compiled_once
from handover.plants.helix.se3 import Vector, add, cross, dot, norm, scale, subtract, vector

CAPSULES = 7
"""Bodies of the gripper: two links of each of three fingers, the second of which has the tip, then the palm."""

_DEEPEST = 0.02
"""How deep a finger tip may be in the hand's surface before it counts as under the hand, m."""


class ContactNumbers(NamedTuple):
    """What does not change; all are numbers, so that a plain tuple can carry them into the kernel.

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
    size, most = norm(f_t), mu * f_n
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
    size = norm(moment)
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
    distance = norm(to_middle)
    if distance > 0.0 and to_middle[2] >= c.cup_cosine * distance:
        depth = distance + radius - c.cup_radius
        return (depth if depth < radius + _DEEPEST else -1.0), scale(1.0 / distance, to_middle)
    beside = math.hypot(to_middle[0], to_middle[1])
    rim = bottom[2] + c.cup_radius * (1.0 - c.cup_cosine)
    depth = rim + radius - p[2]
    return (depth if beside <= c.palm_radius and depth < _DEEPEST else -1.0), (0.0, 0.0, 1.0)


@compiled_inline
def _gripper_contacts(
    c: ContactNumbers,
    p: Vector,
    v: Vector,
    w: Vector,
    xi: Floats,
    ends: Floats,
    end_rates: Floats,
    radii: Floats,
    h: float,
) -> tuple[float, Vector, Vector]:
    """Return the sum of f_n of the gripper's bodies on the ball, the force on the gripper, and the ball's moment."""
    pressure, on_gripper, torque = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(CAPSULES):
        a, b = vector(ends[i], 0), vector(ends[i], 1)
        s = _nearest(p, a, b)
        away = subtract(p, add(scale(1.0 - s, a), scale(s, b)))
        distance = norm(away)
        depth = c.ball_radius + radii[i] - distance
        if depth > 0.0 and distance > 0.0:
            n = scale(1.0 / distance, away)
            lever = scale(-c.ball_radius, n)
            of_body = add(scale(1.0 - s, vector(end_rates[i], 0)), scale(s, vector(end_rates[i], 1)))
            slip = subtract(add(v, cross(w, lever)), of_body)
            f_n, f, spring = _touch(c.finger_stiffness, c.finger_friction, c, depth, n, slip, vector(xi, i), h)
            pressure += f_n
            on_gripper, torque = subtract(on_gripper, f), add(torque, cross(lever, f))
            xi[i, 0], xi[i, 1], xi[i, 2] = spring
        else:
            xi[i, 0], xi[i, 1], xi[i, 2] = 0.0, 0.0, 0.0
    return pressure, on_gripper, torque


@compiled_inline
def _hand_contact(
    c: ContactNumbers,
    p: Vector,
    v: Vector,
    w: Vector,
    xi: Floats,
    bottom: Vector,
    bottom_rate: Vector,
    f_hold: float,
    h: float,
    on_ball: Vector,
    torque: Vector,
) -> tuple[float, Vector, Vector, Vector]:
    """Return f_n of the hand on the ball, the force on the hand, and the ball's force and moment with the hand's."""
    on_hand = (0.0, 0.0, 0.0)
    depth, n = _depth_in_hand(p, c.ball_radius, bottom, c)
    if not depth > 0.0:
        for i in range(3):
            xi[CAPSULES, i], xi[CAPSULES + 1, i] = 0.0, 0.0
        return 0.0, on_hand, on_ball, torque
    lever = scale(-c.ball_radius, n)
    slip = subtract(add(v, cross(w, lever)), bottom_rate)
    f_n, f, spring = _touch(c.hand_stiffness, c.hand_friction, c, depth, n, slip, vector(xi, CAPSULES), h)
    most = c.ball_radius * (c.rolling_friction * f_n + c.hand_friction * f_hold)
    moment, theta = _roll(most, c, w, vector(xi, CAPSULES + 1), h)
    xi[CAPSULES, 0], xi[CAPSULES, 1], xi[CAPSULES, 2] = spring
    xi[CAPSULES + 1, 0], xi[CAPSULES + 1, 1], xi[CAPSULES + 1, 2] = theta
    held = scale(f_hold, n)
    on_hand = add(subtract(on_hand, f), held)
    on_ball = subtract(add(on_ball, f), held)
    torque = add(add(torque, cross(lever, f)), moment)
    return f_n, on_hand, on_ball, torque


@compiled_inline
def _tip_contacts(
    c: ContactNumbers,
    ends: Floats,
    end_rates: Floats,
    radii: Floats,
    bottom: Vector,
    bottom_rate: Vector,
    on_gripper: Vector,
    on_hand: Vector,
) -> tuple[Vector, Vector]:
    """Return the forces on gripper and hand with those of the finger tips that press on the hand."""
    for i in range(1, CAPSULES - 1, 2):
        depth, n = _depth_in_hand(vector(ends[i], 1), radii[i], bottom, c)
        if depth > 0.0:
            v_n = dot(subtract(vector(end_rates[i], 1), bottom_rate), n)
            f = scale(max(0.0, c.hand_stiffness * depth * (1.0 - c.dissipation * v_n)), n)
            on_gripper, on_hand = add(on_gripper, f), subtract(on_hand, f)
    return on_gripper, on_hand


@compiled_inline
def _integrate(
    c: ContactNumbers, ball: Floats, arm: Floats, on_ball: Vector, torque: Vector, on_hand: Vector, h: float
) -> None:
    """Advance ball and hand by a step of semi-implicit Euler."""
    inertia = 0.4 * c.ball_mass * c.ball_radius * c.ball_radius
    for i in range(3):
        fall = -c.gravity if i == 2 else 0.0
        ball[1, i] += h * (on_ball[i] / c.ball_mass + fall)
        ball[0, i] += h * ball[1, i]
        ball[2, i] += h * torque[i] / inertia
        arm[1, i] += h * (on_hand[i] - c.arm_damping * arm[1, i] - c.arm_stiffness * arm[0, i]) / c.arm_mass
        arm[0, i] += h * arm[1, i]


@compiled_once(__name__, *se3.SOURCES)
def advance(
    numbers: tuple[float, ...],
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
    forces: Floats,
    pressures: Floats,
) -> None:
    """Advance ball and hand by steps h (semi-implicit Euler), while gripper and place of the hand move evenly.

    All are plain arrays, tuples and numbers, so that machine code which is kept depends on no module's name.

    Args:
        numbers: those of `ContactNumbers`.
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
        forces: filled with means over the steps: force on the gripper and on the hand in W, (2, 3), N.
        pressures: likewise: sum of f_n of the gripper's bodies on the ball, and f_n of the hand, (2,), N.
    """
    c = ContactNumbers(*numbers)
    forces[:], pressures[:] = 0.0, 0.0
    for _ in range(steps):
        p, v, w = vector(ball, 0), vector(ball, 1), vector(ball, 2)
        x, x_rate = vector(arm, 0), vector(arm, 1)
        low = (bottom[0] + x[0], bottom[1] + x[1], bottom[2] + x[2])
        low_rate = (bottom_rate[0] + x_rate[0], bottom_rate[1] + x_rate[1], bottom_rate[2] + x_rate[2])
        by_gripper, on_gripper, torque = _gripper_contacts(c, p, v, w, xi, ends, end_rates, radii, h)
        on_ball = scale(-1.0, on_gripper)
        by_hand, on_hand, on_ball, torque = _hand_contact(c, p, v, w, xi, low, low_rate, f_hold, h, on_ball, torque)
        on_gripper, on_hand = _tip_contacts(c, ends, end_rates, radii, low, low_rate, on_gripper, on_hand)
        _integrate(c, ball, arm, on_ball, torque, on_hand, h)
        pressures[0] += by_gripper / steps
        pressures[1] += by_hand / steps
        for i in range(3):
            bottom[i] += h * bottom_rate[i]
            forces[0, i] += on_gripper[i] / steps
            forces[1, i] += on_hand[i] / steps
        for i in range(CAPSULES):
            for j in range(2):
                for m in range(3):
                    ends[i, j, m] += h * end_rates[i, j, m]
