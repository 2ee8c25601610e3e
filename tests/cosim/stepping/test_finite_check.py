import numpy as np
import pytest
from numpy.typing import NDArray
from signals_of import port_of

from handover.cosim.fmu.failures import NotFinite
from handover.cosim.stepping.transfers import FiniteCheck


def check_of(values: NDArray[np.float64], *names: str) -> FiniteCheck:
    """Check equal parts of an array, which are outputs of these names."""
    parts = dict(zip(names, np.split(values, len(names)), strict=True))
    ports = {n: (port_of(n, v, fmi_type="Float64"), [f"reader.{n}"]) for n, v in parts.items()}
    return FiniteCheck("unit", 3, {n: (v,) for n, v in parts.items()}, ports)


def test_outputs_that_follow_each_other_are_checked_at_once():
    values = np.zeros(6)
    assert len(check_of(values, "a", "b", "c").blocks) == 1


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("at", range(6))
def test_the_element_is_named(at: int, value: float):
    values = np.zeros(6)
    check = check_of(values, "a", "b", "c")
    check(0.0)
    values[at] = value
    with pytest.raises(NotFinite) as caught:
        check(0.5)
    assert caught.value.element == f"{'abc'[at // 2]}[{at % 2 + 1}]"
    assert caught.value.readers == (f"reader.{'abc'[at // 2]}",)
    assert caught.value.t == 0.5


@pytest.mark.filterwarnings("error")
def test_the_largest_numbers_are_finite():
    values = np.array([1.7e308, -1.7e308, 5e-324, 1.7e308])
    check_of(values, "a")(0.0)


def test_a_unit_that_feeds_nobody_is_not_looked_at():
    assert FiniteCheck("unit", 3, {"a": (np.full(1, np.nan),)}, {}).blocks == []
