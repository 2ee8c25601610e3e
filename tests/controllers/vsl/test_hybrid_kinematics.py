import dataclasses
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handover.controllers.vsl import default_friction_model, default_physics_model, default_small_model
from handover.controllers.vsl.default_model import DEFAULT_MODEL
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
)
from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.learned_model import Cubic
from handover.controllers.vsl.model_text import model_text, parse_model

ARM = VslKinematics(0.15, 0.225, 0.225, Elbow.UP)
MODEL = parse_model(DEFAULT_MODEL, "that ships")
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
    Learned.CUBIC: DEFAULT_MODEL,
    Learned.SMALL: default_small_model.DEFAULT_MODEL,
    Learned.PHYSICS: default_physics_model.DEFAULT_MODEL,
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


def test_model_based_passes_the_rigid_angles_on():
    y = HybridKinematics(RIGID).step(0.0, 0.02, USUAL)
    np.testing.assert_array_equal(y.q_cmd, USUAL.q_ref)
    np.testing.assert_array_equal(y.qd_cmd, USUAL.qd_ref)
    np.testing.assert_allclose(y.p_WG_model, ARM.forward(USUAL.q_meas))
    np.testing.assert_array_equal(y.p_WG_est, y.p_WG_model)
    assert y.outside is False


def test_hybrid_adds_what_was_learned():
    y = HybridKinematics(Params()).step(0.0, 0.02, USUAL)
    np.testing.assert_array_equal(y.q_cmd, MODEL.command(USUAL.q_ref, USUAL.p_meas, USUAL.i_meas))
    np.testing.assert_array_equal(y.p_WG_est, MODEL.tip(USUAL.q_meas, USUAL.p_meas, USUAL.i_meas))
    np.testing.assert_allclose(y.p_WG_model, ARM.forward(USUAL.q_meas))
    assert y.q_cmd[1] > USUAL.q_ref[1] + 0.02  # the arm sags: it is commanded upwards
    assert y.p_WG_est[2] < y.p_WG_model[2]
    assert not y.outside


@pytest.mark.parametrize("learned", list(SHIPPED))
def test_each_of_those_that_ship_is_behind_the_same_ports(learned: Learned):
    model = parse_model(SHIPPED[learned], "that ships")
    assert model.kind is learned
    y = HybridKinematics(Params(learned=learned)).step(0.0, 0.02, USUAL)
    np.testing.assert_array_equal(y.q_cmd, model.command(USUAL.q_ref, USUAL.p_meas, USUAL.i_meas))
    np.testing.assert_array_equal(y.p_WG_est, model.tip(USUAL.q_meas, USUAL.p_meas, USUAL.i_meas))
    cubic = HybridKinematics(Params()).step(0.0, 0.02, USUAL)
    np.testing.assert_allclose(y.q_cmd, cubic.q_cmd, atol=0.02)
    np.testing.assert_allclose(y.p_WG_est, cubic.p_WG_est, atol=0.008)


def test_without_window_loop_and_swing_their_gains_change_nothing():
    odd = Params(K_I=9.0, K_D=9.0, K_F=1.5, reversal=0.5, tracker_rate=7.0, tracker_lag=1.0, dq_max=0.01, qd_max=1.0)
    one, other = HybridKinematics(Params()), HybridKinematics(odd)
    for k in range(10):
        u = dataclasses.replace(USUAL, q_ref=USUAL.q_ref + 0.01 * k, p_WG_meas=np.full(3, 0.1 * k))
        assert flat(one.step(k * 0.02, 0.02, u)) == flat(other.step(k * 0.02, 0.02, u))


@pytest.mark.parametrize("params", [Params(closed_loop=True), Params(method=Method.MODEL_BASED, closed_loop=True)])
def test_the_closed_loop_raises_a_tip_that_is_too_low(params: Params):
    unit = HybridKinematics(params)
    first = unit.step(0.0, 0.02, USUAL)
    low = dataclasses.replace(USUAL, q_meas=first.q_cmd, p_WG_meas=ARM.forward(Q) - np.array([0.0, 0.0, 0.02]))
    last = [unit.step(k * 0.02, 0.02, low) for k in range(1, 30)][-1]
    assert ARM.forward(last.q_cmd)[2] > ARM.forward(first.q_cmd)[2] + 0.005


