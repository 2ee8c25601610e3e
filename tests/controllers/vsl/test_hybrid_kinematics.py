import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_continues, assert_outputs_change_nothing
from support.wording import Wording

from handover.controllers.vsl.hybrid_kinematics import (
    Elbow,
    HybridKinematics,
    Imu,
    Inputs,
    InvalidModel,
    Learned,
    Method,
    Outputs,
    Params,
    UnusedParameters,
    shipped_file,
)
from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.learned_model import Cubic
from handover.controllers.vsl.model_text import model_text, read_model

ARM = VslKinematics(0.15, 0.225, 0.225, Elbow.UP)
MODEL = read_model(shipped_file("cubic"))
Q = ARM.inverse(np.array([0.35, 0.0, 0.15]))
USUAL = Inputs(
    q_ref=Q,
    qd_ref=np.array([0.0, -0.1, 0.3]),
    q_meas=Q + np.array([0.0, 0.05, 0.02]),
    p_meas=np.array([1e5, 1e5]),
    i_meas=np.array([0.0, *MODEL.inverse.domain.mean[5:].tolist()]),
)
RIGID = Params(method=Method.MODEL_BASED)
ESTIMATE = Params(method=Method.ESTIMATE)
SHIPPED = {
    Learned.CUBIC: MODEL,
    Learned.SMALL: read_model(shipped_file("small")),
    Learned.PHYSICS: read_model(shipped_file("physics")),
}
ALL = [
    RIGID,
    ESTIMATE,
    Params(),
    Params(learned=Learned.SMALL, closed_loop=True),
    Params(learned=Learned.PHYSICS, vibration_damping=True),
    Params(friction_compensation=True, closed_loop=True, vibration_damping=True),
    Params(imu=Imu.FEEDBACK, mismatch_limit=0.0001),
]


def flat(y: Outputs) -> list[bytes]:
    return [np.asarray(v).tobytes() for v in vars(y).values()]


def test_rigid_kinematics_pass_angles_on_and_estimate_where_the_tip_would_be():
    hybrid, rigid, estimate = (HybridKinematics(p).step(0.0, 0.02, USUAL) for p in (Params(), RIGID, ESTIMATE))
    np.testing.assert_array_equal([rigid.q_cmd, rigid.qd_cmd], [USUAL.q_ref, USUAL.qd_ref])
    np.testing.assert_allclose(rigid.p_WG_model, ARM.forward(USUAL.q_meas))
    np.testing.assert_array_equal(rigid.p_WG_est, rigid.p_WG_model)
    assert rigid.outside is False
    np.testing.assert_array_equal([estimate.q_cmd, estimate.qd_cmd], [rigid.q_cmd, rigid.qd_cmd])
    np.testing.assert_array_equal([estimate.p_WG_est, estimate.p_WG_model], [hybrid.p_WG_est, hybrid.p_WG_model])
    assert estimate.outside == hybrid.outside
    room_for_corrections = HybridKinematics(Params(qd_correction=0.2)).step(0.0, 0.02, USUAL)
    np.testing.assert_allclose(room_for_corrections.qd_cmd, [0.0, -0.3, 0.5])


@pytest.mark.parametrize("learned", SHIPPED)
def test_each_of_those_that_ship_is_behind_the_same_ports(learned: Learned):
    model = SHIPPED[learned]
    assert model.kind is learned
    y = HybridKinematics(Params(learned=learned)).step(0.0, 0.02, USUAL)
    np.testing.assert_array_equal(y.q_cmd, model.command(USUAL.q_ref, USUAL.p_meas, USUAL.i_meas))
    np.testing.assert_array_equal(y.p_WG_est, model.tip(USUAL.q_meas, USUAL.p_meas, USUAL.i_meas))
    np.testing.assert_allclose(y.p_WG_model, ARM.forward(USUAL.q_meas))
    assert y.q_cmd[1] > USUAL.q_ref[1] + 0.02  # the arm sags: it is commanded upwards
    assert y.p_WG_est[2] < y.p_WG_model[2]
    assert not y.outside
    cubic = HybridKinematics(Params()).step(0.0, 0.02, USUAL)
    np.testing.assert_allclose(y.q_cmd, cubic.q_cmd, atol=0.02)
    np.testing.assert_allclose(y.p_WG_est, cubic.p_WG_est, atol=0.008)


