"""Units are connected in one line: which inputs and outputs match, what is left and why, and what is ambiguous."""

import math
from pathlib import Path
from typing import Any

import pytest
from support.cosim.fmu_of import FmuOf
from support.cosim.terminal_units import described_unit
from support.wording import Wording

from handover.cosim.blocks.units import BaseExponents, Unit
from handover.cosim.exceptions import WiringError
from handover.cosim.system.conversion import LinearTransformation, conversion, exact_number
from handover.cosim.system.system import Connection, PortName, System
from handover.cosim.system.time_series import TimeSeries


@pytest.fixture
def s(fmu: FmuOf) -> System:
    """Two masses and a spring, unwired."""
    system = System()
    for name in ("mass", "spring", "other"):
        system.add(name, fmu("Spring" if name == "spring" else "Mass"))
    return system


def test_all_inputs_of_a_unit_are_connected_that_match(s: System):
    mass, spring = s.units["mass"], s.units["spring"]
    there, back = s.connect(mass.y, spring.u), s.connect(spring.y, mass.u)
    s.check()
    assert (there.connected, back.connected) == (("x",), ("f",))
    assert s.connections == [
        Connection(PortName("mass", "x"), PortName("spring", "x")),
        Connection(PortName("spring", "f"), PortName("mass", "f")),
    ]
    assert str(there) == "mass.x -> spring.x"


def test_what_has_the_name_but_does_not_fit_is_left_with_the_reason(tmp_path: Path, wording: Wording):
    s = System()
    a = s.add("a", described_unit(tmp_path / "a.fmu", {}, {"x": "m", "y": "N", "v": "m 3"}))
    b = s.add("b", described_unit(tmp_path / "b.fmu", {"x": "m", "y": "m", "v": "m 2", "z": "m"}, {}))
    matched = s.connect(a.y, b.u)
    assert (set(matched.connected), set(matched.left), set(matched.unmatched)) == ({"x"}, {"y", "v"}, {"z"})
    wording.check(matched)


def test_a_single_connection_or_values_over_time_take_precedence_before_and_after(s: System):
    mass, spring, other = (s.units[name] for name in ("mass", "spring", "other"))
    s.connect(other.y.x, spring.u.x)
    assert dict(s.connect(mass.y, spring.u).left) == {"x": "other.x feeds it"}
    s.connect(spring.y, mass.u)
    s.connect(spring.y.f, mass.u.f)
    s.check()
    assert s.sources_of("spring") == {"x": PortName("other", "x")}
    assert s.sources_of("mass") == {"f": PortName("spring", "f")}
    s.connect(spring.y, other.u)
    s.follow(other.u.f, TimeSeries([0.0, 1.0], [[0.0], [1.0]], linear=True))
    s.check()
    assert s.sources_of("other") == {}
    assert dict(s.connect(spring.y, other.u).left) == {"f": "it follows values over time"}


def test_an_input_that_several_units_match_is_refused_until_one_is_named(s: System, fmu: FmuOf, wording: Wording):
    mass, spring, other = (s.units[name] for name in ("mass", "spring", "other"))
    third = s.add("third", fmu("Mass"))
    for _ in range(2):
        assert s.connect(mass.y, spring.u).connected == ("x",)
    for unit in (other, third):
        reported = s.connect(unit.y, spring.u)
        assert (reported.connected, dict(reported.left)) == ((), {"x": "mass.x matches it, too"})
    for taken_back in (None, mass.y.x):
        if taken_back is not None:
            s.disconnect(taken_back)
        with pytest.raises(WiringError) as caught:
            s.check()
        wording.check(caught.value)
    s.disconnect(third.y.x)
    s.check()
    assert s.sources_of("spring") == {"x": PortName("other", "x")}
    s.connect(mass.y, spring.u)
    s.connect(mass.y.x, spring.u.x)
    s.check()
    assert s.sources_of("spring") == {"x": PortName("mass", "x")}