def test_friction_compensation_forgets_no_turn():
    """Of an arm whose currents carry friction by the direction of its commands, the currents are seen without."""
    frictionless = parse_model(default_friction_model.DEFAULT_MODEL, "that ships")
    unit = HybridKinematics(Params(friction_compensation=True, i_lag=0.0))
    for k in range(10):
        q = USUAL.q_ref + 0.01 * k * np.array([0.0, 1.0, -1.0])
        friction = np.array([0.0, *(np.array(frictionless.friction) * np.array([1.0, -1.0]))])
        sliding = dataclasses.replace(USUAL, q_ref=q, i_meas=USUAL.i_meas + (friction if k > 1 else 0.0))
        y = unit.step(k * 0.02, 0.02, sliding)
        np.testing.assert_allclose(y.q_cmd, frictionless.command(q, USUAL.p_meas, USUAL.i_meas), atol=1e-9)


def test_speeds_leave_room_for_corrections():
    y = HybridKinematics(Params(qd_correction=0.2)).step(0.0, 0.02, USUAL)
    np.testing.assert_allclose(y.qd_cmd, [0.0, -0.3, 0.5])


def test_what_was_not_trained_on_is_reported():
    unit = HybridKinematics(Params(i_lag=0.0))
    strange = [
        dataclasses.replace(USUAL, p_meas=np.array([4e5, 1e5])),
        dataclasses.replace(USUAL, i_meas=np.array([0.0, 3.0, 0.0])),
        dataclasses.replace(USUAL, q_ref=np.array([0.0, 2.5, -1.0])),
        dataclasses.replace(USUAL, q_meas=np.array([0.0, 2.5, -1.0])),
    ]
    for u in strange:
        y = unit.step(0.0, 0.02, u)
        assert y.outside
        assert np.all(np.isfinite(y.q_cmd))
        assert np.all(np.abs(y.q_cmd - u.q_ref) < 0.6)
    assert not unit.step(0.0, 0.02, USUAL).outside


@pytest.mark.parametrize("learned", SHIPPED)
def test_joint_1_turns_the_arm_within_the_training(learned: Learned):
    turn = np.array([1.4, 0.0, 0.0])
    u = dataclasses.replace(USUAL, q_ref=USUAL.q_ref + turn, q_meas=USUAL.q_meas + turn)
    unit = HybridKinematics(Params(i_lag=0.0, learned=learned))
    y, before = unit.step(0.0, 0.02, u), unit.step(0.0, 0.02, USUAL)
    assert not y.outside
    bent, usual = (math.dist(e.p_WG_est, ARM.forward(at.q_meas)) for e, at in ((y, u), (before, USUAL)))
    assert abs(bent - usual) < 2e-3  # m; what it is held to at its edge
    assert unit.step(0.0, 0.02, dataclasses.replace(u, q_ref=np.array([np.nan, *USUAL.q_ref[1:]]))).outside


def test_currents_are_smoothed_by_two_lags():
    unit, lag = HybridKinematics(Params(i_lag=0.2)), 0.2
    unit.step(0.0, 0.02, USUAL)
    jump = dataclasses.replace(USUAL, i_meas=USUAL.i_meas + np.array([0.0, 0.1, 0.1]))
    ys = [unit.step(0.0, 0.02, jump) for _ in range(50)]
    for n in (1, 10, 50):
        t = n * 0.02
        share = 1.0 - (1.0 + t / lag) * np.exp(-t / lag)
        smoothed = USUAL.i_meas + share * (jump.i_meas - USUAL.i_meas)
        expected = MODEL.command(USUAL.q_ref, USUAL.p_meas, smoothed)
        np.testing.assert_allclose(ys[n - 1].q_cmd, expected, atol=2e-3)
    quick = HybridKinematics(Params(i_lag=0.0))
    quick.step(0.0, 0.02, USUAL)
    np.testing.assert_array_equal(
        quick.step(0.0, 0.02, jump).q_cmd, MODEL.command(jump.q_ref, jump.p_meas, jump.i_meas)
    )


@pytest.mark.parametrize("params", ALL)
def test_outputs_take_no_time(params: Params):
    unit = HybridKinematics(params)
    state = unit.get_state()
    first = flat(unit.outputs(0.0, USUAL))
    assert unit.get_state() == state
    assert first == flat(unit.step(0.0, 0.02, USUAL))


