"""What is wrong with a system is found before anything starts, all at once."""

from copy import copy
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import Edited, native_fmu
from support.wording import Wording

from handover.cosim.blocks.units import UNKNOWN, BaseExponents, Unit
from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.exceptions import InvalidFmu, NotExportable, WiringError
from handover.cosim.fmu.file.default_experiment import proposed_step
from handover.cosim.fmu.file.description import FmuPort, describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import PortName, System
from handover.cosim.system.time_series import TimeSeries
from handover.cosim.system.wiring_faults import doubt, mismatch, obstacle
from handover.cosim.typed_data import InvalidData, checked
from handover.cosim.typed_data import PortName as ReadName

M, NM = BaseExponents(m=1), BaseExponents(kg=1, m=2, s=-2)


def faults_of(s: System) -> tuple[str, ...]:
    with pytest.raises(WiringError) as refused:
        Master(s)
    return refused.value.faults


def test_all_faults_are_reported_at_once_with_what_is_valid(fmu: FmuOf, wording: Wording):
    s = System()
    mass, spring = s.add("mass", fmu("Mass"), mas=1.0, m=-1.0), s.add("spring", fmu("Spring"), k="stiff")
    counter, echo = s.add("counter", fmu("Counter")), s.add("echo", fmu("Echo"))
    s.add("twice", fmu("Mass"), m=-1.0)
    s.add("twice", fmu("Mass"), period=Fraction(0))  # takes its place, and is what is wrong
    for source, target in (
        (mass.y.x, mass.u.f),  # units
        (counter.y.at, echo.u.n),  # kinds
        (counter.y.at, echo.u.pair),  # shapes
        (mass.y.xx, spring.u.x),  # names
        (mass.y.x, spring.u.stretch),
        (mass.u.f, spring.u.x),  # ends
        (mass.y.x, spring.y.f),
        (PortName("sprint", "f"), spring.u.x),
    ):
        s.connect(source, target)
    faults = faults_of(s)
    assert not any("twice.m" in fault for fault in faults)
    wording.check("\n".join(faults))


def test_an_input_is_fed_once(fmu: FmuOf):
    s = System()
    a, b, spring = s.add("a", fmu("Mass")), s.add("b", fmu("Mass")), s.add("spring", fmu("Spring"))
    s.connect(a.y.x, spring.u.x)
    s.check()
    s.connect(b.y.x, spring.u.x)
    assert faults_of(s) == ("spring.x is fed twice: by a.x and by b.x",)


@pytest.mark.parametrize("name", ["arm", "system.arm", "a/b", " the arm", ".", "", " ", "\t", "a\nb", "\n.a", "a\0"])
def test_a_unit_can_be_called_as_a_ports_name_that_is_read_begins(fmu: FmuOf, name: str):
    s, is_read = System(), True
    s.add(name, fmu("Mass"))
    try:
        checked([f"{name}.x"], list[ReadName])
    except InvalidData:
        is_read = False
    assert is_read == (name.strip() != "" and name.isprintable())
    if is_read:
        s.check()
    else:
        assert len(faults_of(s)) == 1


def test_two_outputs_have_two_names(fmu: FmuOf):
    s = System()
    mass = describe_fmu(fmu("Mass"))
    s.add("a", replace(mass, outputs={"b.x": mass.outputs["x"]}))
    s.check()
    s.add("a.b", mass)
    (fault,) = faults_of(s)
    assert "a.b.x" in fault


def test_an_entry_of_an_array_is_refused_with_what_connects_it(fmu: FmuOf):
    s = System()
    counter, spring = s.add("counter", fmu("Counter")), s.add("spring", fmu("Spring"))
    with pytest.raises(TypeError, match=r"^counter\.pair\[1\]: .*a block of yours"):
        s.connect(counter.y.pair[1], spring.u.x)
    s.connect(counter.y["pair[1]"], spring.u.x)
    (fault,) = faults_of(s)
    assert "a block of yours" in fault


@pytest.mark.parametrize("content", [None, b"no zip", b""])
def test_a_file_that_is_no_fmu_is_refused(tmp_path: Path, content: bytes | None, wording: Wording):
    file = tmp_path / "some.fmu"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InvalidFmu) as refused:
        System().add("x", file)
    wording.check(refused.value)
    with pytest.raises(InvalidFmu, match=r"^Push: there is no such file; .* handover.unit\('Push'\)$"):
        System().add("x", "Push")


@pytest.mark.parametrize("name", ["Mass", "Spring"])
def test_both_standards_describe_a_unit_alike(fmu: FmuOf, name: str):
    a, b = (System().add("unit", fmu(name, fmi)).description for fmi in (2, 3))
    for x, y in ((a.inputs, b.inputs), (a.outputs, b.outputs), (a.parameters, b.parameters)):
        assert list(x) == list(y)
        assert [(p.name, p.signature, p.minimum, p.maximum) for p in x.values()] == [
            (p.name, p.signature, p.minimum, p.maximum) for p in y.values()
        ]
    assert a.feedthrough == b.feedthrough


