"""What the corrected kinematics remember: currents, friction's direction, the tip's errors, the path's speed."""

import math
from typing import Protocol

import numpy as np

from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.learned_model import VslModel, friction_direction, inputs_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.state import pack_state, unpack_state

_SHORTEST_LEVER = 0.03
"""m; of an arm that stands upright, currents say nothing of a load (assumed)."""

_MOVING_ERROR = 0.05
"""Angle between command and encoder, rad, from which a joint is on its way and the tip not yet to judge (assumed)."""

_DAMPING = 0.01
"""Of the inverse of the Jacobian, m: singular values below it, near a stretched elbow, count for less (assumed)."""

_SAME_TIME = 1e-9
"""s; rounding of sums of intervals."""

_YIELD_TIME = 0.3
"""Time in which what a joint has yielded to a swing is given back, s: a swing's period (assumed)."""

_GRAVITY = 9.81

_SHAKEN = 0.05
"""Root mean square by which an accelerometer's angle changes from period to period, rad, from which it tells more of
shaking than of where a link points (assumed)."""

_SHAKING_TIME = 0.2
"""Time over which that mean is taken, s (assumed)."""


class Readings(Protocol):
    """What is wanted and what is measured, of `HybridKinematics`."""

    q_ref: Floats
    qd_ref: Floats
    q_meas: Floats
    p_meas: Floats
    i_meas: Floats
    p_WG_meas: Floats
    tilt_meas: Floats


class CurrentFilter:
    """Currents through two lags in series, which attenuate what an arm that swings feels of its own inertia.

    With friction compensation, the gears' friction is taken off first: i - c d, with c as trained and d in
    [-1, 1] which way friction acts, by the unit's own commands, which have no noise. What is smoothed then is what a
    load adds to the nominal currents i_0(q, p) at its levers b(q): i - c d - i_0 = lambda b + e, with e square to b.
    lambda and e change with the load alone, so that smoothing them does not lag behind the posture.

    Args:
        friction_model: the model that was trained on currents without friction; None without compensation.
        lag: time constant of each lag, s; 0 for none.
        reversal: turn that reverses friction, rad.
    """

    def __init__(self, friction_model: VslModel | None, lag: float, reversal: float) -> None:
        self._friction_model, self._lag, self._reversal = friction_model, lag, reversal
        self._smoothed: tuple[Floats, Floats] | None = None
        self._direction = np.zeros(2)

    def step(self, u: Readings, dt: float) -> Floats:
        """Return the currents, shape (3,), A, after a further period; of joint 1 0 with friction compensation."""
        nominal = self._nominal(u)
        self._smoothed = self._after(u, dt, nominal)
        return self._at_posture(self._smoothed[1], nominal)

    def now(self, u: Readings) -> Floats:
        """Return the currents as they would be; no time passes."""
        nominal = self._nominal(u)
        return self._at_posture(self._after(u, 0.0, nominal)[1], nominal)

    def turn(self, turn: Floats) -> None:
        """Take up how the joints are commanded to turn on, shape (3,), rad."""
        self._direction = friction_direction(self._direction, turn[1:], self._reversal)

    def oscillation(self, u: Readings, i: Floats) -> Floats:
        """Return by how much currents of joints 2 and 3 are off the smoothed ones, i, shape (2,), A."""
        friction = 0.0 if self._friction_model is None else self._direction * self._friction_model.friction
        return u.i_meas[1:] - friction - i[1:]

    def get_state(self) -> bytes:
        """Return what is smoothed, and the direction of friction."""
        return pack_state((self._smoothed, self._direction))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this filter or of one with equal arguments."""
        self._smoothed, self._direction = unpack_state(state)

    def _nominal(self, u: Readings) -> tuple[Floats, Floats]:
        """Return i_0 and b at the posture, A and m; nothing without friction compensation."""
        model = self._friction_model
        return (np.zeros(0), np.zeros(0)) if model is None else model.currents(u.q_meas, u.p_meas)

    def _after(self, u: Readings, dt: float, nominal: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
        """Return what is smoothed, once and twice: the currents, or with friction compensation [lambda, e_2, e_3]."""
        measured = self._explained(u, nominal)
        if self._smoothed is None or self._lag == 0.0:
            return np.array(measured), np.array(measured)
        share = 1.0 - math.exp(-dt / self._lag)
        once = self._smoothed[0] + share * (measured - self._smoothed[0])
        return once, self._smoothed[1] + share * (once - self._smoothed[1])

    def _explained(self, u: Readings, at_posture: tuple[Floats, Floats]) -> Floats:
        if self._friction_model is None:
            return u.i_meas
        nominal, levers = at_posture
        more = u.i_meas[1:] - self._direction * self._friction_model.friction - nominal
        by_lever = levers @ more / max(levers @ levers, _SHORTEST_LEVER**2)
        return np.concatenate([[by_lever], more - by_lever * levers])

    def _at_posture(self, smoothed: Floats, at_posture: tuple[Floats, Floats]) -> Floats:
        if self._friction_model is None:
            return smoothed
        nominal, levers = at_posture
        return np.concatenate([[0.0], nominal + smoothed[0] * levers + smoothed[1:]])


class TipFeedback:
    """Integral control of the tip as tracker or IMUs see it, at their rate: dq' = K_I J~^+ e, e = f(q_ref) - p_WG.

    q_ref is that of the period that ends; J~ is the corrected Jacobian, J~^+ its damped inverse. e is smoothed: an arm
    that swings would be swung up. dq rests while joints are on their way.

    Args:
        kinematics: f, of rigid links.
        model: what corrects its Jacobian; None for rigid links.
        rate: of readings, Hz.
        lag: time constant of the smoothing, s; 0 for none.
        K_I: share of the error that is taken away in a second, 1/s.
        limit: largest turn of a joint, rad.
    """

    def __init__(
        self, kinematics: VslKinematics, model: VslModel | None, rate: float, lag: float, K_I: float, limit: float
    ) -> None:
        self._kinematics, self._model = kinematics, model
        self._rate, self._K_I, self._limit = rate, K_I, limit
        self._share = 1.0 if lag == 0.0 else 1.0 - math.exp(-1.0 / (rate * lag))
        self._readings = 0
        self._error = np.zeros(3)
        self.dq = np.zeros(3)
        """By how much the joints are turned, rad."""

    def step(self, t: float, u: Readings, p_WG: Floats, i: Floats, before: tuple[Floats, Floats] | None) -> None:
        """Turn the joints on by a share of the tip's error, if there is a reading that there was not.

        Args:
            t: time, s.
            u: what is measured.
            p_WG: where the tip is seen, shape (3,), m.
            i: smoothed currents, shape (3,), A.
            before: q_ref and q_cmd of the period that ends.
        """
        readings = math.floor((t + _SAME_TIME) * self._rate) + 1
        if readings == self._readings:
            return
        self._readings = readings
        if before is None or is_moving(before[1], u.q_meas):
            return
        self._error = self._error + self._share * (self._kinematics.forward(before[0]) - p_WG - self._error)
        q = u.q_meas
        J = self._kinematics.jacobian(q) if self._model is None else self._model.tip_jacobian(q, u.p_meas, i)
        damped = np.transpose(J) @ np.linalg.solve(J @ np.transpose(J) + _DAMPING**2 * np.eye(3), self._error)
        self.dq = np.clip(self.dq + self._K_I / self._rate * damped, -self._limit, self._limit)

    def get_state(self) -> bytes:
        """Return the readings so far, the smoothed error, and dq."""
        return pack_state((self._readings, self._error, self.dq))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this loop or of one with equal arguments."""
        self._readings, self._error, self.dq = unpack_state(state)


