import itertools
import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handover.cosim.blocks.description import describe
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


def flat(y: ArmOutputs) -> Floats:
    return np.concatenate([np.ravel(getattr(y, v.name)) for v in describe(VslArm).outputs])


def walk(arm: VslArm, u: ArmInputs, steps: int, dt: float = 0.02) -> list[ArmOutputs]:
    return [arm.step(i * dt, dt, u) for i in range(steps)]


OUT = (0.4, 0.0, 0.15)


@pytest.mark.parametrize(("pressure", "load", "wanted"), [(0.5e5, 0.0, 34.9), (0.5e5, 0.1, 52.8), (2.0e5, 0.1, 24.1)])
def test_the_tip_errs_as_much_as_it_was_measured_to(pressure: float, load: float, wanted: float):
    assert tip_error(OUT, pressure, load) == pytest.approx(wanted, rel=0.01)


def test_a_printed_arm_errs_by_a_few_millimetres():
    assert tip_error(OUT, 1e5, 0.0, PRINTED) == pytest.approx(3.2, rel=0.05)
    assert tip_error(OUT, 1e5, 0.1, PRINTED) == pytest.approx(4.7, rel=0.05)


@pytest.mark.parametrize("place", [(0.3, 0.0, 0.05), (0.3, 0.0, 0.35), (0.4, 0.0, 0.15), (0.25, 0.0, 0.1)])
def test_error_grows_with_load_and_falls_with_pressure(place: tuple[float, float, float]):
    loads, pressures = [0.0, 0.025, 0.05, 0.075, 0.1], [0.5e5, 1e5, 1.5e5, 2e5]
    errors = np.array([[tip_error(place, p, m) for p in pressures] for m in loads])
    assert np.all(np.diff(errors, axis=0) > 0.2)
    assert np.all(np.diff(errors, axis=1) < -0.5)
    assert np.all(errors > [[tip_error(place, 1e5, m, PRINTED)] for m in loads])


def test_error_grows_with_reach():
    errors = [tip_error((x, 0.0, 0.15), 1e5, 0.05) for x in (0.2, 0.25, 0.3, 0.35, 0.4, 0.44)]
    assert np.all(np.diff(errors) > 1.0)


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
        return walk(
            VslArm(replace(EXACT, motion=motion, q_0=start + turn)), ArmInputs(q_cmd=goal + turn, load=0.05), 10
        )[-1]

    y = moved(0.0)
    assert y.p_WG[1] == 0.0
    for theta_1 in (-2.0, 0.6, 3.0):
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


def test_currents_hold_the_weight():
    y = at((0.449, 0.0, 0.15), params=replace(PRINTED, joint_stiffness=1e9, servo_stiffness=1e9, EI_rigid=1e9))
    r2 = 0.225 * math.cos(reach(0.449, 0.0, 0.15)[1])
    tau_3 = 9.81 * r2 * (0.14 / 2.0 + 0.035)
    tau_2 = tau_3 + 9.81 * r2 * (0.14 / 2.0 + 0.125 + 0.14 + 0.035)
    np.testing.assert_allclose(y.i_meas, [0.0, tau_2 / 1.78, tau_3 / 1.78], rtol=1e-6)


def test_the_gears_have_no_friction_at_the_start():
    arm = VslArm(replace(PRINTED, q_0=reach(*OUT)))
    u = ArmInputs(q_cmd=reach(*OUT), load=0.1)
    before = arm.outputs(0.0, u).i_meas
    assert before[1] > 0.5
    np.testing.assert_allclose(arm.step(0.0, 0.02, u).i_meas, before, atol=1e-9)


def test_current_depends_on_the_way_by_which_the_joint_came():
    u = ArmInputs(q_cmd=reach(0.35, 0.0, 0.1))
    above, below = (
        walk(VslArm(replace(EXACT, q_0=u.q_cmd + np.array([0.2, way, 0.0]))), u, 20)[-1].i_meas for way in (0.3, -0.3)
    )
    assert below[1] - above[1] == pytest.approx(2.0 * 0.06 / 1.78, rel=1e-4)
    assert below[0] == pytest.approx(-0.06 / 1.78)


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


