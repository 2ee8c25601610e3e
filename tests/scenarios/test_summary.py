import sys

import pytest

from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.results.summary import metric_data, peak_memory
from handover.scenarios.results.tables import told


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_metric_that_is_not_finite_is_null_and_told_as_undefined(value: float):
    made = metric_data(Metric(value, "m", "a length"))
    assert made == {"value": None, "unit": "m", "description": "a length"}
    assert told(made) == "undefined"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(0.1, "kg", "100 g"), (2e3, "Pa", "2 kPa"), (7.2e4, "s", "20 h"), (0.0123, "m", "12.3 mm"), (1.0, "rad", "57.3°")],
)
def test_a_metric_is_told_in_the_unit_in_which_pages_show_it(value: float, unit: str, text: str):
    assert told(metric_data(Metric(value, unit, ""))) == text


def test_without_the_system_telling_memory_there_is_no_figure_of_it(monkeypatch: pytest.MonkeyPatch):
    assert (peak_memory() or 0.0) > 1e6
    monkeypatch.setitem(sys.modules, "resource", None)
    assert peak_memory() is None
