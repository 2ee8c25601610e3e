"""A scenario's parameters that are its units': declared once, and carried to each unit."""

import math
import typing
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, cast

import pytest

from handover.cosim.blocks.declarations import DeclarationError, declared_variables
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.origins import assumed, stated
from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.units import Metre
from handover.cosim.blocks.variable import Causality
from handover.cosim.system.system import PlacedUnit, System
from handover.fmus.catalog import find_unit, import_class
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.exposed import carry, check_exposed, expose, exposed, with_exposed
from handover.scenarios.experiment.places import Place


@dataclass(frozen=True, kw_only=True)
class Params:
    """Of a unit."""

    size: Metre = parameter(2.0, "its size", minimum=1.0, maximum=9.0, origin=stated("table 1"))


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Of a scenario."""

    size: float = expose(Params, "a.size", "b.width")
    other: float = expose(Params, "c.size", start=3.0, maximum=4.0, origin=assumed("half"))


def test_a_declaration_is_the_units_but_for_what_the_scenario_says():
    [of_unit] = declared_variables(Params, Causality.PARAMETER)
    size, other = declared_variables(Parameters, Causality.PARAMETER)
    assert size == of_unit
    assert (other.unit, other.start, other.minimum, other.maximum) == (of_unit.unit, 3.0, 1.0, 4.0)
    assert (other.description, other.origin) == ("its size", assumed("half"))


def test_what_a_unit_does_not_declare_is_refused():
    with pytest.raises(DeclarationError) as e:
        expose(Params, "a.weight")
    assert (e.value.owner, e.value.field) == ("Params", "weight")


def test_a_unit_that_the_scenario_has_not_is_refused():
    check_exposed(Parameters, ("b", "c"))
    with pytest.raises(DeclarationError) as e:
        check_exposed(Parameters, ("a", "cc"))
    assert (e.value.owner, e.value.field) == ("Parameters", "other")

    @dataclass(frozen=True, kw_only=True)
    class OfAnother:
        other: float = expose(Parameters, "other")

    check_exposed(OfAnother, ("a",))


def test_all_units_get_the_value_but_where_they_are_set_to_another():
    system, start = System(), {"a": {}, "b": {"height": 1.0}, "c": {"size": 8.0}}
    for name, values in start.items():
        system.units[name] = PlacedUnit(name, cast(Any, None), values, Fraction(1), sampled=False)
    carry(Parameters(size=5.0), system)
    assert {name: unit.start for name, unit in system.units.items()} == {
        "a": {"size": 5.0},
        "b": {"height": 1.0, "width": 5.0},
        "c": {"size": 8.0},
    }


def test_what_is_exposed_is_optional_of_a_place():
    places = with_exposed({"a": Place(required={"size": "must be"}), "b": Place()}, Parameters)
    assert places["a"] == Place(required={"size": "must be"})
    assert list(places["b"].optional) == ["width"]


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_units_of_a_scenario_take_what_it_exposes(name: str):
    scenario = SCENARIOS[name]
    annotated = typing.get_type_hints(scenario.parameters_type)
    paths = [path for path in exposed(scenario.parameters_type) if path[1] in scenario.units]
    for own, unit, of_unit in paths:
        [v] = [v for v in scenario.parameters() if v.name == own]
        declared = {v.name: v for v in describe(import_class(find_unit(scenario.units[unit]).block)).parameters}
        taken = declared[of_unit]
        assert (v.kind, v.unit, v.shape, v.items) == (taken.kind, taken.unit, taken.shape, taken.items), own
        low, high = (-math.inf, math.inf)
        assert (low if taken.minimum is None else taken.minimum) <= (low if v.minimum is None else v.minimum), own
        assert (high if taken.maximum is None else taken.maximum) >= (high if v.maximum is None else v.maximum), own
        assert annotated[own] in (float, int, bool, str, v.enumeration) or v.shape, own
