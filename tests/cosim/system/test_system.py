from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from support.cosim.native_units import Edited, native_fmu

from handover.cosim.blocks.start_values import numbers_of
from handover.cosim.blocks.units import UNKNOWN, BaseExponents, Unit
from handover.cosim.blocks.variable import Causality, Kind, Variable
from handover.cosim.exceptions import InvalidFmu, WiringError
from handover.cosim.fmu.file.default_experiment import proposed_step
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.system.system import PortName, System
from handover.cosim.system.wiring_faults import doubt, mismatch, obstacle

M, NM = BaseExponents(m=1), BaseExponents(kg=1, m=2, s=-2)

FmuOf = Callable[..., Path]


def faults_of(system: System) -> tuple[str, ...]:
    with pytest.raises(WiringError) as caught:
        system.check()
    return caught.value.faults


def test_a_sound_system_passes(fmu: FmuOf):
    s = System()
    mass, spring = s.add("mass", fmu("Mass"), m=2.0), s.add("spring", fmu("Spring"))
    s.connect(mass.y.x, spring.u.x)
    s.connect(spring.y.f, mass.u.f)
    s.check()


def test_units_and_kinds_and_shapes_must_agree(fmu: FmuOf):
    s = System()
    mass, counter, echo = s.add("mass", fmu("Mass")), s.add("counter", fmu("Counter")), s.add("echo", fmu("Echo"))
    s.connect(mass.y.x, mass.u.f)
    s.connect(counter.y.at, echo.u.n)
    s.connect(counter.y.at, echo.u.pair)
    unit, kind, shape = faults_of(s)
    assert unit == "mass.x (real m) -> mass.f (real N): their units differ in dimension"
    assert kind == "counter.at (real) -> echo.n (integer): real cannot feed integer"
    assert shape == "counter.at (real) -> echo.pair (real [2]): their shapes differ"


def test_unknown_names_are_reported_with_the_nearest_valid_ones(fmu: FmuOf):
    s = System()
    mass, spring = s.add("mass", fmu("Mass"), mas=1.0), s.add("spring", fmu("Spring"))
    s.connect(mass.y.xx, spring.u.x)
    s.connect(mass.y.x, spring.u.stretch)
    s.connect(mass.u.f, spring.u.x)
    s.connect(mass.y.x, spring.y.f)
    text = "\n".join(faults_of(s))
    assert "mass has no parameter or input 'mas'; did you mean m" in text
    assert "mass has no output 'xx'; did you mean x?" in text
    assert "spring has no input 'stretch'; valid: x" in text
    assert "mass.f is an input, not an output" in text
    assert "spring.f is an output, not an input" in text


def test_a_connection_to_a_unit_that_is_not_there_is_reported(fmu: FmuOf):
    s, other = System(), System()
    s.add("spring", fmu("Spring"))
    spring = other.add("sprint", fmu("Spring"))
    s.connect(spring.y.f, spring.u.x)
    text = "\n".join(faults_of(s))
    assert "there is no unit 'sprint'; did you mean spring?" in text


def test_an_input_is_fed_once(fmu: FmuOf):
    s = System()
    a, b, spring = s.add("a", fmu("Mass")), s.add("b", fmu("Mass")), s.add("spring", fmu("Spring"))
    s.connect(a.y.x, spring.u.x)
    s.connect(b.y.x, spring.u.x)
    assert faults_of(s) == ("spring.x is fed twice: by a.x and by b.x",)


def test_values_out_of_range_or_of_the_wrong_kind_are_reported(fmu: FmuOf):
    s = System()
    s.add("a", fmu("Mass"), m=-1.0)
    s.add("b", fmu("Mass"), m="heavy")
    s.add("a", fmu("Mass"), period=Fraction(0))
    text = "\n".join(faults_of(s))
    assert "a.m" not in text  # the second a took its place, and is what is wrong
    assert "b.m: 'heavy' is not a number in kg" in text
    assert "two units are called 'a'" in text
    assert "give one that is above 0 s" in text


def test_range_faults_name_the_range(fmu: FmuOf):
    s = System()
    s.add("a", fmu("Mass"), m=-1.0)
    assert faults_of(s) == ("a.m: -1.0 is out of range: from 0.001 to 100 kg",)


@pytest.mark.parametrize(
    ("content", "text"),
    [(None, "no such file"), (b"no zip", "not an FMU"), (b"", "not an FMU")],
)
def test_a_file_that_is_no_fmu_is_refused(tmp_path: Path, content: bytes | None, text: str):
    file = tmp_path / "some.fmu"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InvalidFmu, match=text):
        System().add("x", file)


