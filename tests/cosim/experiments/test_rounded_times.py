"""Times of a table that are rounded are ends of steps; others stay as they are."""

from fractions import Fraction

import pytest

from handover.cosim.experiments.experiment_run import communication_points
from handover.cosim.experiments.signal_table import read_table


@pytest.mark.parametrize("varies_step", [False, True])
def test_times_with_few_digits_are_ends_of_steps(varies_step: bool):
    step = Fraction(1, 30)
    table = read_table(b"time\n0\n0.0333333\n0.06666667\n1.0e-1\n0.13333\n", "in.csv", {}).snapped(Fraction(0), step)
    assert communication_points(table.times, (), step, varies_step=varies_step) == [k * step for k in range(5)]


@pytest.mark.parametrize(
    ("rows", "wanted"),
    [("0\n0.035\n", [0.0, 0.035]), ("0\n0.03333\n0.03334\n", [0.0, 0.03333, 0.03334]), ("0\n1\n", [0.0, 1.0]),
     ("0e-99999999999999999999\n1\n", [0.0, 1.0])],
)  # fmt: skip
def test_times_within_a_step_stay(rows: str, wanted: list[float]):
    table = read_table(f"time\n{rows}".encode(), "in.csv", {}).snapped(Fraction(0), Fraction(1, 30))
    assert [float(t) for t in table.times] == wanted
