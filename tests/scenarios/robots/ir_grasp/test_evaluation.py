from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from support.scenarios.made_signals import made_signals

from handover.controllers.ir_grasp.ir_reflex import Phase, Stop
from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.plants.ir_grasp.hand import sensor_rays
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.robots.ir_grasp.evaluation import GraspEvaluator
from handover.scenarios.robots.ir_grasp.parameters import Parameters

HELD = (0.1, 0.0)
"""Where a held object is, in H."""


def signals(
    phase: Phase,
    p_HO: tuple[float, float] = HELD,
    touching: int = 3,
    p_WH: float = -0.1,
    index: tuple[float, float] = (0.05, 0.05),
    thumb: float = 0.01,
    p_ground: tuple[float, float] = (0.0, 0.0),
    stop: Stop = Stop.THRESHOLD,
) -> Signals:
    """Return what a hand along x, and an object at a place in its frame, would show.

    The index's distances are as seen, and true; the thumb's is as seen.
    """
    scene: dict[str, Any] = {"p_WH": [p_WH, 0.0], "p_WO": [p_WH + p_HO[0], p_HO[1]], "yaw": 0.0, "yaw_O": 0.0}
    scene |= {"range": [0.01, index[1], 0.01], "q": np.zeros(8), "p_ground": p_ground, "touching": touching}
    reflex: dict[str, Any] = {"distance": [thumb, index[0], 0.01], "cost": 1e-5, "yaw_cmd": 0.0, "sigma_cmd": 0.0}
    reflex |= {"p_WH_cmd": [p_WH, 0.0], "steps": 4, "phase": phase, "stop": stop}
    return made_signals({"scene": scene, "reflex": reflex})


def follow(*moments: tuple[float, Signals]) -> GraspEvaluator:
    evaluator = GraspEvaluator(Parameters())
    for t, seen in moments:
        evaluator(t, seen)
    evaluator.finish(moments[-1][1])
    return evaluator


def grasp(*after: tuple[float, Signals], at_closing: Signals | None = None) -> GraspEvaluator:
    begin = ((0.0, signals(Phase.REACH)), (0.5, signals(Phase.CHECK)), (1.0, signals(Phase.PROBE)))
    return follow(*begin, (3.0, signals(Phase.CLOSE)), (4.0, at_closing or signals(Phase.PULL)), *after)


def test_an_object_that_comes_along_and_stays_is_held():
    evaluator = grasp((5.0, signals(Phase.SHAKE, p_WH=-0.25)), (7.0, signals(Phase.DONE)), (7.4, signals(Phase.DONE)))
    outcome = evaluator.outcome()
    assert (evaluator.over, outcome.success) == (True, True)
    assert "threshold" in outcome.reason
    assert outcome.metrics["refinement_time"].value == pytest.approx(2.5)
    assert outcome.metrics["probing_moves"].value == 1
    assert evaluator.moments == {"start": 0.0, "before closing": 3.0, "end": 7.4}


@pytest.mark.parametrize(("phase", "when"), [(Phase.PULL, "during the pull"), (Phase.SHAKE, "during the shake")])
def test_an_object_that_slipped_out_is_not_held_and_it_is_reported_when(phase: Phase, when: str):
    lost: dict[str, Any] = {"p_HO": (0.2, 0.0), "touching": 0}
    between = [(5.0, signals(Phase.SHAKE))] if phase is Phase.SHAKE else []
    evaluator = grasp(*between, (5.5, signals(phase, **lost)), *((t, signals(Phase.DONE, **lost)) for t in (7.0, 7.4)))
    assert (evaluator.over, evaluator.outcome().success) == (True, False)
    assert f"slipped out of the closed hand {when}" in evaluator.outcome().reason


def test_a_hand_that_closed_beside_the_object_says_where_it_is_and_one_finger_that_pushes_holds_nothing():
    beside: dict[str, Any] = {"p_HO": (0.17, 0.03), "touching": 0}
    done = ((t, signals(Phase.DONE, **beside)) for t in (7.0, 7.4))
    outcome = grasp(*done, at_closing=signals(Phase.PULL, **beside)).outcome()
    assert not outcome.success
    assert "does not touch the object, 170 mm ahead of the wrist and +30 mm beside it" in outcome.reason
    assert not grasp(*((t, signals(Phase.DONE, touching=1)) for t in (7.0, 7.4))).outcome().success