def test_joints_follow_their_profile():
    arm = VslArm(EXACT)
    u = ArmInputs(q_cmd=np.array([0.5, 0.8411, -1.2]), qd_cmd=np.array([0.5, 0.0, 0.2]))
    y = walk(arm, u, 25)[-1]
    assert y.q_meas[0] == pytest.approx(0.25)
    assert y.q_meas[2] == pytest.approx(-1.6821 + 0.1, abs=2e-3)


def test_pressure_follows_its_command_and_stiffens_the_arm():
    arm = VslArm(replace(EXACT, q_0=reach(*OUT)))
    u = ArmInputs(q_cmd=reach(*OUT), p_cmd=np.array([2e5, 1e5]))
    y = walk(arm, u, 200)
    assert y[-1].p_meas[0] == pytest.approx(2e5, abs=2000.0)
    assert y[-1].p_meas[1] == pytest.approx(1e5, abs=2000.0)
    assert np.all(np.diff([x.p_WG[2] for x in y[:50]]) > 0.0)


def test_the_centre_line_goes_from_the_base_to_the_tip():
    y = at((0.2, 0.25, 0.3), 0.5e5, 0.1)
    np.testing.assert_array_equal(y.shape[0], np.zeros(3))
    np.testing.assert_allclose(y.shape[1], [0.0, 0.0, 0.15])
    np.testing.assert_array_equal(y.shape[-1], y.p_WG)
    links = np.linalg.norm(np.diff(y.shape[1:], axis=0), axis=1)
    np.testing.assert_allclose(links[:12], 0.225 / 12, rtol=0.02)
    np.testing.assert_allclose(links[12:], 0.225 / 11, rtol=0.02)


def test_noise_is_as_large_as_declared():
    arm = VslArm(Params(seed=3, leak_time=1e9))
    y = walk(arm, ArmInputs(), 1500)
    q, i, p = (np.std([getattr(x, name) for x in y], axis=0) for name in ("q_meas", "i_meas", "p_meas"))
    np.testing.assert_allclose(q, math.radians(0.06), rtol=0.06)
    np.testing.assert_allclose(i, 0.003, rtol=0.06)
    np.testing.assert_allclose(p, 200.0, rtol=0.06)
    np.testing.assert_allclose(np.std([x.p_WG_meas - x.p_WG for x in y], axis=0), 0.0005, rtol=0.06)


