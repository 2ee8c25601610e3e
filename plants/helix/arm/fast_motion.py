"""Motion of `TendonArmFast`: the generalized-alpha method on a Lie group, after Arnold and Bruels (2007).

Over a step h from rates v and algorithmic accelerations a, with those at its end, a', unknown:
x' = x o exp(h v + h^2 ((1/2 - beta) a + beta a')), v' = v + h ((1 - gamma) a + gamma a'),
(1 - alpha_m) a' + alpha_m a = (1 - alpha_f) dv'/dt + alpha_f dv/dt, and all forces balance at the end of the step.
"""

from typing import NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.helix import se3
from handover.plants.helix.arm import fast_forces, fast_matrix
from handover.plants.helix.arm.fast_forces import (
    Chain,
    Integers,
    accelerate,
    add_beams,
    add_loads,
    add_tendons,
    clear,
    copy,
    measure_tendons,
)
from handover.plants.helix.arm.fast_matrix import Directions, Factors, factorize, solve
from handover.plants.helix.compiled import compiled, compiled_once
from handover.plants.helix.se3 import from_rotation_vector, normalize, quaternion, quaternion_multiply

_RADIUS = 0.9  # spectral radius at infinite frequency, as of TendonArm's solver
_ALPHA_M = (2.0 * _RADIUS - 1.0) / (_RADIUS + 1.0)
_ALPHA_F = _RADIUS / (_RADIUS + 1.0)
_GAMMA = 0.5 + _ALPHA_F - _ALPHA_M
_BETA = 0.25 * (1.0 + _ALPHA_F - _ALPHA_M) ** 2

_TOLERANCE = 1e-8
"""M and rad; the last correction of Newton's method is smaller."""
_ITERATIONS = 30
_HALVINGS = 6
"""How often a step without a solution is halved before it is given up."""
_FAR = 1e3
"""M and rad; a correction that is larger, or not a number, ends the iteration."""
_WILD = 1e15
"""M/s2 and rad/s2; accelerations beyond it, or that are no numbers, are of no motion."""
_SLOW = 0.2
"""A correction that is more of the last one than that makes the matrix be factorized again."""


class Motion(NamedTuple):
    """Where the chain is and how it moves: see `fast_forces`.

    Attributes:
        p: p_B of the nodes, (n + 1, 3), in m.
        q: q_B of the nodes, (n + 1, 4).
        motors: positions of the motors, (9,), in m.
        v: rates of nodes and motors, (6 (n + 1) + 9,).
    """

    p: Floats
    q: Floats
    motors: Floats
    v: Floats


class Memory(NamedTuple):
    """Memory of a step; nothing in it outlasts a call of `advance`."""

    end: Motion
    d: Directions
    v_t: Floats
    a: Floats
    a_end: Floats
    v_t_end: Floats
    r: Floats
    y: Floats
    s: Floats
    S: Factors
    h: Floats  # of the step that S is of, (1,), or 0


@compiled
def _memory(n: int) -> Memory:
    """Return the memory of steps of n discs."""
    m = 6 * n + 15
    end = Motion(np.zeros((n + 1, 3)), np.zeros((n + 1, 4)), np.zeros(9), np.zeros(m))
    end.q[0, 0] = 1.0
    return Memory(
        end,
        Directions(
            np.zeros((n, 6, 12)),
            np.zeros((n, 3)),
            np.zeros((n, 3)),
            np.zeros((6 * n + 6, 9)),
            np.zeros(9),
            np.zeros(9),
            np.zeros(9),
        ),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(9),
        Factors(
            np.zeros((6 * n, fast_matrix.WIDTH)), np.zeros((6 * n, 9)), np.zeros((9, 9)), np.zeros(1), np.zeros((9, 9))
        ),
        np.zeros(1),
    )


@compiled
def _balance(chain: Chain, x: Motion, v_t: Floats, command: Floats, f_G: Floats, w: Memory) -> None:
    """Fill w.r with inertia less forces, and what `factorize` takes."""
    clear(w.r)
    add_beams(chain.beams, x.p, x.q, x.v, w.d.beams, w.d.force, w.r)
    measure_tendons(chain, x.p, x.q, w.d.spans, w.d.length, w.d.G)
    add_tendons(chain, x.motors, x.v, w.d.length, w.d.G, w.r, w.d.f, w.d.slope)
    add_loads(chain, x.q, x.motors, x.v, v_t, command, f_G, w.r)


