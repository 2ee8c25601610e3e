"""Files of waypoints: the path that they make, and what is refused with its reason."""

import math
import tracemalloc
from pathlib import Path as FilePath

import numpy as np
import pytest
from support.wording import Wording

from handover.controllers.vsl.paths import Arc, Line
from handover.controllers.vsl.trajectory_planner import Inputs, InvalidPath, Params, Path, TrajectoryPlanner
from handover.controllers.vsl.waypoints import InvalidWaypoints, read_waypoints
from handover.cosim.blocks.ports import Floats


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
