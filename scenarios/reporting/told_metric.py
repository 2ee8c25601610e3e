"""Writes figures of merit with units that read well."""

import math
from collections.abc import Mapping
from typing import Any

from scenarios.campaign.shown_unit import unit_symbol


def told(metric: Mapping[str, Any]) -> str:
    """Write a metric with a unit that reads well: mm for small lengths, degrees, ms for small times, MB for memory."""
    value, unit = metric["value"], metric["unit"]
    if value is None:
        return "undefined"
    if unit == "m" and abs(value) < 1:
        return f"{value * 1000:.1f} mm"
    if unit == "s" and 0 < abs(value) < 0.1:
        return f"{value * 1000:.2f} ms"
    if unit == "m2" and abs(value) < 1e-2:
        return f"{value * 1e6:.4g} mm²"
    if unit == "rad":
        return f"{math.degrees(value):.2f}°"
    if unit == "B":
        return f"{value / 1e6:.0f} MB"
    return f"{value:.4g}" + ("" if unit == "1" else f" {unit_symbol(unit)}")
