"""From ticks to distance by the constant characteristic of the infrared sensors. [Luberto] eq. (11)."""

import math
from dataclasses import dataclass

_FULL_SCALE = 4095.0
_ENOUGH = 60  # halvings of 4095 ticks: beyond the last bit of a float


@dataclass(frozen=True)
class Calibration:
    """y = a e^(b x) + c e^(d x): distance y in m over ADC output x in ticks, from 0 to 4095; falls as x grows."""

    a: float
    b: float
    c: float
    d: float

    def distance(self, ticks: float) -> float:
        """Return the distance y, in m, that stands for an ADC output, by eq. (11)."""
        return self.a * math.exp(self.b * ticks) + self.c * math.exp(self.d * ticks)

    def ticks(self, distance: float) -> float:
        """Return the ADC output x, in ticks, that stands for a distance in m, by halving; 0 or 4095 beyond the curve.

        Compared with it, a reading is judged without working out its distance.
        """
        low, high = 0.0, _FULL_SCALE
        for _ in range(_ENOUGH):
            middle = (low + high) / 2.0
            low, high = (middle, high) if self.distance(middle) > distance else (low, middle)
        return (low + high) / 2.0

    def faults(self) -> list[str]:
        """Return what keeps the curve from falling, so that a reading would have no one distance."""
        faults = [
            f"{name} = {value:g} m must be above 0" for name, value in (("a", self.a), ("c", self.c)) if value <= 0.0
        ]
        falling = (("b", self.b), ("d", self.d))
        return faults + [f"{name} = {value:g} 1/tick must be below 0" for name, value in falling if value >= 0.0]
