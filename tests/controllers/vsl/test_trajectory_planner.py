import math
import tracemalloc
from dataclasses import replace
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_passed_on, flat
from support.wording import Wording

from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.paths import Arc, Line
from handover.controllers.vsl.trajectory_planner import (
    Elbow,
    Inputs,
    InvalidPath,
    Outputs,
    Params,
    Path,
    TrajectoryPlanner,
)
from handover.controllers.vsl.waypoints import InvalidWaypoints, read_waypoints
from handover.cosim.blocks.ports import Floats

ARM = VslKinematics(0.15, 0.225, 0.225, Elbow.UP)
DT = 0.02


def walk(planner: TrajectoryPlanner, steps: int, u: Inputs | None = None) -> list[Outputs]:
    return [planner.step(k * DT, DT, u or Inputs()) for k in range(steps)]


def moving(**values: Any) -> list[Outputs]:
    planner, seen = TrajectoryPlanner(Params(settle=0.0, **values)), list[Outputs]()
    while True:
        y = planner.step(len(seen) * DT, DT, Inputs())
        if not y.moving:
            assert y.done
            return seen
        seen.append(y)


def goals(ys: list[Outputs]) -> Floats:
    return np.array([y.p_WG_goal for y in ys])


@pytest.mark.parametrize("path", [Path.LINEAR, Path.CURVE, Path.SQUARE])
def test_speed_is_the_wanted_one(path: Path):
    length = {Path.LINEAR: 0.3, Path.CURVE: 0.1 * math.pi, Path.SQUARE: 0.4}[path]
    ys = moving(path=path, V=0.05)
    assert len(ys) * DT == pytest.approx(length / 0.05, abs=DT)
    for y, before in zip(ys[1:], ys, strict=False):
        if y.segment == before.segment and not np.array_equal(y.p_WG_goal, before.p_WG_goal):
            start = ARM.forward(before.q_ref)  # q' is that of the step's first point
            v = ARM.jacobian(before.q_ref) @ y.qd_ref
            assert np.linalg.norm(v) == pytest.approx(0.05, rel=1e-9)
            way = y.p_WG_goal - start
            assert v @ way / np.linalg.norm(way) == pytest.approx(0.05, rel=1e-3)


def test_curve_is_two_quarter_circles_and_the_square_visits_its_corners():
    ys = moving(path=Path.CURVE)
    for segment, centre, end in ((1, [0.3, 0.0, 0.15], [0.4, 0.0, 0.15]), (2, [0.4, 0.0, 0.05], [0.3, 0.0, 0.05])):
        points = goals([y for y in ys if y.segment == segment])
        np.testing.assert_allclose(np.linalg.norm(points - centre, axis=1), 0.1, atol=1e-12)
        assert np.all((points > np.array([0.3, 0.0, 0.05]) - 1e-12) & (points < np.array([0.4, 0.0, 0.15]) + 1e-12))
        np.testing.assert_allclose(points[-1], end, atol=1e-12)
    ys = moving(path=Path.SQUARE, N=10)
    corners = [[y.p_WG_goal for y in ys if y.segment == s][-1][[0, 2]] for s in (1, 2, 3, 4)]
    np.testing.assert_allclose(corners, [[0.25, 0.05], [0.25, 0.15], [0.35, 0.15], [0.35, 0.05]], atol=1e-12)


def test_line_steps_are_those_of_algorithm_1():
    x_0, x_g, N = np.array([0.3, -0.1, 0.05]), np.array([0.25, 0.1, 0.3]), 7
    x, expected = x_0, [x_0]
    for k in range(1, N + 1):
        x = x + (x_g - x) / (N - (k - 1))
        expected.append(x)
    np.testing.assert_allclose(Line(x_0, x_g).sampled(N, 0.1)[0], expected, atol=1e-15)


