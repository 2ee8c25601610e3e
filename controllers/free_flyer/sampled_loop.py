"""A linear plant under a sampled linear controller, with delay, by python-control: poles and response."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any, TypedDict

import numpy as np

from handover.cosim.blocks.ports import Floats

_LASTING = math.exp(-1.0)  # a pole nearer to zero, such as a delay's, has decayed within a sample
_WHOLE = 1e-9  # of a period: what a delay of whole periods may err by rounding


@cache
def _control() -> Any:
    """Load python-control, which takes a second, when the first loop is closed: ports are read without it."""
    import control

    return control


@cache
def _arithmetic_libraries() -> Any:
    """Find the libraries (BLAS) that python-control calculates with."""
    _control()
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearPlant:
    """dx/dt = A x + B u + E d, y = C x: u is commanded, d comes from outside."""

    A: Floats
    B: Floats
    E: Floats
    C: Floats


@dataclass(frozen=True, kw_only=True)
class LinearController:
    """z[n+1] = A z[n] + B y[n], u[n] = -(C z[n] + D y[n])."""

    A: Floats
    B: Floats
    C: Floats
    D: Floats


def without_memory(D: Floats) -> LinearController:
    """Return the controller u[n] = -D y[n]."""
    inputs, measured = D.shape
    return LinearController(A=np.zeros((0, 0)), B=np.zeros((0, measured)), C=np.zeros((inputs, 0)), D=D)


class LoopFigures(TypedDict):
    """What a controller's outputs tell of its closed loop: the keys are the outputs' names."""

    pole_radius: float
    damping_ratio: float
    pole_frequency: float
    slowest_decay: float


class SampledLoop:
    """Plant, hold, delay and controller, closed: a linear system at the sampling instants.

    The controller measures y at multiples of the period. A command reaches the plant after the delay and is held until
    the next one does; d is held over each period.

    Args:
        plant: what is controlled.
        controller: its law.
        period: time between two samples, s.
        delay: time from a measurement to its command's effect, s; not negative, parts of a period count.
    """

    def __init__(self, plant: LinearPlant, controller: LinearController, period: float, delay: float = 0.0) -> None:
        self._plant, self._controller = plant, controller
        self.period, self.delay = period, delay

    @cached_property
    def system(self) -> Any:
        """The closed loop from d to y, a discrete `control.StateSpace`."""
        commands, disturbances = self._plant.B.shape[1], self._plant.E.shape[1]
        whole, past = split_delay(self.delay, self.period)
        line = _delay_line(commands, whole, self.period)
        straight = _control().ss([], [], [], np.eye(disturbances), self.period)
        forward = _sampled(self._plant, past, self.period) * _control().append(line, straight)
        c = self._controller
        idle_C, idle_D = (np.zeros((disturbances, M.shape[1])) for M in (c.C, c.D))
        law = _control().ss(c.A, c.B, np.vstack([c.C, idle_C]), np.vstack([c.D, idle_D]), self.period)
        return _control().feedback(forward, law)[:, commands:]

    @cached_property
    def poles(self) -> Any:
        """The closed loop's poles z."""
        return self.system.poles()

    @property
    def pole_radius(self) -> float:
        """Largest |z|; the loop is stable if it is less than 1."""
        return float(np.max(np.abs(self.poles)))

    @property
    def slowest_decay(self) -> float:
        """Time constant of the pole with the largest |z|, s; infinite if that is not less than 1."""
        radius = self.pole_radius
        if radius == 0.0:
            return 0.0
        return -self.period / math.log(radius) if radius < 1.0 else math.inf

    @property
    def least_damped(self) -> tuple[float, float]:
        """Damping ratio and frequency (rad/s) of the pole s = log(z) / period with the least ratio.

        Poles that decay with a time constant shorter than the period are left out, unless there are no others.
        """
        lasting = np.abs(self.poles) > min(_LASTING, 0.999 * self.pole_radius)
        z = self.poles[lasting]
        s = np.log(z.astype(complex)) / self.period
        frequency = np.abs(s)
        ratio = -s.real / np.maximum(frequency, 1e-300)
        least = int(np.argmin(ratio))
        return float(ratio[least]), float(frequency[least])

    @property
    def figures(self) -> LoopFigures:
        """Pole radius, least damping ratio with its pole's frequency (rad/s), and slowest decay (s)."""
        ratio, frequency = self.least_damped
        return LoopFigures(
            pole_radius=self.pole_radius,
            damping_ratio=ratio,
            pole_frequency=frequency,
            slowest_decay=self.slowest_decay,
        )

    def response(self, d: Floats) -> Floats:
        """Return y, shape (n, outputs), at the beginnings of n periods from rest, with d of shape (n, disturbances)."""
        T = self.period * np.arange(len(d))
        y: Floats = _control().forced_response(self.system, T, np.transpose(d), squeeze=False).outputs
        return np.transpose(y)