def ends(*facts: dict[str, Any]) -> list[FmuPort]:
    x = FmuPort(name="x", kind=Kind.REAL, causality=Causality.OUTPUT, fmi_type="", references=(1,))
    return [replace(x, **each) for each in facts]


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
    output, target = ends({"unit": a}, {"unit": b})
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
)
def test_what_holds_the_same_values_can_be_connected_with_a_line(a: Any, b: Any, is_connected: bool):
    output, target = ends(*({"kind": kind, "shape": shape} for kind, shape in (a, b)))
    assert mismatch(output, target) is not None
    assert (obstacle(output, target) is None) is is_connected
    assert not is_connected or doubt(output, target)


@pytest.mark.parametrize(
    ("text", "meant"),
    [(0.0333333, Fraction(1, 30)), (0.02, Fraction(1, 50)), (0.012, Fraction(3, 250)), (1e-7, Fraction(1, 10**7))],
)
def test_a_proposed_step_is_taken_as_it_is_meant(text: float, meant: Fraction):
    assert proposed_step(text) == meant


def test_a_port_is_no_name_and_a_period_is_exact(fmu: FmuOf, wording: Wording):
    s = System()
    mass = s.add("mass", str(fmu("Mass")))
    name: Any = "mass.x"
    inexact: Any = 0.01
    with pytest.raises(TypeError) as refused:
        s.connect(name, mass.u.f)
    wording.check(refused.value)
    assert not s.connections
    with pytest.raises(TypeError) as refused:
        s.add("mass", fmu("Mass"), period=inexact)
    wording.check(refused.value)


def test_a_port_of_another_system_is_not_taken_for_this_ones_by_its_units_name(fmu: FmuOf):
    s, other = System(), System()
    own, theirs = (system.add("mass", fmu("Mass")) for system in (s, other))
    for use in (
        lambda: s.connect(theirs.y.x, own.u.f),
        lambda: s.connect(own.y.x, theirs.u.f),
        lambda: s.connect(theirs.y, own.u),
        lambda: s.disconnect(theirs.u.f),
        lambda: s.connect(other.add("sprint", fmu("Spring")).y.f, own.u.f),  # of which this has no unit yet
        lambda: s.external(theirs.u.f),
        lambda: s.follow(theirs.u.f, TimeSeries(np.zeros(1), np.ones((1, 1)), linear=True)),
    ):
        with pytest.raises(ValueError, match=r"another System"):
            use()
    assert not s.connections
    assert not s.externals
    assert not s.followed


def test_a_copy_has_the_same_units_and_its_changes_are_its_own(fmu: FmuOf):
    s = System()
    mass, spring = s.add("mass", fmu("Mass")), s.add("spring", fmu("Spring"))
    s.connect(spring.y, mass.u)
    made = copy(s)
    assert made.connections == s.connections != []
    made.external(mass.u.f)
    made.connect(mass.y.x, spring.u.x)
    made.notes.append("of the copy")
    added = made.add("other", fmu("Mass"))
    assert ([str(c.source) for c in s.connections], s.externals, s.notes) == (["spring.f"], {}, [])
    assert "other" not in s.units
    with pytest.raises(ValueError, match="another System"):
        s.connect(added.y.x, spring.u.x)
    made.check()


def test_what_is_said_of_a_unit_goes_with_it(fmu: FmuOf):
    s = System()
    a, b, spring = s.add("a", fmu("Mass")), s.add("b", fmu("Mass")), s.add("spring", fmu("Spring"))
    s.connect(a.y.x, spring.u.x)
    s.connect(spring.y, b.u)
    s.external(a.u.f)
    s.remove("spring")
    assert (s.connections, s.sources_of("b"), [*s.externals]) == ([], {}, [a.u.f])
    s.remove("a")
    assert not s.externals
    s.check()
    first, second, fed = s.add("first", fmu("Spring")), s.add("second", fmu("Spring")), s.add("fed", fmu("Mass"))
    s.connect(first.y, fed.u)
    s.connect(second.y, fed.u)
    s.remove("first")
    assert s.sources_of("fed") == {"f": second.y.f}
    s.add("fed", fmu("Mass"), period=Fraction(0))
    assert len(faults_of(s)) == 2
    s.remove("fed")
    s.check()


