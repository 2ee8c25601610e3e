"""A sensor approaches a face: what it reads on its real path, the curve through that, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest
from support.scenarios.flyer_runs import metric, run
from support.wording import Wording

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.plants.ir_grasp.hand import JOINTS, sensor_rays
from handover.plants.ir_grasp.objects import SOLIDS
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.robots.ir_grasp.ir_sensor import THING, Finger, IrSensor, SensorParameters, bench_pose
from handover.scenarios.robots.ir_grasp.sensor_curve import (
    Fit,
    apparent_distance,
    controller_curve,
    fit_curve,
    rank_correlation,
    readings_of,
    time_of_flight,
)


def test_a_finger_is_the_one_of_its_name():
    """The thumb is to the right of the palm, the other two to the left."""
    origins, _ = sensor_rays(np.zeros(2), 0.0, np.zeros(JOINTS))
    assert [bool(origins[finger][1] > 0) for finger in (Finger.THUMB, Finger.INDEX, Finger.RING)] == [False, True, True]


@pytest.mark.parametrize("finger", Finger)
def test_the_beam_meets_the_face_at_the_distance_and_the_angle(finger: Finger):
    for incidence in (0.0, -0.4, 0.4):
        p_WH, yaw = bench_pose(SensorParameters(finger=finger, incidence=incidence), 0.04)
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
    last: list[float] = []
    for reflectivity in ("0.5", "1.0"):
        out = tmp_path / reflectivity
        run(IrSensor, out, f"reflectivity={reflectivity}", "scene.noise=0", "first=0.02", "speed=0.05")
        last.append(readings_of(Record(out / "signals.parquet"), Finger.THUMB)[1][-1])
    assert last[0] == pytest.approx(last[1] / 2, abs=1.0)


def test_a_hand_that_touches_the_box_has_failed(tmp_path: Path):
    ended = run(IrSensor, tmp_path / "r", "finger=index", "last=0.002", "first=0.02", "speed=0.05")
    assert not ended.summary["success"]
    assert "choose a larger `last`" in ended.summary["reason"]


def test_an_approach_that_leads_away_is_refused(wording: Wording):
    with pytest.raises(InvalidParameter) as refused:
        IrSensor().build(SensorParameters(first=0.02, last=0.03), 0, lambda unit: cached(IrSensor.units[unit], 3))
    wording.check(refused.value)


TICKS = np.linspace(150.0, 3600.0, 300)


def read_at(distance: Floats, curve: Fit) -> Floats:
    """Return the readings of a curve at distances, by interpolation."""
    x = np.linspace(0.0, 4095.0, 20_000)
    return np.interp(-distance, -curve.distance(x), x)


@pytest.mark.parametrize("curve", [Fit(0.055, -0.0035, 0.025, -0.0005), Fit(0.025, -0.0005, 0.055, -0.0035)])
def test_a_fit_finds_the_constants_that_made_the_readings_the_steeper_exponential_first(curve: Fit):
    fit = fit_curve(curve.distance(TICKS), TICKS)
    assert fit is not None
    assert (fit.a, fit.b, fit.c, fit.d) == pytest.approx((0.055, -0.0035, 0.025, -0.0005), rel=1e-4)
    assert fit.residual < 1e-8


def test_readings_out_of_range_or_at_the_converters_end_are_left_out_and_few_give_no_fit():
    distance, ticks = controller_curve().distance(TICKS), TICKS
    beside = [*distance.tolist(), 0.08, 0.003, 0.01, 0.02], [*ticks.tolist(), 900.0, 900.0, 4095.0, 0.0]
    assert fit_curve(*beside) == fit_curve(distance, ticks)
    assert fit_curve(distance[:5], ticks[:5]) is None


def test_what_the_curve_puts_beyond_the_range_is_not_seen():
    edge = ReflexParams().calibration.ticks(ReflexParams().distance_max)
    assert np.isnan(apparent_distance(np.array([0.0, edge - 1.0]))).all()
    assert apparent_distance(np.array([edge + 1.0])) == pytest.approx(ReflexParams().distance_max, abs=3e-4)


def test_a_dark_face_keeps_the_order_of_distances_and_a_saturated_reading_loses_it():
    distance = np.linspace(0.010, 0.050, 200)
    ticks = read_at(distance, controller_curve())
    assert rank_correlation(distance, 0.6 * ticks) == pytest.approx(1.0)
    assert rank_correlation(distance, np.minimum(ticks, 300.0)) < 0.9
    assert np.isnan(rank_correlation(distance[:2], ticks[:2]))


def test_light_flies_a_millimetre_and_back_in_7_picoseconds():
    assert time_of_flight(np.array([1e-3]))[0] == pytest.approx(6.671e-12, rel=1e-4)
    assert time_of_flight(np.array([0.3]), speed=2.0)[0] == pytest.approx(0.3)
