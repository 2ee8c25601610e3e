"""Values as one reads them: in a fitting unit, with as many digits as mean something."""

import math

import pytest

from handover.cosim.exceptions import counted
from handover.scenarios.experiment.display_unit import column_text, digits_after_point, display_unit


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (2.661, "rad/s", "2.661 rad/s"),
        (math.radians(40.68), "rad", "40.68°"),
        (math.radians(0.05991), "rad", "0.060°"),
        (math.radians(0.0005991), "rad", "0.00060°"),
        (0.0, "rad", "0°"),
        (0.0123456, "m", "12.35 mm"),
        (-0.0004343, "m", "-0.434 mm"),
        (0.0, "s", "0 s"),
        (0.0161, "s", "16.1 ms"),
        (0.009961, "1", "0.009961"),
        (0.06389, "m/s", "0.06389 m/s"),
        (math.nan, "m", "–"),
        (math.radians(0.00001234), "rad", "1.234e-05°"),
        (-1e-30, "m", "-1e-27 mm"),
        (2.225e-308, "m", "0 mm"),
        (1e300, "m", "1e+300 m"),
    ],
)
def test_a_value_is_reported_in_its_unit(value: float, unit: str, text: str):
    assert display_unit(unit, value).text(value) == text


def test_numbers_of_a_column_have_the_same_digits_after_the_point():
    columns = [40.68, 0.05991], [40.68, 12.1], [3025.0, 7.88], [3025.5, 1200.0], [12.345, math.nan, 0.0], [1e-4, 2e-4]
    assert [digits_after_point(values) for values in columns] == [3, 2, 1, 0, 2, 7]
    columns = [10.0, 4.0], [5.5, 1e-9], [1e-30], [math.nan], list[float]()
    assert [digits_after_point(values) for values in columns] == [0, 4, 7, 0, 0]


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([1e-4, 2e-4], ["0.0001000", "0.0002000"]),
        ([1.5e-37, 2e-300], ["1.500e-37", "0.0000000"]),
        ([1e300, 2.0], ["1.000e+300", "2"]),
        ([5.5, 1e-9], ["5.5000", "0.0000"]),
    ],
)
def test_numbers_that_fixed_digits_do_not_suit_have_an_exponent(values: list[float], texts: list[str]):
    digits = digits_after_point(values)
    assert [column_text(value, digits) for value in values] == texts


def test_a_number_of_things_is_said_in_its_grammar():
    assert [counted(n, "run") for n in (0, 1, 2)] == ["0 runs", "1 run", "2 runs"]
    assert [counted(n, "axis", "axes") for n in (1, 3)] == ["1 axis", "3 axes"]