def test_angles_are_those_of_the_goal_and_elbow_and_joint_1_goes_on_past_half_a_turn():
    past: dict[str, Any] = {"x_0": np.array([-0.3, 0.1, 0.2]), "x_g": np.array([-0.3, -0.1, 0.2])}
    for elbow in Elbow:
        before: dict[str, Any] = {"x_0": np.array([0.2, 0.2, 0.1]), "x_g": np.array([0.3, -0.1, 0.3])}
        for ends in (before, past):
            ys = moving(path=Path.CUSTOM, elbow=elbow, **ends)
            for y in ys:
                np.testing.assert_allclose(ARM.forward(y.q_ref), y.p_WG_goal, atol=1e-12)
                assert bool(y.q_ref[2] < 0.0) is (elbow is Elbow.UP)
        theta_1 = np.array([y.q_ref[0] for y in ys])
        assert np.all(np.diff(theta_1) >= 0.0)
        assert theta_1[-1] == pytest.approx(math.pi + math.atan2(0.1, 0.3))


def test_points_come_as_fast_as_the_path_is_to_be_gone_by():
    ys = moving(path=Path.LINEAR, N=50, V=0.3)  # as the paper's: 6 mm in 20 ms, a point a period
    heights = 0.05 + 0.006 * np.arange(1, 51)
    np.testing.assert_allclose(goals(ys), np.column_stack([np.full(50, 0.3), np.zeros(50), heights]), atol=1e-12)
    ys = moving(path=Path.LINEAR, N=3, V=0.1)  # a point a second, at which the goal stays
    assert len(ys) == 150
    assert len(np.unique(goals(ys), axis=0)) == 3
    np.testing.assert_array_equal(ys[0].p_WG_goal, ys[49].p_WG_goal)
    np.testing.assert_allclose([ys[0].p_WG_goal, ys[50].p_WG_goal], [[0.3, 0.0, 0.15], [0.3, 0.0, 0.25]])
    ys = moving(path=Path.LINEAR, N=2000, V=0.1)  # more points than periods: some are left out
    assert len(ys) == 150
    np.testing.assert_allclose(goals(ys)[:, 2], 0.05 + 0.1 * DT * np.arange(150), atol=2e-4)


def test_settles_then_waits_for_go_and_holds_the_end():
    planner = TrajectoryPlanner(Params(settle=1.0, qd_0=np.array([0.5, 0.6, 0.7])))
    waiting = walk(planner, 70, Inputs(go=False))
    assert not any(y.moving or y.done for y in waiting)
    assert {y.segment for y in waiting} == {0}
    np.testing.assert_allclose(waiting[-1].p_WG_goal, [0.3, 0.0, 0.05])
    np.testing.assert_array_equal(waiting[-1].qd_ref, [0.5, 0.6, 0.7])
    assert planner.step(1.4, DT, Inputs()).moving
    assert planner.step(1.42, DT, Inputs(go=False)).moving
    assert [y.moving for y in walk(TrajectoryPlanner(Params(settle=1.0)), 60)].index(True) == 50
    p = Params(path=Path.LINEAR, settle=0.0, V=1.0, pressure=np.array([5e4, 2e5]))
    y = walk(TrajectoryPlanner(p), 30)[-1]
    assert (y.done, y.moving, y.segment) == (True, False, 1)
    np.testing.assert_allclose(y.p_WG_goal, [0.3, 0.0, 0.35])
    np.testing.assert_array_equal(y.p_cmd, [5e4, 2e5])


def test_a_restored_state_goes_on_bit_for_bit_and_outputs_are_those_of_the_coming_step():
    given = [Inputs(go=n > 8) for n in range(440)]
    assert_passed_on(partial(TrajectoryPlanner, Params(settle=0.1)), given, 15, DT)
    for settle in (0.0, 0.1):
        planner = TrajectoryPlanner(Params(settle=settle))
        for n, u in enumerate(given[:14]):
            np.testing.assert_array_equal(flat(planner.outputs(n * DT, u)), flat(planner.step(n * DT, DT, u)))


