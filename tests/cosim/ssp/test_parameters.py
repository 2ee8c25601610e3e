"""Which values the parameter bindings of an SSP give to which variables."""

from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim import decay
from support.cosim.ssp_of import (
    MM,
    MORE_PARAMETERS,
    NAMESPACES,
    bindings,
    component,
    connection,
    connectors,
    described,
    pack_ssp,
    parameters,
    system,
)
from support.wording import Wording

from handover.cosim.exceptions import InvalidSsp
from handover.cosim.master.master import Master
from handover.cosim.probe.finding import Level
from handover.cosim.ssp.check_ssp import check_ssp
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.system.signals import Signals
from handover.fmus.build import build_block

MAPPING = '<ssm:ParameterMapping {} version="1.0">{}</ssm:ParameterMapping>'.format
SET_MM = MM.replace("ssd:", "ssv:")

Starts = Mapping[str, Mapping[str, Any]]
Open = Callable[..., Starts]


@pytest.fixture
def started(tmp_path: Path) -> Open:
    """Open an SSP of decay.c's FMU with more parameters; return its units' start values."""
    fmu = decay.pack(tmp_path / "unit.fmu", b"", decay.edited(*MORE_PARAMETERS))

    def start(inside: str, more: str = "", files: Mapping[str, str] | None = None) -> Starts:
        file = pack_ssp(tmp_path / "a.ssp", described(inside, more), {"resources/unit.fmu": fmu, **(files or {})})
        with SspFile(file) as ssp:
            return {name: unit.start for name, unit in ssp.system.units.items()}

    return start


def one(*values: str, more: str = "", set_more: str = "") -> str:
    return system(component("a", bindings(parameters(*values, more=set_more), more=more)))


def test_values_of_all_types_are_bound_single_entries_of_arrays_and_in_the_variable_s_unit(started: Open):
    given = ("u|Real|1.5", "mode|Integer|3", "on|Boolean|true", "called|String|a b", "light|Enumeration|GREEN")
    values = {"u": 1.5, "mode": 3, "on": True, "called": "a b", "light": "GREEN"}
    assert started(one(*given, "p[2]|Real|20")) == {"a": {**values, "p[2]": 20.0}}
    start = started(one("p[2]|Real|20", "p[1]|Real|10"))["a"]
    assert list(start) == ["p"]
    np.testing.assert_array_equal(start["p"], [10.0, 20.0])
    assert started(one("u|Real|1500|mm", set_more=SET_MM)) == {"a": {"u": 1.5}}
    assert started(one("u|Real|1500|mm"), MM) == {"a": {"u": 1.5}}


def test_sets_and_mappings_can_be_files_of_their_own(started: Open):
    mapping = MAPPING(
        NAMESPACES,
        '<ssm:MappingEntry source="x" target="u"><ssc:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry>'
        '<ssm:MappingEntry source="x" target="p[1]" suppressUnitConversion="true"/>'
        '<ssm:MappingEntry source="nowhere" target="on"/>',
    )
    binding = (
        '<ssd:ParameterBinding source="sets/a%20b.ssv"><ssd:ParameterMapping source="m.ssm"/></ssd:ParameterBinding>'
    )
    inside = system(component("a", f"<ssd:ParameterBindings>{binding}</ssd:ParameterBindings>"))
    files = {"sets/a b.ssv": parameters("x|Real|1500|mm", "mode|Integer|3", more=SET_MM), "m.ssm": mapping}
    assert started(inside, files=files) == {"a": {"u": 2 * 1.5 + 1, "p[1]": 1500.0}}


def test_what_a_mapping_and_its_set_do_not_have_of_each_other_is_reported(
    started: Open, caplog: pytest.LogCaptureFixture, wording: Wording
):
    entries = '<ssm:MappingEntry source="modus" target="mode"/>\n<ssm:MappingEntry source="x" target="u"/>'
    values = parameters("x|Real|1", "mode|Integer|3", *(f"other{n}|Real|1" for n in range(6)))
    files = {"m.ssm": MAPPING(NAMESPACES, entries), "s.ssv": values}
    assert started(bound('<ssd:ParameterMapping source="m.ssm"/>', 'source="s.ssv"'), files=files) == {"a": {"u": 1.0}}
    assert len(caplog.records) == 2
    for record in caplog.records:
        wording.check(record.getMessage())