def test_gains_of_what_is_off_change_nothing():
    """Without friction compensation nothing is done by currents against vibrations: they lag behind the posture."""
    gains: dict[str, Any] = {"K_I": 9.0, "K_F": 1.5, "reversal": 0.5, "tracker_rate": 7.0, "tracker_lag": 1.0}
    odd = Params(K_D=9.0, dq_max=0.01, qd_max=1.0, **gains)
    damped = Params(vibration_damping=True)
    for params in ((Params(), odd), (replace(damped, K_D=0.0), replace(damped, K_D=4.0))):
        one, other = map(HybridKinematics, params)
        for k in range(10):
            u = replace(
                USUAL, q_ref=USUAL.q_ref + 0.01 * k, i_meas=USUAL.i_meas + 0.02 * k, p_WG_meas=np.full(3, 0.1 * k)
            )
            assert flat(one.step(k * 0.02, 0.02, u)) == flat(other.step(k * 0.02, 0.02, u))


@pytest.mark.parametrize("method", [Method.HYBRID, Method.MODEL_BASED])
def test_the_closed_loop_raises_a_tip_that_is_too_low(method: Method):
    unit = HybridKinematics(Params(method=method, closed_loop=True))
    first = unit.step(0.0, 0.02, USUAL)
    low = replace(USUAL, q_meas=first.q_cmd, p_WG_meas=ARM.forward(Q) - np.array([0.0, 0.0, 0.02]))
    last = [unit.step(k * 0.02, 0.02, low) for k in range(1, 30)][-1]
    assert ARM.forward(last.q_cmd)[2] > ARM.forward(first.q_cmd)[2] + 0.005


def test_friction_compensation_forgets_no_turn():
    """Of an arm whose currents carry friction by the direction of its commands, the currents are seen without."""
    frictionless = read_model(shipped_file("friction"))
    unit = HybridKinematics(Params(friction_compensation=True, i_lag=0.0))
    for k in range(10):
        q = USUAL.q_ref + 0.01 * k * np.array([0.0, 1.0, -1.0])
        friction = np.array([0.0, *(np.array(frictionless.friction) * np.array([1.0, -1.0]))])
        sliding = replace(USUAL, q_ref=q, i_meas=USUAL.i_meas + (friction if k > 1 else 0.0))
        y = unit.step(k * 0.02, 0.02, sliding)
        np.testing.assert_allclose(y.q_cmd, frictionless.command(q, USUAL.p_meas, USUAL.i_meas), atol=1e-9)


def test_what_was_not_trained_on_is_reported():
    unit = HybridKinematics(Params(i_lag=0.0))
    upright = np.array([0.0, 2.5, -1.0])
    for given in ({"p_meas": np.array([4e5, 1e5])}, {"i_meas": upright}, {"q_ref": upright}, {"q_meas": upright}):
        u = replace(USUAL, **given)
        y = unit.step(0.0, 0.02, u)
        assert y.outside
        assert np.all(np.isfinite(y.q_cmd))
        assert np.all(np.abs(y.q_cmd - u.q_ref) < 0.6)
    assert not unit.step(0.0, 0.02, USUAL).outside
    by_beam = HybridKinematics(Params(learned=Learned.PHYSICS))
    stretched = Inputs(q_ref=np.array([0.0, math.pi / 2.0, 0.0]), p_meas=np.full(2, 1e5))
    assert np.all(np.isfinite(by_beam.step(0.0, 0.02, stretched).q_cmd))


