"""Which values the parameter bindings of an SSP give to which variables."""

import logging
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

from handover.cosim.exceptions import InvalidSsp
from handover.cosim.master.master import Master
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.system.signals import Signals
from handover.fmus.build import build_block

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


def refusal(open_: Callable[[], Starts]) -> str:
    with pytest.raises(InvalidSsp) as caught:
        open_()
    assert "\n" not in str(caught.value)
    return "; ".join(caught.value.faults)


def test_values_of_all_types_are_bound(started: Open):
    given = ("u|Real|1.5", "mode|Integer|3", "on|Boolean|true", "called|String|a b", "light|Enumeration|GREEN")
    assert started(one(*given)) == {
        "a": {"u": 1.5, "mode": 3, "on": True, "called": "a b", "light": "GREEN"},
    }


def test_entries_make_up_an_array(started: Open):
    start = started(one("p[2]|Real|20", "p[1]|Real|10"))["a"]
    assert list(start) == ["p"]
    np.testing.assert_array_equal(start["p"], [10.0, 20.0])


def test_of_an_array_single_entries_can_be_bound(started: Open):
    assert started(one("p[2]|Real|20")) == {"a": {"p[2]": 20.0}}


def test_a_value_is_converted_to_the_variable_s_unit(started: Open):
    assert started(one("u|Real|1500|mm", set_more=SET_MM)) == {"a": {"u": 1.5}}
    assert started(one("u|Real|1500|mm"), MM) == {"a": {"u": 1.5}}


def test_sets_and_mappings_can_be_files_of_their_own(started: Open):
    mapping = (
        f'<ssm:ParameterMapping {NAMESPACES} version="1.0">'
        '<ssm:MappingEntry source="x" target="u"><ssc:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry>'
        '<ssm:MappingEntry source="x" target="p[1]" suppressUnitConversion="true"/>'
        '<ssm:MappingEntry source="nowhere" target="on"/></ssm:ParameterMapping>'
    )
    binding = (
        '<ssd:ParameterBinding source="sets/a%20b.ssv"><ssd:ParameterMapping source="m.ssm"/></ssd:ParameterBinding>'
    )
    inside = system(component("a", f"<ssd:ParameterBindings>{binding}</ssd:ParameterBindings>"))
    files = {"sets/a b.ssv": parameters("x|Real|1500|mm", "mode|Integer|3", more=SET_MM), "m.ssm": mapping}
    assert started(inside, files=files) == {"a": {"u": 2 * 1.5 + 1, "p[1]": 1500.0}}


def test_what_a_mapping_and_its_set_do_not_have_of_each_other_is_reported(
    started: Open, caplog: pytest.LogCaptureFixture
):
    entries = '<ssm:MappingEntry source="modus" target="mode"/>\n<ssm:MappingEntry source="x" target="u"/>'
    mapping = f'<ssm:ParameterMapping {NAMESPACES} version="1.0">{entries}</ssm:ParameterMapping>'
    inside = '<ssd:ParameterMapping source="m.ssm"/>'
    whole = bound(inside, 'source="s.ssv"')
    values = parameters("x|Real|1", "mode|Integer|3", *(f"other{n}|Real|1" for n in range(6)))
    assert started(whole, files={"m.ssm": mapping, "s.ssv": values}) == {"a": {"u": 1.0}}
    left_out = "'mode', 'other0', 'other1', 'other2', 'other3' and 2 more"
    assert [record.getMessage() for record in caplog.records] == [
        "m.ssm, line 1: a: no parameter is called 'modus'; its mapping to 'mode' is left out; did you mean mode?",
        f"s.ssv, line 1: a: no entry maps {left_out}, left out",
    ]


def test_a_mapping_can_stand_inside(started: Open):
    entry = '<ssm:MappingEntry source="x" target="mode"/>'
    mapping = f'<ssm:ParameterMapping {NAMESPACES} version="1.0">{entry}</ssm:ParameterMapping>'
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


