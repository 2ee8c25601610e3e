"""A connection converts units where the dimension is the same, says so in the log, and rejects others."""

import itertools
import logging
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.cosim.native_units import Edited, native_fmu
from support.cosim.signals_of import port_of
from support.wording import Wording

from handover.cosim.exceptions import WiringError
from handover.cosim.fmu.event_instance import EventInstance
from handover.cosim.fmu.failures import NotFinite
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.stepping.transfers import FiniteCheck, ScaledCopy
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import PlacedUnit, System

QUANTITIES = ("angle", "length", "temperature")


def pair(fmi: int, **start: Any) -> tuple[System, PlacedUnit, PlacedUnit]:
    """Return a system of a unit that gives deg, mm and degC and one that takes rad, m and K, unwired."""
    s = System()
    return s, s.add("a", native_fmu("workshop", fmi), **start), s.add("b", native_fmu("si", fmi))


@pytest.mark.parametrize(("fmi", "compiled"), [(2, True), (3, False)])
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


def test_a_transformation_takes_the_conversions_place():
    s, a, b = pair(3, angle_in=30.0, length_in=125.0)
    s.connect(a.y.angle, b.u.angle_in, LinearTransformation(2.0, -1.0))
    s.connect(a.y.length, b.u.temperature_in, LinearTransformation(0.5))
    s.connect(a.y.temperature, b.u.length_in, LinearTransformation())
    with Master(s) as master:
        master.run(Fraction(1))
        found = [float(master.signals[f"b.{name}"]) for name in QUANTITIES]
    assert found == [59.0, 0.0, 62.5]


def test_what_cannot_be_transformed_is_refused(wording: Wording):
    s, a, b = pair(3)
    s.connect(a.y.angle, b.u.angle_in, LinearTransformation(float("nan")))
    s.connect(a.y.length, b.u.temperature_in)
    c, d = s.add("c", native_fmu("discrete_passer")), s.add("d", native_fmu("discrete_passer"))
    s.connect(c.y.count, d.u.count_in, LinearTransformation(2.0))
    e, f = s.add("e", native_fmu("array_passer")), s.add("f", native_fmu("binary_passer"))
    s.connect(e.y.y, f.u.u)
    with pytest.raises(WiringError) as caught:
        s.check()
    assert len(caught.value.faults) == 4
    wording.check(caught.value)


@pytest.mark.parametrize("source_type", ["float32", "float64"])
@pytest.mark.parametrize("target_type", ["float32", "float64"])
def test_widths_are_met_in_double_precision(source_type: str, target_type: str):
    source = np.array([0.1, -3.7, 1e7], dtype=source_type)
    target = np.zeros(3, dtype=target_type)
    ScaledCopy(target, source, LinearTransformation(1.1, 0.3))()
    expected = [np.dtype(target_type).type(float(x) * 1.1 + 0.3) for x in source]
    assert target.tolist() == [float(x) for x in expected]


DATA = b"\x00\xff" + bytes(range(100))


def last_row(system: System, name: str, options: MasterOptions) -> list[Any]:
    found: list[list[Any]] = []
    with Master(system, options) as master:
        master.run(Fraction(3, 10), [lambda _t, y: found.append(y[name].tolist())])
    return found[-1]


def chain(*names: str, **start: Any) -> System:
    """Units one after the other, each of which passes `u` on as `y`."""
    s = System()
    units = [s.add(f"u{i}", native_fmu(name), **(start if i == 0 else {})) for i, name in enumerate(names)]
    for source, target in itertools.pairwise(units):
        s.connect(source.y.y, target.u.u)
    return s


@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL])
@pytest.mark.parametrize(
    ("names", "given", "comes"),
    [
        pytest.param(("array_passer",) * 3, [1.0, -2.0, 3.5], [1.0, -2.0, 3.5], id="array"),
        pytest.param(("binary_passer",) * 3, DATA, list(DATA), id="bytes"),
        pytest.param(("binary_passer", "bytes_keeper", "binary_passer"), DATA, list(DATA), id="bytes at events"),
    ],
)
def test_arrays_and_bytes_go_through_units(names: tuple[str, ...], given: Any, comes: list[Any], algorithm: Algorithm):
    assert last_row(chain(*names, u=given), "u2.y", MasterOptions(algorithm=algorithm)) == comes


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
    assert ["an integer is not an enumeration" in line for line in s.tolerated] == [True]
    with pytest.raises(WiringError, match="an integer is not an enumeration"):
        Master(s, MasterOptions(strict=True))
    assert last_row(s, "target.count", MasterOptions(compiled=compiled)) == 5


def check_of(values: NDArray[np.float64], *names: str) -> FiniteCheck:
    """Check equal parts of an array, which are outputs of these names."""
    parts = dict(zip(names, np.split(values, len(names)), strict=True))
    ports = {n: (port_of(n, v, fmi_type="Float64"), [f"reader.{n}"]) for n, v in parts.items()}
    return FiniteCheck("unit", 3, {n: (v,) for n, v in parts.items()}, ports)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_the_element_that_is_not_finite_is_named(value: float):
    values = np.array([1.7e308, -1.7e308, 5e-324, 1.7e308, 0.0, 0.0])
    check = check_of(values, "a", "b", "c")
    assert len(check.blocks) == 1  # as they follow each other
    for at in range(6):
        check(0.0)
        before, values[at] = values[at], value
        with pytest.raises(NotFinite) as caught:
            check(0.5)
        assert caught.value.element == f"{'abc'[at // 2]}[{at % 2 + 1}]"
        assert (caught.value.readers, caught.value.t) == ((f"reader.{'abc'[at // 2]}",), 0.5)
        values[at] = before
    assert FiniteCheck("unit", 3, {"a": (np.full(1, np.nan),)}, {}).blocks == []  # what feeds nobody
