"""Newton's matrix of `TendonArmFast`: banded, since elements join neighbours, plus a term of rank one for each tendon.

A = S + sum s_t g_t g_t^T. S holds inertia, stiffness and damping of the chain, and of what forces change as their
directions turn the two largest parts: that pulled tendons resist transverse motion, and that an element's force turns
with its ends. The rest is left out, which costs iterations, not accuracy. S = L L^T within a band of 12, and with
X = L^-1 G the tendons are eliminated by Woodbury's identity.
"""

import math
from typing import NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.fast_forces import Chain
from handover.plants.helix.compiled import compiled
from handover.plants.helix.se3 import Vector, add, cross, dot, quaternion, rotate, scale, subtract, vector

WIDTH = 12
"""Entries of a row of the band: two nodes' coordinates, the last one that on the diagonal."""


class Directions(NamedTuple):
    """Where forces in the chain point, and how large they are; filled by `fast_forces`.

    Attributes:
        beams: rates of the elements' strains, (n, 6, 12).
        force: forces in the elements in B, (n, 3).
        spans: lengths of the tendons' parts, (n, 3).
        G: derivatives of the tendons' lengths, (6 (n + 1), 9).
        length: of the tendons, (9,).
        f: forces in the tendons, (9,), negative in a slack one.
        slope: dT/df of the tendons, (9,).
    """

    beams: Floats
    force: Floats
    spans: Floats
    G: Floats
    length: Floats
    f: Floats
    slope: Floats


class Factors(NamedTuple):
    """The factorized matrix, without the fixed node.

    Attributes:
        L: Cholesky's factor by rows of the band, (6 n, 12).
        X: L^-1 times the tendons' directions, (6 n, 9).
        W: directions times S^-1 times directions, (9, 9), the motors' part included.
        motor: the motors' diagonal entry in S, (1,).
        small: the matrix of Woodbury's identity, (9, 9); of one solution.
    """

    L: Floats
    X: Floats
    W: Floats
    motor: Floats
    small: Floats


@compiled
def factorize(
    chain: Chain, p: Floats, q: Floats, d: Directions, inertia: float, K: float, D: float, S: Factors
) -> bool:
    """Factorize inertia M + K stiffness + D damping; false if it is not positive definite.

    Args:
        chain: the chain.
        p: positions of the nodes.
        q: their orientations.
        d: directions of the forces.
        inertia: factor of the masses.
        K: factor of the stiffnesses.
        D: factor of the dampings.
        S: filled.
    """
    _assemble(chain, q, d.beams, inertia, K, D, S.L)
    _add_turning(chain, p, q, d, K, S.L)
    if not _cholesky(S.L):
        return False
    for i in range(len(S.X)):
        for t in range(9):
            S.X[i, t] = d.G[6 + i, t]
    _forward(S.L, S.X)
    omega = chain.motor_rate
    S.motor[0] = chain.motor_mass * (inertia + K * omega * omega + D * 2.0 * omega)
    for t in range(9):
        for k in range(9):
            S.W[t, k] = 0.0
    for i in range(len(S.X)):
        for t in range(9):
            for k in range(t + 1):
                S.W[t, k] += S.X[i, t] * S.X[i, k]
    for t in range(9):
        S.W[t, t] += 1.0 / S.motor[0]
    return True


@compiled
def _assemble(chain: Chain, q: Floats, beams: Floats, inertia: float, K: float, D: float, L: Floats) -> None:
    """Fill the lower half of the band."""
    for i in range(len(L)):
        for k in range(WIDTH):
            L[i, k] = 0.0
    for b in range(1, len(chain.nodes)):
        m, across, along, z = chain.nodes[b, 0], chain.nodes[b, 1], chain.nodes[b, 2], chain.nodes[b, 3]
        row = 6 * (b - 1)
        for c in range(3):
            L[row + c, 11] = inertia * m
            L[row + 3 + c, 11] = inertia * (along if c == 2 else across)
        if z != 0.0:
            for c in range(2):
                axis = (1.0 if c == 0 else 0.0, 1.0 if c == 1 else 0.0, 0.0)
                a = rotate(quaternion(q, b), cross(axis, (0.0, 0.0, z)))
                for k in range(3):
                    L[row + 3 + c, 8 + k - c] = inertia * m * a[k]
    for e in range(len(beams)):
        row = 6 * (e - 1)
        for j in range(6):
            s = K * chain.beams[e, 1 + j] + D * chain.beams[e, 7 + j]
            for i in range(0 if e > 0 else 6, 12):
                x = s * beams[e, j, i]
                for k in range(0 if e > 0 else 6, i + 1):
                    L[row + i, 11 + k - i] += x * beams[e, j, k]


