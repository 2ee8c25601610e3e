"""Writes figures of merit with units that read well."""

from collections.abc import Mapping
from typing import Any

from handover.scenarios.experiment.display_unit import shown_unit


def told(metric: Mapping[str, Any]) -> str:
    """Write a metric, as `summary.json` has it, in the unit in which pages show such a value."""
    value, unit = metric["value"], metric["unit"]
    return "undefined" if value is None else shown_unit(unit, value).text(value)
