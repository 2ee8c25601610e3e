import enum
from typing import Any

import numpy as np
import pytest

from handover.cosim.blocks.start_values import fault_of, numbers_of, range_of
from handover.cosim.blocks.units import BaseExponents, Unit
from handover.cosim.blocks.variable import Causality, Kind, Variable

METRE = Unit("m", BaseExponents(m=1))


class Place(enum.IntEnum):
    FRONT = 0
    LEFT = 4


def variable(kind: Kind, **facts: Any) -> Variable:
    if kind is Kind.ENUMERATION:
        facts["items"] = tuple((e.name, int(e)) for e in Place)
    return Variable(name="x", kind=kind, causality=Causality.PARAMETER, description="", start=None, **facts)


@pytest.mark.parametrize(
    ("given", "value", "text"),
    [
        (variable(Kind.REAL, unit=METRE, minimum=0.0, maximum=2.0), 2.5, "out of range: from 0 to 2 m"),
        (variable(Kind.REAL, unit=METRE, minimum=0.0), -1, "at least 0 m"),
        (variable(Kind.REAL, unit=METRE, maximum=0.0), 1, "at most 0 m"),
        (variable(Kind.REAL, unit=METRE), "far", "'far' is not a number in m"),
        (variable(Kind.REAL), float("nan"), "not finite"),
        (variable(Kind.REAL, shape=(3,), unit=METRE), [1.0, 2.0], "an array of shape [3] of numbers in m"),
        (variable(Kind.REAL, shape=(2,), minimum=0.0), [1.0, -2.0], "out of range"),
        (variable(Kind.INTEGER), 1.5, "a whole number"),
        (variable(Kind.BOOLEAN), "maybe", "neither true nor false"),
        (variable(Kind.ENUMERATION), "behind", "none of front, left"),
        (variable(Kind.ENUMERATION), 3, "none of 0 (front), 4 (left)"),
        (variable(Kind.STRING), 5, "5 is not a string"),
    ],
)
def test_a_bad_value_is_reported_with_valid_values(given: Variable, value: Any, text: str):
    fault = fault_of(given, value)
    assert fault is not None
    assert text in fault


def test_a_port_whose_unit_has_no_name_is_of_numbers():
    assert fault_of(variable(Kind.REAL, unit=Unit("")), "far") == "'far' is not a number"


@pytest.mark.parametrize(
    ("given", "value"),
    [
        (variable(Kind.REAL, unit=METRE, minimum=0.0, maximum=2.0), 2.0),
        (variable(Kind.REAL, shape=(3,)), np.ones(3)),
        (variable(Kind.INTEGER, minimum=0.0), 7),
        (variable(Kind.BOOLEAN), True),
        (variable(Kind.ENUMERATION), "left"),
        (variable(Kind.STRING), "a word"),
    ],
)
def test_a_good_value_has_no_fault(given: Variable, value: Any):
    assert fault_of(given, value) is None


def test_numbers_come_in_row_major_order():
    assert numbers_of(variable(Kind.REAL, shape=(2, 2)), [[1, 2], [3, 4]]).tolist() == [1, 2, 3, 4]
    assert numbers_of(variable(Kind.ENUMERATION), "Left").tolist() == [4]


def test_no_range_is_reported_where_there_is_none():
    assert range_of(variable(Kind.REAL)) == ""
