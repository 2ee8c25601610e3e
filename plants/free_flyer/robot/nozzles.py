"""Air out of twelve nozzles: a free-flyer's two propulsion modules and their force allocation, [Fernandes2020] 4.1.1.

Each module is a plenum under pressure of an impeller, with six nozzles of fixed direction that pairs of flappers open.
Geometry, impeller and coefficients are those of Astrobee's flight software (`gnc/pmc` and `gnc/matlab` of
github.com/nasa/astrobee); its nozzles were measured one by one and differ by up to a tenth, here all of an axis have
their mean, and both plenums that of their leaks, so that the robot pushes equally hard both ways.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats

_INCH = 0.0254

# Module 1 is at +y, module 2 the same turned by half a turn about z. Nozzles 1-2 and 7-8 blow along x, 3-4 and 9-10
# along y, 5-6 and 11-12 along z.
_P_MODULE = _INCH * np.array(
    [
        [6.00, 4.01, -1.56],
        [-6.00, 4.01, 1.56],
        [2.83, 6.00, 2.83],
        [-2.83, 6.00, -2.83],
        [-2.66, 4.01, 6.00],
        [2.66, 4.01, -6.00],
    ]
)
_DIRECTIONS_MODULE = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.float64)
_HALF_A_TURN = np.array([-1.0, -1.0, 1.0])

P_BN: Floats = np.vstack([_P_MODULE, _P_MODULE * _HALF_A_TURN])
"""Nozzles seen from the centre of mass, (12, 3), m, in B."""
DIRECTIONS: Floats = np.vstack([_DIRECTIONS_MODULE, _DIRECTIONS_MODULE * _HALF_A_TURN])
"""Where they blow to, (12, 3) unit vectors in B."""
_TORQUES: Floats = np.cross(DIRECTIONS, P_BN)
WRENCH_OF_THRUST: Floats = np.transpose(np.hstack([-DIRECTIONS, _TORQUES]))
"""Force and torque on the robot of a unit of each nozzle's thrust, (6, 12)."""
AXIS_OF_NOZZLE: NDArray[np.intp] = np.array([0, 0, 1, 1, 2, 2] * 2)
"""The axis along which each nozzle blows, 0 to 2."""

_WIDTH = _INCH * np.array([5.0, 2.8, 2.8])[AXIS_OF_NOZZLE]
_FLAP_LENGTH = 0.5353 * _INCH
_ANGLE_CLOSED, _ANGLE_OPEN = np.radians([15.68, 79.91])
LARGEST_ANGLE = float(_ANGLE_OPEN - _ANGLE_CLOSED)
"""How far flappers open, rad."""
_DISCHARGE = np.array([0.845583, 0.909421, 0.921172])[AXIS_OF_NOZZLE]
_LEAK = 0.0043470
"""Effective area, m^2, through which a plenum leaks whose nozzles are all closed."""

_DIAMETER, _HEIGHT = 5.5 * _INCH, 1.6742 * _INCH
_AIR = 1.2
"""Density, kg/m^3."""
_PRESSURE_BY_FLOW = np.array([58.72, -45.013, 11.782, -2.1758, 0.1278, 0.0825])
_SLOPE_BY_FLOW = np.polyder(_PRESSURE_BY_FLOW)
_GREATEST_FLOW = 0.33319
_ARM = 0.1
"""Metres by which torques are made forces, to ask what is left of them."""
_PANEL = 0.008
"""Seconds over which the mean is by one rule of Gauss."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)

# Tables from which Newton's method starts.
_FLOW = np.linspace(0.0, _GREATEST_FLOW, 2001)


def _pressure(flow: Floats) -> Floats:
    """Return dp / (rho (w D)^2) of an impeller by its flow coefficient, C_P = f(C_Q)."""
    c = _PRESSURE_BY_FLOW
    return ((((c[0] * flow + c[1]) * flow + c[2]) * flow + c[3]) * flow + c[4]) * flow + c[5]


def _pressure_slope(flow: Floats) -> Floats:
    c = _SLOPE_BY_FLOW
    return (((c[0] * flow + c[1]) * flow + c[2]) * flow + c[3]) * flow + c[4]


def _area(flow: Floats) -> Floats:
    """Return the effective area through which it flows, m^2: A = C_Q D h / sqrt(2 C_P)."""
    return flow * _DIAMETER * _HEIGHT / np.sqrt(2.0 * _pressure(flow))


def _total_thrust(flow: Floats) -> Floats:
    """Return the sum of thrust over discharge coefficient of a plenum's nozzles, over rho (w D)^2, m^2."""
    return 2.0 * _pressure(flow) * (_area(flow) - _LEAK)


