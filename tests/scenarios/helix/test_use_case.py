"""The use case: what its evaluation tells of a ball's way, what is refused before it starts, and a whole run."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli
from support.kept_runs import kept_run
from support.scenarios.helix_signals import PICTURE, port, views_and_ports
from support.scenarios.parameter_origins import assert_every_default_has_its_origin

import handover.scenarios.helix
from handover.controllers.helix.servo.visual_servo import Phase, Verdict
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import WiringError
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.fmus.build import cached
from handover.plants.helix.hand.partner_parameters import Holder
from handover.plants.helix.hand.partner_parameters import Params as HandParams
from handover.scenarios.helix.helix_use_case import BowlPlace, HelixUseCase, UseCaseParameters
from handover.scenarios.helix.parameters import Tuning
from handover.scenarios.helix.use_case_evaluation import UseCaseEvaluator

P = UseCaseParameters()
OVER = P.p_WG_drop
ASIDE = np.array([0.3, 0.0, 0.0])
LYING = P.p_WD - np.array([0.0, 0.0, 0.035])


def signals(phase: Phase, holder: Holder, p_WO: Any, verdict: Verdict = Verdict.NONE) -> Signals:
    """Return what a gripper over the bowl and a ball at a place would show."""
    units, ports = views_and_ports(phase, holder)
    units["arm"]["p_WG"] = (OVER,)
    units["hand"]["p_WO"] = (np.asarray(p_WO, dtype=np.float64),)
    units["servo"]["verdict"] = (np.array([int(verdict)]),)
    items = tuple((v.name, int(v)) for v in Verdict)
    ports["servo"]["verdict"] = port("verdict", Kind.ENUMERATION, items=items)
    return Signals(units, ports, PICTURE)


def follow(*seen: tuple[float, Signals]) -> UseCaseEvaluator:
    evaluator = UseCaseEvaluator(P, P.bowl, P.carry_patience)
    for t, at_t in seen:
        evaluator(t, at_t)
    evaluator.finish(seen[-1][1])
    return evaluator


TAKEN = (17.0, signals(Phase.HOLD, Holder.GRIPPER, [0.16, 0.0, -0.6]))
CARRIED = (25.0, signals(Phase.DROP, Holder.GRIPPER, OVER))


def falling(beside: float, end: Any, phase: Phase = Phase.DROP) -> list[tuple[float, Signals]]:
    """Return a ball that falls past the rim beside the bowl's middle, and lies at a place a second later."""
    aside = np.array([beside, 0.0, 0.0])
    rest = [(31.0 + 0.1 * k, end) for k in range(8)]
    ways = [(30.0, OVER + aside), (30.2, P.p_WD + aside - np.array([0.0, 0.0, 0.01])), *rest]
    return [(t, signals(phase, Holder.FREE, p)) for t, p in ways]


def test_a_ball_that_rests_in_the_bowl_is_a_success():
    evaluator = follow(TAKEN, CARRIED, *falling(0.02, LYING))
    assert evaluator.over
    outcome = evaluator.outcome()
    assert outcome.success
    assert "the ball rests in the bowl since 31.0 s; it fell in 0.020 m beside the middle" in outcome.reason
    figures = {name: m.value for name, m in outcome.metrics.items()}
    assert figures["drop_offset"] == pytest.approx(0.02)
    assert figures["carry_time"] == pytest.approx(13.0)
    assert figures["task_time"] == pytest.approx(31.0)
    assert "final_distance" not in figures


def test_an_evaluator_that_is_restored_judges_as_before():
    seen, other = follow(TAKEN, CARRIED, *falling(0.02, LYING)), UseCaseEvaluator(P, P.bowl, P.carry_patience)
    for evaluator in (seen, other):
        evaluator.bind(P)
    other.set_state(seen.get_state())
    assert other.outcome() == seen.outcome()


def test_it_is_not_over_before_the_ball_rests():
    assert not follow(TAKEN, CARRIED, *falling(0.02, LYING)[:4]).over
    assert not follow(TAKEN, CARRIED).over


def test_a_ball_that_missed_the_bowl_says_by_how_much():
    outcome = follow(TAKEN, CARRIED, *falling(0.1, [0.1, -0.16, -1.2])).outcome()
    assert not outcome.success
    assert outcome.reason.startswith(
        "the ball missed the bowl by 0.020 m: it fell past the rim's height 0.100 m beside"
    )