def test_a_mapping_can_stand_inside(started: Open):
    mapping = MAPPING(NAMESPACES, '<ssm:MappingEntry source="x" target="mode"/>')
    inside = bindings(parameters("x|Integer|4")).replace(
        "</ssd:ParameterBinding>", f"<ssd:ParameterMapping>{mapping}</ssd:ParameterMapping></ssd:ParameterBinding>"
    )
    assert started(system(component("a", inside))) == {"a": {"mode": 4}}


def test_later_bindings_and_those_further_out_come_first(started: Open):
    inner = bindings(parameters("u|Real|1", "mode|Integer|1", "on|Boolean|1"), parameters("u|Real|2"))
    middle = system(component("a", inner), name="m", before=bindings(parameters("a.mode|Integer|2", "a.u|Real|3")))
    outer = system(middle, before=bindings(parameters("m.a.u|Real|4")))
    assert started(outer) == {"m.a": {"u": 4.0, "mode": 2, "on": True}}


def test_a_prefix_stands_before_all_names_of_a_set(started: Open):
    before = bindings(parameters("u|Real|4", "mode|Integer|5"), more='prefix="b."')
    assert started(system(component("a") + component("b"), before=before)) == {"a": {}, "b": {"u": 4.0, "mode": 5}}


def test_a_connector_of_the_system_gives_its_value_to_what_it_feeds(started: Open):
    """On its way it is converted and transformed as any other."""
    inside = '<ssc:LinearTransformation factor="2" offset="1"/>'
    whole = system(
        component("a", connectors(u="input")) + component("b", connectors(u="input")),
        connection("x", "a.u") + connection("x", "b.u", inside),
        before=connectors(x="input mm") + bindings(parameters("x|Real|1.5|m", "a.mode|Integer|2", more=SET_MM.replace(
            "</ssv:Units>", '<ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit></ssv:Units>'))),
    )  # fmt: skip
    assert started(whole, MM) == {"a": {"u": 1.5, "mode": 2}, "b": {"u": 4.0}}


def test_a_parameter_of_the_system_gives_its_value_to_those_of_units(started: Open):
    mode = '<ssd:Connectors><ssd:Connector name="mode" kind="parameter"><ssc:Integer/></ssd:Connector></ssd:Connectors>'
    whole = system(
        component("a", mode), connection("mode", "a.mode"), before=mode + bindings(parameters("mode|Integer|7"))
    )
    assert started(whole) == {"a": {"mode": 7}}


def test_a_name_that_nothing_has_is_left_out_and_reported_with_the_nearest(
    started: Open, caplog: pytest.LogCaptureFixture, wording: Wording
):
    assert started(one("y|Real|1", "nothing|Real|1", "mode|Integer|2")) == {"a": {"mode": 2}}
    middle = system(component("a", bindings(parameters("moed|Integer|1"))), name="m")
    assert started(system(middle, before=bindings(parameters("m.a.p[3]|Real|1")))) == {"m.a": {}}
    assert len(caplog.records) == 4
    for record in caplog.records:
        wording.check(record.getMessage())


def test_a_name_that_nothing_has_is_a_warning_of_a_check(tmp_path: Path):
    fmu = decay.pack(tmp_path / "unit.fmu", b"", decay.DESCRIPTION)
    file = pack_ssp(tmp_path / "a.ssp", described(one("nothing|Real|1")), {"resources/unit.fmu": fmu})
    (found,) = (f for f in next(check_ssp(file, 10.0)).sections[0].findings if "'nothing'" in f.what)
    assert found.level is Level.WARNING


@pytest.mark.parametrize(("unit", "value"), [("[m]", 1.5), ("mm", 0.0015)])
def test_a_value_in_a_unit_that_is_not_defined_is_taken_as_it_is(tmp_path: Path, unit: str, value: float):
    fmu = decay.pack(tmp_path / "unit.fmu", b"", decay.DESCRIPTION)
    file = pack_ssp(tmp_path / "a.ssp", described(one(f"u|Real|1.5|{unit}"), MM), {"resources/unit.fmu": fmu})
    with SspFile(file) as ssp:
        assert ssp.system.units["a"].start == {"u": pytest.approx(value)}
        assert ["the unit '[m]' is not defined" in line for line in ssp.system.tolerated] == [True] * (unit == "[m]")


