"""Units are connected in one line: which inputs and outputs match, what is left and why, and what is ambiguous."""

import math
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from support.cosim.terminal_units import described_unit

from handover.cosim.blocks.units import BaseExponents, Unit
from handover.cosim.exceptions import WiringError
from handover.cosim.master.master import Master
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.system.conversion import LinearTransformation, conversion, exact_number
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import Connection, PortName, System
from handover.cosim.system.time_series import TimeSeries

FmuOf = Callable[..., Path]


def pair(fmu: FmuOf) -> System:
    s = System()
    s.add("mass", fmu("Mass"))
    s.add("spring", fmu("Spring"))
    return s


def test_all_inputs_of_a_unit_are_connected_that_match(fmu: FmuOf):
    s = pair(fmu)
    mass, spring = s.units["mass"], s.units["spring"]
    there, back = s.connect(mass.y, spring.u), s.connect(spring.y, mass.u)
    s.check()
    assert (there.connected, back.connected) == (("x",), ("f",))
    assert s.connections == [
        Connection(PortName("mass", "x"), PortName("spring", "x")),
        Connection(PortName("spring", "f"), PortName("mass", "f")),
    ]
    assert str(there) == "mass.x -> spring.x"


def test_one_line_gives_the_run_of_single_connections(fmu: FmuOf):
    def run(*, whole: bool) -> list[float]:
        s, x = pair(fmu), list[float]()
        mass, spring = s.units["mass"], s.units["spring"]
        if whole:
            s.connect(mass.y, spring.u)
            s.connect(spring.y, mass.u)
        else:
            s.connect(mass.y.x, spring.u.x)
            s.connect(spring.y.f, mass.u.f)

        def observe(t: float, signals: Signals) -> None:  # noqa: ARG001
            x.append(float(signals["mass.x"]))

        with Master(s) as master:
            assert isinstance(master.stepper, PlanStepper)
            master.run(Fraction(1), [observe])
        return x

    assert run(whole=True) == run(whole=False)
    assert len(set(run(whole=True))) > 10


def test_what_has_the_name_but_does_not_fit_is_left_with_the_reason(fmu: FmuOf):
    s = System()
    a, b = s.add("a", fmu("Echo")), s.add("b", fmu("Echo"))
    outputs, inputs = a.description.outputs, b.description.inputs
    matched = s.connect(a.y, b.u)
    fits = {
        n for n in inputs if n in outputs and inputs[n].kind is outputs[n].kind and inputs[n].shape == outputs[n].shape
    }
    assert set(matched.connected) == fits
    assert set(matched.left) == {n for n in inputs if n in outputs} - fits
    assert set(matched.unmatched) == {n for n in inputs if n not in outputs}


def test_a_single_connection_takes_precedence_before_and_after(fmu: FmuOf):
    s = pair(fmu)
    other = s.add("other", fmu("Mass"))
    mass, spring = s.units["mass"], s.units["spring"]
    s.connect(other.y.x, spring.u.x)
    matched = s.connect(mass.y, spring.u)
    assert dict(matched.left) == {"x": "other.x feeds it"}
    s.connect(spring.y, mass.u)
    s.connect(spring.y.f, mass.u.f)
    s.check()
    assert s.sources_of("spring") == {"x": PortName("other", "x")}
    assert s.sources_of("mass") == {"f": PortName("spring", "f")}


def test_values_over_time_take_the_place_of_a_match(fmu: FmuOf):
    s = pair(fmu)
    mass, spring = s.units["mass"], s.units["spring"]
    s.connect(spring.y, mass.u)
    s.follow(mass.u.f, TimeSeries([0.0, 1.0], [[0.0], [1.0]], linear=True))
    s.check()
    assert s.sources_of("mass") == {}
    assert dict(s.connect(spring.y, mass.u).left) == {"f": "it follows values over time"}