def split_delay(delay: float, period: float) -> tuple[int, float]:
    """Return a delay's whole periods, and what is left of it, s."""
    whole = math.floor(delay / period + _WHOLE)
    return whole, max(delay - whole * period, 0.0)


def largest_stable(radius: Callable[[float], float], upper: float, steps: int = 10) -> float:
    """Return about the largest x in [0, upper] with radius(x) < 1, by bisection; 0 if none is found."""
    low, high = 0.0, upper
    for _ in range(steps):
        middle = (low + high) / 2.0
        low, high = (middle, high) if radius(middle) < 1.0 else (low, middle)
    return low


def discretised(A: Floats, B: Floats, time: float) -> tuple[Floats, Floats]:
    """Return A and B of x[n+1] = A x[n] + B u[n] for dx/dt = A x + B u with u held for a time."""
    system = _zero_order_hold(_control().ss(A, B, np.eye(len(A)), np.zeros(B.shape)), time)
    return np.asarray(system.A), np.asarray(system.B)


def _delay_line(channels: int, periods: int, period: float) -> Any:
    """From u[n] to the command of `periods` ago, and the one before that."""
    n = channels * (periods + 1)
    A, B = np.eye(n, k=-channels), np.eye(n, channels)
    C, D = np.eye(n + channels, n, k=-channels), np.eye(n + channels, channels)  # u[n], then the states, newest first
    wanted = slice(channels * periods, None)
    return _control().ss(A, B, C[wanted], D[wanted], period)


def _sampled(plant: LinearPlant, past: float, period: float) -> Any:
    """The plant at samples, from [u, u before it, d]: the older command still acts for the time `past`."""
    newer = _discrete(plant, period - past)
    older = _discrete(plant, past) if past > 0.0 else None
    whole = _discrete(plant, period)
    commands = plant.B.shape[1]
    before = np.zeros_like(plant.B) if older is None else newer.A @ older.B[:, :commands]
    B = np.hstack([newer.B[:, :commands], before, whole.B[:, commands:]])
    return _control().ss(whole.A, B, plant.C, np.zeros((len(plant.C), B.shape[1])), period)


@lru_cache(maxsize=16)
def _discrete(plant: LinearPlant, time: float) -> Any:
    B = np.hstack([plant.B, plant.E])
    continuous = _control().ss(plant.A, B, plant.C, np.zeros((len(plant.C), B.shape[1])))
    return _zero_order_hold(continuous, time)


def _zero_order_hold(continuous: Any, time: float) -> Any:
    """Return a continuous `control.StateSpace` sampled with its inputs held.

    Its matrix exponential would wake the threads of BLAS, which then wait busily for about 0.1 s of CPU time, beside
    the run's first steps, and have nothing to do for matrices of some twenty rows. Only meanwhile is there one thread:
    other units in this process keep theirs.
    """
    with _arithmetic_libraries().limit(limits=1, user_api="blas"):
        return _control().sample_system(continuous, time, method="zoh")