def test_both_standards_describe_a_unit_alike(fmu: FmuOf):
    s = System()
    for name in ("Mass", "Spring"):
        a, b = (s.add(f"{name}{v}", fmu(name, v)).description for v in (2, 3))
        for x, y in ((a.inputs, b.inputs), (a.outputs, b.outputs), (a.parameters, b.parameters)):
            assert list(x) == list(y)
            assert [(p.name, p.signature, p.minimum, p.maximum) for p in x.values()] == [
                (p.name, p.signature, p.minimum, p.maximum) for p in y.values()
            ]
        assert a.feedthrough == b.feedthrough


@pytest.mark.parametrize(
    ("a", "b", "fault"),
    [
        (Unit("N.m", NM), Unit("Nm", NM), None),
        (Unit("m", M), UNKNOWN, None),
        (Unit("m", defined=False), Unit("m", M), None),
        (Unit("furlong", defined=False), Unit("m", M), "the unit 'furlong' is not defined in its FMU"),
        (Unit("mm", M, 1e-3), Unit("m", M), None),
        (Unit("mm", M, 0.0), Unit("m", M), "the unit 'mm' has the factor 0.0"),
        (Unit("m", M), Unit("N.m", NM), "differ in dimension"),
    ],
)
def test_units_are_compared_by_what_they_mean(a: Unit, b: Unit, fault: str | None):
    output, target = (
        FmuPort(name="x", kind=Kind.REAL, causality=Causality.OUTPUT, fmi_type="Float64", references=(1,), unit=u)
        for u in (a, b)
    )
    found = mismatch(output, target)
    assert (found is None) if fault is None else (found is not None and fault in found)
    assert (doubt(output, target) is not None) == (a.symbol == "furlong")  # else it can be connected, or cannot


@pytest.mark.parametrize(
    ("a", "b", "is_connected"),
    [
        ((Kind.INTEGER, ()), (Kind.ENUMERATION, ()), True),
        ((Kind.ENUMERATION, ()), (Kind.INTEGER, ()), False),
        ((Kind.BINARY, (1,)), (Kind.BINARY, ()), True),
        ((Kind.BINARY, ()), (Kind.BINARY, (1,)), True),
        ((Kind.BINARY, (2,)), (Kind.BINARY, ()), False),
        ((Kind.REAL, (1,)), (Kind.INTEGER, ()), False),
    ],
)  # fmt: skip
def test_what_holds_the_same_values_can_be_connected_with_a_line(a: Any, b: Any, is_connected: bool):
    output, target = (
        FmuPort(name="x", kind=kind, shape=shape, causality=Causality.OUTPUT, fmi_type="", references=(1,))
        for kind, shape in (a, b)
    )
    assert mismatch(output, target) is not None
    assert (obstacle(output, target) is None) is is_connected
    assert not is_connected or doubt(output, target)


@pytest.mark.parametrize(
    ("text", "meant"),
    [(0.0333333, Fraction(1, 30)), (0.02, Fraction(1, 50)), (0.012, Fraction(3, 250)), (1e-7, Fraction(1, 10**7))],
)
def test_a_proposed_step_is_taken_as_it_is_meant(text: float, meant: Fraction):
    assert proposed_step(text) == meant


def test_large_integers_keep_their_digits():
    seed = Variable(name="seed", kind=Kind.INTEGER, causality=Causality.PARAMETER, start=0)
    assert numbers_of(seed, 2**53 + 1).tolist() == [2**53 + 1]


def test_a_port_is_distinguished_from_a_name(fmu: FmuOf):
    s = System()
    mass = s.add("mass", str(fmu("Mass")))
    wrong: Any = "mass.x"
    with pytest.raises(TypeError, match=r"'mass\.x' is not a port: give unit\.y\.NAME"):
        s.connect(wrong, mass.u.f)
    assert not s.connections


def test_a_period_must_be_exact_and_above_0(fmu: FmuOf):
    s = System()
    inexact: Any = 0.01
    with pytest.raises(TypeError, match=r"mass: period = 0\.01 is not exact.*give Fraction\('1/100'\)"):
        s.add("mass", fmu("Mass"), period=inexact)
    s.add("mass", fmu("Mass"), period=Fraction(0))
    assert faults_of(s) == ("mass: its communication step is 0 s; give one that is above 0 s",)


def test_all_units_get_one_step():
    s = System()
    s.add("slow", native_fmu("gain", 2), period=Fraction(1, 3))
    s.add("own", native_fmu("gain", 3))
    s.set_step(Fraction(1, 500))
    assert {u.period for u in s.units.values()} == {Fraction(1, 500)}
    s.check()


def test_a_port_whose_name_is_no_identifier_is_named_by_key(edited: Edited):
    file = edited("mass", 2, ('name="x"', 'name="der(x) / a b"'))
    system = System()
    first, second = system.add("first", file), system.add("second", file)
    assert first.y["der(x) / a b"] == PortName("first", "der(x) / a b")
    assert second.u["f"] == second.u.f
    system.connect(first.y["der(x) / a b"], second.u.f)
    assert any("first.der(x) / a b (real m)" in fault for fault in faults_of(system))  # m is no N
