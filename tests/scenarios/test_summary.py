import sys

import pytest

from scenarios import runner
from scenarios.experiment import Metric
from scenarios.report import told


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_metric_that_is_not_finite_is_null_and_told_as_undefined(value: float):
    made = runner._metric(Metric(value, "m", "a length"))  # pyright: ignore[reportPrivateUsage]
    assert made == {"value": None, "unit": "m", "description": "a length"}
    assert told(made) == "undefined"


def test_without_the_system_telling_memory_there_is_no_figure_of_it(monkeypatch: pytest.MonkeyPatch):
    assert (runner._peak_memory() or 0.0) > 1e6  # pyright: ignore[reportPrivateUsage]
    monkeypatch.setitem(sys.modules, "resource", None)
    assert runner._peak_memory() is None  # pyright: ignore[reportPrivateUsage]