@pytest.mark.parametrize("learned", SHIPPED)
def test_joint_1_turns_the_arm_within_the_training(learned: Learned):
    turn = np.array([1.4, 0.0, 0.0])
    u = replace(USUAL, q_ref=USUAL.q_ref + turn, q_meas=USUAL.q_meas + turn)
    unit = HybridKinematics(Params(i_lag=0.0, learned=learned))
    y, before = unit.step(0.0, 0.02, u), unit.step(0.0, 0.02, USUAL)
    assert not y.outside
    bent, usual = (math.dist(e.p_WG_est, ARM.forward(at.q_meas)) for e, at in ((y, u), (before, USUAL)))
    assert abs(bent - usual) < 2e-3  # m; what it is held to at its edge
    assert unit.step(0.0, 0.02, replace(u, q_ref=np.array([np.nan, *USUAL.q_ref[1:]]))).outside


def test_currents_are_smoothed_by_the_lag_that_is_set():
    jump = replace(USUAL, i_meas=USUAL.i_meas + np.array([0.0, 0.1, 0.1]))
    for lag, share in ((0.2, 1.0 - 2.0 * np.exp(-1.0)), (0.0, 1.0)):  # two lags, after 0.2 s
        unit = HybridKinematics(Params(i_lag=lag))
        unit.step(0.0, 0.02, USUAL)
        y = [unit.step(0.0, 0.02, jump) for _ in range(10)][-1]
        smoothed = USUAL.i_meas + share * (jump.i_meas - USUAL.i_meas)
        np.testing.assert_allclose(y.q_cmd, MODEL.command(USUAL.q_ref, USUAL.p_meas, smoothed), atol=2e-3)


