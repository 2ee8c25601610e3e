"""What scenarios declare of their places is what they wire, with nothing left out, and runs as a compiled plan."""

import re
from dataclasses import replace
from fractions import Fraction
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from support.cosim.native_units import native_fmu
from support.rewritten_archive import described_otherwise

from handover.cosim.blocks.variable import Causality
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.stepper_factory import StepperFactory
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.graph import system_svg
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.fmus.catalog import find_unit
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.exposed import notes_on_exposed
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.experiment.places import ports_of_place, sample_in_places

LED = "flyer_human_to_robot"
"""A scenario whose hand can be led, by inputs from outside, for which a compiled plan does not ask."""


class Systems(NamedTuple):
    """A scenario's system by `build`, and by `wire`, which fits it to the units that it gets."""

    plain: System
    fitted: System


A_ROBOT = ("ir_grasp", "helix_handover", "vsl_hybrid", "flyer_robot_to_human")
EACH = [name if name in A_ROBOT else pytest.param(name, marks=pytest.mark.slow) for name in SCENARIOS]


@pytest.fixture(scope="module", params=EACH)
def scenario(request: pytest.FixtureRequest) -> type[Experiment[Any]]:
    return SCENARIOS[request.param]


@pytest.fixture(scope="module")
def systems(scenario: type[Experiment[Any]]) -> Systems:
    experiment, parameters = scenario(), scenario.parameters_type()
    both = (experiment.build, experiment.wire)
    return Systems(*(make(parameters, 0, lambda unit: cached(scenario.units[unit], 3)) for make in both))


def test_a_place_is_declared_for_each_unit_with_ports_that_its_own_unit_has(scenario: type[Experiment[Any]]):
    assert set(scenario.places) == set(scenario.units)
    for name, place in scenario.places.items():
        assert not set(place.required) & set(place.optional)
        assert set(place.advised) <= set(place.optional)
        ports = ports_of_place(place, find_unit(scenario.units[name]))
        assert all(port.text for port in ports)
        clauses = [port.text.split("; ") for port in ports]
        assert [named for named in clauses if len(set(named)) < len(named)] == []


def test_all_that_is_wired_is_declared_and_none_is_left_out_of_its_own_units(
    scenario: type[Experiment[Any]], systems: Systems
):
    plain, fitted = systems
    assert fitted.notes == []
    assert fitted.connections == plain.connections
    for name, unit in plain.units.items():
        wired = {end.port for c in plain.connections for end in (c.source, c.target) if end.unit == name}
        place = scenario.places[name]
        assert {*wired, *unit.start} <= {*place.required, *place.optional}, name
        assert {*fitted.units[name].start} == {*unit.start}


def test_a_note_names_a_few_ports_that_a_unit_lacks_and_counts_many():
    scenario = SCENARIOS["flyer_arm_impedance"]
    fmus = {unit: cached(name, 3) for unit, name in scenario.units.items()}
    system = scenario().wire(scenario.parameters_type(), 0, {**fmus, "impedance": fmus["push"]}.__getitem__)
    (note,) = (n for n in system.notes if n.startswith("unit impedance (Push) has"))
    ports = ports_of_place(scenario.places["impedance"], find_unit("ArmImpedanceController"))
    absent = {c: [p.declared.name for p in ports if p.declared.causality is c and not p.is_required] for c in Causality}
    assert f"no outputs {', '.join(absent[Causality.OUTPUT])}: " in note
    many = len(absent[Causality.PARAMETER])
    listed = "handover list flyer_arm_impedance --unit impedance"
    assert f"no parameters of ArmImpedanceController's {many}, which `{listed}` " in note


def test_no_box_covers_another_in_the_graph_of_a_scenario(systems: Systems):
    numbers = re.findall(
        r'<rect x="([-\d.]+)" y="([-\d.]+)" width="([\d.]+)" height="([\d.]+)"', system_svg(systems.fitted)
    )
    boxes = [tuple(map(float, found)) for found in numbers]
    assert len(boxes) == len(systems.fitted.units)
    for (x, y, w, h), (x_2, y_2, w_2, h_2) in combinations(boxes, 2):
        assert x + w < x_2 or x_2 + w_2 < x or y + h < y_2 or y_2 + h_2 < y


def test_every_scenario_runs_as_a_compiled_plan(systems: Systems):
    assert StepperFactory(systems.fitted, MasterOptions()).plan_obstacle is None


def test_one_whose_hand_is_led_says_which_inputs_keep_it_from_that():
    scenario = SCENARIOS[LED]
    parameters = parse_parameters(scenario, ["hand=outside"])
    system = scenario().wire(parameters, 0, lambda unit: cached(scenario.units[unit], 3))
    reason = StepperFactory(system, MasterOptions()).plan_obstacle
    assert reason is not None
    assert reason.startswith("inputs come from outside: person.")


def test_a_unit_whose_fmu_proposes_no_step_takes_that_of_its_place(tmp_path: Path):
    file = tmp_path / "push.fmu"
    described_otherwise(cached("Push", 2), file, lambda text: re.sub("<DefaultExperiment[^>]*/>", "", text))
    scenario = SCENARIOS["flyer_impedance"]
    others = {unit: cached(name, 2) for unit, name in scenario.units.items()}
    system = scenario().wire(scenario.parameters_type(), 0, {**others, "push": file}.__getitem__)
    system.check()
    assert system.units["push"].period == find_unit("Push").step
    assert "push: its FMU proposes no communication step; 0.016 s is taken" in "".join(system.tolerated)


def test_a_sampled_unit_in_the_place_of_another_keeps_its_period():
    own = replace(describe_fmu(native_fmu("gain", 3)), name="Own", sampled=True)
    for step, period, is_noted in ((0.25, 0.25, True), (0.05, 0.05, True), (0.2, 0.1, False), (0.1, 0.1, False)):
        s = System()
        s.add("servo", replace(own, step=step), period=Fraction(1, 10), sampled=True)
        sample_in_places(s, {"servo": "VisualServo"})
        assert (float(s.units["servo"].period), bool(s.notes)) == (period, is_noted)
    s = System()
    s.add("servo", replace(own, sampled=False), period=Fraction(1, 10), sampled=True)
    camera = replace(own, step=1 / 30)  # as the scenario's own, which skips pictures
    s.add("camera", camera, period=Fraction(1, 10))
    sample_in_places(s, {"servo": "VisualServo", "camera": "StereoCamera"})
    assert {u.period for u in s.units.values()} == {Fraction(1, 10)}
    assert ["no sampling period of its own" in note for note in s.notes] == [True]
    s.add("same", replace(own, name="VisualServo", step=0.25), period=Fraction(1, 10))  # the name is no proof
    sample_in_places(s, {"same": "VisualServo"})
    assert s.units["same"].period == Fraction(1, 4)


def test_a_parameter_that_only_a_replaced_unit_has_is_noted():
    scenario, s = SCENARIOS["helix_handover"], System()
    s.add("servo", replace(describe_fmu(native_fmu("gain", 3)), name="Own"))
    assert notes_on_exposed(parse_parameters(scenario, ["alpha=0.123"]), s) == [
        "alpha: servo (Own) has no alpha, so it is not set there"
    ]
    assert notes_on_exposed(scenario.parameters_type(), s) == []