def test_a_local_variable_with_a_start_value_can_be_given_one_and_a_computed_one_not(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, wording: Wording
):
    for initial in ('initial="exact"', 'initial="approx"', 'initial="calculated"', ""):
        has_start = "ex" in initial or "app" in initial
        edit = ('"local" variability="continuous"><Real', f'"local" {initial}><Real' + ' start="1"' * has_start)
        fmu = decay.pack(tmp_path / "unit.fmu", b"", decay.edited(*MORE_PARAMETERS, edit))
        file = pack_ssp(tmp_path / "a.ssp", described(one("x|Real|3")), {"resources/unit.fmu": fmu})
        with SspFile(file) as ssp:
            assert ssp.system.units["a"].start == ({"x": 3.0} if has_start else {})
        if has_start:
            with SspFile(file, parameters={"a.x": "4"}) as ssp:  # comes before what the file gives
                assert ssp.system.units["a"].start == {"x": 4.0}
                assert "a.x" not in ssp.parameters
    assert len(caplog.records) == 2
    for record in caplog.records:
        wording.check(record.getMessage())


def test_of_very_many_values_that_are_left_out_the_first_are_named(started: Open, caplog: pytest.LogCaptureFixture):
    assert started(one("u|Real|1", *(f"x_{k}|Real|1" for k in range(50)))) == {"a": {"u": 1.0}}
    assert len(caplog.messages) == 21
    assert "x_19" in caplog.messages[19]
    assert caplog.messages[20] == "and 30 more values are left out"


def bound(inside: str, more: str = "") -> str:
    binding = f"<ssd:ParameterBinding {more}>{inside}</ssd:ParameterBinding>"
    return system(component("a", f"<ssd:ParameterBindings>{binding}</ssd:ParameterBindings>"))


def test_a_bad_binding_is_refused(started: Open, wording: Wording):
    twice = '<ssm:MappingEntry source="x" target="u"/><ssm:MappingEntry source="y" target="u"/>'
    files = {
        "bad.ssv": "<a>",
        "dtd.ssv": "<!DOCTYPE a><a/>",
        "twice.ssv": parameters("u|Real|1", "u|Real|2"),
        "m.ssm": MAPPING(NAMESPACES, twice),
        "s.ssv": parameters("x|Real|1"),
    }
    for inside in (
        bound("", 'source="gone.ssv"'),
        bound("", 'source="bad.ssv"'),
        bound("", 'source="dtd.ssv"'),
        bound("", 'source="twice.ssv"'),
        bound("", 'source="SystemStructure.ssd"'),
        bound("", 'source="../a.ssv"'),
        bound("", 'type="text/csv" source="bad.ssv"'),
        bound("", 'sourceBase="component" source="bad.ssv"'),
        bound(""),
        bound("<ssd:ParameterValues><a/></ssd:ParameterValues>"),
        bound('<ssd:ParameterMapping source="m.ssm"/>', 'source="s.ssv"'),
        one("u|Thing|1"),
        one("u|Real|1 2"),
        one("u|Integer|x"),
        one("u|String|1.5"),
        one("mode|Real|3"),
        one("on|Integer|1"),
        one("light|Enumeration|BLUE"),
        one("mode|Integer|12"),
        one("u|Real|NaN"),
    ):
        with pytest.raises(InvalidSsp) as caught:
            started(inside, files=files)
        assert "\n" not in str(caught.value)
        wording.check("; ".join(caught.value.faults))


@pytest.fixture
def fmu(tmp_path: Path) -> Path:
    return decay.pack(tmp_path / "unit.fmu", b"", decay.edited(*MORE_PARAMETERS))


def packed(fmu: Path, inside: str, more: str = "") -> Path:
    return pack_ssp(fmu.with_name("a.ssp"), described(inside, more), {"resources/unit.fmu": fmu})


def starts(file: Path, given: Mapping[str, str]) -> dict[str, Any]:
    """Return the units' start values."""
    with SspFile(file, parameters=given) as ssp:
        return {name: dict(unit.start) for name, unit in ssp.system.units.items()}


def test_given_values_come_before_the_file_s_and_are_of_all_types(fmu: Path):
    file = packed(fmu, system(component("a", bindings(parameters("on|Boolean|false", "called|String|old")))))
    start = starts(file, {"a.on": "True", "a.called": "a, b", "a.light": "green", "a.p": "3,-4.5"})["a"]
    np.testing.assert_array_equal(start.pop("p"), [3.0, -4.5])
    assert start == {"on": True, "called": "a, b", "light": "green"}
    assert starts(file, {"a.light": "2"})["a"] == {"on": False, "called": "old", "light": 2}


