"""The hands that people lead in a plan's rounds, and in which rounds nobody could."""

from collections.abc import Sequence
from dataclasses import fields

from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.runs.execution.selection import find_scenario
from handover.scenarios.study.plan.plan import Condition, StudyPlan

_CHOICE = "hand"
"""Parameter of a scenario by which a hand is led from outside."""


class NoHand(ValueError):
    """A scenario in which nobody outside can lead a hand."""


def round_parameters(condition: Condition) -> list[str]:
    """Return the parameters of a round: those of the plan, and that its hand is led from outside."""
    return [*condition.given, f"{_CHOICE}=outside"]


def led_hand_of(scenario: str, parameters: Sequence[str]) -> LedHand:
    """Return the hand that somebody outside leads in a scenario with parameters, texts `NAME=VALUE`.

    Raises:
        NoHand: there is none. InvalidParameter: a value is invalid.
    """
    kind = find_scenario(scenario)
    chooses = any(f.name == _CHOICE for f in fields(kind.parameters_type))
    led = None
    if chooses or not any(p.startswith(f"{_CHOICE}=") for p in parameters):  # in some a hand is always led
        led = kind().led_hand(parse_parameters(kind, parameters))
    if led is None:
        raise NoHand(
            f"in {scenario} nobody outside can lead a hand; where it can be led, `handover list SCENARIO` shows a "
            f"parameter {_CHOICE}, as of flyer_robot_to_human"
        )
    return led


def hand_faults(plan: StudyPlan) -> list[str]:
    """Return, of each task and behaviour of a plan in which nobody could lead the hand, why."""
    faults: list[str] = []
    for c in plan.conditions:
        try:
            led_hand_of(c.scenario, round_parameters(c))
        except (NoHand, InvalidParameter) as e:
            faults.append(f"tasks.{c.task}, {c.behaviour}: {e}")
    return list(dict.fromkeys(faults))
