"""What converts between units, number by number."""

import math

import pytest

from handover.cosim.blocks.units import BaseExponents, Unit
from handover.cosim.system.conversion import LinearTransformation, conversion, exact_number

ANGLE, LENGTH, TEMPERATURE = BaseExponents(rad=1), BaseExponents(m=1), BaseExponents(K=1)
RAD, METRE, KELVIN = Unit("rad", ANGLE), Unit("m", LENGTH), Unit("K", TEMPERATURE)
DEG, GRAD = Unit("deg", ANGLE, math.pi / 180), Unit("grad", ANGLE, math.pi / 200)
MILLIMETRE, MICROMETRE = Unit("mm", LENGTH, 1e-3), Unit("um", LENGTH, 1e-6)
CELSIUS, FAHRENHEIT = Unit("degC", TEMPERATURE, 1.0, 273.15), Unit("degF", TEMPERATURE, 5 / 9, 273.15 - 32 * 5 / 9)


@pytest.mark.parametrize(
    ("source", "target", "expected"),
    [
        (DEG, RAD, LinearTransformation(0.017453292519943295)),
        (RAD, DEG, LinearTransformation(57.29577951308232)),
        (DEG, GRAD, LinearTransformation(10 / 9)),
        (Unit("deg", ANGLE, 0.0174532925199433), RAD, LinearTransformation(0.017453292519943295)),
        (MILLIMETRE, METRE, LinearTransformation(0.001)),
        (METRE, MILLIMETRE, LinearTransformation(1000.0)),
        (MILLIMETRE, MICROMETRE, LinearTransformation(1000.0)),
        (CELSIUS, KELVIN, LinearTransformation(1.0, 273.15)),
        (KELVIN, CELSIUS, LinearTransformation(1.0, -273.15)),
        (FAHRENHEIT, CELSIUS, LinearTransformation(5 / 9, -17.77777777777778)),
        (CELSIUS, FAHRENHEIT, LinearTransformation(1.8, 32.0)),
        (Unit("km/h", LENGTH, 0.277777777777778), METRE, LinearTransformation(5 / 18)),
    ],
    ids=lambda x: x.symbol if isinstance(x, Unit) else "",
)
def test_a_conversion_is_rounded_once(source: Unit, target: Unit, expected: LinearTransformation):
    assert conversion(source, target) == expected


def test_a_number_that_is_near_nothing_is_taken_as_it_stands():
    yard = 0.9143987654321234
    assert float(exact_number(yard)) == yard
    assert exact_number(-0.25) == -1 / 4


@pytest.mark.parametrize(
    ("linear", "text"),
    [
        (LinearTransformation(2.0), "times 2"),
        (LinearTransformation(1.0, 273.15), "plus 273.15"),
        (LinearTransformation(1.8, 32.0), "times 1.8, plus 32"),
    ],
)
def test_a_conversion_says_what_it_does(linear: LinearTransformation, text: str):
    assert str(linear) == text
