"""The virtual body's motion against its closed form, the observer's convergence, and the loop's stability."""

import math
from dataclasses import replace
from typing import Any

import control as untyped_control
import numpy as np
import pytest
from support.controllers.pushed_body import ARM, GOAL, MASS, Body, T, pushed
from support.restored_states import assert_continues, assert_outputs_change_nothing
from support.wording import Wording

from handover.controllers.free_flyer.admittance_controller import AdmittanceController, Inputs, Params
from handover.controllers.free_flyer.body import InvalidControllerParameters
from handover.controllers.free_flyer.ports import Behaviour
from handover.controllers.free_flyer.published_rate import PUBLISHED_PERIOD, AdmittanceController67
from handover.controllers.free_flyer.wrench_observer import ThrustModel, WrenchObserver
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot import thrusters

control: Any = untyped_control
NO_LIMITS: dict[str, Any] = {"f_max": np.full(3, 100.0), "tau_max": np.full(3, 100.0)}
PROMPT = Params(lag=0.0, **NO_LIMITS)
SPRING = {Behaviour.RIGID: (7.0 * MASS, 15.0), Behaviour.COMPLIANT: (0.7 * MASS, 5.0)}


def steady(axis: int, size: float, seconds: float) -> Floats:
    d = np.zeros((round(seconds / T), 6))
    d[:, axis] = size
    return d


@pytest.mark.parametrize(
    ("behaviour", "ratio", "axis"),
    [(Behaviour.RIGID, 0.5, 1), (Behaviour.RIGID, 1.0, 2), (Behaviour.COMPLIANT, 2.0, 0)],
)
def test_a_step_of_force_moves_the_gripper_as_the_virtual_mass(behaviour: Behaviour, ratio: float, axis: int):
    """1 / (m_v s^2 + k_B s + k_D) along every axis, also where the lever would turn the body."""
    k, b = SPRING[behaviour]
    p = replace(PROMPT, behaviour=behaviour, inertia_ratio=ratio, observer_rate=100.0)
    real = pushed(AdmittanceController(p), steady(axis, 0.05, 4.0))
    t = T * np.arange(len(real))
    wanted = 0.05 * control.step_response(control.tf([1.0], [ratio * MASS, b, k]), t).outputs
    assert np.max(np.abs(real[:, axis] - wanted)) < 0.07 * np.max(wanted)
    assert np.max(np.abs(real[:, 3:])) < 0.02


@pytest.mark.parametrize(("axis", "delay"), [*((axis, 0) for axis in range(6)), (2, 2)])
def test_small_pushes_move_the_gripper_as_linear_theory_says(axis: int, delay: int):
    controller = AdmittanceController(replace(PROMPT, delay=delay * T))
    wrench = steady(axis, 0.05 if axis < 3 else 0.01, 3.0)
    wrench[round(0.5 / T) :] = 0.0
    predicted = controller.loop.response(wrench)[:, :6]
    real = pushed(controller, wrench, delay)
    assert np.max(np.abs(real - predicted)) < 0.01 * np.max(np.abs(predicted[:, axis]))


def test_the_observer_alone_forgets_exponentially_and_takes_thrust_for_no_wrench():
    observer, h = WrenchObserver(5.0, T), np.zeros(6)
    memory = observer.begun(h)
    thrust, wrench = np.arange(6.0), np.linspace(-1.0, 1.0, 6)
    for n in range(50):
        np.testing.assert_allclose(observer.estimate(memory, h), (1.0 - math.exp(-5.0 * n * T)) * wrench, atol=1e-12)
        memory, h = observer.following(memory, h, thrust), h + T * (thrust + wrench)


@pytest.mark.parametrize(("lag", "delay"), [(0.0, 0.04), (0.02, 0.005), (0.3, 0.016)])
def test_the_model_of_the_propulsion_is_that_of_the_thrusters(lag: float, delay: float):
    model, rng = ThrustModel(lag, delay, T), np.random.default_rng(3)
    plant = thrusters.Thrusters(thrusters.Params(lag=lag, delay=delay, f_max=np.full(3, 9.0), tau_max=np.full(3, 9.0)))
    thrust, past = np.zeros(6), [np.zeros(6)] * model.remembered
    for n in range(40):
        command = rng.normal(size=6)
        y = plant.step(n * T, T, thrusters.Inputs(f_impedance=command[:3], tau_impedance=command[3:]))
        thrust, mean = model.over_period(thrust, [command, *past])
        past = [command, *past][: model.remembered]
        np.testing.assert_allclose(mean, np.concatenate([y.f_B, y.tau_B]), atol=1e-12)


def test_commands_stay_within_the_limits_and_the_estimate_knows_it():
    """A pull that thrust cannot hold is estimated as what it is, and not as what was commanded in vain."""
    controller, body = AdmittanceController(Params(lag=0.0)), Body()
    y = controller.outputs(0.0, body.measured())
    for n in range(round(1.5 / T)):
        y = controller.step(n * T, T, body.measured())
        assert np.all(np.abs(y.f_cmd) <= Params().f_max)
        assert np.all(np.abs(y.tau_cmd) <= Params().tau_max)
        body.push(y.f_cmd, y.tau_cmd, np.array([4.0, 0.0, 0.0]), np.zeros(3), T)
    np.testing.assert_allclose(y.f_G_est, [4.0, 0.0, 0.0], atol=0.01)