_AREAS = _area(_FLOW)
_RISING = _FLOW[: int(np.argmax(_total_thrust(_FLOW))) - 4]
_THRUSTS = _total_thrust(_RISING)
_LARGEST_OPENING = float(_AREAS[len(_RISING) - 1]) - _LEAK
"""Effective area of a plenum's nozzles, m^2, just before the one beyond which they give less, as the pressure falls."""


def _flow_of_area(area: Floats) -> Floats:
    flow: Floats = np.interp(area, _AREAS, _FLOW)
    for _ in range(2):
        root = np.sqrt(2.0 * _pressure(flow))
        slope = _DIAMETER * _HEIGHT - area * _pressure_slope(flow) / root
        flow = flow - (flow * _DIAMETER * _HEIGHT - area * root) / slope
    return flow


def _flow_of_thrust(thrust: Floats) -> Floats:
    """Return the flow of a total thrust up to the largest."""
    flow: Floats = np.interp(thrust, _THRUSTS, _RISING)
    for _ in range(2):
        p, slope = _pressure(flow), _pressure_slope(flow)
        root = np.sqrt(2.0 * p)
        f = flow * _DIAMETER * _HEIGHT * root - 2.0 * _LEAK * p - thrust
        df = _DIAMETER * _HEIGHT * (root + flow * slope / root) - 2.0 * _LEAK * slope
        flow = flow - f / df
    return flow


@dataclass(frozen=True)
class Nozzles:
    """What nozzles give, and how far they must open for it.

    Thrust of a nozzle of area A is 2 dp C_d^2 A, times a factor; dp follows from the impeller's speed and from all that
    is open at its plenum. A flapper pair that is turned by an angle a from closed opens
    A = 2 width length (cos(closed) - cos(closed + a)).

    Args:
        factors: of the thrust of nozzles along x, y and z, (3,).
        speed: of the impellers for which the allocation reckons, rad/s.
    """

    factors: Floats
    speed: float

    def allocate(self, wrench: Floats) -> tuple[Floats, bool]:
        """Return the nozzles' thrusts, (12,), N, and whether the wrench, (6,), N and N m, had to be scaled down.

        As Astrobee's force allocation module (FAM) does it: thrusts of least norm by the pseudo-inverse; among the four
        nozzles along an axis, which together push nowhere, the least thrust is then taken from all if it is negative.
        Where that is more than nozzles and plenums have, all thrusts are scaled by the same factor, so that the wrench
        keeps its line of action. (Astrobee clips each nozzle, which turns a robot that was only to be pushed.)
        """
        thrusts = _FORCE_ALLOCATION @ wrench
        lowest = np.minimum(np.minimum.reduceat(thrusts[_BY_AXIS], [0, 4, 8]), 0.0)
        thrusts = np.maximum(thrusts - lowest[AXIS_OF_NOZZLE], 0.0)
        share = self._share(thrusts)
        return min(share, 1.0) * thrusts, share < 1.0

    def angles(self, thrusts: Floats) -> Floats:
        """Return the flappers' angles, (12,), rad, that give thrusts which there are, (12,), N."""
        flow = _flow_of_thrust(self._totals(thrusts) / self._dynamic_pressure)
        dp = np.repeat(self._dynamic_pressure * _pressure(flow), 6)
        areas = thrusts / (2.0 * dp * self._coefficients)
        cosine = np.cos(_ANGLE_CLOSED) - areas / (2.0 * _WIDTH * _FLAP_LENGTH)
        return np.clip(np.arccos(cosine) - _ANGLE_CLOSED, 0.0, LARGEST_ANGLE)

    def wrench(self, angles: Floats, speeds: Floats) -> Floats:
        """Return force and torque on the robot, (n, 6), N and N m.

        Args:
            angles: of the flappers, (n, 12), rad.
            speeds: of the impellers, (n, 2), rad/s.
        """
        areas = _areas(angles)
        opened = np.add.reduceat(areas * _DISCHARGE, [0, 6], axis=1) + _LEAK
        dp = _AIR * (speeds * _DIAMETER) ** 2 * _pressure(_flow_of_area(opened))
        thrusts = np.repeat(dp, 6, axis=1) * (2.0 * self._coefficients * areas)
        wrenches: Floats = thrusts @ np.transpose(WRENCH_OF_THRUST)
        return wrenches

    @property
    def _coefficients(self) -> Floats:
        coefficients: Floats = _DISCHARGE**2 * np.asarray(self.factors)[AXIS_OF_NOZZLE]
        return coefficients

    @property
    def _dynamic_pressure(self) -> float:
        return _AIR * (self.speed * _DIAMETER) ** 2

    def _totals(self, thrusts: Floats) -> Floats:
        """Return the sum of A C_d 2 dp of each plenum, (2,), N."""
        return np.add.reduceat(thrusts * _DISCHARGE / self._coefficients, [0, 6])

    def _share(self, thrusts: Floats) -> float:
        """Return how many times these thrusts there are: openings grow with them, all in one proportion."""
        needed = thrusts / self._coefficients
        shares: list[float] = []
        for total, own in zip(self._totals(thrusts).tolist(), (slice(6), slice(6, 12)), strict=True):
            if total > 0.0:
                proportion = float(np.max(needed[own] / _LARGEST_AREA[own])) / total
                opened = min(1.0 / proportion, _LARGEST_OPENING)
                flow = _flow_of_area(np.array(opened + _LEAK))
                shares.append(float(self._dynamic_pressure * _total_thrust(flow)) / total)
        return min(shares, default=np.inf)