def test_of_outputs_that_match_one_input_those_that_are_preferred_stay(tmp_path: Path):
    s = System()
    given = {"x": "m", "y": "m"}
    a, b = (s.add(name, described_unit(tmp_path / f"{name}.fmu", {}, given)) for name in "ab")
    c = s.add("c", described_unit(tmp_path / "c.fmu", {"y": "m", "x": "m", "z": "m"}, {}))
    s.connect(a.y, c.u)
    s.connect(b.y, c.u)
    assert s.prefer_matches(lambda output: output == b.y.x) == {c.u.y: [a.y.y, b.y.y]}
    s.check()
    assert s.connections == [Connection(b.y.x, c.u.x)]
    assert s.sources_of("c") == {"x": b.y.x}
    s.connect(a.y.y, c.u.y)
    s.check()


def test_ends_that_are_no_outputs_and_inputs_are_refused(s: System, wording: Wording):
    mass, spring, elsewhere = s.units["mass"], s.units["spring"], System()
    ends: list[tuple[System, tuple[Any, ...]]] = [
        (s, (mass.y, spring.u, LinearTransformation(2.0))),
        (s, (mass.u, spring.u)),
        (s, (mass.y, spring.u.x)),
        (s, (mass, spring)),
        (elsewhere, (mass.y, spring.u)),
    ]
    for system, given in ends:
        with pytest.raises(ValueError if system is elsewhere else TypeError) as refused:
            system.connect(*given)
        wording.check(refused.value)
    s.connect(mass.y, s.units["other"].u)  # of which nothing matches
    with pytest.raises(WiringError) as caught:
        s.check()
    wording.check(caught.value)


ANGLE, LENGTH, TEMPERATURE = BaseExponents(rad=1), BaseExponents(m=1), BaseExponents(K=1)
RAD, METRE, KELVIN = Unit("rad", ANGLE), Unit("m", LENGTH), Unit("K", TEMPERATURE)
DEG, GRAD = Unit("deg", ANGLE, math.pi / 180), Unit("grad", ANGLE, math.pi / 200)
MILLIMETRE, MICROMETRE = Unit("mm", LENGTH, 1e-3), Unit("um", LENGTH, 1e-6)
CELSIUS, FAHRENHEIT = Unit("degC", TEMPERATURE, 1.0, 273.15), Unit("degF", TEMPERATURE, 5 / 9, 273.15 - 32 * 5 / 9)


@pytest.mark.parametrize(
    ("source", "target", "expected"),
    [
        (DEG, RAD, LinearTransformation(0.017453292519943295)),
        (RAD, DEG, LinearTransformation(57.29577951308232)),
        (DEG, GRAD, LinearTransformation(10 / 9)),
        (Unit("deg", ANGLE, 0.0174532925199433), RAD, LinearTransformation(0.017453292519943295)),
        (MILLIMETRE, METRE, LinearTransformation(0.001)),
        (METRE, MILLIMETRE, LinearTransformation(1000.0)),
        (MILLIMETRE, MICROMETRE, LinearTransformation(1000.0)),
        (CELSIUS, KELVIN, LinearTransformation(1.0, 273.15)),
        (KELVIN, CELSIUS, LinearTransformation(1.0, -273.15)),
        (FAHRENHEIT, CELSIUS, LinearTransformation(5 / 9, -17.77777777777778)),
        (CELSIUS, FAHRENHEIT, LinearTransformation(1.8, 32.0)),
        (Unit("km/h", LENGTH, 0.277777777777778), METRE, LinearTransformation(5 / 18)),
    ],
    ids=lambda x: x.symbol if isinstance(x, Unit) else "",
)
def test_a_conversion_is_rounded_once(source: Unit, target: Unit, expected: LinearTransformation):
    assert conversion(source, target) == expected


def test_a_number_that_is_near_nothing_is_taken_as_it_stands_and_a_conversion_says_what_it_does():
    yard = 0.9143987654321234
    assert float(exact_number(yard)) == yard
    assert exact_number(-0.25) == -1 / 4
    conversions = [LinearTransformation(*x) for x in ((2.0,), (1.0, 273.15), (1.8, 32.0))]
    assert [str(x) for x in conversions] == ["times 2", "plus 273.15", "times 1.8, plus 32"]