CUSTOM: list[tuple[dict[str, Any], int]] = [
    ({"x_g": np.array([0.5, 0.0, 0.15])}, 1),
    ({"x_g": np.array([0.45, 0.0, 0.15])}, 1),
    ({"x_g": np.array([0.0, 0.0, 0.35])}, 1),
    ({"x_g": np.array([0.3, 0.0, 0.05])}, 1),
    ({"x_g": np.array([np.nan, 0.0, 0.05])}, 1),
    ({"x_0": np.array([-0.2, 0.0, 0.3]), "x_g": np.array([0.2, 0.0, 0.3]), "N": 101}, 1),
    ({"L_3": 0.2, "x_0": np.array([0.2, 0.002, 0.15]), "x_g": np.array([-0.2, 0.002, 0.15]), "N": 3}, 1),
    ({"x_0": np.array([0.4, 0.0, 0.15]), "x_g": np.array([-0.4, 0.0, 0.15])}, 1),
    ({"L_2": 0.4, "L_3": 0.1, "x_g": np.array([0.2, 0.0, 0.15])}, 1),
    ({"path": Path.CURVE, "L_2": 0.2, "L_3": 0.2}, 2),
    ({"N": 0, "V": -1.0}, 2),
]


def test_a_path_that_cannot_be_followed_is_refused(wording: Wording):
    for changes, faults in CUSTOM:
        with pytest.raises(InvalidPath) as caught:
            TrajectoryPlanner(replace(Params(path=Path.CUSTOM), **changes))
        assert len(caught.value.faults) == faults
        wording.check(caught.value)


def file(folder: FilePath, text: str) -> FilePath:
    path = folder / "way.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_lines_and_arcs_join_the_waypoints(tmp_path: FilePath):
    way = "via_x, via_y, via_z, x, y, z\n,,,0.3,0,0.1\n,,,0.35,0,0.1\n0.4,0,0.15,0.35,0,0.2\n"
    line, arc = read_waypoints(file(tmp_path, way))
    assert isinstance(line, Line)
    assert isinstance(arc, Arc)
    ends = np.array([line.x_0, line.x_g, arc.x_0, arc.x_g])
    np.testing.assert_allclose(ends[:, [0, 2]], [[0.3, 0.1], [0.35, 0.1], [0.35, 0.1], [0.35, 0.2]])
    assert arc.length == pytest.approx(0.05 * math.pi)


def test_a_file_may_have_no_columns_for_arcs_and_empty_lines_and_a_byte_order_mark(tmp_path: FilePath):
    segments = read_waypoints(file(tmp_path, "\ufeffx,y,z\n0.3,0,0.1\n\n0.3,0.1,0.1\n0.2,0.1,0.2\n"))
    assert [type(segment) for segment in segments] == [Line, Line]