def test_a_name_that_nothing_has_is_left_out_and_reported(started: Open, caplog: pytest.LogCaptureFixture):
    with caplog.at_level(logging.WARNING):
        assert started(one("y|Real|1", "nothing|Real|1", "mode|Integer|2")) == {"a": {"mode": 2}}
    text = caplog.text
    assert "SystemStructure.ssd, line 3: a has nothing called 'nothing' that can be set" in text
    assert "'y'" in text


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ("u|Integer|x", "u: 'x' is not a number"),
        ("u|String|1.5", "u: it is real, and the value given is of type String"),
        ("mode|Real|3", "mode: it is integer"),
        ("on|Integer|1", "on: it is boolean, and the value given is of type Integer"),
        ("light|Enumeration|BLUE", "a.light: 'BLUE' is none of red, green"),
        ("mode|Integer|12", "a.mode: 12 is out of range: from 0 to 11"),
        ("u|Real|NaN", "a.u: nan is not finite"),
    ],
)
def test_a_value_that_a_variable_cannot_have_is_refused(started: Open, given: str, text: str):
    assert text in refusal(lambda: started(one(given)))


@pytest.mark.parametrize(("unit", "value"), [("[m]", 1.5), ("mm", 0.0015)])
def test_a_value_in_a_unit_that_is_not_defined_is_taken_as_it_is(tmp_path: Path, unit: str, value: float):
    fmu = decay.pack(tmp_path / "unit.fmu", b"", decay.DESCRIPTION)
    file = pack_ssp(tmp_path / "a.ssp", described(one(f"u|Real|1.5|{unit}"), MM), {"resources/unit.fmu": fmu})
    with SspFile(file) as ssp:
        assert ssp.system.units["a"].start == {"u": pytest.approx(value)}
        assert ["the unit '[m]' is not defined" in line for line in ssp.system.tolerated] == [True] * (unit == "[m]")


def test_a_name_that_nothing_has_is_reported_with_the_nearest(started: Open, caplog: pytest.LogCaptureFixture):
    middle = system(component("a", bindings(parameters("moed|Integer|1"))), name="m")
    assert started(system(middle, before=bindings(parameters("m.a.p[3]|Real|1")))) == {"m.a": {}}
    assert "m.a has nothing called 'moed' that can be set; its value is left out; did you mean mode?" in caplog.text
    assert (
        "whole has nothing called 'm.a.p[3]' that can be set; its value is left out; did you mean m.a.p[1] or m.a.p[2]"
        in caplog.text
    )


@pytest.mark.parametrize("initial", ["exact", "approx"])
def test_a_local_variable_with_a_start_value_can_be_given_one(tmp_path: Path, initial: str):
    with_start = ('"local" variability="continuous"><Real', f'"local" initial="{initial}"><Real start="1"')
    fmu = decay.pack(tmp_path / "unit.fmu", b"", decay.edited(*MORE_PARAMETERS, with_start))
    file = pack_ssp(tmp_path / "a.ssp", described(one("x|Real|3")), {"resources/unit.fmu": fmu})
    with SspFile(file) as ssp:
        assert ssp.system.units["a"].start == {"x": 3.0}
    with SspFile(file, parameters={"a.x": "4"}) as ssp:  # comes before what the file gives
        assert ssp.system.units["a"].start == {"x": 4.0}
        assert "a.x" not in ssp.parameters


@pytest.mark.parametrize("more", ['initial="calculated"', ""])
def test_a_local_variable_that_is_computed_cannot_be_set(tmp_path: Path, more: str, caplog: pytest.LogCaptureFixture):
    computed = ('"local" variability="continuous"><Real', f'"local" {more}><Real')
    fmu = decay.pack(tmp_path / "unit.fmu", b"", decay.edited(*MORE_PARAMETERS, computed))
    two = system("".join(component(name, bindings(parameters("x|Real|3"))) for name in ("a", "b")))
    with SspFile(pack_ssp(tmp_path / "a.ssp", described(two), {"resources/unit.fmu": fmu})) as ssp:
        assert ssp.system.units["a"].start == {}
    lines = [record.getMessage() for record in caplog.records]
    assert [line.partition(": ")[2].partition(";")[0] for line in lines] == [
        f"{name} has nothing called 'x' that can be set" for name in ("a", "b")
    ]