@pytest.mark.parametrize("params", ALL)
@pytest.mark.parametrize("steps", [0, 7])
def test_a_restored_state_goes_on_bit_for_bit(params: Params, steps: int):
    rng = np.random.default_rng(3)
    us = [
        dataclasses.replace(
            USUAL,
            q_ref=USUAL.q_ref + 0.01 * (k // 3),
            q_meas=USUAL.q_meas + 0.01 * (k // 3),
            i_meas=USUAL.i_meas + rng.normal(0.0, 0.05, 3),
            p_WG_meas=ARM.forward(Q) + rng.normal(0.0, 0.01, 3),
            tilt_meas=np.array([Q[1], Q[1] + Q[2]]) + rng.normal(0.0, 0.01, 2),
        )
        for k in range(steps + 20)
    ]
    one, other = HybridKinematics(params), HybridKinematics(params)

    def go_on(unit: HybridKinematics) -> list[list[bytes]]:
        return [flat(unit.step((steps + k) * 0.02, 0.02, u)) for k, u in enumerate(us[steps:])]

    for k, u in enumerate(us[:steps]):
        one.step(k * 0.02, 0.02, u)
    state = one.get_state()
    after = go_on(one)
    other.set_state(state)
    assert go_on(other) == after
    one.set_state(state)
    assert go_on(one) == after


def test_a_model_is_read_from_a_file(tmp_path: Path):
    shipped = parse_model(DEFAULT_MODEL, "that ships")
    assert isinstance(shipped.inverse, Cubic)
    constant = np.zeros_like(shipped.inverse.coefficients)
    constant[0] = 0.25
    file = tmp_path / "m.json"
    file.write_text(model_text(replace(shipped, inverse=replace(shipped.inverse, coefficients=constant))))
    y = HybridKinematics(Params(model=str(file))).step(0.0, 0.02, USUAL)
    np.testing.assert_allclose(y.q_cmd, USUAL.q_ref + 0.25)


def test_a_file_that_is_no_model_is_refused(tmp_path: Path):
    file = tmp_path / "m.json"
    file.write_text("{}")
    with pytest.raises(InvalidModel, match=r"m\.json: its format is None"):
        HybridKinematics(Params(model=str(file)))
    with pytest.raises(InvalidModel, match="there is no such file"):
        HybridKinematics(Params(model=str(tmp_path / "none.json")))


@pytest.mark.parametrize(
    ("params", "text"),
    [
        (Params(learned=Learned.PUBLISHED), r"there is none: train one.*`handover vsl-train --learned published`"),
        (
            Params(learned=Learned.SMALL, friction_compensation=True),
            r"there is none.*`handover vsl-train --learned small --friction-compensation`",
        ),
        (Params(learned=Learned.SMALL, model="cubic"), "it is a cubic model, and the parameter learned says small"),
        (
            Params(friction_compensation=True, model="cubic"),
            "it was trained on currents with friction, and the parameter friction_compensation says true",
        ),
        (
            Params(model="frictionless"),
            "it was trained on currents without friction, and the parameter friction_compensation says false",
        ),
    ],
)
def test_a_model_that_is_not_what_the_parameters_say_is_refused(params: Params, text: str, tmp_path: Path):
    (tmp_path / "cubic").write_text(DEFAULT_MODEL)
    (tmp_path / "frictionless").write_text(default_friction_model.DEFAULT_MODEL)
    with pytest.raises(InvalidModel, match=text):
        HybridKinematics(dataclasses.replace(params, model=str(tmp_path / params.model) if params.model else ""))


def test_by_rigid_kinematics_what_was_learned_is_refused_and_not_ignored():
    idle = Params(
        method=Method.MODEL_BASED,
        learned=Learned.SMALL,
        model="m.json",
        friction_compensation=True,
        vibration_damping=True,
    )
    with pytest.raises(UnusedParameters) as e:
        HybridKinematics(idle)
    assert [fault.split(":")[0] for fault in e.value.faults] == [
        "learned",
        "model",
        "friction_compensation",
        "vibration_damping",
    ]
    HybridKinematics(dataclasses.replace(RIGID, closed_loop=True, K_I=1.0))
    HybridKinematics(dataclasses.replace(idle, method=Method.ESTIMATE, model="", learned=Learned.CUBIC))


@pytest.mark.parametrize("params", [Params(L_2=0.2), Params(elbow=Elbow.DOWN)])
def test_a_model_of_other_links_is_refused(params: Params):
    with pytest.raises(InvalidModel, match=r"trained for L_1, L_2, L_3 = 0\.15, 0\.225, 0\.225 m with the elbow up"):
        HybridKinematics(params)


def test_an_estimate_alone_leaves_the_command_to_rigid_kinematics():
    hybrid, rigid, estimate = (HybridKinematics(p).step(0.0, 0.02, USUAL) for p in (Params(), RIGID, ESTIMATE))
    np.testing.assert_array_equal([estimate.q_cmd, estimate.qd_cmd], [rigid.q_cmd, rigid.qd_cmd])
    np.testing.assert_array_equal([estimate.p_WG_est, estimate.p_WG_model], [hybrid.p_WG_est, hybrid.p_WG_model])
    assert estimate.outside == hybrid.outside


@pytest.mark.parametrize("params", ALL)
def test_an_output_depends_at_once_on_the_inputs_that_it_declares_alone(params: Params):
    """Each input is changed in the last of some periods along a path; what changes then is what is declared."""
    rng = np.random.default_rng(5)

    unit = HybridKinematics(params)

    def inputs(k: int) -> Inputs:
        q = USUAL.q_ref + 0.004 * k * np.array([0.0, 1.0, -1.0])
        u = dataclasses.replace(USUAL, q_ref=q, q_meas=q + 0.01, p_WG_meas=ARM.forward(q) - 0.01)
        return dataclasses.replace(u, tilt_meas=np.array([q[1], q[1] + q[2]]))

    for k in range(7):
        unit.step(k * 0.04, 0.04, inputs(k))
    state = unit.get_state()

    def last(**given: Any) -> dict[str, Any]:
        unit.set_state(state)
        return vars(unit.step(0.28, 0.04, dataclasses.replace(inputs(7), **given)))

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
    still, begun = Q - 0.02 * v_up, dataclasses.replace(USUAL, q_ref=Q, qd_ref=v_up)
    changed = [begun, dataclasses.replace(begun, q_ref=still), dataclasses.replace(begun, i_meas=np.zeros(3))]
    speeds: list[float] = []
    for u in changed:
        unit = HybridKinematics(Params(vibration_damping=True, i_lag=0.0))
        unit.step(0.0, 0.02, dataclasses.replace(USUAL, q_ref=still, qd_ref=np.zeros(3)))
        speeds.append(float(np.abs(unit.step(0.02, 0.02, u).qd_cmd[1])))
    assert speeds[0] == 4.8 > max(speeds[1:])
    assert {"q_ref", "qd_ref", "i_meas"} <= set(HybridKinematics.feedthrough["qd_cmd"])


def test_without_friction_compensation_nothing_is_done_by_currents_against_vibrations():
    """Smoothed currents with friction lag behind the posture: taken for a swing, they made the tip err by half more."""
    runs: list[list[list[bytes]]] = []
    for K_D in (0.0, 4.0):
        unit = HybridKinematics(Params(vibration_damping=True, K_D=K_D))
        moved = [USUAL, *(dataclasses.replace(USUAL, i_meas=USUAL.i_meas + 0.02 * k) for k in range(5))]
        runs.append([flat(unit.step(0.02 * k, 0.02, u)) for k, u in enumerate(moved)])
    assert runs[0] == runs[1]


def bending(softer: float) -> Inputs:
    """Return readings of an arm that bends by so much more than learned, which the encoders do not see."""
    sag = softer * np.array([0.0, 0.05, 0.05])
    tip = MODEL.tip(USUAL.q_meas, USUAL.p_meas, USUAL.i_meas) - np.array([0.0, 0.0, 0.02 * (softer - 1.0)])
    return dataclasses.replace(USUAL, tilt_meas=np.array([Q[1], Q[1] + Q[2]]) - sag[1:], p_WG_meas=tip)


@pytest.mark.parametrize("sensor", [{"closed_loop": True}, {"imu": Imu.MONITOR}, {}])
def test_a_sensor_at_the_arm_tells_a_mismatch_that_inputs_do_not(sensor: dict[str, Any]):
    unit = HybridKinematics(Params(K_I=0.0, mismatch_limit=0.01, **sensor))
    y = unit.outputs(0.0, USUAL)
    for k in range(400):
        y = unit.step(k * 0.02, 0.02, dataclasses.replace(bending(2.0), q_meas=unit.outputs(0.0, USUAL).q_cmd))
    assert y.model_mismatch == bool(sensor)
    assert (y.innovation > 0.01) == bool(sensor)
    assert not y.outside


def test_parameters_out_of_range_are_refused():
    with pytest.raises(UnusedParameters, match="K_I"):
        HybridKinematics(Params(K_I=-5.0))


def test_the_beam_commands_an_arm_that_is_stretched_out_upright():
    unit = HybridKinematics(Params(learned=Learned.PHYSICS))
    y = unit.step(0.0, 0.02, Inputs(q_ref=np.array([0.0, math.pi / 2.0, 0.0]), p_meas=np.full(2, 1e5)))
    assert np.all(np.isfinite(y.q_cmd))