@pytest.mark.parametrize("sweep", [0.3, 2.0, math.pi, 5.0])
def test_an_arc_runs_at_its_speed_on_its_circle_through_the_third_point(sweep: float):
    rng = np.random.default_rng(1)
    basis: Floats = np.linalg.qr(rng.standard_normal((3, 2)))[0]
    e1, e2 = basis[:, 0], basis[:, 1]
    x_c, r, V, N = rng.standard_normal(3), 0.07, 0.05, 200
    x_0, via, x_g = [x_c + r * (math.cos(a) * e1 + math.sin(a) * e2) for a in (0.0, 0.4 * sweep, sweep)]
    arc = Arc(x_0, via, x_g)
    points, velocities = arc.sampled(N, V)
    assert arc.length == pytest.approx(r * sweep)
    np.testing.assert_allclose(np.linalg.norm(points - x_c, axis=1), r)
    for k, x in ((0, x_0), (-1, x_g), (2 * N // 5, via)):
        np.testing.assert_allclose(points[k], x, atol=1e-12)
    moved = (points[2:] - points[:-2]) * (N * V / arc.length / 2.0)
    np.testing.assert_allclose(velocities[1:-1], moved, atol=2e-4 * V)


NO_WAYPOINTS = [
    "x,y\n0.3,0\n",
    "x,y,z,x\n0.3,0,0,0\n",
    "",
    "x,y,z\n0.3,0,0.1\n",
    "x,y,z\n0.3,0,0.1\n0.3,0\n",
    "x,y,z\n0.3,0,0.1\n0.3,nan,0.2\n0.3,a,0.2\n",
    "x,y,z\n0.3,0,0.1\n0.3,0,0.1\n",
    "x,y,z,via_x,via_y,via_z\n0.3,0,0.1,,,\n0.3,0,0.2,0.35,0,\n",
    "x,y,z,via_x,via_y,via_z\n0.3,0,0.1,0.1,0,0\n0.3,0,0.2,,,\n",
    "x,y,z,via_x,via_y,via_z\n0.3,0,0.1,,,\n0.3,0,0.2,0.3,0,0.13\n",
]


def test_what_is_no_list_of_waypoints_is_refused(tmp_path: FilePath, wording: Wording):
    (tmp_path / "binary.csv").write_bytes(b"x,y,z\n\xff\xfe,0,0\n")
    with pytest.raises(InvalidWaypoints):
        read_waypoints(tmp_path / "binary.csv")
    for text in (None, *NO_WAYPOINTS):
        way = tmp_path / "none.csv" if text is None else file(tmp_path, text)
        with pytest.raises(InvalidWaypoints) as caught:
            read_waypoints(way)
        wording.check(caught.value)


def test_the_planner_goes_by_the_waypoints(tmp_path: FilePath):
    way = file(tmp_path, "x,y,z,via_x,via_y,via_z\n0.3,0,0.1,,,\n0.35,0,0.1,,,\n0.35,0,0.2,0.4,0,0.15\n")
    planner = TrajectoryPlanner(Params(path=Path.CUSTOM, waypoints=str(way), N=10, settle=0.0))
    y = planner.outputs(0.0, Inputs())
    seen = [y]
    while not y.done:
        y = planner.step(0.0, 0.02, Inputs())
        seen.append(y)
    goals = np.array([s.p_WG_goal for s in seen])
    assert {s.segment for s in seen} == {1, 2}
    np.testing.assert_allclose(goals[-1], [0.35, 0.0, 0.2])
    assert goals[:, 0].max() == pytest.approx(0.4)
    assert len(seen) * 0.02 == pytest.approx((0.05 + 0.05 * math.pi) / 0.05, abs=0.1)


def test_out_of_reach_is_said_with_the_waypoint_and_by_how_much(tmp_path: FilePath, wording: Wording):
    for name, more, N in (("way.csv", "0.35,0,0.15\n", 10), ("way.csv", "", 1), ("none.csv", "", 1)):
        file(tmp_path, f"x,y,z\n0.3,0,0.15\n{more}0.5,0,0.15\n")
        with pytest.raises(InvalidPath) as caught:
            TrajectoryPlanner(Params(path=Path.CUSTOM, waypoints=str(tmp_path / name), N=N))
        wording.check(caught.value)


def test_the_long_way_round_an_arc_through_nearly_a_line_is_refused_at_once(tmp_path: FilePath):
    """By way of a point 3 um beside the line, beyond its end: 600 m of arc, which 600,000 points would sample."""
    way = file(tmp_path, "x,y,z,via_x,via_y,via_z\n0.3,0,0.15,,,\n0.31,0,0.15,0.32,0,0.150001\n")
    tracemalloc.start()
    with pytest.raises(InvalidPath, match=r"from waypoint 1 to 2, between its points, at .* too far"):
        TrajectoryPlanner(Params(path=Path.CUSTOM, waypoints=str(way), N=1))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1e7