def test_a_hand_that_closed_at_its_limit_says_at_which_and_how_far_beyond_the_object_is():
    evaluator, reach = GraspEvaluator(Parameters()), float(ReflexParams().reach[0])
    placed = SimpleNamespace(start={"p_WH_pregrasp": [-0.1, 0.01], "yaw_pregrasp": 0.0})
    evaluator.note_units({"reflex": cast(PlacedUnit, placed)})
    first, seen = (
        signals(Phase.REACH, p_WH=-0.25),
        signals(Phase.CLOSE, p_WH=-0.1 + reach, p_HO=(0.30, 0.0), stop=Stop.REACH),
    )
    rest = ((4.0, signals(Phase.PULL)), (5.0, signals(Phase.DONE)), (5.4, signals(Phase.DONE)))
    for t, moment in ((0.0, first), (3.0, seen), *rest):
        evaluator(t, moment)
    outcome = evaluator.outcome()
    pads, _ = sensor_rays(np.array([-0.1 + reach, 0.0]), 0.0, np.zeros(8))
    middle = seen["scene.p_WO"][0] + evaluator.parameters.solid.parts[0].centroid[0]
    assert outcome.metrics["beyond_reach"].value == pytest.approx(middle - pads[[0, 2]].mean(axis=0)[0])
    assert f"limit of its reach in x, +{1e3 * reach:.0f} mm of at most {1e3 * reach:.0f} mm" in outcome.reason
    pushed = np.linalg.norm(seen["scene.p_WO"] - first["scene.p_WO"])
    assert f"pushed the object {1e3 * pushed:.0f} mm" in outcome.reason


def test_a_controller_that_is_done_before_its_hand_closed_has_failed():
    evaluator = follow((0.0, signals(Phase.REACH)), *((t, signals(Phase.DONE)) for t in (1.0, 1.4)))
    assert (evaluator.over, evaluator.outcome().success) == (True, False)
    assert evaluator.outcome().reason == "done at 1.0 s, before the hand closed"


def test_a_controller_without_a_phase_of_closing_is_judged_by_the_pull():
    seen = ((1.0, Phase.PULL), (5.0, Phase.SHAKE), (7.0, Phase.DONE), (7.4, Phase.DONE))
    outcome = follow((0.0, signals(Phase.REACH)), *((t, signals(phase)) for t, phase in seen)).outcome()
    assert outcome.success
    assert outcome.reason == "pulled back at 1.0 s; the object came along with the hand and stayed in it"


def test_what_a_finger_does_not_see_is_no_number_and_distinguished_from_what_is_at_the_end_of_its_range():
    def at_closing(seen: float, true: float, thumb: float = 0.01) -> dict[str, Metric]:
        closing = signals(Phase.CLOSE, index=(seen, true), thumb=thumb)
        return dict(follow((0.0, signals(Phase.REACH)), (1.0, closing)).outcome().metrics)

    seen, unseen = at_closing(0.06, 0.07), at_closing(0.065, 0.2)
    for name, value in (("final_distance_index", 0.06), ("true_distance_index", 0.07)):
        assert seen[name].value == value
        assert np.isnan(unseen[name].value)
    assert unseen["final_distance_index"].description.endswith("by [Luberto] eq. (11) (sees nothing)")
    assert unseen["true_distance_index"].description.endswith("along the beam (meets nothing)")
    assert seen["true_distance_index"].description.endswith("along the beam")
    assert (seen["final_cost"].value, unseen["final_cost"].value) == (1e-5, 1e-5)  # the index is not in it
    assert np.isnan(at_closing(0.06, 0.07, thumb=0.065)["final_cost"].value)


def test_a_run_that_ends_early_says_in_which_phase():
    evaluator = follow((0.0, signals(Phase.REACH)), (0.5, signals(Phase.PROBE)))
    assert not evaluator.over
    assert "stopped at 0.5 s in phase PROBE" in evaluator.outcome().reason


def test_what_the_ground_carried_the_object_is_no_displacement_by_the_hand():
    def displacement(p_ground: tuple[float, float]) -> float:
        closing = signals(Phase.CLOSE, p_HO=(0.13, 0.04), p_ground=p_ground)
        return follow((0.0, signals(Phase.REACH)), (1.0, closing)).outcome().metrics["displacement"].value

    assert displacement((0.0, 0.0)) == pytest.approx(0.05)
    assert displacement((0.03, 0.04)) == pytest.approx(0.0, abs=1e-12)
    assert displacement((0.03, 0.0)) == pytest.approx(0.04)
