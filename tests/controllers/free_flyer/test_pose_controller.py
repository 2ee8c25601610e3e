"""The PID and its path, with the free-flyer and its thrusters, their limits and lag."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.restored_states import assert_continues, assert_outputs_change_nothing
from support.wording import Wording

from handover.controllers.free_flyer.body import InvalidControllerParameters
from handover.controllers.free_flyer.pose_controller import (
    Bounds,
    Inputs,
    Outputs,
    Params,
    PoseController,
    profile_between,
)
from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.free_flyer import FreeFlyer
from handover.plants.free_flyer.robot.free_flyer import Inputs as FlyerInputs
from handover.plants.free_flyer.robot.free_flyer import Params as FlyerParams
from handover.plants.free_flyer.robot.navigation import Inputs as NavigationInputs
from handover.plants.free_flyer.robot.navigation import Navigation
from handover.plants.free_flyer.robot.navigation import Params as NavigationParams
from handover.plants.free_flyer.robot.thrusters import Inputs as ThrusterInputs
from handover.plants.free_flyer.robot.thrusters import Params as ThrusterParams
from handover.plants.free_flyer.robot.thrusters import Propulsion, Thrusters

T = 0.016
MASS, INERTIA = 9.584, np.array([0.1534, 0.1427, 0.1623])
NOTHING = np.zeros(3)
F_MAX, TAU_MAX = np.array([0.55, 0.39, 0.45]), np.array([0.064, 0.040, 0.075])
STILL = (0.0, 0.0, 0.0)
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
BOUNDS = Bounds(speed=0.1, acceleration=0.02, rate=0.17, turning=0.1)


class Robot:
    """The free-flyer behind its thrusters, with a constant force on its centre of mass from outside."""

    def __init__(
        self, draught: Floats = NOTHING, noise: float = 0.0, propulsion: Propulsion = Propulsion.LIMITED, **start: Any
    ) -> None:
        deviations: dict[str, Any] = {"position_noise": noise, "velocity_noise": noise, "attitude_noise": 2 * noise}
        self.body = FreeFlyer(FlyerParams(**start))
        self.navigation = Navigation(NavigationParams(**deviations, rate_noise=2.0 * noise))
        self.thrusters = Thrusters(ThrusterParams(propulsion=propulsion))
        self.draught, self.t = draught, 0.0
        self.y = self.body.outputs(0.0, FlyerInputs())
        self.estimate = self.navigation.outputs(0.0, self.true())

    def measured(self, **changes: Any) -> Inputs:
        given: dict[str, Any] = {**vars(self.estimate), "active": True, **changes}
        return Inputs(**given)

    def true(self) -> NavigationInputs:
        return NavigationInputs(p_WB=self.y.p_WB, q_WB=self.y.q_WB, v_WB=self.y.v_WB, w_WB=self.y.w_WB)

    def fly(self, y: Outputs) -> None:
        thrust = self.thrusters.step(0.0, T, ThrusterInputs(f_pose=y.f_cmd, tau_pose=y.tau_cmd))
        at_centre = -np.cross(self.y.p_WG - self.y.p_WB, self.draught)
        push = FlyerInputs(f_B=thrust.f_B, tau_B=thrust.tau_B, f_G=self.draught, tau_G=at_centre)
        self.y = self.body.step(0.0, T, push)
        self.estimate = self.navigation.step(self.t, T, self.true())
        self.t += T


def flown(
    controller: PoseController, robot: Robot, seconds: float, given: list[Inputs] | None = None, **goal: Any
) -> list[Outputs]:
    made: list[Outputs] = []
    for n in range(round(seconds / T)):
        u = robot.measured(**goal)
        made.append(controller.step(n * T, T, u))
        robot.fly(made[-1])
        if given is not None:
            given.append(u)
    return made


@pytest.mark.parametrize(("goal", "turn"), [([0.4, 0.2, -0.3], [0.0, 0.0, 1.2]), ([0.0, -0.07, 0.0], [0.0, 3.0, 0.0])])
def test_gripper_arrives_within_millimetres_within_thrust(goal: list[float], turn: list[float]):
    R = Rotation.from_rotvec(turn)
    robot, controller = Robot(noise=0.001), PoseController(Params())
    ys = flown(controller, robot, 40.0, p_WG_goal=np.array(goal), q_WG_goal=R.as_quat(scalar_first=True))
    assert np.linalg.norm(robot.y.p_WG - goal) < 0.005
    assert (Rotation.from_quat(robot.y.q_WG, scalar_first=True).inv() * R).magnitude() < 0.01
    assert np.max(np.abs([y.f_cmd for y in ys]) / F_MAX) < 0.95
    assert np.max(np.abs([y.tau_cmd for y in ys]) / TAU_MAX) < 0.95
    assert ys[-1].error_p < 0.01


def test_profile_joins_its_ends_smoothly_and_keeps_its_bounds():
    rng = np.random.default_rng(0)
    p_0, p_1, v_0 = (tuple(s * rng.normal(size=3)) for s in (0.5, 0.5, 0.02))
    q_0, q_1 = (tuple(q) for q in Rotation.random(2, rng=rng).as_quat(scalar_first=True))
    way = profile_between(p_0, v_0, q_0, p_1, q_1, BOUNDS)  # type: ignore
    t = np.linspace(0.0, way.T, 2001)
    rows = [way.at(x) for x in t]
    p, v, a, w, dw = (np.array([getattr(r, k) for r in rows]) for k in ("p", "v", "a", "w", "dw"))
    np.testing.assert_allclose([p[0], p[-1], v[0], v[-1]], [p_0, p_1, v_0, STILL], atol=1e-12)
    np.testing.assert_allclose([a[0], a[-1]], np.zeros((2, 3)), atol=1e-12)
    for x, rate in ((p, v), (v, a), (w, dw)):
        np.testing.assert_allclose(np.gradient(x, t, axis=0)[1:-1], rate[1:-1], atol=1e-6)
    R = Rotation.from_quat(np.array([r.q for r in rows]), scalar_first=True)
    turned = (R[2:] * R[:-2].inv()).as_rotvec() / (t[2:] - t[:-2])[:, None]
    np.testing.assert_allclose(turned, w[1:-1], atol=1e-5)
    assert (R[-1].inv() * Rotation.from_quat(q_1, scalar_first=True)).magnitude() < 1e-7
    for rate, most in ((v, BOUNDS.speed), (a, BOUNDS.acceleration), (w, BOUNDS.rate), (dw, BOUNDS.turning)):
        assert np.max(np.linalg.norm(rate, axis=1)) <= most + 1e-9


def test_braking_is_within_the_bound_and_makes_use_of_it():
    way = profile_between(STILL, (0.0, 0.06, 0.0), UPRIGHT, (0.0, -0.01, 0.0), UPRIGHT, BOUNDS)
    largest = max(abs(way.at(t).a[1]) for t in np.linspace(0.0, way.T, 1001))
    assert 0.9 * 0.02 < largest <= 0.02
    nowhere = profile_between(STILL, STILL, UPRIGHT, STILL, UPRIGHT, BOUNDS)
    assert (nowhere.T, nowhere.at(0.0).p) == (0.0, STILL)


def test_small_error_gives_the_pid_law():
    """At rest at the goal of a way that is over, off by e, turned by phi, moving with v and w (in the world)."""
    controller, robot = PoseController(Params(k_I=0.0, k_I_R=0.0)), Robot()
    flown(controller, robot, 0.1)
    e, phi, v, w = (np.array(x) for x in ([0.01, 0, 0], [0, 0.004, 0], [0, 0.02, 0], [0, 0, 0.01]))
    q = Rotation.from_rotvec(-phi).as_quat(scalar_first=True)
    off = Robot(p_WB_0=np.array([0.30, -0.07, 0.0]) - e, q_WB_0=q, v_WB_0=v, w_WB_0=w)
    y = controller.step(0.1, T, off.measured())
    w_B = np.transpose(rotation_of(q)) @ w
    np.testing.assert_allclose(y.f_cmd, MASS * np.transpose(rotation_of(q)) @ (0.6 * e - 1.2 * v), atol=1e-9)
    np.testing.assert_allclose(y.tau_cmd, INERTIA * (4.0 * phi - 3.2 * w_B) + np.cross(w_B, INERTIA * w_B), atol=1e-9)


def test_integral_takes_away_the_offset_of_a_draught():
    fast = Params(k_I=0.1)
    offsets: list[float] = []
    for params, seconds in ((fast, 40.0), (replace(fast, k_I=0.0), 20.0)):
        robot = Robot(draught=np.array([0.0, 0.0, 0.1]))
        flown(PoseController(params), robot, seconds)
        offsets.append(abs(float(robot.y.p_WG[2])))
    assert offsets[0] < 1e-3
    assert offsets[1] == pytest.approx(0.1 / (0.6 * MASS), rel=0.05)


def test_sums_stand_still_while_the_thrust_is_cut():
    """A robot that is held in place far from its goal does not wind up: let go, it does not shoot past it."""
    controller, robot = PoseController(Params(k_I=0.1)), Robot()
    goal = np.array([0.0, 0.33, 0.0])
    held = [controller.step(n * T, T, robot.measured(p_WG_goal=goal)) for n in range(round(60.0 / T))]
    assert held[-1].f_cmd[1] == F_MAX[1]
    path: list[float] = []
    for n in range(round(30.0 / T)):
        robot.fly(controller.step(n * T, T, robot.measured(p_WG_goal=goal)))
        path.append(float(robot.y.p_WG[1]))
    assert max(path) < 0.33 + 0.3
    assert path[-1] == pytest.approx(0.33, abs=0.02)


def test_turning_off_and_on_begins_afresh():
    controller, robot = PoseController(Params(k_I=0.05)), Robot(draught=np.array([0.02, 0.0, 0.0]))
    fresh = controller.get_state()
    flown(controller, robot, 5.0, p_WG_goal=np.array([0.3, 0.0, 0.0]))
    assert controller.get_state() != fresh
    y = controller.step(5.0, T, robot.measured(active=False))
    assert not np.any(y.f_cmd)
    assert not np.any(y.tau_cmd)
    assert controller.get_state() == fresh


def test_changed_goal_is_gone_to_from_where_the_robot_is():
    controller, robot = PoseController(Params()), Robot()
    flown(controller, robot, 6.0, p_WG_goal=np.array([0.5, -0.07, 0.0]))
    assert np.linalg.norm(robot.y.v_WB) > 0.05
    before = robot.y.v_WB
    y = flown(controller, robot, T, p_WG_goal=np.array([0.2, 0.3, 0.0]))[0]
    assert np.max(np.abs(y.f_cmd)) < 1e-3  # the way begins with the velocity that there is
    np.testing.assert_allclose(robot.y.v_WB, before, atol=1e-3)
    flown(controller, robot, 25.0, p_WG_goal=np.array([0.2, 0.3, 0.0]))
    np.testing.assert_allclose(robot.y.p_WG, [0.2, 0.3, 0.0], atol=1e-3)


def test_poles_are_those_of_the_gains():
    """Position poles s^2 + 1.2 s + 0.6: a frequency of 0.775 rad/s and a ratio of 0.775, attitude 2 rad/s and 0.8."""
    y = PoseController(Params(lag=0.0, k_I=0.0, k_I_R=0.0)).outputs(0.0, Inputs())
    assert y.damping_ratio == pytest.approx(1.2 / (2.0 * math.sqrt(0.6)), rel=0.01)
    assert y.pole_frequency == pytest.approx(math.sqrt(0.6), rel=0.01)
    assert y.pole_radius == pytest.approx(math.exp(-0.6 * T), rel=1e-4)


def test_linear_prediction_holds_for_a_small_push():
    """Off from the goal by a push on the base's centre, without lag and limits in play."""
    controller, wrench = PoseController(Params(lag=0.0)), np.zeros((round(8.0 / T), 6))
    wrench[:30, 0] = 0.05
    predicted, robot, path = controller.loop.response(wrench)[:, 0], Robot(propulsion=Propulsion.IDEAL), list[float]()
    for d in wrench:
        path.append(float(robot.y.p_WG[0]))
        robot.draught = d[:3]
        robot.fly(controller.step(0.0, T, robot.measured()))
    assert np.max(np.abs(np.array(path) - predicted)) < 0.01 * np.max(predicted)


