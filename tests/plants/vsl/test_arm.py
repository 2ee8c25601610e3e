import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_continues, assert_outputs_change_nothing, flat
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.arm import Inputs as ArmInputs
from handover.plants.vsl.arm import InvalidInput, VslArm
from handover.plants.vsl.arm import Outputs as ArmOutputs
from handover.plants.vsl.parameters import InvalidVslArmParameters, Link, Motion, Params
from handover.plants.vsl.statics import NoEquilibrium

EXACT = Params(servo_noise=0.0, current_noise=0.0, tracker_noise=0.0, pressure_noise=0.0)
PRINTED = replace(EXACT, link_2=Link.RIGID, link_3=Link.RIGID)


def reach(x: float, y: float, z: float) -> Floats:
    """Joint angles of the stiff arm, elbow up, eqs. (2)-(4), corrected."""
    r1, r2, L = math.hypot(x, y), z - 0.15, 0.225
    bend = math.acos(math.hypot(r1, r2) / (2.0 * L))
    return np.array([math.atan2(y, x), math.atan2(r2, r1) + bend, -2.0 * bend])


def stiff(q: Floats) -> Floats:
    """Eq. (1)."""
    theta_1, theta_2, theta_3 = q
    r = 0.225 * (math.cos(theta_2) + math.cos(theta_2 + theta_3))
    z = 0.15 + 0.225 * (math.sin(theta_2) + math.sin(theta_2 + theta_3))
    return np.array([r * math.cos(theta_1), r * math.sin(theta_1), z])


def at(
    p_WG: tuple[float, float, float], pressure: float = 1e5, load: float = 0.0, params: Params = EXACT
) -> ArmOutputs:
    """The arm at rest, sent to a place where a stiff one would be."""
    arm = VslArm(replace(params, q_0=reach(*p_WG), p_0=np.array([pressure, pressure])))
    return arm.outputs(0.0, ArmInputs(load=load))


def tip_error(p_WG: tuple[float, float, float], pressure: float, load: float, params: Params = EXACT) -> float:
    """Millimetres between the arm's tip and where its encoders and eq. (1) have it."""
    y = at(p_WG, pressure, load, params)
    return 1e3 * float(np.linalg.norm(y.p_WG - stiff(y.q_meas)))


def walk(arm: VslArm, u: ArmInputs, steps: int, dt: float = 0.02) -> list[ArmOutputs]:
    return [arm.step(i * dt, dt, u) for i in range(steps)]


OUT = (0.4, 0.0, 0.15)


@pytest.mark.parametrize(
    ("params", "pressure", "load", "wanted"),
    [(EXACT, 0.5e5, 0.0, 34.9), (EXACT, 2.0e5, 0.1, 24.1), (PRINTED, 1e5, 0.0, 3.2), (PRINTED, 1e5, 0.1, 4.7)],
)
def test_the_tip_errs_as_much_as_it_was_measured_to(params: Params, pressure: float, load: float, wanted: float):
    assert tip_error(OUT, pressure, load, params) == pytest.approx(wanted, rel=0.01 if params is EXACT else 0.05)


def test_error_grows_with_load_and_reach_and_falls_with_pressure():
    place, loads, pressures = (0.25, 0.0, 0.1), [0.0, 0.05, 0.1], [0.5e5, 1e5, 2e5]
    errors = np.array([[tip_error(place, p, m) for p in pressures] for m in loads])
    assert np.all(np.diff(errors, axis=0) > 0.2)
    assert np.all(np.diff(errors, axis=1) < -0.5)
    assert np.all(errors > [[tip_error(place, 1e5, m, PRINTED)] for m in loads])
    assert np.all(np.diff([tip_error((x, 0.0, 0.15), 1e5, 0.05) for x in (0.2, 0.3, 0.4, 0.44)]) > 1.0)