def _areas(angles: Floats) -> Floats:
    return 2.0 * _WIDTH * _FLAP_LENGTH * (np.cos(_ANGLE_CLOSED) - np.cos(_ANGLE_CLOSED + angles))


_LARGEST_AREA = _areas(np.full(12, LARGEST_ANGLE))
_FORCE_ALLOCATION: Floats = np.linalg.pinv(WRENCH_OF_THRUST).astype(np.float64)
_BY_AXIS = np.argsort(AXIS_OF_NOZZLE, kind="stable")


@dataclass
class PropulsionModules:
    """Flappers that turn to their angles, and impellers that come to their speed, each first order.

    Flappers turn no faster than their rate: a' = clip((c - a) / T, -rate, rate) for the angle c that is due. Impellers
    run at one speed. Both are exact in time; the wrench, which depends on all of them through the plenums' pressure,
    is integrated by Gauss's rule. The allocation reckons with impellers at their speed and flappers that move freely.

    Args:
        nozzles: what they give.
        flapper_lag: T, s.
        flapper_rate: rad/s.
        impeller_lag: s.
        largest: the angle beyond which each nozzle's flappers do not open, (12,), rad.
        angles: of the flappers, (12,), rad.
        speeds: of the impellers, (2,), rad/s.
    """

    nozzles: Nozzles
    flapper_lag: float
    flapper_rate: float
    impeller_lag: float
    largest: Floats
    angles: Floats
    speeds: Floats

    def wrench(self) -> Floats:
        """Return force and torque on the robot as all stands, (6,), N and N m."""
        return self.nozzles.wrench(self.angles[None], self.speeds[None])[0]

    def advance(self, d: float, thrusts: Floats) -> Floats:
        """Advance by d seconds in which these thrusts are due, (12,), N; return the wrench's integral, (6,)."""
        due = np.minimum(self.nozzles.angles(thrusts), self.largest)
        panels = max(1, math.ceil(d / _PANEL - 1e-9))
        starts = np.arange(panels) * (d / panels)
        t = (starts[:, None] + (d / panels / 2.0) * (_NODES + 1.0)).ravel()[:, None]
        weights = np.tile(_WEIGHTS * (d / panels / 2.0), panels)
        total = weights @ self.nozzles.wrench(self._angles_after(t, due), self._speeds_after(t))
        end = np.array([[d]])
        self.angles, self.speeds = self._angles_after(end, due)[0], self._speeds_after(end)[0]
        return total

    def _angles_after(self, t: Floats, due: Floats) -> Floats:
        away = due - self.angles
        at_rate = self.flapper_rate * self.flapper_lag
        size = np.abs(away)
        left = np.maximum(size - self.flapper_rate * t, np.minimum(size, at_rate))
        if self.flapper_lag > 0.0:
            slower = np.maximum(size - at_rate, 0.0) / self.flapper_rate
            left = left * np.exp(-np.maximum(t - slower, 0.0) / self.flapper_lag)
        return due - np.sign(away) * left

    def _speeds_after(self, t: Floats) -> Floats:
        decay = np.exp(-t / self.impeller_lag) if self.impeller_lag > 0.0 else np.zeros_like(t)
        return self.nozzles.speed + (self.speeds - self.nozzles.speed) * decay


def lost_directions(stuck: Sequence[int]) -> list[str]:
    """Return the forces and torques that the nozzles cannot give without some of them, by their places from 0.

    Nozzles only push: what is left must reach each direction by thrusts that are not negative. SciPy's solver crashes
    where nothing is left.
    """
    from scipy.optimize import nnls  # only stuck nozzles need it

    left = np.delete(WRENCH_OF_THRUST, stuck, axis=1)
    left[3:] /= _ARM
    lost: list[str] = []
    for row, name in enumerate(f"{what} {axis}" for what in ("force along", "torque about") for axis in "xyz"):
        for sign in (1.0, -1.0):
            direction = np.zeros(6)
            direction[row] = sign
            if not left.size or float(nnls(left, direction)[1]) > 1e-6:
                lost.append(f"{name[:-1]}{'+' if sign > 0 else '-'}{name[-1]}")
    return lost