def bound(inside: str, more: str = "") -> str:
    binding = f"<ssd:ParameterBinding {more}>{inside}</ssd:ParameterBinding>"
    return system(component("a", f"<ssd:ParameterBindings>{binding}</ssd:ParameterBindings>"))


@pytest.mark.parametrize(
    ("inside", "text"),
    [
        (bound("", 'source="gone.ssv"'), "there is no 'gone.ssv' in the SSP; "),
        (bound("", 'source="bad.ssv"'), "bad.ssv cannot be read: it is not well-formed"),
        (bound("", 'source="dtd.ssv"'), "dtd.ssv cannot be read: it has a document type"),
        (bound("", 'source="twice.ssv"'), "parameter 'u' is there twice"),
        (bound("", 'source="SystemStructure.ssd"'), "where <ssv:ParameterSet> is right"),
        (bound("", 'source="../a.ssv"'), "leads out of the SSP"),
        (bound("", 'type="text/csv" source="bad.ssv"'), "type 'text/csv' is not supported"),
        (bound("", 'sourceBase="component" source="bad.ssv"'), "sourceBase='component' is not supported"),
        (bound(""), "neither a source nor one <ssv:ParameterSet> inside"),
        (bound("<ssd:ParameterValues><a/></ssd:ParameterValues>"), "<a> where <ssv:ParameterSet> is right"),
        (one("u|Thing|1"), "parameter 'u' has 0 types; one of Real, "),
        (one("u|Real|1 2"), "u: 2 values where 1 is right"),
    ],
)  # fmt: skip
def test_a_bad_binding_is_refused(started: Open, inside: str, text: str):
    twice = parameters("u|Real|1", "u|Real|2")
    files = {"bad.ssv": "<a>", "dtd.ssv": "<!DOCTYPE a><a/>", "twice.ssv": twice}
    assert text in refusal(lambda: started(inside, files=files))


def test_a_mapping_of_two_to_one_name_is_refused(started: Open):
    entries = '<ssm:MappingEntry source="x" target="u"/><ssm:MappingEntry source="y" target="u"/>'
    mapping = f'<ssm:ParameterMapping {NAMESPACES} version="1.0">{entries}</ssm:ParameterMapping>'
    inside = '<ssd:ParameterMapping source="m.ssm"/>'
    whole = bound(inside, 'source="s.ssv"')
    files = {"m.ssm": mapping, "s.ssv": parameters("x|Real|1")}
    assert "m.ssm, line 1: two parameters are mapped to 'u'" in refusal(lambda: started(whole, files=files))


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
    with SspFile(file, parameters={"s.width": "250"}) as ssp:
        width = ssp.parameters["s.width"]
        assert (width.unit.symbol, width.start) == ("mm", "250")
        assert {"s.a.p", "s.a.on"} < ssp.parameters.keys()


def test_what_a_system_s_parameter_feeds_can_be_given_itself(fmu: Path):
    assert starts(of_connector(fmu), {"s.a.p[1]": "0.5"}) == {"s.a": {"p[1]": 0.5}}


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({"a.onn": "true"}, "no parameter 'a.onn'; did you mean a.on"),
        ({"a.u": "1"}, "no parameter 'a.u'; "),  # an input
        ({"a.on": "maybe"}, "a.on: 'maybe' is neither true nor false"),
        ({"a.p": "1"}, "a.p: 1 values where 2 are right"),
        ({"a.p[3]": "1"}, "no parameter 'a.p[3]'; "),
        ({"a.light": "blue"}, "'blue' is none of red, green"),
    ],
)
def test_what_is_wrong_is_told(fmu: Path, given: Mapping[str, str], fault: str):
    with pytest.raises(InvalidSsp) as e:
        SspFile(packed(fmu, system(component("a"))), parameters=given)
    assert fault in "; ".join(e.value.faults)


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
