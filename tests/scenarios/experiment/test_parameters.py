import enum
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import pytest
from support.wording import Wording

from handover.cosim.blocks.declarations import DeclarationError, declared_variables
from handover.cosim.blocks.units import Metre
from handover.cosim.blocks.variable import Causality
from handover.scenarios.catalog import SCENARIOS, named_scenario
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.needs import any_of, needs_of, parameter
from handover.scenarios.experiment.parameters import (
    InvalidParameter,
    check_effects,
    idle_parameters,
    parse_parameters,
)
from handover.scenarios.robots.free_flyer.handover.handovers import RobotToHuman
from handover.scenarios.robots.helix.disturbances import Cover
from handover.scenarios.robots.helix.helix_handover import HelixHandover
from handover.scenarios.robots.helix.parameters import HandPlace
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp


def test_values_are_parsed_by_their_declared_kind_and_what_is_not_given_has_its_default():
    p = parse_parameters(HelixHandover, ["alpha=0.1", "place=back_left", "cover=right"])
    assert (p.alpha, p.place, p.cover) == (0.1, HandPlace.BACK_LEFT, Cover.RIGHT)
    assert parse_parameters(HelixHandover, []) == HelixHandover.parameters_type()


@pytest.mark.parametrize(
    ("scenario", "given"),
    [
        (HelixHandover, ["alfa=0.1"]),
        (HelixHandover, ["alpha=fast", "alpha=0.1"]),
        (HelixHandover, ["alpha=", "radius=-1", "nothing=3", "place=behind"]),
        (HelixHandover, ["alpha=nan"]),
        (HelixHandover, ["alpha=1e999"]),
        (HelixHandover, ["alpha=0.1,0.2"]),
        (HelixHandover, ["alpha"]),
        (RobotToHuman, ["stuck_nozzle=13"]),
        (RobotToHuman, ["stuck_nozzle=1.5"]),
        (IrGrasp, ["shift=0.1"]),
        (IrGrasp, ["shift=0.1 0.2"]),
    ],
)
def test_bad_parameters_are_refused_with_valid_values(scenario: type[Any], given: list[str], wording: Wording):
    with pytest.raises(InvalidParameter) as caught:
        parse_parameters(scenario, given)
    assert len(caught.value.faults) == len(given)
    wording.check(caught.value)


ROBOT_TO_HUMAN = "flyer_robot_to_human"


@pytest.mark.parametrize(
    ("scenario", "idle", "given", "cure"),
    [
        ("helix_handover", ["move_from=6", "move_for=1"], [], ["move_height=0.1"]),
        ("helix_handover", ["hide_from=6", "cover_from=6"], [], ["hide_for=1", "cover=left"]),
        ("helix_reflex_grasp", ["azimuth=0.2", "near=0.1"], [], ["offer=given", "cameras=covered"]),
        ("vsl_hybrid", ["x_0=0.3,0,0.1", "x_g=0.4,0,0.1", "arm_seed=3"], [], ["path=custom", "length_scatter=0.001"]),
        ("vsl_hybrid", ["waypoints=way.csv"], ["path=square"], ["path=custom"]),
        ("vsl_hybrid", ["x_0=0.3,0,0.1"], ["path=custom", "waypoints=way.csv"], ["waypoints="]),
        ("flyer_impedance", ["torque=4", "delay_known=false"], [], ["kind=torque", "navigation_delay=0.1"]),
        ("flyer_arm_impedance", ["force=4"], ["kind=torque"], ["kind=force"]),
        ("flyer_impedance", ["stuck_nozzle=3"], ["propulsion=limited"], ["propulsion=nozzles"]),
        ("flyer_two_robots", ["hand_delay=1"], ["hands=one_at_end"], ["hands=two"]),
        (ROBOT_TO_HUMAN, ["skill=0.5", "sight_error=0"], ["hand=outside"], ["hand=simulated"]),
        (ROBOT_TO_HUMAN, ["interface_delay=0"], ["hand_track=t.csv"], ["hand_track="]),
        ("ir_grasp", ["disc_radius=0.05", "expected_radius=0.05"], ["thing=bar"], ["thing=disc", "expected=disc"]),
        ("ir_grasp", ["corner_count=4"], [], ["thing=polygon"]),
        ("ir_grasp", ["forward=0.05"], ["strategy=contact"], ["strategy=forward"]),
        ("ir_grasp", ["correction=fast", "literal=true"], ["strategy=blind"], ["strategy=reflex"]),
        ("ir_grasp", ["last_grasp=r"], [], ["correction=fast"]),
        ("ir_grasp", ["carried_from=1", "carried_until=9", "nudge_time=1"], [], ["carried_speed=0.1", "nudge=0.01,0"]),
        ("ir_grasp", ["turn_most=0.1"], ["perturbed=false"], ["perturbed=true"]),
        ("ir_grasp", ["shift_most=0.1"], ["shift=0.01,0", "turn=0.1"], ["shift=0,0", "turn=0"]),
    ],
)
def test_what_nothing_comes_of_is_refused_until_what_it_needs_is_set(
    scenario: str, idle: list[str], given: list[str], cure: list[str], wording: Wording
):
    kind = named_scenario(scenario)
    with pytest.raises(InvalidParameter) as caught:
        check_effects(kind, parse_parameters(kind, [*idle, *given]))
    assert len(caught.value.faults) == len(idle)
    wording.check(caught.value)
    cured = {text.partition("=")[0]: text for text in (*idle, *given, *cure)}
    check_effects(kind, parse_parameters(kind, [*cured.values()]))


class _Kind(enum.IntEnum):
    PLAIN = 0
    ROUND = 1


@dataclass(frozen=True, kw_only=True)
class _Parameters:
    kind: _Kind = parameter(_Kind.PLAIN, "its kind")
    speed: Metre = parameter(0.0, "its speed")
    late: Metre = parameter(0.0, "its delay", needs=(any_of("speed", "kind"),))


def test_what_would_do_is_said_of_each_parameter_that_is_needed_of_some():
    kind = cast(Any, SimpleNamespace(parameters=lambda: declared_variables(_Parameters, Causality.PARAMETER)))
    assert idle_parameters(kind, _Parameters(late=1.0)) == {"late": "speed is set or kind=round"}
    assert not idle_parameters(kind, _Parameters(late=1.0, kind=_Kind.ROUND))


def test_what_needs_a_parameter_that_is_not_beside_it_is_refused():
    @dataclass(frozen=True, kw_only=True)
    class Parameters:
        late: Metre = parameter(0.0, "its delay", needs=(any_of("sped"),))

    with pytest.raises(DeclarationError) as e:
        needs_of(Parameters)
    assert (e.value.owner, e.value.field) == ("Parameters", "late")


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_nothing_is_said_of_defaults_whatever_else_is_set(scenario: str):
    kind: type[Experiment[Any]] = named_scenario(scenario)
    assert not idle_parameters(kind, kind.parameters_type())