def test_commands_nothing_when_off_and_begins_anew_when_on():
    body, once = Body(v=np.array([0.02, 0.0, 0.01])), AdmittanceController(PROMPT)
    u = body.measured()
    first = once.step(0.0, T, u)
    once.step(T, T, body.measured())
    off = once.step(2 * T, T, replace(u, active=False))
    for vector in (off.f_cmd, off.tau_cmd, off.f_G_est, off.tau_G_est):
        assert not np.any(vector)
    np.testing.assert_array_equal(once.step(3 * T, T, u).f_cmd, first.f_cmd)
    np.testing.assert_allclose(first.f_cmd[2], -15.0 * 0.01, rtol=0.15)  # it begins with the gripper's own velocity


def test_where_the_goal_changes_the_gripper_is_drawn_from_where_it_is():
    controller, body = AdmittanceController(PROMPT), Body()
    for n in range(10):
        controller.step(n * T, T, body.measured())
    y = controller.step(10 * T, T, replace(body.measured(), p_WG_goal=GOAL + np.array([0.001, 0.0, 0.0])))
    assert 0.0 < y.f_cmd[0] < 7.0 * MASS * 0.001
    assert y.error_p == pytest.approx(0.001)


def test_a_restored_state_continues_bit_for_bit():
    controller, body, given = AdmittanceController(Params(delay=0.02)), Body(), list[Inputs]()
    for n in range(90):
        given.append(body.measured())
        y = controller.step(n * T, T, given[-1])
        body.push(y.f_cmd, y.tau_cmd, np.array([0.2, 0.1, -0.3]), np.zeros(3), T)
    assert_continues(lambda: AdmittanceController(Params(delay=0.02)), given.__getitem__, [1, 60], 30)
    assert_outputs_change_nothing(lambda: AdmittanceController(PROMPT), given[60], same=True)


def test_a_delay_that_is_known_leaves_the_virtual_body_alone_until_the_inner_loop_cannot_bear_it():
    """The observer's model of the propulsion predicts the commands that are on their way."""
    prompt, late = (AdmittanceController(Params(delay=d)).outputs(0.0, Inputs()) for d in (0.0, 0.064))
    assert late.pole_radius == pytest.approx(prompt.pole_radius, abs=1e-9)
    assert late.damping_ratio == pytest.approx(prompt.damping_ratio, abs=1e-6)


def test_what_cannot_work_is_refused_with_a_remedy(wording: Wording):
    unusable: tuple[dict[str, Any], ...] = (
        {"k_x": 900.0, "k_v": 200.0},
        {"delay": 0.1, "k_v": 20.0, "k_x": 100.0},
        {"k_v": 0.0, "k_R": 0.0},
        {"mass": np.inf, "delay": -0.01},
        {"behaviour": Behaviour.CUSTOM, "damping_rotation": np.zeros((3, 3))},
    )
    for changes in unusable:
        with pytest.raises(InvalidControllerParameters) as refused:
            AdmittanceController(replace(Params(), **changes))
        wording.check(refused.value)


def test_turning_the_goal_turns_the_command():
    """The law is in the goal's axes: a goal turned about the arm, with the robot at it, changes nothing in B."""
    half = np.array([math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0])
    u = Inputs(p_WB_meas=GOAL - ARM, v_WB_meas=np.array([0.03, 0.0, 0.0]), p_WG_goal=GOAL, active=True)
    a = AdmittanceController(PROMPT).step(0.0, T, u)
    b = AdmittanceController(PROMPT).step(0.0, T, replace(u, q_WB_meas=half, q_WG_goal=half))
    np.testing.assert_allclose(a.f_cmd, b.f_cmd, atol=1e-12)


def test_an_output_depends_directly_on_the_inputs_that_are_declared_and_on_no_others():
    controller, rng = AdmittanceController(Params(delay=T)), np.random.default_rng(5)

    def drawn(active: bool = True) -> Inputs:
        q, goal = (np.array([1.0, *0.1 * rng.standard_normal(3)]) for _ in range(2))
        p, v, w, g = 0.02 * rng.standard_normal((4, 3))
        places = {"p_WB_meas": p, "q_WB_meas": q, "p_WG_goal": g, "q_WG_goal": goal}
        return Inputs(**places, v_WB_meas=v, w_WB_meas=w, active=active)

    changed: dict[str, set[str]] = {v.name: set() for v in describe(AdmittanceController).outputs}
    for n in range(12):
        u = drawn()
        for _ in range(5):
            controller.step(0.0, T, u)
        for given in (u, drawn(active=n % 3 > 0)):
            before, other = vars(controller.outputs(0.0, given)), vars(drawn(active=not given.active))
            for name, value in other.items():
                after = vars(controller.outputs(0.0, replace(given, **{name: value})))
                for output in changed:
                    if not np.array_equal(before[output], after[output]):
                        changed[output].add(name)
    declared = AdmittanceController.feedthrough
    assert changed == {output: set(declared.get(output, ())) for output in changed}


def test_at_another_rate_loop_observer_and_virtual_body_have_that_rate():
    """The virtual body's step of force is the same, by a loop that is closed at 67.5 Hz."""
    period = float(PUBLISHED_PERIOD)
    slow, fast = AdmittanceController(PROMPT), AdmittanceController67(PROMPT)
    assert (slow.loop.period, fast.loop.period) == (T, period)
    assert slow.loop.slowest_decay == pytest.approx(fast.loop.slowest_decay, rel=0.01)
    wrenches = [np.tile([0.05, 0.0, 0.0, 0.0, 0.0, 0.0], (round(2.0 / dt), 1)) for dt in (T, period)]
    ends = [c.loop.response(d)[-1, 0] for c, d in zip((slow, fast), wrenches, strict=True)]
    assert ends[0] == pytest.approx(ends[1], rel=0.01)
