"""The experiment `ir-convergence`: descents by step, and drawings after the paper's figures."""

import numpy as np
import pytest

from handover.controllers.ir_grasp.visibility import Visibility
from handover.cosim.blocks.ports import Floats
from handover.scenarios.published.ir_grasp.grasp_drawings import SEEN
from handover.scenarios.published.ir_grasp.ir_convergence import Descent, IrConvergence, judge_descents, median_of
from handover.scenarios.published.published_experiment import Verdict

NAN = float("nan")


def descent(*thumb_and_ring: tuple[float, float]) -> Descent:
    return Descent(np.array([[thumb, NAN, ring] for thumb, ring in thumb_and_ring]))


def test_the_norm_is_that_of_thumb_and_ring_and_has_no_ends_where_the_object_is_lost_from_sight():
    assert descent((0.03, 0.04), (0.009, 0.012)).ends == pytest.approx((0.05, 0.015))
    assert descent((0.03, 0.04), (NAN, 0.012)).ends is None
    assert descent((0.03, 0.04)).ends is None


def test_a_median_ends_where_fewer_than_half_of_the_curves_go_on_or_see():
    curves: list[Floats] = [np.array(c) for c in ([4.0, 3.0, 2.0], [6.0, NAN], [8.0, NAN], [9.0])]
    assert median_of(curves) == pytest.approx([7.0, NAN], nan_ok=True)


def test_that_the_norm_falls_is_refuted_by_runs_in_which_it_does_not():
    falls, rises = descent((0.03, 0.04), (0.01, 0.01)), descent((0.03, 0.04), (0.04, 0.04))
    assert judge_descents([falls] * 40, True).verdict is Verdict.REPRODUCED
    assert judge_descents([falls] * 35 + [rises] * 5, True).verdict is Verdict.NOT_REPRODUCED
    few = judge_descents([falls] * 20, False)
    assert few.verdict is Verdict.NOT_COMPARABLE
    assert "at least 36" in few.reason
    assert judge_descents([], False).verdict is Verdict.NOT_COMPARABLE


def test_the_plan_takes_the_tables_things_in_both_poses_by_the_papers_algorithm():
    plan = IrConvergence().plan(quick=False)
    assert len({(p["thing"], p["perturbed"]) for p in plan.points}) == len(plan.points) == 10
    assert plan.fixed == {"strategy": "reflex", "correction": "paper"}


def test_each_case_of_figure_9_has_a_scene_in_which_the_sensors_read_so():
    assert {case: scene.case() for case, scene in SEEN.items()} == {c: c for c in Visibility if c.name != "ALL_SEEN"}
