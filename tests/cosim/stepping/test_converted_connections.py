"""A connection converts units where the dimension is the same, says so in the log, and rejects others."""

import logging
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from native_units import native_fmu

from handover.cosim.exceptions import WiringError
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.stepping.transfers import ScaledCopy
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import PlacedUnit, System

QUANTITIES = ("angle", "length", "temperature")


def pair(fmi: int, **start: Any) -> tuple[System, PlacedUnit, PlacedUnit]:
    """Return a system of a unit that gives deg, mm and degC and one that takes rad, m and K, unwired."""
    s = System()
    return s, s.add("a", native_fmu("workshop", fmi), **start), s.add("b", native_fmu("si", fmi))


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("fmi", [2, 3])
def test_degrees_millimetres_and_celsius_arrive_in_si_units(fmi: int, compiled: bool, caplog: pytest.LogCaptureFixture):
    s, a, b = pair(fmi, angle_in=30.0, length_in=125.0, temperature_in=20.0)
    for name in QUANTITIES:
        s.connect(getattr(a.y, name), getattr(b.u, f"{name}_in"))
    with (
        caplog.at_level(logging.INFO, "handover.cosim.stepping.transfers"),
        Master(s, MasterOptions(compiled=compiled)) as master,
    ):
        at_start = [float(master.signals[f"b.{name}"]) for name in QUANTITIES]
        master.run(Fraction(1))
        at_end = [float(master.signals[f"b.{name}"]) for name in QUANTITIES]
    assert at_start == at_end == [30 * 0.017453292519943295, 0.125, 293.15]
    output = [r.getMessage() for r in caplog.records if r.levelno == logging.INFO]
    assert output == [
        "a.angle (deg) -> b.angle_in (rad): times 0.0174533",
        "a.length (mm) -> b.length_in (m): times 0.001",
        "a.temperature (degC) -> b.temperature_in (K): plus 273.15",
    ]


def test_other_dimensions_are_refused_with_both_ends():
    s, a, b = pair(3)
    s.connect(a.y.length, b.u.temperature_in)
    with pytest.raises(WiringError) as caught:
        s.check()
    (fault,) = caught.value.faults
    assert fault == "a.length (real mm) -> b.temperature_in (real K): their units differ in dimension"


def test_a_transformation_takes_the_conversions_place():
    s, a, b = pair(3, angle_in=30.0, length_in=125.0)
    s.connect(a.y.angle, b.u.angle_in, LinearTransformation(2.0, -1.0))
    s.connect(a.y.length, b.u.temperature_in, LinearTransformation(0.5))
    s.connect(a.y.temperature, b.u.length_in, LinearTransformation())
    with Master(s) as master:
        master.run(Fraction(1))
        found = [float(master.signals[f"b.{name}"]) for name in QUANTITIES]
    assert found == [59.0, 0.0, 62.5]


def test_a_transformation_is_for_finite_reals():
    s, a, b = pair(3)
    s.connect(a.y.angle, b.u.angle_in, LinearTransformation(float("nan")))
    c, d = s.add("c", native_fmu("discrete_passer")), s.add("d", native_fmu("discrete_passer"))
    s.connect(c.y.count, d.u.count_in, LinearTransformation(2.0))
    with pytest.raises(WiringError) as caught:
        s.check()
    first, second = caught.value.faults
    assert "must be finite numbers" in first
    assert second.endswith("integer takes no linear transformation")


@pytest.mark.parametrize("source_type", ["float32", "float64"])
@pytest.mark.parametrize("target_type", ["float32", "float64"])
def test_widths_are_met_in_double_precision(source_type: str, target_type: str):
    source = np.array([0.1, -3.7, 1e7], dtype=source_type)
    target = np.zeros(3, dtype=target_type)
    ScaledCopy(target, source, LinearTransformation(1.1, 0.3))()
    expected = [np.dtype(target_type).type(float(x) * 1.1 + 0.3) for x in source]
    assert target.tolist() == [float(x) for x in expected]
