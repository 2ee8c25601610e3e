"""Parameters of an SSP that a call gives: by which names, in which units, before which bindings of the file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import decay
import numpy as np
import pytest
from ssp_of import (
    MM,
    MORE_PARAMETERS,
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
from handover.cosim.ssp.ssp_file import SspFile


@pytest.fixture
def fmu(tmp_path: Path) -> Path:
    return decay.pack(tmp_path / "unit.fmu", b"", decay.edited(*MORE_PARAMETERS))


def packed(fmu: Path, inside: str, more: str = "") -> Path:
    return pack_ssp(fmu.with_name("a.ssp"), described(inside, more), {"resources/unit.fmu": fmu})


def started(file: Path, given: Mapping[str, str]) -> dict[str, Any]:
    """Return the units' start values."""
    with SspFile(file, parameters=given) as ssp:
        return {name: dict(unit.start) for name, unit in ssp.system.units.items()}


def test_they_come_before_the_file_s_and_are_of_all_types(fmu: Path):
    file = packed(fmu, system(component("a", bindings(parameters("on|Boolean|false", "called|String|old")))))
    start = started(file, {"a.on": "True", "a.called": "a, b", "a.light": "green", "a.p": "3,-4.5"})["a"]
    np.testing.assert_array_equal(start.pop("p"), [3.0, -4.5])
    assert start == {"on": True, "called": "a, b", "light": "green"}
    assert started(file, {"a.light": "2"})["a"] == {"on": False, "called": "old", "light": 2}


def test_an_entry_of_an_array_leaves_the_others_as_the_file_has_them(fmu: Path):
    whole = packed(fmu, system(component("a", bindings(parameters("p[1]|Real|10", "p[2]|Real|20")))))
    np.testing.assert_array_equal(started(whole, {"a.p[2]": "7"})["a"]["p"], [10.0, 7.0])
    np.testing.assert_array_equal(started(whole, {"a.p": "8,9"})["a"]["p"], [8.0, 9.0])
    partly = packed(fmu, system(component("a")))
    assert started(partly, {"a.p[2]": "7"}) == {"a": {"p[2]": 7.0}}


def test_they_are_listed_with_their_values(fmu: Path):
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
    assert started(file, {}) == {"s.a": {"p[1]": 1.0}}
    assert started(file, {"s.width": "250"}) == {"s.a": {"p[1]": 0.25}}
    with SspFile(file, parameters={"s.width": "250"}) as ssp:
        width = ssp.parameters["s.width"]
        assert (width.unit.symbol, width.start) == ("mm", "250")
        assert {"s.a.p", "s.a.on"} < ssp.parameters.keys()


def test_what_a_system_s_parameter_feeds_can_be_given_itself(fmu: Path):
    assert started(of_connector(fmu), {"s.a.p[1]": "0.5"}) == {"s.a": {"p[1]": 0.5}}


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
