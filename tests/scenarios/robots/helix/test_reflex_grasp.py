"""The grasp by infrared fingers: where the ball is offered, what the cameras see, what is said of it, whole runs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.flyer_runs import metric, run
from support.scenarios.helix_signals import PICTURE, port, views_and_ports

from handover.controllers.helix.servo.visual_servo import Phase
from handover.cosim.blocks.variable import Kind
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.fmus.build import cached
from handover.plants.helix.hand.partner_parameters import Holder
from handover.scenarios.robots.helix.helix_reflex_grasp import HelixReflexGrasp, ReflexGraspEvaluator, offered
from handover.scenarios.robots.helix.reflex_grasp_parameters import LastStretch, Offer, ReflexGraspParameters
from handover.scenarios.robots.helix.workspace import cameras_that_see, reach

P = ReflexGraspParameters()


def signals(phase: Phase, beside: float, along: float, believed: Any, holder: Holder = Holder.HAND) -> Signals:
    units, ports = views_and_ports(phase, holder, beside, along)
    units["reflex"] = {"p_GO_est": (np.asarray(believed, dtype=np.float64),)}
    ports["reflex"] = {"p_GO_est": port("p_GO_est", Kind.REAL, shape=(3,))}
    return Signals(units, ports, PICTURE)


def closed_beside(beside: float) -> ReflexGraspEvaluator:
    evaluator, there = ReflexGraspEvaluator(P.handover), [0.0, 0.0, 0.0]
    for t, at_t in (
        (9.9, signals(Phase.DESCEND, 0.03, 0.02, [0.03, 0.0, 0.02])),
        (10.0, signals(Phase.GRASP, beside, 0.001, [0.002, 0.0, 0.001])),
        (15.0, signals(Phase.GRASP, 0.02, 0.0, there)),
        *((t, signals(Phase.HOLD, 0.02, 0.0, there)) for t in (20.0, 22.5)),
    ):
        evaluator(t, at_t)
    return evaluator


def test_the_ball_s_place_counts_as_the_gripper_begins_to_close():
    evaluator = closed_beside(0.012)
    assert evaluator.over
    outcome = evaluator.outcome()
    figures = {name: m.value for name, m in outcome.metrics.items()}
    wanted = {"closing_offset_lateral": 0.012, "closing_offset_axial": 0.001, "felt_error": 0.010}
    assert {name: figures[name] for name in wanted} == pytest.approx(wanted)
    assert not outcome.success
    assert outcome.reason.endswith("the ball was 0.012 m beside its axis, 0.002 m as the controller had it")
    other = ReflexGraspEvaluator(P.handover)
    for each in (evaluator, other):
        each.bind(P)
    other.set_state(evaluator.get_state())
    assert other.outcome() == outcome
    never_closed = ReflexGraspEvaluator(P.handover)
    never_closed(1.0, signals(Phase.APPROACH, 0.03, 0.02, [0.0, 0.0, 0.0]))
    assert not wanted.keys() & never_closed.outcome().metrics.keys()


def test_places_are_drawn_within_reach_and_sight_and_given_ones_are_kept():
    drawn = [offered(P, seed).p_WO for seed in range(50)]
    for p_WO in drawn:
        assert np.hypot(*p_WO[:2]) <= reach(float(p_WO[2]))
        assert cameras_that_see(p_WO) == 2
    assert len({tuple(p_WO) for p_WO in drawn}) == 50
    given = ReflexGraspParameters(offer=Offer.GIVEN, azimuth=1.0, radius=0.1, height=-0.62)
    np.testing.assert_allclose(offered(given, 3).p_WO, [0.1 * np.cos(1.0), 0.1 * np.sin(1.0), -0.62])


def started(seed: int, **values: Any) -> dict[str, dict[str, Any]]:
    fmus = HelixReflexGrasp.units
    system = HelixReflexGrasp().build(ReflexGraspParameters(**values), seed, lambda name: cached(fmus[name], 3))
    system.check()
    return {name: dict(unit.start) for name, unit in system.units.items()}


def test_with_and_without_the_reflex_a_seed_gives_the_same_situation():
    with_it, without = started(7), started(7, reflex=False, near=P.near)
    assert (with_it["reflex"].pop("feels"), without["reflex"].pop("feels")) == (True, False)
    np.testing.assert_equal(with_it, without)
    for cameras, within in ((LastStretch.BALL_HIDDEN, (0.0, 0.04)), (LastStretch.COVERED, (0.04, 0.0))):
        other = started(8, cameras=cameras, near=0.04)
        assert not np.array_equal(other["hand"]["p_WO_0"], with_it["hand"]["p_WO_0"])
        assert (other["camera"]["cover_within"], other["camera"]["hide_ball_within"]) == within


FAST = ("cameras=covered", "offer=given", "radius=0.14", "azimuth=0.4")


@pytest.mark.slow
def test_with_covered_cameras_the_fingers_centre_the_gripper(tmp_path: Path):
    done = run(HelixReflexGrasp, tmp_path / "with", *FAST, seed=3)
    assert done.summary["success"], done.summary["reason"]
    assert metric(done, "closing_offset_lateral") < 0.006
    assert metric(done, "felt_error") < 0.005
    record = Record(tmp_path / "with" / "signals.parquet")
    is_covered = (np.diff(record["vision.seen_R"].astype(float)) < 0.0).argmax()
    apart = np.linalg.norm(record["hand.p_WO"] - record["arm.p_WG"], axis=1)
    assert apart[is_covered] == pytest.approx(P.near, abs=0.015)
    assert HelixReflexGrasp().time_figures(P, record)[0].name == "reflex"