@compiled
def _move(x: Motion, h: float, w: Memory) -> None:
    """Fill w.end and w.v_t_end by the accelerations w.a_end at the end of a step h from x."""
    n, v, a, a_end, end = len(x.p), x.v, w.a, w.a_end, w.end
    for b in range(1, n):
        i = 6 * b
        for c in range(3):
            end.p[b, c] = x.p[b, c] + h * v[i + c] + h * h * ((0.5 - _BETA) * a[i + c] + _BETA * a_end[i + c])
        i += 3
        turn = (
            h * v[i] + h * h * ((0.5 - _BETA) * a[i] + _BETA * a_end[i]),
            h * v[i + 1] + h * h * ((0.5 - _BETA) * a[i + 1] + _BETA * a_end[i + 1]),
            h * v[i + 2] + h * h * ((0.5 - _BETA) * a[i + 2] + _BETA * a_end[i + 2]),
        )
        q = normalize(quaternion_multiply(quaternion(x.q, b), from_rotation_vector(turn)))
        for c in range(4):
            end.q[b, c] = q[c]
    for t in range(9):
        i = 6 * n + t
        end.motors[t] = x.motors[t] + h * v[i] + h * h * ((0.5 - _BETA) * a[i] + _BETA * a_end[i])
    for i in range(len(v)):
        end.v[i] = v[i] + h * ((1.0 - _GAMMA) * a[i] + _GAMMA * a_end[i])
        w.v_t_end[i] = ((1.0 - _ALPHA_M) * a_end[i] + _ALPHA_M * a[i] - _ALPHA_F * w.v_t[i]) / (1.0 - _ALPHA_F)


@compiled
def _step(chain: Chain, x: Motion, command: Floats, f_G: Floats, h: float, w: Memory) -> bool:
    """Find the end of a step h by Newton's method and make it x; false, and x as before, if there is none."""
    K, D, inertia = _BETA * h * h, _GAMMA * h, (1.0 - _ALPHA_M) / (1.0 - _ALPHA_F)
    for i in range(len(x.v)):
        w.a_end[i] = (w.v_t[i] - _ALPHA_M * w.a[i]) / (1.0 - _ALPHA_M)
    last, slow = _FAR, False
    for _ in range(_ITERATIONS):
        _move(x, h, w)
        _balance(chain, w.end, w.v_t_end, command, f_G, w)
        if slow or w.h[0] != h:
            w.h[0] = 0.0
            if not factorize(chain, w.end.p, w.end.q, w.d, inertia, K, D, w.S):
                return False
            w.h[0] = h
        for t in range(9):
            L0 = chain.tendons[t, 2] + w.end.motors[t]
            w.s[t] = max(w.d.slope[t] * (K * chain.tendons[t, 0] + D * chain.tendons[t, 1]) / L0, 0.0)
        if not solve(w.S, w.s, w.r, w.y):
            return False
        size = 0.0
        for i in range(len(w.y)):
            change = K * abs(w.y[i])
            if not change < _FAR:
                return False
            w.a_end[i] += w.y[i]
            size = max(size, change)
        if size < _TOLERANCE:
            _move(x, h, w)
            for b in range(len(x.p)):
                for c in range(3):
                    x.p[b, c] = w.end.p[b, c]
                for c in range(4):
                    x.q[b, c] = w.end.q[b, c]
            copy(w.end.motors, x.motors)
            copy(w.end.v, x.v)
            copy(w.v_t_end, w.v_t)
            copy(w.a_end, w.a)
            return True
        slow, last = size > _SLOW * last, size
    return False


@compiled_once(__name__, fast_forces.__name__, fast_matrix.__name__, *se3.SOURCES)
def advance(
    nodes: Floats,
    beams: Floats,
    ends: Integers,
    holes: Floats,
    tendons: Floats,
    rest: Floats,
    p: Floats,
    q: Floats,
    motors: Floats,
    v: Floats,
    command: Floats,
    f_G: Floats,
    h: float,
    steps: int,
    tension: Floats,
) -> float:
    """Advance a chain's motion by steps h, from the accelerations that its forces give at the start.

    All are plain arrays and numbers, so that machine code which is kept depends on no module's name.

    Args:
        nodes: as the further ones, of `Chain`.
        beams: likewise.
        ends: likewise.
        holes: likewise.
        tendons: likewise.
        rest: likewise, the numbers from `slack_force` on: (5,).
        p: as the further ones, of `Motion`; what it is after a failure is of no use.
        q: likewise.
        motors: likewise.
        v: likewise.
        command: forces of the motors' control, (9,), in N.
        f_G: force on the gripper in B, (3,), in N.
        h: length of a step, in s.
        steps: their number; 0 for the forces in the tendons alone.
        tension: filled with the forces in the tendons at the end, (9,), in N; negative in a slack one.

    Returns:
        A negative number, or after how many seconds there is no solution.
    """
    chain = Chain(nodes, beams, ends, holes, tendons, rest[0], rest[1], rest[2], rest[3], rest[4])
    x, w = Motion(p, q, motors, v), _memory(len(beams))
    failure = -1.0
    if steps > 0:
        _balance(chain, x, w.v_t, command, f_G, w)
        accelerate(chain, x.q, w.r, w.v_t)
        copy(w.v_t, w.a)
        for i in range(len(v)):
            if not abs(w.a[i]) < _WILD:
                return 0.0
    k, done, parts = 0, 0, 1
    while k < steps and failure < 0.0:
        if _step(chain, x, command, f_G, h / parts, w):
            done += 1
            if done == parts:
                k, done, parts = k + 1, 0, 1
        elif parts == 2**_HALVINGS:
            failure = h * (k + done / parts)
        else:
            done, parts = 2 * done, 2 * parts
    measure_tendons(chain, p, q, w.d.spans, w.d.length, w.d.G)
    add_tendons(chain, motors, v, w.d.length, w.d.G, w.r, w.d.f, w.d.slope)
    copy(w.d.f, tension)
    return failure