@compiled
def _add_turning(chain: Chain, p: Floats, q: Floats, d: Directions, K: float, L: Floats) -> None:
    """Add what forces change as they turn.

    A tendon's part resists with T / span across the chord c, so three make sum T / span (I - c c^T) between the two
    origins. The force F of an element turns by half of what each of its ends turns: with the mean rotation phi and the
    chord d, the second variation of its work is F . (phi x (phi x d)) / 2 - (F x phi) . (change of d).
    """
    for e in range(len(d.force)):
        i = 0
        while e >= chain.ends[i + 1]:
            i += 1
        s = 0.0
        for k in range(3):
            s += K * max(d.f[3 * i + k], 0.0) / d.spans[e, k]
        chord = subtract(vector(p, e + 1), vector(p, e))
        square = dot(chord, chord)
        row, q_B0, q_B1 = 6 * (e - 1), quaternion(q, e), quaternion(q, e + 1)
        F = (-0.5 * K * d.force[e, 0], -0.5 * K * d.force[e, 1], -0.5 * K * d.force[e, 2])
        for c in range(3):
            for k in range(3):
                x = s * ((1.0 if c == k else 0.0) - chord[c] * chord[k] / square)
                if k <= c:
                    L[row + 6 + c, 11 + k - c] += x
                if e > 0:
                    L[row + 6 + c, 5 + k - c] -= x
                    if k <= c:
                        L[row + c, 11 + k - c] += x
            axis_0, axis_1 = rotate(q_B0, _axis(c)), rotate(q_B1, _axis(c))
            swept_0, swept_1 = cross(F, axis_0), cross(F, axis_1)
            bent_0, bent_1 = _bend(F, chord, axis_0), _bend(F, chord, axis_1)
            for k in range(3):
                L[row + 9 + c, 8 + k - c] += swept_1[k]
                other_0, other_1 = rotate(q_B0, _axis(k)), rotate(q_B1, _axis(k))
                if k <= c:
                    L[row + 9 + c, 11 + k - c] += dot(other_1, bent_1)
                if e > 0:
                    L[row + 9 + c, 2 + k - c] -= swept_1[k]
                    L[row + 6 + k, 8 + c - k] += swept_0[k]
                    L[row + 3 + c, 8 + k - c] -= swept_0[k]
                    L[row + 9 + c, 5 + k - c] += dot(other_0, bent_1)
                    if k <= c:
                        L[row + 3 + c, 11 + k - c] += dot(other_0, bent_0)


@compiled
def _axis(c: int) -> Vector:
    return (1.0 if c == 0 else 0.0, 1.0 if c == 1 else 0.0, 1.0 if c == 2 else 0.0)


@compiled
def _bend(F: Vector, d: Vector, turn: Vector) -> Vector:
    """Return (F . d) turn / 2 - (F (d . turn) + d (F . turn)) / 4, a quarter of a second variation for F = -K f / 2."""
    both = add(scale(dot(d, turn), F), scale(dot(F, turn), d))
    return subtract(scale(0.5 * dot(F, d), turn), scale(0.25, both))


@compiled
def _cholesky(L: Floats) -> bool:
    """Factorize in place; the diagonal holds its inverse. False if the matrix is not positive definite."""
    for i in range(len(L)):
        start = max(0, 6 * (i // 6) - 6)
        for j in range(start, i + 1):
            s = L[i, 11 + j - i]
            for k in range(max(start, 6 * (j // 6) - 6), j):
                s -= L[i, 11 + k - i] * L[j, 11 + k - j]
            if j < i:
                L[i, 11 + j - i] = s * L[j, 11]
            elif s > 0.0:
                L[i, 11] = 1.0 / math.sqrt(s)
            else:
                return False
    return True


@compiled
def _forward(L: Floats, X: Floats) -> None:
    """Solve L Y = X in place, X (6 n, 9)."""
    for i in range(len(L)):
        for j in range(max(0, 6 * (i // 6) - 6), i):
            x = L[i, 11 + j - i]
            for t in range(9):
                X[i, t] -= x * X[j, t]
        for t in range(9):
            X[i, t] *= L[i, 11]


@compiled
def solve(S: Factors, s: Floats, r: Floats, y: Floats) -> bool:
    """Fill y with the solution of A y = -r; false if the tendons' part is not positive definite.

    y = S^-1 (-r - G z), (I + s^1/2 W s^1/2) s^-1/2 z = s^1/2 G^T S^-1 (-r).

    Args:
        S: the factorized chain.
        s: the tendons' factors, (9,), at least 0.
        r: residual: six entries a node with those of the fixed one, then the motors'.
        y: filled likewise.
    """
    n, L, X, B = len(S.L), S.L, S.X, S.small
    t = np.zeros(9)
    for i in range(6):
        y[i] = 0.0
    for i in range(n):
        x = -r[6 + i]
        for j in range(max(0, 6 * (i // 6) - 6), i):
            x -= L[i, 11 + j - i] * y[6 + j]
        y[6 + i] = x * L[i, 11]
        for k in range(9):
            t[k] += X[i, k] * y[6 + i]
    for k in range(9):
        y[6 + n + k] = -r[6 + n + k] / S.motor[0]
        t[k] = math.sqrt(s[k]) * (t[k] - y[6 + n + k])
    if not _solve_small(S.W, s, B, t):
        return False
    for k in range(9):
        t[k] *= math.sqrt(s[k])
        y[6 + n + k] += t[k] / S.motor[0]
    for i in range(n - 1, -1, -1):
        x = y[6 + i]
        for k in range(9):
            x -= X[i, k] * t[k]
        y[6 + i] = x
    for i in range(n - 1, -1, -1):
        y[6 + i] *= L[i, 11]
        for j in range(max(0, 6 * (i // 6) - 6), i):
            y[6 + j] -= L[i, 11 + j - i] * y[6 + i]
    return True


@compiled
def _solve_small(W: Floats, s: Floats, B: Floats, t: Floats) -> bool:
    """Solve (I + s^1/2 W s^1/2) x = t in place by Cholesky's method."""
    for i in range(9):
        for j in range(i + 1):
            x = math.sqrt(s[i] * s[j]) * W[i, j] + (1.0 if i == j else 0.0)
            for k in range(j):
                x -= B[i, k] * B[j, k]
            if j < i:
                B[i, j] = x / B[j, j]
            elif x > 0.0:
                B[i, i] = math.sqrt(x)
            else:
                return False
        for k in range(i):
            t[i] -= B[i, k] * t[k]
        t[i] /= B[i, i]
    for i in range(8, -1, -1):
        t[i] /= B[i, i]
        for k in range(i):
            t[k] -= B[i, k] * t[i]
    return True
