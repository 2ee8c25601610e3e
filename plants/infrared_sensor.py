"""Infrared distance sensors on fingertips: what their converters read, after [Luberto] sec. III, V-B."""

import math
from bisect import bisect_left
from dataclasses import dataclass
from functools import lru_cache

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import NOT_GIVEN, assumed, stated
from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.units import Metre, Number, PerTick

_CURVE = assumed(
    "eq. (11) of [Luberto] states the form; coefficients such that 12 bits cover 4 to 65 mm (84 mm at 0 ticks, 3.8 mm "
    "at 4095)"
)

_TOP = 4095  # of a 12-bit converter


def _distance(a: float, b: float, c: float, d: float, ticks: float) -> float:
    return a * math.exp(b * ticks) + c * math.exp(d * ticks)


@lru_cache(maxsize=16)  # fingers share their constants, and a scene makes its sensors twice: to check them, and to read
def _nearness(a: float, b: float, c: float, d: float) -> tuple[float, ...]:
    """Return less distance, in m, by ticks: it rises, for bisection."""
    return tuple(-_distance(a, b, c, d, float(x)) for x in range(_TOP + 1))


class InvalidSensorParameters(InvalidParameters):
    """A characteristic that cannot be inverted over the range of the sensor; `faults` lists all that is wrong."""

    block = "InfraredSensor"


class InfraredSensor:
    """Ticks of a 12-bit converter by what the beam meets, from the characteristic y = a e^(bx) + c e^(dx), eq. (11).

    The characteristic maps ticks x to the distance y of a reference surface that is met squarely. The voltage is
    proportional to the returned intensity (sec. V-B), so another surface, met at an angle theta from its normal,
    reads rho cos(theta)^n x, where x is the inverted characteristic and rho its reflectivity. Nothing comes back from
    beyond `farthest`. Nearer than `nearest` the emitter's light misses the receiver more and more: x falls linearly
    from its value at `nearest` to the share `contact` of it at distance 0 (assumed; the sensor's data sheet
    shows the fall).

    Args:
        a: in m.
        b: in 1/tick.
        c: in m.
        d: in 1/tick.
        nearest: of the operating range, in m.
        farthest: of the operating range, in m.
        contact: share of the largest reading that is left at contact.
        exponent: n of the law of incidence; 1 is Lambert's.

    Raises:
        InvalidSensorParameters: the characteristic does not fall strictly or does not cover the operating range.
    """

    def __init__(
        self,
        a: float,
        b: float,
        c: float,
        d: float,
        nearest: float,
        farthest: float,
        contact: float,
        exponent: float,
    ) -> None:
        self._a, self._b, self._c, self._d = a, b, c, d
        self._nearest, self._farthest = nearest, farthest
        self._contact, self._exponent = contact, exponent
        self._nearness = _nearness(a, b, c, d)
        if faults := [*self._shape_faults(), *self._range_faults()]:
            raise InvalidSensorParameters(faults)
        self._brightest = self._inverse(nearest)

    def distance(self, ticks: float) -> float:
        """Return the distance in m that the characteristic gives for ticks, eq. (11)."""
        return _distance(self._a, self._b, self._c, self._d, ticks)

    def ticks(
        self, distance: float, cosine: float, reflectivity: float, gloss: float = 0.0, lobe: float = 1.0
    ) -> float:
        """Return the noise-free, unrounded ticks for a ray that meets a surface.

        Args:
            distance: of the surface from the sensor's window along the ray, in m.
            cosine: of the angle between ray and surface normal.
            reflectivity: of the surface, over the reference's.
            gloss: share of the light that the surface reflects like a mirror; emitter and receiver are at one place, so
                what is met at the angle theta comes back 2 theta off: cos(2 theta)^lobe of it is received.
            lobe: exponent of the mirror's lobe.
        """
        if distance > self._farthest or cosine <= 0.0:
            return 0.0
        if distance < self._nearest:
            share = self._contact + (1.0 - self._contact) * max(distance, 0.0) / self._nearest
            x = share * self._brightest
        else:
            x = self._inverse(distance)
        returned = cosine**self._exponent
        if gloss > 0.0:
            returned = (1.0 - gloss) * returned + gloss * max(0.0, 2.0 * cosine * cosine - 1.0) ** lobe
        return reflectivity * returned * x

    def reading(self, ticks: float) -> float:
        """Return what the converter makes of noisy ticks: a whole number from 0 to 4095."""
        return float(min(max(round(ticks), 0), _TOP))

    def _inverse(self, distance: float) -> float:
        """Return x of y(x) = distance, by linear interpolation between whole ticks, which is good to 0.001 tick."""
        i = bisect_left(self._nearness, -distance)
        if i == 0:
            return 0.0
        if i > _TOP:
            return float(_TOP)
        below, above = self._nearness[i - 1], self._nearness[i]
        return i - 1 + (-distance - below) / (above - below)

    def _shape_faults(self) -> list[str]:
        rising = next((x for x in range(_TOP) if not self._nearness[x] < self._nearness[x + 1]), None)
        if rising is None:
            return []
        return [f"the characteristic must fall from 0 to {_TOP} ticks; it does not at {rising} ticks"]

    def _range_faults(self) -> list[str]:
        faults: list[str] = []
        if not 0.0 < self._nearest < self._farthest:
            faults.append(f"nearest {self._nearest:g} m must be positive and less than farthest {self._farthest:g} m")
        first, last = -self._nearness[0], -self._nearness[-1]
        if not (last <= self._nearest and self._farthest <= first):
            faults.append(
                f"the characteristic goes from {first:.4g} m at 0 ticks to {last:.4g} m at {_TOP} ticks and must cover "
                f"{self._nearest:g} m to {self._farthest:g} m"
            )
        return faults


