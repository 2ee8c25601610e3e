"""Grasps of objects that move on their own, have any shape, or are not alone, on the built FMUs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.flyer_runs import metric, run
from support.wording import Wording

from handover.controllers.ir_grasp.ir_reflex import Phase
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import CosimError
from handover.cosim.record.reader import Record
from handover.plants.ir_grasp.hand import RING, THUMB, Finger, finger_points
from handover.plants.ir_grasp.objects import SOLIDS, Thing, outlines
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp, published_values
from handover.scenarios.robots.ir_grasp.parameters import Expected, Parameters
from handover.scenarios.runs.results.summary import RunResult

BLIND = ("strategy=blind", "perturbed=false", "vision_position=0", "vision_yaw=0")


def grasp(out: Path, *given: str) -> tuple[RunResult, Record]:
    ended = run(IrGrasp, out / "run", *given)
    return ended, Record(out / "run" / "signals.parquet")


def closing(record: Record) -> int:
    return int(np.argmax(record["reflex.phase"] == Phase.CLOSE))


def test_what_the_ground_carries_and_bumps_is_no_push(tmp_path: Path):
    motion = ("carried_speed=0.02", "carried_direction=1.5707963", "nudge=0.01,0", "nudge_time=0.1")
    ended, record = grasp(tmp_path, *BLIND, *motion)
    k = closing(record)
    moved = record["scene.p_WO"][k] - record["scene.p_WO"][0]
    np.testing.assert_allclose(moved, [0.01, 0.02 * record.time[k]], atol=4e-4)
    np.testing.assert_allclose(record["scene.p_ground"][k], moved, atol=4e-4)
    assert metric(ended, "displacement") < 4e-4


def pad(f: Finger, points: Floats) -> Floats:
    """Return the middle of a fingertip's pad, (2,) in W, m, by its finger's joints and tip."""
    along = (points[-1] - points[-2]) / f.lengths[-1]
    return 0.5 * (points[-1] + points[-2]) + f.radii[-1] * f.flexion * np.array([-along[1], along[0]])


def test_the_offset_at_the_grasp_is_that_of_the_pads_middle(tmp_path: Path):
    ended, record = grasp(tmp_path, *BLIND, "standoff=0.03", "shift=0,0.02")
    k = closing(record)
    points = finger_points(record["scene.p_WH"][k], float(record["scene.yaw"][k]), record["scene.q"][k])
    middle = np.mean([pad(THUMB, points[0]), pad(RING, points[2])], axis=0)
    offset = float(np.linalg.norm(record["scene.p_WO"][k] - middle))
    assert metric(ended, "offset_at_grasp") == pytest.approx(offset, abs=1e-6)


def test_the_replay_shows_the_objects_that_there_are(tmp_path: Path):
    given = (*BLIND, "thing=polygon", "other_radius=0.02", "other_place=0.06,0.06")
    run(IrGrasp, tmp_path / "run", *given, stop=0.1)
    parameters, record = parse_parameters(IrGrasp, given), Record(tmp_path / "run" / "signals.parquet")
    bodies = {b.label: b for b in IrGrasp().replay(parameters, record).bodies}
    np.testing.assert_allclose(bodies["second object"].p_WB[0], [0.06, 0.06, 0.0])
    spread = np.ptp(np.asarray(bodies["object"].mesh.vertices)[:, :2], axis=0)
    np.testing.assert_allclose(spread, np.ptp(outlines(parameters.solid)[0], axis=0), atol=1e-6)


def test_the_table_has_the_papers_things_and_disturbances_only():
    assert all(published_values(Parameters(thing=thing)) for thing in SOLIDS)
    beyond: list[dict[str, Any]] = [
        *({"thing": thing} for thing in Thing if thing not in SOLIDS),
        {"shift": np.array([0.01, 0.0])},
        {"carried_speed": 0.01},
        {"nudge": np.array([0.0, 0.01])},
        {"expected": Expected.DISC},
        {"other_radius": 0.02},
    ]
    assert not any(published_values(Parameters(**changes)) for changes in beyond)


CROSSED = "corners=0,0,0.04,0.04,0.04,0,0,0.04,0,0,0,0,0,0,0,0"


@pytest.mark.parametrize(
    "given",
    [
        ("thing=teapot",),
        ("thing=paper_box_c",),
        ("thing=polygon", CROSSED, "corner_count=4"),
        ("scene.b=0.003",),
        ("shift=-0.2,0",),
    ],
    ids=["teapot", "box", "crossed", "characteristic", "palm"],
)
def test_what_cannot_be_is_refused_before_the_run_starts(given: tuple[str, ...], tmp_path: Path, wording: Wording):
    with pytest.raises((InvalidParameter, CosimError)) as refused:
        run(IrGrasp, tmp_path / "run", "perturbed=false", *given)
    wording.check(refused.value)
    assert not (tmp_path / "run" / "signals.parquet").exists()
