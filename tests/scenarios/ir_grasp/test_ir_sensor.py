"""A sensor on the hand approaches a face: what it reads on its real path, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest
from support.scenarios.flyer_runs import metric, run

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.plants.ir_grasp.hand import JOINTS, sensor_rays
from handover.plants.ir_grasp.objects import SOLIDS
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.ir_grasp.ir_sensor import THING, Finger, IrSensor, SensorParameters, bench_pose
from handover.scenarios.ir_grasp.sensor_curve import readings_of


@pytest.mark.parametrize("finger", Finger)
@pytest.mark.parametrize("incidence", [0.0, -0.4, 0.4])
def test_the_beam_meets_the_face_at_the_distance_and_the_angle(finger: Finger, incidence: float):
    p = SensorParameters(finger=finger, incidence=incidence)
    p_WH, yaw = bench_pose(p, 0.04)
    origins, directions = sensor_rays(p_WH, yaw, np.zeros(JOINTS))
    (x, y), (d_x, d_y) = origins[finger], directions[finger]
    c, s = math.cos(incidence), math.sin(incidence)
    hit = SOLIDS[THING].intersect(c * x + s * y, c * y - s * x, c * d_x + s * d_y, c * d_y - s * d_x)
    assert hit is not None
    assert (hit.distance, hit.cosine) == pytest.approx((0.04, math.cos(incidence)))


def test_readings_are_those_of_the_curve_at_the_distance_of_their_scan(tmp_path: Path):
    ended = run(IrSensor, tmp_path / "r", "finger=ring", "scene.noise=0", "scene.beam=0", "first=0.05", "speed=0.05")
    assert ended.summary["success"], ended.summary["reason"]
    distance, ticks = readings_of(Record(tmp_path / "r" / "signals.parquet"), Finger.RING)
    curve = ReflexParams().calibration
    assert len(ticks) > 50
    assert [curve.distance(x) for x in ticks] == pytest.approx(distance.tolist(), abs=2e-4)  # a tick is 0.15 mm or less
    assert metric(ended, "apparent_at_20_mm") == pytest.approx(0.020, abs=1e-3)  # 0.75 mm of way between scans


def test_a_face_that_returns_half_reads_half(tmp_path: Path):
    readings: dict[float, float] = {}
    for reflectivity in (0.5, 1.0):
        given = (f"reflectivity={reflectivity}", "scene.noise=0", "first=0.02", "speed=0.05")
        run(IrSensor, tmp_path / str(reflectivity), *given)
        readings[reflectivity] = readings_of(Record(tmp_path / str(reflectivity) / "signals.parquet"), Finger.THUMB)[1][
            -1
        ]
    assert readings[0.5] == pytest.approx(readings[1.0] / 2, abs=1.0)


def test_a_hand_that_touches_the_box_has_failed(tmp_path: Path):
    ended = run(IrSensor, tmp_path / "r", "finger=index", "last=0.002", "first=0.02", "speed=0.05")
    assert not ended.summary["success"]
    assert "choose a larger `last`" in ended.summary["reason"]


def test_an_approach_that_leads_away_is_refused():
    with pytest.raises(InvalidParameter, match=r"last 0\.03 m must be less than first 0\.02 m"):
        IrSensor().build(SensorParameters(first=0.02, last=0.03), 0, lambda unit: cached(IrSensor.units[unit], 3))