class ImuTip:
    """Sees the tip by the inclinations of the links' ends, see `VslKinematics.bent`, as long as the links do not shake.

    An accelerometer takes every acceleration for a change of gravity's direction, and atan2 does not let that average
    out: of an arm that swings at 1.5 bar with 25 g, whose inclinations shake by 0.26 rad, the tip seems 15 mm off.

    Args:
        kinematics: of rigid links.
        shares: see `VslKinematics.bent`.
    """

    def __init__(self, kinematics: VslKinematics, shares: Floats) -> None:
        self._kinematics, self._shares = kinematics, shares
        self._before: Floats | None = None
        self._square = np.zeros(2)

    def step(self, dt: float, u: Readings) -> Floats | None:
        """Return where the tip is, shape (3,), m, a period, s, after the last; None while links shake."""
        if self._before is not None:
            share = 1.0 - math.exp(-dt / _SHAKING_TIME)
            self._square = self._square + share * ((u.tilt_meas - self._before) ** 2 - self._square)
        self._before = np.array(u.tilt_meas)
        if np.max(self._square) > _SHAKEN**2:
            return None
        return self._kinematics.bent(u.q_meas, u.tilt_meas, self._shares)

    def get_state(self) -> bytes:
        """Return the inclinations of the last period, and how they shake."""
        return pack_state((self._before, self._square))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this sensor or of one with equal arguments."""
        self._before, self._square = unpack_state(state)


class ModelMonitor:
    """Tells by a sensor that the arm is not the one that was learned from: by the innovation, measured - estimated tip.

    It is smoothed, so that noise and swings do not count, and rests while joints are on their way. What was learned
    cannot tell by its own inputs: on an arm with stiffer links they are as they were.

    Args:
        lag: time constant of the smoothing, s; 0 for none.
        limit: length of the smoothed innovation above which the arm differs, m.
    """

    def __init__(self, lag: float, limit: float) -> None:
        self._lag, self._limit = lag, limit
        self._mean = np.zeros(3)

    @property
    def innovation(self) -> float:
        """Length of the smoothed innovation, m."""
        return math.hypot(*self._mean.tolist())

    @property
    def mismatch(self) -> bool:
        """Whether it is above the limit."""
        return self.innovation > self._limit

    def step(self, dt: float, p_WG: Floats, p_WG_est: Floats) -> None:
        """Take up where the tip is seen and where it is taken to be, shape (3,), m, a period, s, after the last."""
        share = 1.0 if self._lag == 0.0 else 1.0 - math.exp(-dt / self._lag)
        self._mean = self._mean + share * (p_WG - p_WG_est - self._mean)

    def get_state(self) -> bytes:
        """Return the smoothed innovation."""
        return pack_state(self._mean)

    def set_state(self, state: bytes) -> None:
        """Restore a state of this monitor or of one with equal arguments."""
        self._mean = unpack_state(state)


def is_moving(q_cmd: Floats, q_meas: Floats) -> bool:
    """Return whether a joint is still far from where it was commanded to, so that the tip is not yet to judge."""
    return bool(np.max(np.abs(q_cmd - q_meas)) > _MOVING_ERROR)


class VibrationDamping:
    """Turns joints 2 and 3 against the swings that a path's changes of speed excite.

    What joints carry weighs i (a + g) / g under an acceleration a: the tip's, by the path's velocities J qd_ref, from
    one period to the next. That bends links by G i a / g, with G = d q_cmd / d i, eq. (11), which is commanded ahead:
    times K_F, since the servos' share of G does not yield so fast. What swings nevertheless shows in the currents, and
    the joints yield to it at K_D times the bending, as a damper in series does.

    Without friction compensation K_D must be 0: smoothed currents lag behind the posture, and what they lack is taken
    for a swing. On the curve with 50 g, at 0.1 and 0.2 m/s, the error of the tip is 3.1 and 4.4 mm without damping, 5.1
    and 6.7 mm with K_D = 4 (at 0.1 m/s 2.4 and 3.9 mm on an arm without friction, too; 3.8 and 7.3 mm with lags of 1
    s), and 3.0 and 4.3 mm with what is commanded ahead alone. With friction compensation it is 1.4 and 3.0 mm, and
    1.2 and 2.2 mm with both.

    Args:
        model: what corrects.
        K_F: share of the bending that is commanded ahead.
        K_D: share of the bending by a swing that the joints yield by in a second, 1/s.
    """

    def __init__(self, model: VslModel, K_F: float, K_D: float) -> None:
        self._model, self._K_F, self._K_D = model, K_F, K_D
        self._path: tuple[Floats, Floats] | None = None
        """q_ref and qd_ref of the period that ends."""
        self._v = np.zeros(3)
        self._yielded = np.zeros(2)
        self._ahead = np.zeros(2)

    @property
    def dq(self) -> Floats:
        """By how much the joints are turned, shape (3,), rad."""
        return np.concatenate([[0.0], self._yielded + self._ahead])

    def step(self, dt: float, u: Readings, i: Floats, oscillation: Floats) -> bool:
        """Find how to turn the joints; return whether at once.

        Args:
            dt: period, s.
            u: what is wanted and measured.
            i: smoothed currents, shape (3,), A.
            oscillation: by how much those of joints 2 and 3 are off them, shape (2,), A.
        """
        G = self._model.inverse.jacobian(inputs_of(u.q_ref, u.p_meas, i))[1:, 5:]
        self._yielded = self._yielded - dt * (self._K_D * (G @ oscillation) + self._yielded / _YIELD_TIME)
        was = self._ahead
        self._ahead = self._K_F * (G @ (i[1:] * self._weights(dt, u)))
        return bool(np.any(was) or np.any(self._ahead))

    def get_state(self) -> bytes:
        """Return where on the path it is, its speed, and the turns."""
        return pack_state((self._path, self._v, self._yielded, self._ahead))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this compensation or of one with equal arguments."""
        self._path, self._v, self._yielded, self._ahead = unpack_state(state)

    def _weights(self, dt: float, u: Readings) -> Floats:
        """Return by how much more of itself joints 2 and 3 carry, as the path's velocity changes, shape (2,)."""
        k, q = self._model.kinematics, u.q_ref
        v = self._velocity(u)
        a, self._v, self._path = (v - self._v) / dt, v, (np.array(q), np.array(u.qd_ref))
        theta_1, theta_2, theta_3 = q.tolist()
        outwards, upwards = float(a[0]) * math.cos(theta_1) + float(a[1]) * math.sin(theta_1), float(a[2])
        x_3, z_3 = k.L_3 * math.cos(theta_2 + theta_3), k.L_3 * math.sin(theta_2 + theta_3)
        x_2, z_2 = x_3 + k.L_2 * math.cos(theta_2), z_3 + k.L_2 * math.sin(theta_2)
        slopes = [z / x if abs(x) >= _SHORTEST_LEVER else 0.0 for x, z in ((x_2, z_2), (x_3, z_3))]  # from each joint
        return np.array([upwards - outwards * slope for slope in slopes]) / _GRAVITY

    def _velocity(self, u: Readings) -> Floats:
        """Return the path's velocity, shape (3,), m/s.

        A speed with which q_ref does not change is no speed of the path: 0. Where both stay, a point holds for several
        periods.
        """
        if self._path is None:
            return np.zeros(3)
        if np.any(u.q_ref != self._path[0]):
            return self._model.kinematics.jacobian(u.q_ref) @ u.qd_ref
        return self._v if np.array_equal(u.qd_ref, self._path[1]) else np.zeros(3)