def test_an_input_that_two_units_match_is_refused_until_one_is_named(fmu: FmuOf):
    s = pair(fmu)
    other = s.add("other", fmu("Mass"))
    mass, spring = s.units["mass"], s.units["spring"]
    s.connect(mass.y, spring.u)
    s.connect(mass.y, spring.u)
    s.connect(other.y, spring.u)
    with pytest.raises(WiringError) as caught:
        s.check()
    assert caught.value.faults == (
        "spring.x: mass.y.x and other.y.x match it by name; connect the one that is meant: "
        "connect(mass.y.x, spring.u.x)",
    )
    s.disconnect(mass.y.x)
    s.check()
    assert s.sources_of("spring") == {"x": PortName("other", "x")}
    s.connect(mass.y, spring.u)
    s.connect(other.y.x, spring.u.x)
    s.check()


def test_of_three_units_that_match_one_is_named_when_another_was_taken_back(fmu: FmuOf):
    s = pair(fmu)
    mass, spring = s.units["mass"], s.units["spring"]
    others = [s.add(name, fmu("Mass")) for name in ("second", "third")]
    assert s.connect(mass.y, spring.u).connected == ("x",)
    for other in others:
        told = s.connect(other.y, spring.u)
        assert (told.connected, dict(told.left)) == ((), {"x": "mass.x matches it, too"})
    s.disconnect(mass.y.x)
    with pytest.raises(WiringError, match=r"second\.y\.x and third\.y\.x match it by name"):
        s.check()
    s.connect(others[1].y.x, spring.u.x)
    s.check()
    assert s.sources_of("spring") == {"x": PortName("third", "x")}


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


def test_a_transformation_of_whole_units_is_refused(fmu: FmuOf):
    s = pair(fmu)
    mass, spring = s.units["mass"], s.units["spring"]
    given: Any = (mass.y, spring.u, LinearTransformation(2.0))
    with pytest.raises(TypeError, match=r"a transformation is for one connection: give unit\.y\.NAME"):
        s.connect(*given)


def test_units_of_which_nothing_matches_are_refused(fmu: FmuOf):
    s = System()
    a, b = s.add("a", fmu("Mass")), s.add("b", fmu("Mass"))
    s.connect(a.y, b.u)
    with pytest.raises(WiringError, match=r"a\.y -> b\.u: no output has the name of an input; a has x.*, b f"):
        s.check()


def test_ends_that_are_no_outputs_and_inputs_are_refused(fmu: FmuOf):
    s = pair(fmu)
    mass, spring = s.units["mass"], s.units["spring"]
    with pytest.raises(TypeError, match=r"mass\.u are its inputs: what feeds stands first; did you mean mass\.y"):
        s.connect(mass.u, spring.u)
    with pytest.raises(TypeError, match="is one port or terminal, and the other end all of a unit"):
        s.connect(mass.y, spring.u.x)  # type: ignore


def test_units_are_told_from_their_ports(fmu: FmuOf):
    s, other = pair(fmu), System()
    mass, spring = s.units["mass"], s.units["spring"]
    with pytest.raises(TypeError, match=r"^mass is a unit, and its ports are connected: give mass\.y, or"):
        s.connect(mass, spring)  # type: ignore
    with pytest.raises(ValueError, match=r"^mass\.y: this system has no unit 'mass'"):
        other.connect(mass.y, spring.u)


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


def test_a_number_that_is_near_nothing_is_taken_as_it_stands():
    yard = 0.9143987654321234
    assert float(exact_number(yard)) == yard
    assert exact_number(-0.25) == -1 / 4


@pytest.mark.parametrize(
    ("linear", "text"),
    [
        (LinearTransformation(2.0), "times 2"),
        (LinearTransformation(1.0, 273.15), "plus 273.15"),
        (LinearTransformation(1.8, 32.0), "times 1.8, plus 32"),
    ],
)
def test_a_conversion_says_what_it_does(linear: LinearTransformation, text: str):
    assert str(linear) == text
