"""Forces in the chain of discs of `TendonArmFast`, with their directions: the matrices by which rates become strains.

Coordinates in the base frame B (z down): node b of n + 1, the first the fixed mount, has the position p_B of its origin
and the orientation q_B; its rates are six entries of v from 6 b on, the velocity in B and the angular velocity in the
disc. After the nodes come the rates of nine motors. Forces are listed likewise.
"""

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.compiled import compiled
from handover.plants.helix.se3 import (
    add,
    cross,
    half,
    logarithm,
    norm,
    quaternion,
    quaternion_inverse,
    quaternion_multiply,
    rotate,
    scale,
    subtract,
    vector,
)

Integers: TypeAlias = NDArray[np.int64]


class Chain(NamedTuple):
    """What does not change: n elements, n + 1 nodes, nine tendons.

    Attributes:
        nodes: mass, inertia about the origin across and along the axis, centre's z: (n + 1, 4).
        beams: natural length, six stiffnesses, six dampings (three of translation, three of rotation): (n, 13).
        ends: nodes at the ends of the three segments: (4,).
        holes: of the tendons in a disc, (3, 3), in m.
        tendons: EA in N, DA in N s, reference length in m: (9, 3).
        slack_force: largest push of a slack tendon, in N.
        motor_mass: in kg.
        motor_rate: natural angular frequency of the motors, in rad/s.
        gravity: along z of B, in m/s2.
        gripper: distance of the gripper from the last node, in m.
    """

    nodes: Floats
    beams: Floats
    ends: Integers
    holes: Floats
    tendons: Floats
    slack_force: float
    motor_mass: float
    motor_rate: float
    gravity: float
    gripper: float


@compiled
def clear(a: Floats) -> None:
    """Fill a vector with zeros; numpy's a[:] = 0 takes Numba long to compile."""
    for i in range(len(a)):
        a[i] = 0.0


@compiled
def copy(a: Floats, b: Floats) -> None:
    """Copy a vector a to b."""
    for i in range(len(a)):
        b[i] = a[i]


@compiled
def beam_strain(p: Floats, q: Floats, e: int, rates: Floats) -> tuple[float, float, float, float, float, float]:
    """Return the logarithm (u, theta) of the motion from node e to e + 1, and fill the rates of its ends' motion.

    Forces and moments between the ends act in the frame M, whose orientation is midway from the one to the other, with
    the lever u / 2 from either end. Exudyn's connector does so in its intrinsic formulation.

    Args:
        p: positions of nodes.
        q: their orientations.
        e: the element.
        rates: filled with the relative twist in M by the rates of the two nodes, (6, 12).
    """
    q_B0, q_B1 = quaternion(q, e), quaternion(q, e + 1)
    q_01 = quaternion_multiply(quaternion_inverse(q_B0), q_B1)
    q_M1 = half(q_01)
    q_BM = quaternion_multiply(q_B0, q_M1)
    q_MB, q_M0 = quaternion_inverse(q_BM), quaternion_inverse(q_M1)
    chord = subtract(vector(p, e + 1), vector(p, e))
    u, theta = logarithm(q_01, rotate(quaternion_inverse(q_B0), chord))
    arm = scale(0.5, u)
    for c in range(3):
        axis = (1.0 if c == 0 else 0.0, 1.0 if c == 1 else 0.0, 1.0 if c == 2 else 0.0)
        moved = rotate(q_MB, axis)
        turned_0, turned_1 = rotate(q_M0, axis), rotate(q_M1, axis)
        swept_0, swept_1 = cross(arm, turned_0), cross(arm, turned_1)
        for j in range(3):
            rates[j, c] = -moved[j]
            rates[j, c + 6] = moved[j]
            rates[j, c + 3] = swept_0[j]
            rates[j, c + 9] = swept_1[j]
            rates[j + 3, c + 3] = -turned_0[j]
            rates[j + 3, c + 9] = turned_1[j]
    return (u[0], u[1], u[2], theta[0], theta[1], theta[2])


@compiled
def add_beams(beams: Floats, p: Floats, q: Floats, v: Floats, rates: Floats, force: Floats, r: Floats) -> None:
    """Add the elements' resistance K (strain - natural) + D strain rate, six numbers each, to r.

    The strain's rate is what M sees of the difference of the ends' velocities, and of angular velocities. As in Exudyn
    the former has no part of how M turns: across, such damping would resist turning, so only that along z is given.

    Fills `rates`, (n, 6, 12), and the forces in B that the far ends feel from their elements, (n, 3), reversed.
    """
    for e in range(len(beams)):
        B = rates[e]
        for c in range(3):
            force[e, c] = 0.0
        strain = beam_strain(p, q, e, B)
        for j in range(6):
            rate = 0.0
            for i in range(12):
                if j >= 3 or i % 6 < 3:
                    rate += B[j, i] * v[6 * e + i]
            natural = beams[e, 0] if j == 2 else 0.0
            wrench = beams[e, 1 + j] * (strain[j] - natural) + beams[e, 7 + j] * rate
            for i in range(12):
                r[6 * e + i] += B[j, i] * wrench
            if j < 3:
                for c in range(3):
                    force[e, c] += B[j, c + 6] * wrench