def test_an_entry_of_an_array_leaves_the_others_as_the_file_has_them(fmu: Path):
    whole = packed(fmu, system(component("a", bindings(parameters("p[1]|Real|10", "p[2]|Real|20")))))
    np.testing.assert_array_equal(starts(whole, {"a.p[2]": "7"})["a"]["p"], [10.0, 7.0])
    np.testing.assert_array_equal(starts(whole, {"a.p": "8,9"})["a"]["p"], [8.0, 9.0])
    with pytest.raises(InvalidSsp, match=r"a\.p and a\.p\[2\] are both given"):
        starts(whole, {"a.p[2]": "7", "a.p": "8,9"})
    partly = packed(fmu, system(component("a")))
    assert starts(partly, {"a.p[2]": "7"}) == {"a": {"p[2]": 7.0}}


def test_parameters_are_listed_with_their_values(fmu: Path):
    file = packed(fmu, system(component("a", bindings(parameters("on|Boolean|true", "p[2]|Real|20")))))
    with SspFile(file) as ssp:
        listed = ssp.parameters
    starts = {name: port.start for name, port in listed.items()}
    assert starts == {"a.mode": "0", "a.p": "1 20.0", "a.on": "true", "a.called": "", "a.light": "1"}
    assert [port.name for port in listed.values()] == list(listed)


def of_connector(fmu: Path) -> Path:
    """Return an SSP in which `s.width`, 1000 mm, feeds the parameter p[1] of `s.a`, in m."""
    unit = component("a", connectors(**{"p[1]": "parameter"}))
    before = connectors(width="parameter mm") + bindings(parameters("width|Real|1000"))
    inner = system(unit, connection("width", "a.p[1]"), name="s", before=before)
    return packed(fmu, system(inner), MM)


def test_a_system_s_parameter_is_in_the_unit_of_its_connector(fmu: Path):
    file = of_connector(fmu)
    assert starts(file, {}) == {"s.a": {"p[1]": 1.0}}
    assert starts(file, {"s.width": "250"}) == {"s.a": {"p[1]": 0.25}}
    assert starts(file, {"s.a.p[1]": "0.5"}) == {"s.a": {"p[1]": 0.5}}  # which it feeds
    with SspFile(file, parameters={"s.width": "250"}) as ssp:
        width = ssp.parameters["s.width"]
        assert (width.unit.symbol, width.start) == ("mm", "250")
        assert {"s.a.p", "s.a.on"} < ssp.parameters.keys()


def test_what_is_wrong_with_a_given_value_is_reported(fmu: Path, wording: Wording):
    for given in ("a.onn=true", "a.u=1", "a.on=maybe", "a.p=1", "a.p[3]=1", "a.light=blue"):
        name, _, value = given.partition("=")
        with pytest.raises(InvalidSsp) as caught:
            SspFile(packed(fmu, system(component("a"))), parameters={name: value})
        wording.check("; ".join(caught.value.faults))


STEP = Fraction(1, 10)


def test_entries_that_are_swapped_arrive_swapped(tmp_path: Path):
    fmus = {
        f"resources/{name}.fmu": build_block(f"support.cosim.master_blocks:{name}", 3, tmp_path, step=STEP, scalar=True)
        for name in ("Counter", "Echo")
    }
    gives, takes = ({f"pair[{k}]": kind for k in (1, 2)} for kind in ("output", "input"))
    elements = component("counter", connectors(**gives), "resources/Counter.fmu")
    elements += component("echo", connectors(**takes), "resources/Echo.fmu")
    transformed = '<ssc:LinearTransformation factor="-2" offset="0.5"/>'
    crossed = connection("counter.pair[1]", "echo.pair[2]") + connection("counter.pair[2]", "echo.pair[1]", transformed)
    seen: list[tuple[float, ...]] = []

    def observe(t: float, signals: Signals) -> None:  # noqa: ARG001
        seen.append(tuple(float(signals[n]) for n in ("counter.pair[1]", "counter.pair[2]")))
        seen[-1] += tuple(signals["echo.pair_back"].tolist())

    description = described(system(elements, crossed), version="2.0")
    with SspFile(pack_ssp(tmp_path / "a.ssp", description, fmus)) as ssp, Master(ssp.system) as master:
        master.run(Fraction(1, 2), [observe])
    assert seen == [(float(k), float(k * k), 0.5 - 2.0 * k * k, float(k)) for k in range(6)]
