import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_continues
from support.wording import Wording

from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.paths import Line, QuarterArc
from handover.controllers.vsl.trajectory_planner import (
    Elbow,
    Inputs,
    InvalidPath,
    Outputs,
    Params,
    Path,
    TrajectoryPlanner,
)
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


def flat(y: Outputs) -> list[bytes]:
    return [np.asarray(v).tobytes() for v in vars(y).values()]


def test_linear_path_of_the_paper():
    ys = moving(path=Path.LINEAR, N=50, V=0.3)  # 6 mm in 20 ms: a point a period
    assert len(ys) == 50
    heights = 0.05 + 0.006 * np.arange(1, 51)
    np.testing.assert_allclose(goals(ys), np.column_stack([np.full(50, 0.3), np.zeros(50), heights]), atol=1e-12)


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


def test_curve_is_two_quarter_circles():
    ys = moving(path=Path.CURVE)
    for segment, centre, end in ((1, [0.3, 0.0, 0.15], [0.4, 0.0, 0.15]), (2, [0.4, 0.0, 0.05], [0.3, 0.0, 0.05])):
        points = goals([y for y in ys if y.segment == segment])
        np.testing.assert_allclose(np.linalg.norm(points - centre, axis=1), 0.1, atol=1e-12)
        assert np.all((points > np.array([0.3, 0.0, 0.05]) - 1e-12) & (points < np.array([0.4, 0.0, 0.15]) + 1e-12))
        np.testing.assert_allclose(points[-1], end, atol=1e-12)


@pytest.mark.parametrize("upwards", [True, False])
def test_arc_is_tangential_and_ends_beside_its_centre(upwards: bool):
    x_c = np.array([0.3, 0.0, 0.15])
    arc = QuarterArc(x_c - np.array([0.0, 0.0, 0.1 if upwards else -0.1]), x_c)
    points, velocities = arc.sampled(40, 0.05)
    np.testing.assert_allclose(np.sum((points - x_c) * velocities, axis=1), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(velocities, axis=1), 0.05)
    assert np.all(np.sum(np.diff(points, axis=0) * velocities[:-1], axis=1) > 0.0)
    np.testing.assert_allclose(points[-1], arc.x_g, atol=1e-15)
    np.testing.assert_allclose(arc.x_g, x_c + np.array([0.1 if upwards else -0.1, 0.0, 0.0]))
    assert arc.length == pytest.approx(0.05 * math.pi)


def test_line_steps_are_those_of_algorithm_1():
    x_0, x_g, N = np.array([0.3, -0.1, 0.05]), np.array([0.25, 0.1, 0.3]), 7
    x, expected = x_0, [x_0]
    for k in range(1, N + 1):
        x = x + (x_g - x) / (N - (k - 1))
        expected.append(x)
    np.testing.assert_allclose(Line(x_0, x_g).sampled(N, 0.1)[0], expected, atol=1e-15)


def test_square_visits_its_corners_in_order():
    ys = moving(path=Path.SQUARE, N=10)
    corners = [[y.p_WG_goal for y in ys if y.segment == s][-1] for s in (1, 2, 3, 4)]
    np.testing.assert_allclose(
        np.array(corners)[:, [0, 2]], [[0.25, 0.05], [0.25, 0.15], [0.35, 0.15], [0.35, 0.05]], atol=1e-12
    )


def test_angles_are_those_of_the_goal_and_elbow():
    for elbow in Elbow:
        for y in moving(path=Path.CUSTOM, x_0=np.array([0.2, 0.2, 0.1]), x_g=np.array([0.3, -0.1, 0.3]), elbow=elbow):
            np.testing.assert_allclose(ARM.forward(y.q_ref), y.p_WG_goal, atol=1e-12)
            assert bool(y.q_ref[2] < 0.0) is (elbow is Elbow.UP)


def test_the_goal_stays_between_points():
    ys = moving(path=Path.LINEAR, N=3, V=0.1)  # a point a second
    assert len(ys) == 150
    assert len(np.unique(goals(ys), axis=0)) == 3
    np.testing.assert_array_equal(ys[0].p_WG_goal, ys[49].p_WG_goal)
    np.testing.assert_allclose(ys[0].p_WG_goal, [0.3, 0.0, 0.15])
    np.testing.assert_allclose(ys[50].p_WG_goal, [0.3, 0.0, 0.25])


def test_more_points_than_periods_are_left_out_in_time():
    ys = moving(path=Path.LINEAR, N=2000, V=0.1)
    assert len(ys) == 150
    np.testing.assert_allclose(goals(ys)[:, 2], 0.05 + 0.1 * DT * np.arange(150), atol=2e-4)


def test_settles_then_waits_for_go():
    planner = TrajectoryPlanner(Params(settle=1.0, qd_0=np.array([0.5, 0.6, 0.7])))
    waiting = walk(planner, 70, Inputs(go=False))
    assert not any(y.moving or y.done for y in waiting)
    assert {y.segment for y in waiting} == {0}
    np.testing.assert_allclose(waiting[-1].p_WG_goal, [0.3, 0.0, 0.05])
    np.testing.assert_array_equal(waiting[-1].qd_ref, [0.5, 0.6, 0.7])
    assert planner.step(1.4, DT, Inputs()).moving
    assert planner.step(1.42, DT, Inputs(go=False)).moving
    early = walk(TrajectoryPlanner(Params(settle=1.0)), 60)
    assert [y.moving for y in early].index(True) == 50


def test_the_end_is_held_and_pressures_are_passed_on():
    p = Params(path=Path.LINEAR, settle=0.0, V=1.0, pressure=np.array([5e4, 2e5]))
    y = walk(TrajectoryPlanner(p), 30)[-1]
    assert (y.done, y.moving, y.segment) == (True, False, 1)
    np.testing.assert_allclose(y.p_WG_goal, [0.3, 0.0, 0.35])
    np.testing.assert_array_equal(y.p_cmd, [5e4, 2e5])


def test_joint_1_goes_on_past_half_a_turn():
    ys = moving(path=Path.CUSTOM, x_0=np.array([-0.3, 0.1, 0.2]), x_g=np.array([-0.3, -0.1, 0.2]))
    theta_1 = np.array([y.q_ref[0] for y in ys])
    assert np.all(np.diff(theta_1) >= 0.0)
    assert theta_1[-1] == pytest.approx(math.pi + math.atan2(0.1, 0.3))
    for y in ys:
        np.testing.assert_allclose(ARM.forward(y.q_ref), y.p_WG_goal, atol=1e-12)


@pytest.mark.parametrize("settle", [0.0, 0.1])
def test_outputs_are_those_of_the_coming_step(settle: float):
    planner = TrajectoryPlanner(Params(settle=settle))
    for k in range(12):
        u = Inputs(go=k > 2)
        before = flat(planner.outputs(k * DT, u))
        assert before == flat(planner.step(k * DT, DT, u))


@pytest.mark.parametrize("waits", [0, 6])
def test_a_restored_state_goes_on_bit_for_bit(waits: int):
    make = partial(TrajectoryPlanner, Params(settle=0.1))
    assert_continues(make, lambda n: Inputs(go=n > waits), [0, 3, 20, 400], 60, DT)


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
            TrajectoryPlanner(Params(**{"path": Path.CUSTOM, **changes}))
        assert len(caught.value.faults) == faults
        wording.check(caught.value)
