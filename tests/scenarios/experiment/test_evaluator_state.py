"""The state of an evaluator: what it has seen, and the scenario's parameters wherever they stand in it."""

import enum
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from handover.cosim.blocks.ports import Vector2, parameter
from handover.cosim.blocks.state import NotPlainData
from handover.cosim.blocks.units import Metre
from handover.cosim.system.signals import Signals
from handover.scenarios.experiment.experiment import Evaluator, Outcome
from handover.scenarios.runs.results.tolerated_faults import EvaluatorNotSaved, GuardedEvaluator


class Side(enum.IntEnum):
    LEFT = 0
    RIGHT = 1


@dataclass(frozen=True, kw_only=True)
class Parameters:
    goal: Vector2[Metre] = parameter(np.array([0.3, 0.6]), "where it is to come")
    side: Side = parameter(Side.RIGHT, "from which side")


class Follower(Evaluator):
    """Keeps the parameters, and what it made of them, under names of its own."""

    def __init__(self, parameters: Parameters) -> None:
        self.p, self.side, self.seen = parameters, parameters.side, 0
        self.tried: Any = [(replace(parameters, side=Side.LEFT), 0.5)]

    def __call__(self, t: float, signals: Signals) -> None:
        raise NotImplementedError

    @property
    def over(self) -> bool:
        return False

    def outcome(self) -> Outcome:
        raise NotImplementedError


def test_parameters_are_kept_under_any_name():
    before, after = Follower(Parameters()), Follower(Parameters())
    for evaluator in (before, after):
        evaluator.bind(Parameters())
    before.seen = 3
    after.set_state(before.get_state())
    assert after.seen == 3
    assert after.p.goal.tolist() == [0.3, 0.6]
    assert after.side is Side.RIGHT
    assert after.tried[0][0].side is Side.LEFT


def test_what_cannot_be_kept_is_reported_with_what_would_be_right():
    evaluator = Follower(Parameters())
    with pytest.raises(NotPlainData, match="Parameters"):
        evaluator.get_state()
    evaluator.bind(Parameters())
    evaluator.tried = {1, 2}
    with pytest.raises(EvaluatorNotSaved, match=r"Follower has seen cannot .* builtins\.set: .* its `records` names"):
        GuardedEvaluator(evaluator).packed()