class ToleratedSensor(InfraredSensor):
    """A sensor whose constants are off, so that its characteristic need not cover the operating range.

    Nearer than the characteristic goes the converter saturates at 4095 ticks; farther it reads 0.

    Raises:
        InvalidSensorParameters: the characteristic does not fall strictly.
    """

    def _range_faults(self) -> list[str]:
        return []


@dataclass(frozen=True, kw_only=True)
class SensorParameters:
    """What a unit with such sensors declares of them. The characteristic's coefficients are assumed."""

    a: Metre = parameter(
        0.062, "a of the characteristic y = a exp(b x) + c exp(d x)", minimum=-1.0, maximum=1.0, origin=_CURVE
    )
    b: PerTick = parameter(-0.0030, "b of the characteristic", minimum=-0.1, maximum=0.1, origin=_CURVE)
    c: Metre = parameter(0.022, "c of the characteristic", minimum=-1.0, maximum=1.0, origin=_CURVE)
    d: PerTick = parameter(-0.00043, "d of the characteristic", minimum=-0.1, maximum=0.1, origin=_CURVE)
    nearest: Metre = parameter(
        0.004,
        "distance of the largest reading; nearer, readings fall again",
        minimum=1e-4,
        origin=stated("[Luberto] sec. V-B: operative range 4 to 65 mm"),
    )
    farthest: Metre = parameter(
        0.065,
        "distance beyond which nothing is seen",
        maximum=0.15,
        origin=stated("[Luberto] sec. V-B: operative range 4 to 65 mm"),
    )
    contact_share: Number = parameter(
        0.4, "share of the largest reading that is left at contact", minimum=0.0, maximum=1.0, origin=NOT_GIVEN
    )
    incidence_exponent: Number = parameter(
        1.0,
        "exponent n of the reading's fall with cos(theta)^n, theta from the normal",
        minimum=0.0,
        maximum=10.0,
        origin=NOT_GIVEN,
    )

    @property
    def optics(self) -> tuple[float, float, float, float]:
        """All but the coefficients."""
        return self.nearest, self.farthest, self.contact_share, self.incidence_exponent

    def sensor(self) -> InfraredSensor:
        """Return one of the sensors, with the characteristic's own gain.

        Raises:
            InvalidSensorParameters: its characteristic cannot be inverted.
        """
        return InfraredSensor(self.a, self.b, self.c, self.d, *self.optics)