def test_each_link_has_its_own_pressure_unless_it_is_rigid():
    def height(p_2: float, p_3: float, **links: Any) -> float:
        arm = VslArm(replace(EXACT, q_0=reach(*OUT), p_0=np.array([p_2, p_3]), **links))
        return float(arm.outputs(0.0, ArmInputs()).p_WG[2])

    assert height(0.0, 1e5) < height(1e5, 0.0) < height(1e5, 1e5)
    for p in (0.0, 3e5):
        assert height(p, 1e5, link_2=Link.RIGID) == height(1e5, 1e5, link_2=Link.RIGID) > height(1e5, 1e5)
        assert height(1e5, p, link_3=Link.RIGID) == height(1e5, 1e5, link_3=Link.RIGID) > height(1e5, 1e5)


@pytest.mark.parametrize("motion", list(Motion))
def test_a_turn_of_the_base_turns_everything(motion: Motion):
    start, goal = reach(0.35, 0.0, 0.1), reach(0.3, 0.0, 0.2)

    def moved(theta_1: float) -> ArmOutputs:
        turn = np.array([theta_1, 0.0, 0.0])
        arm = VslArm(replace(EXACT, motion=motion, q_0=start + turn))
        return walk(arm, ArmInputs(q_cmd=goal + turn, load=0.05), 10)[-1]

    y = moved(0.0)
    assert y.p_WG[1] == 0.0
    for theta_1 in (-2.0, 0.6):
        c, s = math.cos(theta_1), math.sin(theta_1)
        R: Floats = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        turned = moved(theta_1)
        np.testing.assert_allclose(turned.p_WG, R @ y.p_WG, atol=1e-12)
        np.testing.assert_allclose(turned.shape, y.shape @ np.transpose(R), atol=1e-12)
        np.testing.assert_allclose(turned.q_meas - y.q_meas, [theta_1, 0.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(turned.i_meas, y.i_meas, atol=1e-9)


def test_the_encoder_sees_droop_but_not_what_gives_behind_it():
    q = reach(*OUT)
    y = at(OUT, load=0.1, params=PRINTED)
    tau = y.i_meas[1:] * 1.78
    np.testing.assert_allclose(y.q_meas[1:], q[1:] - tau / 260.0, rtol=1e-12)
    assert tau[0] > 1.0
    softer = at(OUT, load=0.1, params=replace(PRINTED, joint_stiffness=70.0))
    np.testing.assert_allclose(softer.q_meas, y.q_meas, atol=1e-4)
    assert softer.p_WG[2] < y.p_WG[2] - 2e-3


def test_current_depends_on_the_way_by_which_the_joint_came_and_not_at_the_start():
    u = ArmInputs(q_cmd=reach(0.35, 0.0, 0.1))
    above, below = (
        walk(VslArm(replace(EXACT, q_0=u.q_cmd + np.array([0.2, way, 0.0]))), u, 20)[-1].i_meas for way in (0.3, -0.3)
    )
    assert below[1] - above[1] == pytest.approx(2.0 * 0.06 / 1.78, rel=1e-4)
    assert below[0] == pytest.approx(-0.06 / 1.78)
    arm, u = VslArm(replace(PRINTED, q_0=reach(*OUT))), ArmInputs(q_cmd=reach(*OUT), load=0.1)
    before = arm.outputs(0.0, u).i_meas
    assert before[1] > 0.5
    np.testing.assert_allclose(arm.step(0.0, 0.02, u).i_meas, before, atol=1e-9)


def test_the_base_motor_feels_inertia_when_it_starts_and_stops():
    arm = VslArm(replace(EXACT, gear_friction=0.0, q_0=np.array([0.0, 0.0, 0.0]), link_2=Link.RIGID, link_3=Link.RIGID))
    u = ArmInputs(q_cmd=np.array([0.05, 0.0, 0.0]), qd_cmd=np.array([1.0, 0.0, 0.0]))
    i_1 = [y.i_meas[0] for y in walk(arm, u, 6)]
    L = 0.45
    inertia = 0.28 * L**2 / 3.0 + 0.125 * (L / 2.0) ** 2 + 0.035 * L**2
    assert i_1[0] == pytest.approx(inertia * 1.0 / 0.02 / 1.78, rel=0.02)
    np.testing.assert_allclose(i_1[1], 0.0, atol=1e-12)
    assert sum(i_1) == pytest.approx(0.0, abs=1e-9)


def test_the_base_motor_holds_back_an_arm_that_is_drawn_in_while_it_turns():
    """At a steady speed the current is I' w: of a single massless link with a mass at its end, d(m L^2 cos^2)/dt w."""
    exact = replace(EXACT, gear_friction=0.0, joint_stiffness=1e12, servo_stiffness=1e12, links=1, gravity=0.0)
    params = replace(exact, link_2=Link.RIGID, link_mass=1e-9, EI_rigid=1e9, q_0=np.array([0.0, 0.6, 0.0]))
    arm, dt, w, raise_ = VslArm(params), 0.001, 1.5, 0.8
    u = ArmInputs(q_cmd=np.array([2.0, 1.4, 0.0]), qd_cmd=np.array([w, raise_, 1.0]), load=0.1)
    i_1 = [arm.step(k * dt, dt, u).i_meas[0] for k in range(101)][-1]
    angle = 0.6 + raise_ * 0.1005  # in the middle of the last step
    torque = -0.135 * 0.225**2 * math.sin(2.0 * angle) * raise_ * w
    assert i_1 == pytest.approx(torque / 1.78, rel=1e-3)


def test_pressure_follows_its_command_and_stiffens_the_arm_and_joints_follow_their_profile():
    arm = VslArm(replace(EXACT, q_0=reach(*OUT)))
    y = walk(arm, ArmInputs(q_cmd=reach(*OUT), p_cmd=np.array([2e5, 1e5])), 200)
    np.testing.assert_allclose(y[-1].p_meas, [2e5, 1e5], atol=2000.0)
    assert np.all(np.diff([x.p_WG[2] for x in y[:50]]) > 0.0)
    moved = walk(VslArm(EXACT), ArmInputs(q_cmd=np.array([0.5, 0.8, -1.2]), qd_cmd=np.array([0.5, 0.0, 0.2])), 25)[-1]
    assert moved.q_meas[0] == pytest.approx(0.25)
    assert moved.q_meas[2] == pytest.approx(-1.6821 + 0.1, abs=2e-3)


def test_noise_is_as_large_as_declared():
    y = walk(VslArm(Params(seed=3, leak_time=1e9)), ArmInputs(), 800)
    q, i, p = (np.std([getattr(x, name) for x in y], axis=0) for name in ("q_meas", "i_meas", "p_meas"))
    np.testing.assert_allclose(q, math.radians(0.06), rtol=0.08)
    np.testing.assert_allclose(i, 0.003, rtol=0.08)
    np.testing.assert_allclose(p, 200.0, rtol=0.08)
    np.testing.assert_allclose(np.std([x.p_WG_meas - x.p_WG for x in y], axis=0), 0.0005, rtol=0.08)


def course(i: int) -> ArmInputs:
    x = 0.32 + 0.06 * math.sin(0.2 * i)
    return ArmInputs(
        q_cmd=reach(x, 0.05, 0.15),
        qd_cmd=np.array([0.4, 0.0, 0.6]),
        p_cmd=np.array([2e5, 0.5e5]) if i > 8 else np.array([1e5, 1e5]),
        load=0.075 if i > 12 else 0.0,
    )


@pytest.mark.parametrize("motion", list(Motion))
def test_continues_bit_for_bit_from_a_state_and_outputs_at_the_start_know_the_load(motion: Motion):
    params = Params(motion=motion, seed=5)
    assert_continues(lambda: VslArm(params), course, [0, 10], 10, 0.02)
    assert_outputs_change_nothing(lambda: VslArm(params), ArmInputs(load=0.1), 0.02)
    light, heavy = (VslArm(params).outputs(0.0, ArmInputs(load=m)) for m in (0.0, 0.1))
    assert heavy.p_WG[2] < light.p_WG[2] - 0.005
    other = VslArm(replace(params, seed=6)).outputs(0.0, ArmInputs())
    assert np.abs(flat(other) - flat(light)).max() > 1e-5


def test_swinging_arm_comes_to_the_quasi_static_rest():
    u = ArmInputs(q_cmd=reach(*OUT), load=0.05, p_cmd=np.array([1e5, 1e5]))
    hinges = replace(EXACT, hinges_dynamic=6, leak_time=1e9, damping_time=0.05)
    dynamic = replace(hinges, motion=Motion.DYNAMIC)
    still, swinging, coarse = (
        walk(VslArm(p), u, 100)[-1] for p in (hinges, dynamic, replace(dynamic, hinges_dynamic=2))
    )
    np.testing.assert_allclose([swinging.p_WG, swinging.q_meas], [still.p_WG, still.q_meas], atol=1e-6)
    assert np.linalg.norm(coarse.p_WG - still.p_WG) < 3e-4


@pytest.mark.parametrize(
    ("dt", "motion"), [(0.004, Motion.QUASI_STATIC), (0.0137, Motion.DYNAMIC), (0.1, Motion.DYNAMIC)]
)
def test_any_step_will_do(dt: float, motion: Motion):
    u = ArmInputs(q_cmd=reach(*OUT), qd_cmd=np.array([0.0, 0.5, 1.0]), load=0.05)
    seconds = 3.0 if motion is Motion.DYNAMIC else 1.0
    y = walk(VslArm(replace(EXACT, motion=motion, leak_time=1e9)), u, round(seconds / dt), dt)[-1]
    np.testing.assert_allclose(y.p_WG, at(OUT, load=0.05).p_WG, atol=6e-4)


def test_inputs_are_not_kept():
    arm = VslArm(EXACT)
    u = ArmInputs(q_cmd=reach(*OUT))
    y = arm.step(0.0, 0.02, u)
    u.q_cmd[:] = 9.0
    u.p_cmd[:] = 0.0
    np.testing.assert_array_equal(flat(arm.outputs(0.02, u)), flat(y))


@pytest.mark.parametrize("motion", list(Motion))
def test_an_arm_that_buckles_is_refused_and_stays_as_it_was(motion: Motion):
    params = replace(EXACT, motion=motion, EI_0=0.05, EI_p=0.0, q_0=np.array([0.0, math.pi / 2.0, 0.0]))
    arm = VslArm(params)
    state = arm.get_state()
    with pytest.raises(NoEquilibrium):
        arm.step(0.0, 0.02, ArmInputs(q_cmd=params.q_0, load=0.5))
    assert arm.get_state() == state


@pytest.mark.parametrize(
    "changes",
    [
        {"load": -0.01},
        {"load": math.nan},
        {"load": 0.6},
        {"q_cmd": np.array([0.0, math.nan, 0.0])},
        {"q_cmd": np.array([0.0, -6.3, 0.0])},
        {"p_cmd": np.array([-1.0, 1e5])},
        {"p_cmd": np.array([1e5, 4e5])},
    ],
)
def test_unusable_inputs_are_refused_and_change_nothing(changes: dict[str, Any], wording: Wording):
    arm, u = VslArm(EXACT), replace(ArmInputs(), **changes)
    walk(arm, ArmInputs(), 2)
    state = arm.get_state()
    with pytest.raises(InvalidInput) as refused:
        arm.step(0.04, 0.02, u)
    wording.check(refused.value)
    with pytest.raises(InvalidInput):
        VslArm(EXACT).outputs(0.0, u)
    assert arm.get_state() == state


@pytest.mark.parametrize(
    ("faults", "changes"),
    [
        (3, {"motion": Motion.DYNAMIC, "L_2": 0.06, "cap": 0.04, "valve_tolerance": 2000.0, "link_mass": 0.0}),
        (2, {"L_2": -1.0, "hinges": 0}),
        (1, {"links": 4}),
        (1, {"links": 3, "L_4": 0.05}),
    ],
    ids=["contradictions", "ranges", "links", "third link"],
)
def test_contradicting_parameters_are_refused_all_at_once(faults: int, changes: dict[str, Any], wording: Wording):
    with pytest.raises(InvalidVslArmParameters) as caught:
        VslArm(Params(**changes))
    assert len(caught.value.faults) == faults
    wording.check(caught.value)
