"""What scenarios declare of their places is what they wire, and nothing of it is left out of their own units."""

from typing import Any

import pytest

from handover.fmus.build import cached
from handover.fmus.catalog import find_unit
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.places import ports_of_place


@pytest.fixture(params=SCENARIOS)
def scenario(request: pytest.FixtureRequest) -> type[Experiment[Any]]:
    return SCENARIOS[request.param]


def test_a_place_is_declared_for_each_unit_with_ports_that_its_own_unit_has(scenario: type[Experiment[Any]]):
    assert set(scenario.places) == set(scenario.units)
    for name, place in scenario.places.items():
        assert not set(place.required) & set(place.optional)
        ports = ports_of_place(place, find_unit(scenario.units[name]))
        assert all(port.sentence for port in ports)


def test_all_that_is_wired_is_declared_and_none_is_left_out_of_its_own_units(scenario: type[Experiment[Any]]):
    experiment, parameters = scenario(), scenario.parameters_type()
    built = [
        make(parameters, 0, lambda unit: cached(scenario.units[unit], 3))
        for make in (experiment.build, experiment.wire)
    ]  # fmt: skip
    plain, fitted = built
    assert fitted.notes == []
    assert fitted.connections == plain.connections
    for name, unit in plain.units.items():
        wired = {end.port for c in plain.connections for end in (c.source, c.target) if end.unit == name}
        place = scenario.places[name]
        assert {*wired, *unit.start} <= {*place.required, *place.optional}, name
        assert {*fitted.units[name].start} == {*unit.start}
