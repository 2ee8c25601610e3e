"""Loads and pressures that change on the way, links that are not alike, and the robot's electronics."""

import math
from pathlib import Path

import numpy as np
import pytest
from support.scenarios.flyer_runs import metric, run
from support.wording import Wording

from handover.cosim.record.reader import Record
from handover.plants.vsl.parameters import Link
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.robots.vsl.parameters import BASE_STEP, ENCODER_STEP, TRANSDUCER_STEP, Parameters
from handover.scenarios.robots.vsl.path_experiments import VslModelBased

SHORT = ("path=custom", "settle=4", "points=5", "speed=0.01")
LINE = (*SHORT, "x_0=0.35,0,0.15", "x_g=0.36,0,0.15")


def recorded(out: Path, *given: str) -> Record:
    run(VslModelBased, out, *given)
    return Record(out / "signals.parquet")


def height(record: Record, t: float) -> float:
    return float(record["arm.p_WG"][np.searchsorted(record.time, t - 1e-9), 2])


def test_a_load_is_put_on_and_taken_off(tmp_path: Path):
    given = (*LINE, "load=0", "load_steps=1.5:0.1 2.5:0", "pressure=1e5")
    record = recorded(tmp_path / "run", *given)
    assert height(record, 2.4) < height(record, 1.4) - 0.005
    assert height(record, 3.5) == pytest.approx(height(record, 1.4), abs=1e-4)
    replay = VslModelBased().replay(parse_parameters(VslModelBased, given), record)
    [ball] = [body for body in replay.bodies if body.label == "load"]
    shown = np.isfinite(ball.p_WB[:, 0])
    assert [shown[np.searchsorted(record.time, t)] for t in (1.0, 2.0, 3.0)] == [False, True, False]


def test_pressures_step_and_the_arm_rises_with_them(tmp_path: Path):
    record = recorded(tmp_path / "run", *LINE, "pressure=0.5e5", "pressure_steps=1:2e5 2.5:2e5,1e5")
    at = [np.searchsorted(record.time, t) for t in (0.9, 2.4, 3.9)]
    np.testing.assert_allclose(record["planner.p_cmd"][at], [[5e4, 5e4], [2e5, 2e5], [2e5, 1e5]])
    np.testing.assert_allclose(record["arm.p_meas"][at], record["planner.p_cmd"][at], atol=3000.0)
    assert height(record, 0.9) < height(record, 3.9) < height(record, 2.4)


def test_the_robots_electronics_tell_and_take_whole_steps_and_link_3_has_another_pressure_than_link_2(tmp_path: Path):
    given = (*SHORT, "resolution=electronics", "x_0=0.35,0.05,0.15", "x_g=0.36,0.05,0.15")
    record = recorded(tmp_path / "run", *given, "pressure=1.5e5", "pressure_difference=-1e5")
    q, p_WG = record["arm.q_meas"], record["arm.p_WG"][-1]
    for values, step in ((q[:, 0], BASE_STEP), (q[:, 1:], ENCODER_STEP), (record["arm.p_meas"], TRANSDUCER_STEP)):
        np.testing.assert_allclose(values / step, np.round(values / step), atol=1e-6)
    assert math.atan2(p_WG[1], p_WG[0]) == pytest.approx(q[-1, 0], abs=1e-9)
    np.testing.assert_allclose(record["arm.p_meas"][-1], [1.5e5, 0.5e5], atol=3000.0)


@pytest.mark.parametrize(
    "given",
    [
        "pressure_difference=-1e5",
        "load_steps=1:0.4",
        "load_steps=1,0.1",
        "load_steps=1:0.1 1:0.05",
        "load_steps=900:0.1",
        "pressure_steps=1:4e5",
        "pressure_steps=1:1e5,1e5,1e5",
    ],
)
def test_what_cannot_be_is_refused_before_anything_starts(given: str, wording: Wording):
    with pytest.raises(InvalidParameter) as refused:
        VslModelBased().build(parse_parameters(VslModelBased, [given]), 0, Path)
    wording.check(refused.value)


def test_masses_are_those_of_the_whole_run_and_one_link_of_two_may_be_rigid():
    p = Parameters(load=0.05, load_steps="2:0.1 3:0 4:0.05")
    assert p.masses == [0.05, 0.1]
    np.testing.assert_array_equal(p.load_at(np.array([0.0, 2.0, 3.5, 9.0])), [0.05, 0.1, 0.0, 0.05])
    assert Parameters(load=0.0).masses == []
    assert parse_parameters(VslModelBased, ["links=rigid_vsl"]).links.kinds == (Link.RIGID, Link.VSL)


@pytest.mark.slow
def test_a_path_goes_by_a_file_of_waypoints(tmp_path: Path):
    way = tmp_path / "way.csv"
    way.write_text("x,y,z,via_x,via_y,via_z\n0.3,0,0.1,,,\n0.35,0,0.1,,,\n0.35,0,0.15,0.375,0,0.125\n")
    given = ("path=custom", f"waypoints={way}", "settle=2", "points=20", "speed=0.1")
    ended = run(VslModelBased, tmp_path / "run", *given)
    assert metric(ended, "points_visited") == 40
    assert metric(ended, "path_time") == pytest.approx((0.05 + 0.025 * math.pi) / 0.1, abs=0.05)
    record, p = Record(tmp_path / "run" / "signals.parquet"), parse_parameters(VslModelBased, given)
    assert record["planner.p_WG_goal"][-1] == pytest.approx([0.35, 0.0, 0.15])
    [drawn] = [line for line in VslModelBased().replay(p, record).fixed if line.label == "desired path"]
    assert float(drawn.points[..., 0].max()) == pytest.approx(0.375, abs=1e-4)
    way.unlink()
    assert not VslModelBased().replay(p, record).fixed


@pytest.mark.parametrize(
    ("rows", "given"),
    [
        ("0.3,0,-0.1,,,", ("path=custom",)),
        ("0.36,0,0.02,0.33,0,-0.01", ("path=custom",)),
        ("", ("path=custom",)),
        ("0.3,0,nan,,,", ("path=custom",)),
        ("0.3,0,1e308,,,", ("path=custom",)),
        ("0.3,0", ("path=custom",)),
        ("x,0,0.1,,,", ("path=custom",)),
    ],
    ids=["below", "way below", "one", "nan", "far", "short", "text"],
)
def test_waypoints_that_cannot_be_are_refused(rows: str, given: tuple[str, ...], tmp_path: Path, wording: Wording):
    (tmp_path / "way.csv").write_text(f"x,y,z,via_x,via_y,via_z\n0.3,0,0.02,,,\n{rows}\n")
    with pytest.raises(InvalidParameter) as refused:
        run(VslModelBased, tmp_path / "run", f"waypoints={tmp_path / 'way.csv'}", *given)
    wording.check(refused.value)
