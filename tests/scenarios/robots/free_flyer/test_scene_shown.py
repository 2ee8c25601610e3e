"""What scenes of the free-flyer hold in view, and that the hand is as round as where it touches."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from support.scenarios.flyer_runs import kept, run

from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.record.reader import Record
from handover.plants.free_flyer.hand.hand_kinematics import PALM_BONES, PALM_RADIUS
from handover.scenarios.robots.free_flyer.handover.hand_practice import HandPractice, PracticeParameters
from handover.scenarios.robots.free_flyer.replay import replay_handover
from handover.scenarios.robots.free_flyer.scene import EDGE, robot_at


def test_the_cube_is_in_view_wherever_it_flies_and_the_palm_is_drawn_where_it_touches():
    record = kept("flyer_robot_to_human").record
    shown = replay_handover(record)
    assert shown.window is not None
    assert (shown.window.min(axis=0) <= record["robot.p_WB"].min(axis=0) - EDGE / 2.0).all()
    assert (shown.window.max(axis=0) >= record["robot.p_WB"].max(axis=0) + EDGE / 2.0).all()
    palm = next(body for body in shown.bodies if body.label == "hand")
    bones = np.array(PALM_BONES).reshape(-1, 3)
    x, y, z = (palm.mesh.vertices - bones.mean(axis=0)).T
    half = np.ptp(bones, axis=0) / 2.0
    away = np.maximum([np.abs(x) - half[0], np.abs(y) - half[1]], 0.0)
    np.testing.assert_allclose(np.linalg.norm(away, axis=0) ** 2 + z**2, PALM_RADIUS**2)


def test_the_arm_is_drawn_from_the_cube_to_the_palm():
    record = kept("flyer_robot_to_human").record
    R_WB = rotation_of(record["robot.q_WB"][0])
    _, arm, palm, *_ = ((s.corners - record["robot.p_WB"][0]) @ R_WB for s in robot_at(record, 0, 0.05))
    assert arm[:, 0].max() == pytest.approx(-EDGE / 2.0)
    assert arm[:, 0].min() == pytest.approx(palm[:, 0].mean())


class Practised:
    """Signals of a practice: who holds the object, and whether the hand is to be closed."""

    def __init__(self, holder: str, closed: bool) -> None:
        self._holder, self._closed = holder, closed

    def __getitem__(self, name: str) -> Any:
        return {"person.p_WH": np.zeros(3), "person.closed_goal": np.array(self._closed)}[name]

    def text(self, name: str) -> str:
        return {"person.holder": self._holder}[name]


def test_a_practice_counts_how_often_the_hand_got_the_object():
    evaluator = HandPractice().evaluator(PracticeParameters())
    for t, (holder, closed) in enumerate([("NOBODY", False), ("HAND", True), ("NOBODY", False), ("HAND", True)]):
        evaluator(float(t), cast(Any, Practised(holder, closed)))
    outcome = evaluator.outcome()
    assert (outcome.metrics["fists"].value, outcome.metrics["grasps"].value) == (2.0, 2.0)


def test_a_practice_shows_object_and_hand_without_a_robot(tmp_path: Path):
    folder = tmp_path / "run"
    run(HandPractice, folder, "duration=1")
    scene = HandPractice().replay(PracticeParameters(), Record(folder / "signals.parquet"))
    assert {body.label for body in scene.bodies} == {"object", "hand"}
    assert scene.window is not None
    assert np.isfinite(scene.window).all()