def test_what_cannot_work_is_refused_all_at_once_with_what_would(wording: Wording):
    unusable: tuple[dict[str, Any], ...] = (
        {"delay": 0.5},
        {"acceleration": 0.1, "turning": 1.0, "k_D": 0.0},
        {"k_I": -0.1},
        {"k_I": 0.72},
        {"k_I": np.nan},
        {"mass": 48.0},
        {"I_B": 0.8 * np.eye(3)},
    )
    for changes in unusable:
        with pytest.raises(InvalidControllerParameters) as refused:
            PoseController(Params(**changes))
        assert len(refused.value.faults) == len(changes)
        wording.check(refused.value)
    PoseController(Params(delay=0.1))


def test_restored_state_continues_bit_for_bit():
    goal = {"p_WG_goal": np.array([0.4, 0.2, -0.3]), "q_WG_goal": np.array([0.8, 0.0, 0.6, 0.0])}
    robot, given = Robot(draught=np.array([0.02, 0.0, 0.0]), v_WB_0=np.array([0.01, 0.02, 0.0])), list[Inputs]()
    flown(PoseController(Params()), robot, 4.0, given, **goal)
    assert_continues(lambda: PoseController(Params()), given.__getitem__, [0, 150], 100)
    assert_outputs_change_nothing(lambda: PoseController(Params()), given[0], same=True)
