"""The parameter sets of the catalog's units fit their parameters, and keep apart what is published and what is not."""

import numpy as np
import pytest

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.start_values import fault_of
from handover.cosim.blocks.variable import Variable
from handover.fmus.catalog import UNITS, import_class
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.parameter_sets import parameter_sets

STATUSES = {"stated", "derived", "assumed", "read off figure"}
WITHOUT_ORIGIN = {
    **dict.fromkeys(
        ("HandoverPartner", "StereoCamera", "FingerInfrared", "VisualServo", "Navigation", "HandAndObject"), "seed"
    ),
    **dict.fromkeys(("LargeObjectAndHands", "GraspScene"), "seed"),
    "VslArm": "high_frequency_damping hinges hinges_dynamic link_2 link_3 seed substep",
    "TrajectoryPlanner": "pressure",
    "HybridKinematics": "method",
}
"""Parameters of units that are neither published nor assumed: seeds, numerical ones, and what scenarios set."""


def declared(unit: str) -> dict[str, Variable]:
    return {v.name: v for v in describe(import_class(UNITS[unit].block)).parameters}


@pytest.mark.parametrize("unit", UNITS)
def test_the_sets_of_a_unit_fit_have_origins_and_hold_all_defaults_but_the_exceptions(unit: str):
    parameters, sets = declared(unit), parameter_sets(unit)
    assert sets
    for each in sets:
        assert each.values
        assert [fault_of(parameters[name], value) for name, value in each.values.items()] == [None] * len(each.values)
        assert set(each.origins) == set(each.values)
    for each in (s for s in sets if s.name in ("published", "assumed")):
        assert all(origin.endswith("(assumed)") is (each.name == "assumed") for origin in each.origins.values())
        for name, value in each.values.items():
            start = parameters[name].start
            assert value == start.name.lower() if parameters[name].items else np.array_equal(value, start), name
    found = {name for s in sets if s.name in ("published", "assumed") for name in s.values}
    assert set(parameters) - found == set(WITHOUT_ORIGIN.get(unit, "").split())


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_parameter_of_a_scenario_has_an_origin(scenario: str):
    origins = [v.origin for v in SCENARIOS[scenario].parameters()]
    assert all(origin and origin.where and origin.status in STATUSES for origin in origins)


def test_published_gains_and_our_own_are_sets_of_their_own():
    impedance = {s.name: s for s in parameter_sets("ImpedanceController")}
    assert set(impedance) == {"published", "assumed", "rigid", "compliant"}
    assert impedance["compliant"].values == {"behaviour": "compliant"}
    assert "k_B_rotational 1 N.m.s/rad, table 4.1" in impedance["compliant"].origins["behaviour"]
    assert impedance["published"].origins["mass"] == "Astrobee (stated)"
    assert "p_BG" in impedance["assumed"].values
    servo = {s.name: s.values for s in parameter_sets("VisualServo")}
    assert servo["thesis"]["use_covariance"] != servo["own"]["use_covariance"]


def test_a_unit_of_ones_own_has_none():
    assert parameter_sets("spring") == []