def test_variables_that_are_named_like_arguments_are_given_by_name(edited: Edited, wording: Wording):
    file = edited("mass", 2, ('name="m"', 'name="period"'), ('name="k"', 'name="sampled"'))
    s = System()
    unit = s.add("a", file, start={"period": 2.0, "sampled": 1.0})
    assert (dict(unit.start), unit.sampled) == ({"period": 2.0, "sampled": 1.0}, unit.description.sampled)
    s.check()
    for given in ({"sampled": 1.0}, {"start": 0.5}, {"period": 0.5}, {"start": {"f": 1.0}, "f": 1.0}):
        with pytest.raises(TypeError) as refused:
            s.add("b", file, **dict[str, Any](given))
        wording.check(refused.value)


def test_a_number_is_not_true(fmu: FmuOf):
    s = System()
    s.add("mass", fmu("Mass"), m=True)
    assert ["True" in fault for fault in faults_of(s)] == [True]


def test_a_rebuilt_fmu_is_read_again(tmp_path: Path):
    file, s = tmp_path / "a.fmu", System()
    for block in ("mass", "gain"):
        file.write_bytes(native_fmu(block).read_bytes())
        assert s.add(block, file).description.name == block


def test_only_ports_that_are_there_are_disconnected(fmu: FmuOf):
    s = System()
    mass = s.add("mass", fmu("Mass"), m=2.0)
    for end, named in ((mass.u.ff, "f"), (PortName("mas", "f"), "mass")):
        with pytest.raises(ValueError, match=rf"\b{named}\b"):
            s.disconnect(end)
    s.disconnect(mass.u.m)
    assert not s.units["mass"].start


@pytest.mark.parametrize(
    ("period", "is_moved"), [("1/4", False), ("1/8", False), ("1/2", False), ("1/10", True), ("1/3", True)]
)
def test_ticks_that_do_not_begin_steps_are_named(period: str, is_moved: bool):
    own, s = replace(describe_fmu(native_fmu("gain", 3)), sampled=True, step=0.25), System()
    s.add("servo", own, period=Fraction(period))
    s.add("step", replace(own, sampled=False), period=Fraction(period))
    assert [line.partition(":")[0] for line in s.tolerated] == ["servo"] * is_moved


def test_a_port_whose_name_is_no_identifier_is_named_by_key(edited: Edited):
    file = edited("mass", 2, ('name="x"', 'name="der(x) / a b"'))
    system = System()
    first, second = system.add("first", file), system.add("second", file)
    assert first.y["der(x) / a b"] == PortName("first", "der(x) / a b")
    assert second.u["f"] == second.u.f
    system.connect(first.y["der(x) / a b"], second.u.f)
    assert any("first.der(x) / a b (real m)" in fault for fault in faults_of(system))  # m is not a N


def test_clocks_that_do_not_fit_are_reported(wording: Wording):
    s = System()
    a, b = s.add("a", native_fmu("counter_tenths")), s.add("b", native_fmu("counter_triggered"))
    for source, target in ((a.y.count, b.u.tick), (a.y.carry, b.u.increment)):
        s.connect(source, target)
    s.connect(PortName("b", "tick"), PortName("a", "carry"))  # an output clock triggers an input clock
    s.connect(b.y.carry, a.u.tick)  # which is time-based
    faults = faults_of(s)
    assert len(faults) == 4
    wording.check("\n".join(faults))


def test_clocked_ports_need_event_mode(wording: Wording):
    s = System()
    s.add("a", native_fmu("counter_tenths", hasEventMode=False))
    s.add("b", native_fmu("counter_thirds"), sampled=True)
    faults = faults_of(s)
    assert len(faults) == 2
    wording.check("\n".join(faults))


def test_a_unit_with_clocked_ports_is_not_taken_for_a_sampled_one_nor_a_clock_that_never_ticks_for_one(edited: Edited):
    d = describe_fmu(native_fmu("counter_tenths", canHandleVariableCommunicationStepSize=False))
    assert not d.sampled
    assert describe_fmu(native_fmu("discrete_passer", canHandleVariableCommunicationStepSize=False)).sampled
    file = edited("counter_tenths", 3, ('intervalCounter="1"', 'intervalCounter="0"'))
    with pytest.raises(InvalidFmu, match=r"its clock 'tick' ticks every 0 s from 0 s on"):
        describe_fmu(file)
    counted = 'intervalCounter="1" resolution="10" intervalDecimal="0.1"'
    file = edited("counter_tenths", 3, (counted, 'intervalDecimal="1e999999999"'))
    with pytest.raises(InvalidFmu, match=r"its clock 'tick' is not a number: 1e999999999 "):
        describe_fmu(file)


def test_clock_connections_are_not_exported_silently(tmp_path: Path):
    s = System()
    a, b = s.add("a", native_fmu("counter_tenths")), s.add("b", native_fmu("counter_triggered"))
    s.connect(a.y.carry, b.u.tick)
    with pytest.raises(NotExportable, match=r"a.carry -> b.tick lets a clock tick"):
        write_ssp(s, tmp_path / "clocks.ssp", "clocks")
