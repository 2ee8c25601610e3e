"""Arrays and bytes go from unit to unit as a whole, in FMI 3, in step mode and in event mode."""

from fractions import Fraction
from typing import Any

import pytest
from native_units import Edited, native_fmu

from handover.cosim.exceptions import WiringError
from handover.cosim.fmu.event_instance import EventInstance
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

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
