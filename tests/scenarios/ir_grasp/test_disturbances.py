"""Grasps of objects that move on their own, have any shape, or are not alone, on the built FMUs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.flyer_runs import metric, run

from handover.controllers.ir_grasp.ir_reflex import Phase
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import CosimError
from handover.cosim.record.reader import Record
from handover.plants.ir_grasp.hand import RING, THUMB, Finger, finger_points
from handover.plants.ir_grasp.objects import SOLIDS, Thing, outlines
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp, published_values
from handover.scenarios.ir_grasp.parameters import Expected, Parameters
from handover.scenarios.results.summary import RunResult

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


@pytest.mark.parametrize("shift", [pytest.param("0,0", marks=pytest.mark.slow), "0,0.02"])
def test_the_offset_at_the_grasp_is_that_of_the_pads_middle(tmp_path: Path, shift: str):
    ended, record = grasp(tmp_path, *BLIND, "standoff=0.03", f"shift={shift}")
    k = closing(record)
    points = finger_points(record["scene.p_WH"][k], float(record["scene.yaw"][k]), record["scene.q"][k])
    middle = np.mean([pad(THUMB, points[0]), pad(RING, points[2])], axis=0)
    offset = float(np.linalg.norm(record["scene.p_WO"][k] - middle))
    assert metric(ended, "offset_at_grasp") == pytest.approx(offset, abs=1e-6)


@pytest.mark.slow
def test_the_controller_hears_the_encoders_with_their_noise_and_the_verdict_the_truth(tmp_path: Path):
    _, record = grasp(tmp_path, *BLIND, "scene.wrist_noise=0.001")
    off = record["scene.p_WH_meas"] - record["scene.p_WH"]
    assert np.std(off) == pytest.approx(1e-3, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("thing", ["polygon", "drawn"])
def test_objects_by_parameters_can_be_grasped(thing: str, tmp_path: Path):
    which = ["thing_seed=2"] if thing == "drawn" else []
    ended, _ = grasp(tmp_path, f"thing={thing}", *which, "strategy=forward", "forward=0.055", "perturbed=false")
    assert ended.summary["success"], ended.summary["reason"]


def test_the_replay_shows_the_objects_that_there_are(tmp_path: Path):
    given = (*BLIND, "thing=polygon", "other_radius=0.02", "other_place=0.06,0.06")
    _, record = grasp(tmp_path, *given)
    parameters = parse_parameters(IrGrasp, given)
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
REFUSED = [
    (("thing=teapot",), "'teapot' is none of cylinder"),
    (("thing=paper_box_c",), "did you mean paper_box_a or paper_box_b"),
    (("expected=cube",), "'cube' is none of as_it_is, disc, bar"),
    (("thing=polygon", CROSSED, "corner_count=4"), r"edge 0 .* and edge 2 .* cross"),
    (("scene.b=0.003",), "the characteristic must fall"),
    (("shift=-0.2,0",), "the hand would start in the object: palm by"),
    (("carried_speed=0.05",), r"carried to .* stands out .* beyond the table"),
    (("other_radius=0.04", "other_place=0.05,0"), "second object would start in .*: object by"),
]


@pytest.mark.parametrize(("given", "fault"), REFUSED)
def test_what_cannot_be_is_refused_before_the_run_starts(given: tuple[str, ...], fault: str, tmp_path: Path):
    with pytest.raises((InvalidParameter, CosimError), match=fault):
        run(IrGrasp, tmp_path / "run", "perturbed=false", *given)
    assert not (tmp_path / "run" / "signals.parquet").exists()