def test_seeds_differ_and_equal_seeds_do_not():
    a, b, c = (flat(walk(VslArm(Params(seed=s)), ArmInputs(), 5)[-1]) for s in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert np.abs(a - c).max() > 1e-5


def course(i: int) -> ArmInputs:
    x = 0.32 + 0.06 * math.sin(0.2 * i)
    return ArmInputs(
        q_cmd=reach(x, 0.05, 0.15),
        qd_cmd=np.array([0.4, 0.0, 0.6]),
        p_cmd=np.array([2e5, 0.5e5]) if i > 8 else np.array([1e5, 1e5]),
        load=0.075 if i > 12 else 0.0,
    )


@pytest.mark.parametrize("motion", list(Motion))
@pytest.mark.parametrize("steps", [0, 10, 20])
def test_continues_bit_for_bit_from_a_state_here_and_in_another_arm(motion: Motion, steps: int):
    params = Params(motion=motion, seed=5)
    arm, other = VslArm(params), VslArm(params)
    walk(other, ArmInputs(load=0.1), 3)
    for i in range(steps):
        arm.step(0.02 * i, 0.02, course(i))
    state = arm.get_state()
    wanted = [flat(arm.step(0.02 * i, 0.02, course(i))) for i in range(steps, 30)]
    for again in (arm, other):
        again.set_state(state)
        found = [flat(again.step(0.02 * i, 0.02, course(i))) for i in range(steps, 30)]
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("motion", list(Motion))
def test_outputs_at_the_start_know_the_load_and_change_nothing(motion: Motion):
    asked, fresh = VslArm(Params(motion=motion)), VslArm(Params(motion=motion))
    light, heavy = (asked.outputs(0.0, ArmInputs(load=m)) for m in (0.0, 0.1))
    assert heavy.p_WG[2] < light.p_WG[2] - 0.005
    np.testing.assert_array_equal(
        [flat(y) for y in walk(asked, ArmInputs(load=0.1), 3)], [flat(y) for y in walk(fresh, ArmInputs(load=0.1), 3)]
    )
    np.testing.assert_array_equal(
        flat(fresh.outputs(0.06, ArmInputs())), flat(fresh.outputs(0.06, ArmInputs(load=0.2)))
    )


def test_swinging_arm_comes_to_the_quasi_static_rest():
    u = ArmInputs(q_cmd=reach(*OUT), load=0.05, p_cmd=np.array([1e5, 1e5]))
    hinges = replace(EXACT, hinges_dynamic=6, leak_time=1e9, damping_time=0.05)
    still, swinging, coarse = (
        walk(VslArm(p), u, 200)[-1]
        for p in (
            hinges,
            replace(hinges, motion=Motion.DYNAMIC),
            replace(hinges, motion=Motion.DYNAMIC, hinges_dynamic=2),
        )
    )
    np.testing.assert_allclose(swinging.p_WG, still.p_WG, atol=1e-6)
    np.testing.assert_allclose(swinging.q_meas, still.q_meas, atol=1e-6)
    assert np.linalg.norm(coarse.p_WG - still.p_WG) < 3e-4


@pytest.mark.parametrize(
    ("dt", "motions"),
    [pytest.param(0.001, [Motion.QUASI_STATIC], marks=pytest.mark.slow), (0.0137, Motion), (0.1, Motion)],
)
def test_any_step_will_do(dt: float, motions: Iterable[Motion]):
    u = ArmInputs(q_cmd=reach(*OUT), qd_cmd=np.array([0.0, 0.5, 1.0]), load=0.05)
    seconds = 3.0 if dt > 0.01 else 1.0
    for motion in motions:
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
    with pytest.raises(NoEquilibrium, match="buckles"):
        arm.step(0.0, 0.02, ArmInputs(q_cmd=params.q_0, load=0.5))
    assert arm.get_state() == state


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"load": -0.01}, "load -0.01 kg must be from 0 to 0.5 kg"),
        ({"load": math.nan}, "load nan kg"),
        ({"load": math.inf}, "load inf kg"),
        ({"load": 0.6}, "load 0.6 kg"),
        ({"q_cmd": np.array([0.0, math.nan, 0.0])}, "must be finite"),
        ({"q_cmd": np.array([0.0, -6.3, 0.0])}, "rad must be from -6.283 to 6.283 rad"),
        ({"p_cmd": np.array([-1.0, 1e5])}, "must be from 0 to 300000 Pa"),
        ({"p_cmd": np.array([1e5, 4e5])}, "must be from 0 to 300000 Pa"),
    ],
)
def test_unusable_inputs_are_refused_and_change_nothing(changes: dict[str, Any], fault: str):
    arm = VslArm(EXACT)
    walk(arm, ArmInputs(), 2)
    state = arm.get_state()
    u = replace(ArmInputs(), **changes)
    with pytest.raises(InvalidInput, match=fault):
        arm.step(0.04, 0.02, u)
    with pytest.raises(InvalidInput, match=fault):
        VslArm(EXACT).outputs(0.0, u)
    assert arm.get_state() == state


def test_contradicting_parameters_are_refused_all_at_once():
    with pytest.raises(InvalidVslArmParameters) as caught:
        VslArm(Params(motion=Motion.DYNAMIC, L_2=0.06, cap=0.04, valve_tolerance=2000.0, link_mass=0.0))
    assert len(caught.value.faults) == 3
    assert "two caps of 0.04 m leave nothing flexible of L_2 0.06 m: cap must be less than 0.03 m" in str(caught.value)


def test_values_out_of_range_are_refused_all_at_once():
    with pytest.raises(
        InvalidVslArmParameters, match=r"L_2: -1\.0 is out of range: from 0\.01 to 2 m; hinges: 0"
    ) as caught:
        VslArm(Params(L_2=-1.0, hinges=0))
    assert len(caught.value.faults) == 2


def test_every_start_value_lies_in_its_range():
    described = describe(VslArm)
    for v in itertools.chain(described.parameters, described.inputs):
        assert v.minimum is None or np.all(np.asarray(v.start) >= v.minimum), v.name
        assert v.maximum is None or np.all(np.asarray(v.start) <= v.maximum), v.name
