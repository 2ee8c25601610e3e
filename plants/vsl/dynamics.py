"""Dynamics of the VSL arm's chain: how it swings, integrated by generalized-alpha."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.chain import Complexes, Pose, VslChain
from handover.plants.vsl.parameters import Params
from handover.plants.vsl.statics import VslStatics

_TOLERANCE = 1e-10
_ITERATIONS = 8
_MIN_STEP = 1e-5  # s: a step that fails is halved until it is shorter


class NoConvergence(RuntimeError):
    """The equations of motion could not be solved for a time step."""

    def __init__(self, h: float) -> None:
        super().__init__(
            f"VslArm: no solution of the equations of motion, down to internal steps of {h:.2g} s; a slower "
            "servo_speed or a smaller load would have one"
        )
        self.h = h


class StartsInFace(RuntimeError):
    """The arm would start with its tip below the face that is to stop it."""

    is_refusal = True

    def __init__(self, height: float, face: float) -> None:
        super().__init__(
            f"VslArm: the tip would start {height:.4g} m high, below the face at {face:.4g} m: a q_0 that puts it "
            "above, sag included, or a lower face"
        )
        self.height, self.face = height, face


class _Held(NamedTuple):
    """What is held during a step: stiffness of the springs, masses C by bodies and by coordinates, weights, w^2."""

    k: Floats
    C: Floats
    C_y: Floats
    weight: Floats
    qd2_1: float


class VslDynamics:
    """Motion of the chain, with the coordinates y: angles phi_k of all bodies and shears s_k of those that shear.

        M y'' + D^T C b + B^T k (e + damping_time e') = D^T (C w^2 Re u - i A),   e = B y - offsets

    written with Re(conj(.) .) for products of the complex u_k (see `VslChain`): D = du/dy is i u_k for an angle and
    i exp(i phi_k) for a shear, M = Re(conj(D) C D) + inertia, b = -2 exp(i phi) phi' s' - u phi'^2, A the weights, e
    the deformations of the springs of stiffness k. Turning about J1 at the rate w pulls all masses outwards.

    A level face at height h stops the tip: it pushes up by f = max(0, k_f (h - z) - d_f z'), z the tip's height, which
    takes from all weights.

    A gear of high ratio does not yield to swings: the droop of the servos follows their torques with droop_time,
    droop' = (torque / servo_stiffness - droop) / droop_time, and the offsets are what they aim at less the droop.

    Integrated by generalized-alpha (Arnold and Bruels 2007) in equal steps no longer than `substep`, with Newton's
    method in each. The droop is implicit too: it is linear in the deformations, and makes the springs of the joints
    softer within a step.

    Raises:
        NoEquilibrium, StartsInFace: by `settle`.
        NoConvergence: by `advance`.
    """

    def __init__(self, chain: VslChain, params: Params) -> None:
        self._chain = chain
        self._params = params
        self._statics = VslStatics(chain, params.gravity, 1.0 / params.servo_stiffness)
        sheared = np.flatnonzero(np.array(chain.shearing) > 0.0)
        n, m = len(chain), len(chain) + len(sheared)
        self._sheared = sheared
        self._body = np.concatenate((np.arange(n), sheared))  # of each coordinate
        self._joints = np.array(chain.joints)
        self._B = np.eye(m)
        self._B[np.arange(1, n), np.arange(n - 1)] = -1.0
        self._inertia = np.diag(np.concatenate((chain.inertia, np.zeros(len(sheared)))))
        self._lengths = np.array(chain.lengths)
        self._y: Floats = np.zeros(m)
        self._v: Floats = np.zeros(m)
        self._a: Floats = np.zeros(m)
        self._a_mean = np.zeros(m)
        self._offset: Floats = np.zeros(len(chain.joints))
        self.force = 0.0
        """Largest force of the face on the tip during the last step, N."""
        self.pose = self._statics.pose

    def settle(self, theta: Sequence[float], p: Sequence[float], load: float) -> None:
        """Rest at the angles of the chain's joints that the servos aim at, rad, wherever the arm was before."""
        self._statics.settle(theta, p, load)
        height = self._params.L_1 + float(self._chain.ends(self._statics.pose)[-1].imag)
        if height < self._params.face:
            raise StartsInFace(height, self._params.face)
        self.pose = self._statics.pose
        self._y = np.concatenate((self.pose.angles, self.pose.shears[self._sheared]))
        self._v, self._a, self._a_mean = (np.zeros(len(self._y)) for _ in range(3))
        self._offset = np.array(theta) - self.pose.droop

    def advance(
        self,
        dt: float,
        theta: tuple[Sequence[float], Sequence[float]],
        p: Sequence[float],
        load: float,
        qd_1: float,
    ) -> None:
        """Advance by dt.

        Args:
            dt: in s.
            theta: angles of the chain's joints, rad, that the servos aim at first and last; they go evenly between.
            p: pressures of the links, Pa.
            load: at the tip, kg.
            qd_1: speed of J1, rad/s.
        """
        steps = max(1, math.ceil(dt / self._params.substep - 1e-9))
        held = self._held(p, load, qd_1)
        aims = np.linspace(theta[0], theta[1], steps + 1)
        self.force = 0.0
        for i in range(steps):
            self._substep(dt / steps, aims[i], aims[i + 1], held)

    def frequencies(self, p: Sequence[float], load: float) -> Floats:
        """Return the natural frequencies about the pose at hand, without damping, in Hz, the lowest first."""
        held = self._held(p, load, 0.0)
        u, e, D = self._directions(self._y)
        K = np.transpose(self._B * held.k[:, None]) @ self._B + self._turning(
            u, e, np.asarray(1j * held.weight, dtype=np.complex128)
        )
        whiten = np.linalg.inv(np.linalg.cholesky(self._mass(D, held.C_y)))
        return np.sqrt(np.linalg.eigvalsh(whiten @ K @ np.transpose(whiten))) / (2.0 * math.pi)

    def acceleration(self, qd_1: float) -> Complexes:
        """Return the accelerations of the bodies' ends in the arm's plane, m/s2, after that of the shoulder, (n + 1,).

        J1 turns at the speed qd_1, rad/s.
        """
        u, e, _ = self._directions(self._y)
        a = self._accelerated(u, e, self._v, self._a) - qd_1 * qd_1 * u.real
        return np.concatenate(([0.0], np.cumsum(a)))

    def snapshot(self) -> tuple[Any, ...]:
        """Return the complete state, plain data; its arrays are replaced and never written to."""
        return self._y, self._v, self._a, self._a_mean, self._offset, self.force, tuple(self.pose)

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Restore a state of this chain or of one with equal parameters."""
        self._y, self._v, self._a, self._a_mean, self._offset, self.force, pose = snapshot
        self.pose = Pose(*pose)

    def _held(self, p: Sequence[float], load: float, qd_1: float) -> _Held:
        hinge, shear = self._chain.springs(p)
        k = 1.0 / np.concatenate((hinge, np.array(shear)[self._sheared]))
        weight: Floats = self._params.gravity * (self._chain.carried + load)
        C = self._chain.coupling + load
        return _Held(k, C, C[np.ix_(self._body, self._body)], weight, qd_1 * qd_1)

    def _substep(self, h: float, first: Floats, last: Floats, held: _Held) -> None:
        """Advance by h, or by halves of it if need be, while the servos' aims go from the first to the last."""
        kept = math.exp(-h / self._params.droop_time)
        yielding = (1.0 - kept) / self._params.servo_stiffness
        lag = self._params.damping_time / h
        k = np.array(held.k)
        k[self._joints] /= 1.0 + yielding * (1.0 + lag) * k[self._joints]
        droop = kept * np.array(self.pose.droop)
        rest = np.zeros(len(k))
        rest[self._joints] = last - droop + lag * (last - droop - self._offset)
        if self._move(h, rest, k, held):
            deformation = self._B @ (self._y + self._params.damping_time * self._v)
            torque = (k * (rest - deformation))[self._joints]
            droop += yielding * torque
            self._offset = last - droop
            self._take_pose(torque, droop)
        elif h > _MIN_STEP:
            middle = (first + last) / 2.0
            self._substep(h / 2.0, first, middle, held)
            self._substep(h / 2.0, middle, last, held)
        else:
            raise NoConvergence(h)

    def _move(self, h: float, rest: Floats, k: Floats, held: _Held) -> bool:
        """Advance coordinates and rates by h, with springs k from rest, e + damping_time e' without force.

        Return whether Newton's method converged; if not, nothing has moved.
        """
        alpha_m, alpha_f, beta, gamma = _weights(self._params.high_frequency_damping)
        a_mean = (alpha_f * self._a - alpha_m * self._a_mean) / (1.0 - alpha_m)
        y = self._y + h * self._v + h * h * ((0.5 - beta) * self._a_mean + beta * a_mean)
        v = self._v + h * ((1.0 - gamma) * self._a_mean + gamma * a_mean)
        a = np.zeros(len(y))
        by_a = (1.0 - alpha_m) / (h * h * beta * (1.0 - alpha_f))
        by_v = gamma / (h * beta)
        springs = np.transpose(self._B * k[:, None])
        K = (1.0 + self._params.damping_time * by_v) * (springs @ self._B)
        for _ in range(_ITERATIONS):
            u, e, D = self._directions(y)
            pull, S = self._inertial(u, e, D, (v, a), (by_v, by_a), held)
            stretch = self._B @ (y + self._params.damping_time * v) - rest
            residual = np.real(np.conj(D) * pull[self._body]) + self._inertia @ a + springs @ stretch
            dy = np.linalg.solve(S + K, -residual)
            y, v, a = y + dy, v + by_v * dy, a + by_a * dy
            if np.abs(dy).max() < _TOLERANCE:
                self._y, self._v, self._a = y, v, a
                self._a_mean = a_mean + (1.0 - alpha_f) / (1.0 - alpha_m) * a
                self.force = max(self.force, self._stopped(u, D, v))
                return True
        return False

    def _directions(self, y: Floats) -> tuple[Complexes, Complexes, Complexes]:
        """Return u_k and exp(i phi_k) of all bodies, (n,), and D_j of all coordinates, (m,)."""
        n = len(self._chain)
        e = np.exp(1j * y[:n])
        u = self._lengths * e
        u[self._sheared] += 1j * y[n:] * e[self._sheared]
        return u, e, 1j * np.concatenate((u, e[self._sheared]))

    def _mass(self, D: Complexes, C_y: Floats) -> Floats:
        return C_y * np.real(np.conj(D)[:, None] * D) + self._inertia

    def _inertial(
        self,
        u: Complexes,
        e: Complexes,
        D: Complexes,
        rates: tuple[Floats, Floats],
        by: tuple[float, float],
        held: _Held,
    ) -> tuple[Complexes, Floats]:
        """Return the forces of inertia, turn and weight on u_k, (n,), and their derivative in y, (m, m).

        Rates v and a are those of y, and change with it by the factors given. With e = exp(i phi) in all terms of
        u'' = i u phi'' + i e s'' - 2 e phi' s' - u phi'^2, its derivative by phi is i u''.
        """
        n, at = len(self._chain), self._sheared
        v, a = rates
        by_v, by_a = by
        accelerated = self._accelerated(u, e, v, a)
        force = self._stopped(u, D, v)
        pull = held.C @ (accelerated - held.qd2_1 * u.real) + 1j * (held.weight - force)
        G = by_a * D - held.qd2_1 * D.real
        G[:n] += 1j * accelerated - 2.0 * by_v * u * v[:n]
        G[at] -= 2.0 * by_v * e[at] * v[n:]
        G[n:] += 1j * e[at] * (1j * a[at] - v[at] ** 2) - 2.0 * by_v * e[at] * v[at]
        S = held.C_y * np.real(np.conj(D)[:, None] * G) + by_a * self._inertia + self._turning(u, e, pull)
        if force == 0.0:
            return pull, S
        P = self._params
        return pull, S + (P.face_stiffness + P.face_damping * by_v) * np.outer(D.imag, D.imag)

    def _stopped(self, u: Complexes, D: Complexes, v: Floats) -> float:
        """Return the force of the face on the tip, upwards, N."""
        P = self._params
        depth = P.face - P.L_1 - float(np.sum(u.imag))
        if depth <= 0.0:
            return 0.0
        return max(0.0, P.face_stiffness * depth - P.face_damping * float(D.imag @ v))

    def _accelerated(self, u: Complexes, e: Complexes, v: Floats, a: Floats) -> Complexes:
        """Return u_k'', (n,)."""
        n, at = len(self._chain), self._sheared
        accelerated = 1j * u * a[:n] - u * v[:n] ** 2
        accelerated[at] += e[at] * (1j * a[n:] - 2.0 * v[at] * v[n:])
        return accelerated

    def _turning(self, u: Complexes, e: Complexes, pull: Complexes) -> Floats:
        """Return the derivative in y of the generalised forces of the pull at u_k, as D turns, (m, m)."""
        n, at = len(self._chain), self._sheared
        sheared = np.arange(n, len(self._body))
        turning = np.zeros((len(self._body), len(self._body)))
        turning[np.arange(n), np.arange(n)] = -np.real(np.conj(u) * pull)
        turning[at, sheared] = turning[sheared, at] = -np.real(np.conj(e) * pull)[at]
        return turning

    def _take_pose(self, torque: Floats, droop: Floats) -> None:
        n = len(self._chain)
        shears = np.zeros(n)
        shears[self._sheared] = self._y[n:]
        self.pose = Pose(np.array(self._y[:n]), shears, tuple(torque.tolist()), tuple(droop.tolist()))


def _weights(radius: float) -> tuple[float, float, float, float]:
    """Return alpha_m, alpha_f, beta, gamma for a spectral radius at high frequency."""
    alpha_m, alpha_f = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
    gamma = 0.5 + alpha_f - alpha_m
    return alpha_m, alpha_f, (gamma + 0.5) ** 2 / 4.0, gamma
