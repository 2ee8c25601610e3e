"""The use case: what its evaluation tells of a ball's way, what is refused before it starts, and a whole run."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli
from support.kept_runs import kept_run
from support.scenarios.helix_signals import PICTURE, views_and_ports
from support.wording import Wording

import handover.scenarios.robots.helix
from handover.controllers.helix.servo.visual_servo import Phase, Verdict
from handover.cosim.exceptions import WiringError
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.fmus.build import cached
from handover.plants.helix.hand.partner_parameters import Holder
from handover.plants.helix.hand.partner_parameters import Params as HandParams
from handover.scenarios.robots.helix.helix_use_case import HelixUseCase, UseCaseEvaluator, UseCaseParameters
from handover.scenarios.robots.helix.parameters import Tuning

P = UseCaseParameters()
OVER = P.p_WG_drop
ASIDE = np.array([0.3, 0.0, 0.0])
LYING = P.p_WD - np.array([0.0, 0.0, 0.035])


def signals(phase: Phase, holder: Holder, p_WO: Any, verdict: Verdict = Verdict.NONE) -> Signals:
    """Return what a gripper over the bowl and a ball at a place would show."""
    units, ports = views_and_ports(phase, holder, verdict=verdict)
    units["arm"]["p_WG"] = (OVER,)
    units["hand"]["p_WO"] = (np.asarray(p_WO, dtype=np.float64),)
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


def test_a_ball_that_rests_in_the_bowl_is_a_success(wording: Wording):
    assert not follow(TAKEN, CARRIED, *falling(0.02, LYING)[:4]).over
    assert not follow(TAKEN, CARRIED).over
    evaluator = follow(TAKEN, CARRIED, *falling(0.02, LYING))
    assert evaluator.over
    outcome = evaluator.outcome()
    assert outcome.success
    wording.check(outcome.reason)
    figures = {name: m.value for name, m in outcome.metrics.items()}
    wanted = {"drop_offset": 0.02, "carry_time": 13.0, "task_time": 31.0}
    assert {name: figures[name] for name in wanted} == pytest.approx(wanted)
    assert "final_distance" not in figures
    other = UseCaseEvaluator(P, P.bowl, P.carry_patience)
    for each in (evaluator, other):
        each.bind(P)
    other.set_state(evaluator.get_state())
    assert other.outcome() == evaluator.outcome()


ON_THE_WAY = (25.0, signals(Phase.CARRY, Holder.GRIPPER, OVER))
AWAY = (25.0, signals(Phase.CARRY, Holder.GRIPPER, OVER + ASIDE))
FAILED: tuple[tuple[tuple[float, Signals], ...], ...] = (
    (TAKEN, CARRIED, *falling(0.1, [0.1, -0.16, -1.2])),
    (TAKEN, CARRIED, *falling(0.02, [0.1, -0.16, -1.2])),
    (TAKEN, AWAY, *falling(0.3, [0.3, -0.16, -1.2], Phase.CARRY)),
    (TAKEN, ON_THE_WAY, (40.0, signals(Phase.GIVEN_UP, Holder.GRIPPER, OVER, Verdict.LOST_RING))),
    (TAKEN, (17.0 + P.carry_patience, ON_THE_WAY[1])),
    tuple((t, signals(Phase.HOLD, Holder.HAND, OVER + ASIDE)) for t in (18.0, 20.1)),
)


def test_what_failed_says_why(wording: Wording):
    """The ball missed the bowl, left it again or fell on the way; the arm gave up, was too slow or got no ball."""
    for seen in FAILED:
        evaluator = follow(*seen)
        assert evaluator.over
        assert not evaluator.outcome().success
        wording.check(evaluator.outcome().reason)


def built(**values: Any) -> Any:
    return HelixUseCase().build(UseCaseParameters(**values), 0, lambda name: cached(HelixUseCase.units[name], 3))


def test_a_bowl_that_the_arm_may_not_reach_is_warned_of_and_one_out_of_reach_refused(wording: Wording):
    for values in ({"bowl_distance": 0.3}, {"bowl_height": -0.3}):
        (note,) = (note for note in built(**values).notes if note.startswith("the gripper is to open"))
        wording.check(note)
    assert not built().notes
    for tuning in Tuning:
        built(tuning=tuning).check()
    for values in ({"bowl_distance": 0.6}, {"drop_height": 0.7}):
        with pytest.raises(WiringError) as caught:
            built(**values).check()
        wording.check(caught.value)


def test_a_tuning_sets_the_threshold_of_the_drop():
    file = Path(handover.scenarios.robots.helix.__file__).parent / "paper.toml"
    paper = tomli.loads(file.read_text(encoding="utf-8"))
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