def test_a_ball_that_left_the_bowl_again_is_no_success():
    outcome = follow(TAKEN, CARRIED, *falling(0.02, [0.1, -0.16, -1.2])).outcome()
    assert not outcome.success
    assert "left it again" in outcome.reason


def test_a_ball_that_fell_on_the_way_says_how_far_it_was():
    ball = falling(0.3, [0.3, -0.16, -1.2], Phase.CARRY)
    outcome = follow(TAKEN, (25.0, signals(Phase.CARRY, Holder.GRIPPER, OVER + ASIDE)), *ball).outcome()
    assert not outcome.success
    assert outcome.reason.startswith("the gripper lost the ball on the way at 30.0 s, 0.300 m from above the bowl")


def test_an_arm_that_gives_up_carrying_says_why():
    given_up = signals(Phase.GIVEN_UP, Holder.GRIPPER, OVER, Verdict.LOST_RING)
    evaluator = follow(TAKEN, (25.0, signals(Phase.CARRY, Holder.GRIPPER, OVER)), (40.0, given_up))
    assert evaluator.over
    assert evaluator.outcome().reason.startswith("lost ring while carrying: the gripper stays 0.010 m from its goal")


def test_an_arm_that_is_too_slow_fails():
    t = 17.0 + P.carry_patience
    evaluator = follow(TAKEN, (t, signals(Phase.CARRY, Holder.GRIPPER, OVER)))
    assert evaluator.over
    assert evaluator.outcome().reason.startswith("not dropped within 60 s after the hand let go")


def test_without_a_handover_the_handover_says_why():
    closed = [(t, signals(Phase.HOLD, Holder.HAND, OVER + ASIDE)) for t in (18.0, 20.1)]
    evaluator = follow(*closed)
    assert evaluator.over
    assert evaluator.outcome().reason.startswith("no handover: the gripper closed with the ball")


def built(**values: Any) -> Any:
    return HelixUseCase().build(UseCaseParameters(**values), 0, lambda name: cached(HelixUseCase.units[name], 3))


@pytest.mark.parametrize(
    ("values", "words"),
    [({"bowl_distance": 0.3}, "but the arm is sure to reach 0.15 m"), ({"bowl_height": -0.3}, "is not known to reach")],
)
def test_a_bowl_that_the_arm_may_not_reach_is_warned_of(values: dict[str, float], words: str):
    notes = built(**values).notes
    assert [words in note for note in notes if note.startswith("the gripper is to open")] == [True]
    assert not built().notes


@pytest.mark.parametrize("values", [{"bowl_distance": 0.6}, {"bowl_height": -1.0}, {"drop_height": 0.7}])
def test_a_bowl_out_of_reach_is_told_before_anything_starts(values: dict[str, float]):
    with pytest.raises(WiringError, match=r"the place above the bowl, .* is out of the arm's reach: .* no nearer than"):
        built(**values).check()


@pytest.mark.parametrize("tuning", list(Tuning))
def test_the_bowl_as_it_stands_is_within_reach(tuning: Tuning):
    built(tuning=tuning).check()


def test_what_it_adds_has_an_origin():
    file = Path(handover.scenarios.helix.__file__).parent / "paper.toml"
    paper = tomli.loads(file.read_text(encoding="utf-8"))
    assert_every_default_has_its_origin(paper["use_case"], BowlPlace)
    for name, entry in paper["bowl"].items():
        assert getattr(HandParams(), name) == entry["value"]
    servo = UseCaseParameters().settings
    assert servo["threshold_drop"] == paper["delivery"]["threshold_drop"]["value"][Tuning.OWN]
    assert UseCaseParameters(tuning=Tuning.THESIS).settings["threshold_drop"] == 0.05


@pytest.mark.slow
def test_the_ball_gets_from_the_hand_into_the_bowl():
    folder = kept_run("run", "helix_use_case", "--no-report")
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["success"], summary["reason"]
    assert summary["metrics"]["drop_offset"]["value"] < P.bowl_radius - HandParams().ball_radius
    record = Record(folder / "signals.parquet")
    np.testing.assert_allclose(record["hand.p_WO"][-1], LYING, atol=0.005)
    phases = record["servo.phase"].tolist()
    first = [phases.index(int(p)) for p in (Phase.GRASP, Phase.HOLD, Phase.CARRY, Phase.DROP)]
    assert first == sorted(first)
