"""The loop's time is Python's quotient of whole numbers, to the last bit."""

import ctypes
import random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handover.cosim.plan.memory import loop

WIDEST = 2**63 - 1


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    library = loop()
    assert library is not None
    return library


@given(st.integers(-WIDEST, WIDEST), st.integers(0, 2**62), st.integers(1, WIDEST), st.integers(1, WIDEST))
@example(0, 2**62, WIDEST, 1)
@example(WIDEST, 2**62, WIDEST, 1)
@example(-WIDEST, 0, 1, 1)
@example(0, 1, 1, WIDEST)
@example(-1, 1, 1, WIDEST)
@example(0, 2**53 + 1, 1, 1)
@example(0, 2**54 + 2, 1, 2)
@example(0, 2**53 + 1, 3, 3)
@example(0, 1, 2**53 + 1, 2**62)
def test_any_tick(library: ctypes.CDLL, offset: int, ticks: int, numerator: int, denominator: int):
    exact = (offset + ticks * numerator) / denominator
    assert library.plan_time(offset, ticks, numerator, denominator) == exact


def test_halves_are_rounded_to_even_and_what_is_just_beside_them_is_not(library: ctypes.CDLL):
    for odd in (2**53 + 1, 2**53 + 3, 2**60 + 2**7, 2**60 + 2**7 + 2**8):
        for denominator in (1, 3, 7, 2**30 + 1):
            for beside in (-1, 0, 1):
                numerator = odd * denominator + beside
                if 0 < numerator <= WIDEST:
                    assert library.plan_time(0, 1, numerator, denominator) == numerator / denominator


def test_many_ticks_of_ordinary_periods(library: ctypes.CDLL):
    draw = random.Random(4)
    for numerator, denominator in ((1, 3), (1, 30), (7, 1000), (1, 44_100), (0.1).as_integer_ratio()):
        for _ in range(4000):
            ticks = draw.randrange(2 ** draw.randrange(1, 62))
            assert library.plan_time(0, ticks, numerator, denominator) == ticks * numerator / denominator