@pytest.mark.parametrize("params", ALL)
def test_a_restored_state_goes_on_bit_for_bit_and_outputs_take_no_time(params: Params):
    rng = np.random.default_rng(3)
    us = [
        replace(
            USUAL,
            q_ref=USUAL.q_ref + 0.01 * (k // 3),
            q_meas=USUAL.q_meas + 0.01 * (k // 3),
            i_meas=USUAL.i_meas + rng.normal(0.0, 0.05, 3),
            p_WG_meas=ARM.forward(Q) + rng.normal(0.0, 0.01, 3),
            tilt_meas=np.array([Q[1], Q[1] + Q[2]]) + rng.normal(0.0, 0.01, 2),
        )
        for k in range(27)
    ]
    assert_continues(lambda: HybridKinematics(params), us.__getitem__, [0, 7], 20, 0.02)
    assert_outputs_change_nothing(lambda: HybridKinematics(params), USUAL, 0.02, same=True)


def test_a_model_is_read_from_a_file(tmp_path: Path):
    shipped = MODEL
    assert isinstance(shipped.inverse, Cubic)
    constant = np.zeros_like(shipped.inverse.coefficients)
    constant[0] = 0.25
    file = tmp_path / "m.json"
    file.write_text(model_text(replace(shipped, inverse=replace(shipped.inverse, coefficients=constant))))
    y = HybridKinematics(Params(model=str(file))).step(0.0, 0.02, USUAL)
    np.testing.assert_allclose(y.q_cmd, USUAL.q_ref + 0.25)


def test_a_model_that_is_not_what_the_parameters_say_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(shipped_file("cubic"), "cubic")
    shutil.copyfile(shipped_file("friction"), "frictionless")
    for params in (
        Params(learned=Learned.PUBLISHED),
        Params(learned=Learned.SMALL, friction_compensation=True),
        Params(learned=Learned.SMALL, model="cubic"),
        Params(friction_compensation=True, model="cubic"),
        Params(model="frictionless"),
        Params(L_2=0.2),
        Params(elbow=Elbow.DOWN),
    ):
        with pytest.raises(InvalidModel) as caught:
            HybridKinematics(params)
        wording.check(caught.value)


def test_by_rigid_kinematics_what_was_learned_is_refused_and_not_ignored():
    learned: dict[str, Any] = {"friction_compensation": True, "vibration_damping": True}
    idle = Params(method=Method.MODEL_BASED, learned=Learned.SMALL, model="m.json", **learned)
    with pytest.raises(UnusedParameters) as e:
        HybridKinematics(idle)
    names = [fault.split(":")[0] for fault in e.value.faults]
    assert names == ["learned", "model", *learned]
    with pytest.raises(UnusedParameters):
        HybridKinematics(Params(K_I=-5.0))
    HybridKinematics(replace(RIGID, closed_loop=True, K_I=1.0))
    HybridKinematics(replace(ESTIMATE, **learned))


@pytest.mark.parametrize("params", ALL)
def test_an_output_depends_at_once_on_the_inputs_that_it_declares_alone(params: Params):
    """Each input is changed in the last of some periods along a path; what changes then is what is declared."""
    rng = np.random.default_rng(5)

    unit = HybridKinematics(params)

    def inputs(k: int) -> Inputs:
        q = USUAL.q_ref + 0.004 * k * np.array([0.0, 1.0, -1.0])
        u = replace(USUAL, q_ref=q, q_meas=q + 0.01, p_WG_meas=ARM.forward(q) - 0.01)
        return replace(u, tilt_meas=np.array([q[1], q[1] + q[2]]))

    for k in range(7):
        unit.step(k * 0.04, 0.04, inputs(k))
    state = unit.get_state()

    def last(**given: Any) -> dict[str, Any]:
        unit.set_state(state)
        return vars(unit.step(0.28, 0.04, replace(inputs(7), **given)))

    plain, found = last(), dict[str, set[str]]()
    for name, value in vars(USUAL).items():
        for size in (1e-3, 0.3, 3.0):
            other = last(**{name: value + size * np.maximum(np.abs(value), 0.1) * rng.choice([-1.0, 1.0], len(value))})
            for output, was in plain.items():
                if not np.array_equal(was, other[output]):
                    found.setdefault(output, set()).add(name)
    declared = {output: set(inputs) for output, inputs in HybridKinematics.feedthrough.items()}
    assert all(inputs <= declared[output] for output, inputs in found.items())
    if params.vibration_damping and params.closed_loop:
        assert found["q_cmd"] == declared["q_cmd"] - {"tilt_meas"}
        assert found["p_WG_est"] == declared["p_WG_est"]
    if params.imu is Imu.FEEDBACK:
        assert "tilt_meas" in found["q_cmd"]
        assert found["innovation"] == declared["innovation"] - {"p_WG_meas"}


def test_where_a_swing_may_be_answered_the_speed_depends_on_references_and_currents():
    """A bend that is commanded ahead is as fast as servos can; where nothing begins or nothing is carried, none is."""
    v_up = ARM.joint_velocities(Q, np.array([0.0, 0.0, 0.2]))
    still, begun = Q - 0.02 * v_up, replace(USUAL, q_ref=Q, qd_ref=v_up)
    speeds: list[float] = []
    for u in (begun, replace(begun, q_ref=still), replace(begun, i_meas=np.zeros(3))):
        unit = HybridKinematics(Params(vibration_damping=True, i_lag=0.0))
        unit.step(0.0, 0.02, replace(USUAL, q_ref=still, qd_ref=np.zeros(3)))
        speeds.append(float(np.abs(unit.step(0.02, 0.02, u).qd_cmd[1])))
    assert speeds[0] == 4.8 > max(speeds[1:])


def test_a_sensor_at_the_arm_tells_a_mismatch_that_inputs_do_not():
    """Of an arm that bends by more than learned, which the encoders do not see."""
    tip = MODEL.tip(USUAL.q_meas, USUAL.p_meas, USUAL.i_meas) - np.array([0.0, 0.0, 0.02])
    sensors: tuple[dict[str, Any], ...] = ({"closed_loop": True}, {"imu": Imu.MONITOR}, {})
    for sensor in sensors:
        unit = HybridKinematics(Params(K_I=0.0, mismatch_limit=0.01, **sensor))
        y = unit.outputs(0.0, USUAL)
        softer = replace(USUAL, q_meas=y.q_cmd, tilt_meas=np.array([Q[1], Q[1] + Q[2]]) - 0.1, p_WG_meas=tip)
        for k in range(400):
            y = unit.step(k * 0.02, 0.02, softer)
        assert y.model_mismatch == bool(sensor)
        assert (y.innovation > 0.01) == bool(sensor)
        assert not y.outside