@compiled
def measure_tendons(chain: Chain, p: Floats, q: Floats, spans: Floats, length: Floats, G: Floats) -> None:
    """Fill the tendons' spans, (n, 3), lengths, (9,), and their derivatives by the nodes' coordinates, (6 (n + 1), 9).

    L = sum |P_b+1 - P_b| over the holes P_b = p_b + R_b a of the segment's discs.
    """
    clear(length)
    for i in range(len(G)):
        for t in range(9):
            G[i, t] = 0.0
    for i in range(3):
        for k in range(3):
            hole, tendon = vector(chain.holes, k), 3 * i + k
            first, last = chain.ends[i], chain.ends[i + 1]
            here = add(vector(p, first), rotate(quaternion(q, first), hole))
            before = (0.0, 0.0, 0.0)
            for b in range(first, last + 1):
                after = (0.0, 0.0, 0.0)
                if b < last:
                    there = add(vector(p, b + 1), rotate(quaternion(q, b + 1), hole))
                    span = subtract(there, here)
                    distance = norm(span)
                    spans[b, k] = distance
                    length[tendon] += distance
                    after = scale(1.0 / distance, span)
                    here = there
                pull = subtract(before, after)
                turn = cross(hole, rotate(quaternion_inverse(quaternion(q, b)), pull))
                for c in range(3):
                    G[6 * b + c, tendon] = pull[c]
                    G[6 * b + 3 + c, tendon] = turn[c]
                before = after


@compiled
def add_tendons(
    chain: Chain, motors: Floats, v: Floats, length: Floats, G: Floats, r: Floats, f: Floats, slope: Floats
) -> None:
    """Add the pull T(f) of the tendons to r; fills f and dT/df, (9,).

    f = ((L - L0) EA + (L' - L0') DA) / L0, where L0 is a reference length plus the motor's position;
    T = f for f > 0, else F tanh(f / F), F the largest push.
    """
    n = len(G)
    for t in range(9):
        f[t] = -v[n + t]
    for i in range(n):
        for t in range(9):
            f[t] += G[i, t] * v[i]
    for t in range(9):
        L0 = chain.tendons[t, 2] + motors[t]
        f[t] = ((length[t] - L0) * chain.tendons[t, 0] + f[t] * chain.tendons[t, 1]) / L0
        pull = f[t]
        slope[t] = 1.0
        if pull < 0.0:
            push = math.tanh(pull / chain.slack_force)
            slope[t] = 1.0 - push * push
            pull = chain.slack_force * push
        r[n + t] -= pull
        for i in range(6 * chain.ends[t // 3], 6 * chain.ends[t // 3 + 1] + 6):
            r[i] += G[i, t] * pull


@compiled
def add_loads(
    chain: Chain, q: Floats, motors: Floats, v: Floats, v_t: Floats, command: Floats, f_G: Floats, r: Floats
) -> None:
    """Add inertia, less gravity, the force on the gripper, f_G in B, and the commands to motors, in N, to r.

    Of a disc with the centre c: m (a + R (w' x c + w x (w x c)) - g), and J w' + w x J w + m c x R^T (a - g) about its
    origin; of a motor m (s'' + 2 omega s' + omega^2 s).
    """
    n = len(chain.nodes)
    for b in range(1, n):
        m, across, along, z = chain.nodes[b, 0], chain.nodes[b, 1], chain.nodes[b, 2], chain.nodes[b, 3]
        i, q_B = 6 * b, quaternion(q, b)
        a = (v_t[i], v_t[i + 1], v_t[i + 2] - chain.gravity)
        w = (v[i + 3], v[i + 4], v[i + 5])
        w_t = (v_t[i + 3], v_t[i + 4], v_t[i + 5])
        centre = (0.0, 0.0, z)
        bent = add(cross(w_t, centre), cross(w, cross(w, centre)))
        force = scale(m, add(a, rotate(q_B, bent)))
        spin = cross(w, (across * w[0], across * w[1], along * w[2]))
        lever = scale(m, cross(centre, rotate(quaternion_inverse(q_B), a)))
        moment = add(add((across * w_t[0], across * w_t[1], along * w_t[2]), spin), lever)
        for c in range(3):
            r[i + c] += force[c]
            r[i + 3 + c] += moment[c]
    i, q_B = 6 * (n - 1), quaternion(q, n - 1)
    pull = cross((0.0, 0.0, chain.gripper), rotate(quaternion_inverse(q_B), (f_G[0], f_G[1], f_G[2])))
    for c in range(3):
        r[i + c] -= f_G[c]
        r[i + 3 + c] -= pull[c]
    omega = chain.motor_rate
    for t in range(9):
        s_t = v[6 * n + t]
        r[6 * n + t] += chain.motor_mass * (v_t[6 * n + t] + 2.0 * omega * s_t + omega * omega * motors[t]) - command[t]


@compiled
def accelerate(chain: Chain, q: Floats, r: Floats, v_t: Floats) -> None:
    """Fill the rates' rates v_t of which the inertia balances r, the residual of all that does not depend on them.

    With the centre c of a disc: (J w' - m c x (w' x c)) = M - c x R^T F, a = F / m - R (w' x c).
    """
    n = len(chain.nodes)
    for i in range(6):
        v_t[i] = 0.0
    for b in range(1, n):
        m, across, along, z = chain.nodes[b, 0], chain.nodes[b, 1], chain.nodes[b, 2], chain.nodes[b, 3]
        i, q_B, centre = 6 * b, quaternion(q, b), (0.0, 0.0, z)
        F = (-r[i], -r[i + 1], -r[i + 2])
        M = subtract((-r[i + 3], -r[i + 4], -r[i + 5]), cross(centre, rotate(quaternion_inverse(q_B), F)))
        across -= m * z * z
        w_t = (M[0] / across, M[1] / across, M[2] / along)
        a = subtract(scale(1.0 / m, F), rotate(q_B, cross(w_t, centre)))
        for c in range(3):
            v_t[i + c] = a[c]
            v_t[i + 3 + c] = w_t[c]
    for t in range(9):
        v_t[6 * n + t] = -r[6 * n + t] / chain.motor_mass
