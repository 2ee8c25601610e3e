"""A connection converts units where the dimension is the same, says so in the log, and rejects others."""

import logging
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.cosim.native_units import Edited, native_fmu
from support.cosim.signals_of import port_of

from handover.cosim.exceptions import WiringError
from handover.cosim.fmu.event_instance import EventInstance
from handover.cosim.fmu.failures import NotFinite
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.stepping.transfers import FiniteCheck, ScaledCopy
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.signals import Signals
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


ALGORITHMS = [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL]
DATA = b"\x00\xff" + bytes(range(100))


def last_row(system: System, name: str, options: MasterOptions) -> list[Any]:
    found: list[list[Any]] = []

    def observe(t: float, y: Signals) -> None:  # noqa: ARG001
        found.append(y[name].tolist())

    with Master(system, options) as master:
        master.run(Fraction(3, 10), [observe])
    return found[-1]


def chain(first: str, *others: str, **start: Any) -> System:
    """Units one after the other, each of which passes `u` on as `y`."""
    s = System()
    units = [s.add("u0", native_fmu(first), **start)]
    for i, name in enumerate(others):
        units.append(s.add(f"u{i + 1}", native_fmu(name)))
        s.connect(units[-2].y.y, units[-1].u.u)
    return s


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_array_goes_through_units(algorithm: Algorithm):
    s = chain("array_passer", "array_passer", "array_passer", u=[1.0, -2.0, 3.5])
    assert last_row(s, "u2.y", MasterOptions(algorithm=algorithm)) == [1.0, -2.0, 3.5]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("names", [("binary_passer",) * 3, ("binary_passer", "bytes_keeper", "binary_passer")])
def test_bytes_go_through_units(names: tuple[str, ...], algorithm: Algorithm):
    assert last_row(chain(*names, u=DATA), "u2.y", MasterOptions(algorithm=algorithm)) == list(DATA)


def test_bytes_come_at_an_event_and_only_when_they_change():
    """Only what is in the buffers counts, not where it lies."""
    s = chain("binary_passer", "bytes_keeper", u=DATA)
    with Master(s) as master:
        master.run(Fraction(1, 5))
        unit = master.ensemble.instances["u1"]
        assert isinstance(unit, EventInstance)
        assert not unit.wants_inputs()
        unit.u["u"][1][0] -= 1
        assert unit.wants_inputs()


def test_arrays_of_other_lengths_and_other_bytes_are_refused():
    s = chain("array_passer", "binary_passer")
    with pytest.raises(WiringError, match=r"u0.y \(real \[3\] m\) -> u1.u \(binary application/x-native\)"):
        Master(s)


@pytest.mark.parametrize("compiled", [True, False])
def test_bytes_go_from_an_array_of_one_to_a_scalar(edited: Edited, compiled: bool):
    s = System()
    output = (
        '<Binary name="y" valueReference="2" causality="output" variability="discrete" mimeType="application/x-native"'
    )
    one = f"{output} />", f'{output}><Dimension start="1"/></Binary>'
    first = s.add("u0", edited("binary_passer", 3, one), u=DATA)
    second = s.add("u1", native_fmu("binary_passer"))
    s.connect(first.y.y, second.u.u)
    assert ["u0.y (binary [1]" in line for line in s.tolerated] == [True]
    assert last_row(s, "u1.y", MasterOptions(compiled=compiled)) == list(DATA)


@pytest.mark.parametrize("compiled", [True, False])
def test_an_integer_goes_to_an_enumeration(edited: Edited, compiled: bool):
    kinds = "<TypeDefinitions><SimpleType name='E'><Enumeration><Item name='off' value='0'/><Item name='on' value='5'/>"
    item = ("<DefaultExperiment", f"{kinds}</Enumeration></SimpleType></TypeDefinitions><DefaultExperiment")
    counted = ('<Integer start="0" />', '<Enumeration declaredType="E" start="0" />')
    s = System()
    source = s.add("source", native_fmu("discrete_passer", 2), count_in=5)
    target = s.add("target", edited("discrete_passer", 2, item, counted))
    s.connect(source.y.count, target.u.count_in)
    assert ["an integer is no enumeration" in line for line in s.tolerated] == [True]
    with pytest.raises(WiringError, match="an integer is no enumeration"):
        Master(s, MasterOptions(strict=True))
    assert last_row(s, "target.count", MasterOptions(compiled=compiled)) == 5


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
