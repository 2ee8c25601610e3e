"""What the kinematics remember: currents with friction compensation, the tracker's loop, the damping of vibrations."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handover.controllers.vsl.feedback import CurrentFilter, ImuTip, ModelMonitor, TipFeedback, VibrationDamping
from handover.controllers.vsl.fit import directions_of
from handover.controllers.vsl.hybrid_kinematics import Inputs, shipped_file
from handover.controllers.vsl.learned_model import Adapted, VslModel, friction_direction, inputs_of
from handover.controllers.vsl.model_text import read_model
from handover.cosim.blocks.ports import Floats

FRICTION_MODEL, MODEL = (read_model(shipped_file(kind)) for kind in ("friction", "cubic"))
ARM = MODEL.kinematics
Q = ARM.inverse(np.array([0.35, 0.0, 0.15]))
P = np.array([1e5, 1e5])


def reading(q: Floats = Q, **given: Any) -> Inputs:
    nominal, _ = FRICTION_MODEL.currents(q, P)
    u = Inputs(
        q_ref=q, qd_ref=np.zeros(3), q_meas=q, p_meas=P, i_meas=np.array([0.0, *nominal]), p_WG_meas=ARM.forward(q)
    )
    return dataclasses.replace(u, **given)


@given(st.lists(st.floats(-0.01, 0.01), max_size=20), st.floats(1e-4, 0.01))
def test_the_direction_stays_within_one_and_follows_a_long_turn(turns: list[float], reversal: float):
    direction = np.zeros(1)
    for turn in turns:
        direction = friction_direction(direction, np.array([turn]), reversal)
        assert -1.0 <= direction[0] <= 1.0
    assert friction_direction(direction, np.array([reversal]), reversal)[0] == 1.0
    assert friction_direction(direction, np.array([-reversal]), reversal)[0] == -1.0
    assert friction_direction(direction, np.zeros(1), reversal)[0] == direction[0]


def test_directions_of_commands_are_those_one_after_another():
    q = np.array([[0.0, 0.0], [0.1, -0.1], [0.1, -0.0995], [0.0, 0.0]])
    np.testing.assert_allclose(directions_of(q, 0.002), [[0.0, 0.0], [1.0, -1.0], [1.0, -0.5], [-1.0, 1.0]])


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_window_frees_currents_of_friction(direction: float):
    friction = np.array(FRICTION_MODEL.friction)
    assert np.all(friction > 0.02)
    unit = CurrentFilter(FRICTION_MODEL, 0.2, 0.002)
    unit.turn(np.array([0.0, 1.0, 1.0]) * direction)
    clean = reading()
    sliding = reading(i_meas=clean.i_meas + np.array([0.3, *(direction * friction)]))
    np.testing.assert_allclose(unit.step(sliding, 0.02)[1:], clean.i_meas[1:], atol=1e-12)
    np.testing.assert_allclose(unit.oscillation(sliding, clean.i_meas), 0.0, atol=1e-12)


def test_what_a_load_adds_does_not_lag_behind_the_posture():
    """A load of constant mass adds its levers to the nominal currents: in any posture, at once."""
    units, worst = [CurrentFilter(model, 0.2, 0.002) for model in (FRICTION_MODEL, None)], [0.0, 0.0]
    for k in range(60):
        q = ARM.inverse(np.array([0.30 + 0.0015 * k, 0.0, 0.15]))
        nominal, levers = FRICTION_MODEL.currents(q, P)
        u = reading(q, i_meas=np.array([0.0, *(nominal + 0.3 * levers)]))
        worst = [
            max(w, float(np.max(np.abs(unit.step(u, 0.02) - u.i_meas)))) for w, unit in zip(worst, units, strict=True)
        ]
    assert worst[0] < 1e-9
    assert worst[1] > 0.05


def test_a_change_of_load_is_smoothed_by_two_lags():
    unit = CurrentFilter(FRICTION_MODEL, 0.2, 0.002)
    unit.step(reading(), 0.02)
    _, levers = FRICTION_MODEL.currents(Q, P)
    heavier = reading(i_meas=reading().i_meas + np.array([0.0, *(0.4 * levers)]))
    shares = [float((unit.step(heavier, 0.02) - reading().i_meas)[1] / (0.4 * levers[0])) for _ in range(100)]
    t = 0.02 * np.arange(1, 101)
    np.testing.assert_allclose(shares, 1.0 - (1.0 + t / 0.2) * np.exp(-t / 0.2), atol=0.05)


def test_the_loop_takes_the_tips_error_away():
    """Of a rigid arm whose tip is off by an error."""
    error, loop, ends = np.array([-0.01, 0.005, -0.02]), TipFeedback(ARM, None, 30.0, 0.2, 2.0, 0.2), list[Floats]()
    for k in range(300):
        loop.step(k * 0.02, reading(), ARM.forward(Q + loop.dq) + error, np.zeros(3), (Q, Q))
        ends.append(ARM.forward(Q + loop.dq) + error)
    np.testing.assert_allclose(ends[-1], ARM.forward(Q), atol=1e-4)
    assert 0.2 < np.linalg.norm(ends[24] - ARM.forward(Q)) / np.linalg.norm(error) < 0.8


def test_the_loop_takes_each_reading_once_rests_while_joints_are_on_their_way_and_stays_within_its_limit():
    loop, seen = TipFeedback(ARM, None, 10.0, 0.0, 2.0, 0.2), list[float]()
    for k in range(11):
        loop.step(k * 0.02, reading(), ARM.forward(Q) - np.array([0.0, 0.0, 0.01]), np.zeros(3), (Q, Q))
        seen.append(float(loop.dq[1]))
    assert seen[0] == seen[4] < seen[5] == seen[9] < seen[10]
    loop, far = TipFeedback(ARM, None, 30.0, 0.0, 20.0, 0.05), ARM.forward(Q) - np.array([0.0, 0.0, 0.2])
    for t, before in ((0.0, (Q, Q + np.array([0.0, 0.1, 0.0]))), (0.1, None)):
        loop.step(t, reading(), far, np.zeros(3), before)
    np.testing.assert_array_equal(loop.dq, np.zeros(3))
    for k in range(40):
        loop.step(0.2 + 0.05 * k, reading(), far, np.zeros(3), (Q, Q))
    assert np.max(np.abs(loop.dq)) == 0.05


def test_a_velocity_that_begins_is_commanded_ahead_once():
    unit, i = VibrationDamping(MODEL, 0.6, 0.0), reading().i_meas
    v_up = ARM.joint_velocities(Q, np.array([0.0, 0.0, 0.2]))
    off_the_path = np.array([0.8, 0.8, 0.8])
    for _ in range(8):
        assert not unit.step(0.02, reading(qd_ref=off_the_path), i, np.zeros(2))
    q = [Q + 0.02 * k * v_up for k in range(4)]
    assert unit.step(0.02, reading(q[1], qd_ref=v_up), i, np.zeros(2))
    assert unit.dq[1] > 0.01  # upwards: the links will bend downwards
    unit.step(0.02, reading(q[2], qd_ref=v_up), i, np.zeros(2))
    np.testing.assert_allclose(unit.dq, 0.0, atol=2e-3)
    unit.step(0.02, reading(q[2], qd_ref=v_up), i, np.zeros(2))  # the same point for a further period
    np.testing.assert_array_equal(unit.dq, np.zeros(3))
    unit.step(0.02, reading(q[2], qd_ref=off_the_path), i, np.zeros(2))  # the path has ended
    assert unit.dq[1] < -0.01
    assert unit.step(0.02, reading(q[2], qd_ref=off_the_path), i, np.zeros(2))  # back, and as fast as it came
    np.testing.assert_array_equal(unit.dq, np.zeros(3))
    assert not unit.step(0.02, reading(q[2], qd_ref=off_the_path), i, np.zeros(2))


SMALL, PHYSICS = (read_model(shipped_file(kind)) for kind in ("small", "physics"))
ADAPTED = dataclasses.replace(
    PHYSICS, inverse=Adapted(PHYSICS.inverse, np.zeros(3), np.full((3, 7), 1e-3), 0.1 * np.eye(3))
)


@pytest.mark.parametrize("model", [MODEL, FRICTION_MODEL, SMALL, PHYSICS, ADAPTED])
def test_what_bends_by_a_swing_is_how_the_command_changes_with_the_currents(model: VslModel):
    """What is commanded ahead of a first velocity is K_F G i a / g; G as differences of `VslModel.command` have it."""
    unit, v, dt = VibrationDamping(model, 0.6, 0.0), np.array([0.0, 0.0, 0.2]), 0.02
    i = np.array([0.0, *model.inverse.domain.mean[5:].tolist()])
    qd = ARM.joint_velocities(Q, v)
    unit.step(dt, reading(Q - dt * qd), i, np.zeros(2))
    unit.step(dt, reading(Q, qd_ref=qd), i, np.zeros(2))
    more = 1e-3 * i * v[2] / dt / 9.81
    change = (model.command(Q, P, i + more) - model.command(Q, P, i - more)) / 2e-3
    np.testing.assert_allclose(unit.dq[1:], 0.6 * change[1:], rtol=2e-3, atol=1e-6)
    assert np.all(unit.dq[1:] > 0.001)


@pytest.mark.parametrize("model", [MODEL, FRICTION_MODEL, SMALL, PHYSICS, ADAPTED])
@pytest.mark.parametrize("which", ["inverse", "forward"])
def test_jacobians_are_those_of_differences_by_every_input(model: VslModel, which: str):
    regressor = getattr(model, which)
    i = np.array([0.0, *regressor.domain.mean[5:].tolist()])
    x = inputs_of(Q, P, i)
    J = regressor.jacobian(x)
    for k, h in enumerate([1e-4, 1e-4, 1e-4, 50.0, 50.0, 5e-4, 5e-4]):
        shift = h * np.eye(7)[k]
        slope = (regressor.predict(x + shift) - regressor.predict(x - shift)) / (2.0 * h)
        np.testing.assert_allclose(J[:, k], slope, rtol=2e-3, atol=1e-7 / h)
    assert np.all(np.max(np.abs(J[[1, 2] if which == "inverse" else [0, 2], 3:]), axis=0) > 0.0)


def test_joints_yield_to_a_swing_and_come_back():
    unit, i = VibrationDamping(MODEL, 0.0, 4.0), reading().i_meas
    for _ in range(3):
        unit.step(0.02, reading(), i, np.array([0.1, 0.0]))
    down = float(unit.dq[1])
    assert down < -1e-4  # more current: the links bend downwards, and the joint follows
    for _ in range(100):
        unit.step(0.02, reading(), i, np.zeros(2))
    assert abs(float(unit.dq[1])) < 0.01 * abs(down)


def test_imus_see_the_tip_of_links_bent_in_arcs():
    """Of arcs, whose direction turns evenly, the chord leads half way between their ends."""
    begins, bends = np.array([0.6, -0.5]), np.array([0.08, 0.12])
    along = [np.exp(1j * (a - d * np.linspace(0.0, 1.0, 20001))).mean() for a, d in zip(begins, bends, strict=True)]
    tip = 0.225 * (along[0] + along[1])
    q = np.array([0.3, begins[0], begins[1] - (begins[0] - bends[0])])
    seen = ARM.bent(q, begins - bends, np.array([0.5, 0.5]))
    np.testing.assert_allclose(seen, [tip.real * np.cos(0.3), tip.real * np.sin(0.3), 0.15 + tip.imag], atol=2e-4)
    np.testing.assert_allclose(ARM.bent(q, np.array([q[1], q[1] + q[2]]), np.array([0.75, 1.0])), ARM.forward(q))


def test_imus_do_not_tell_the_tip_while_links_shake():
    sensor, still = ImuTip(ARM, np.array([0.75, 1.0])), np.array([Q[1], Q[1] + Q[2]])
    for k in range(50):
        assert sensor.step(0.02, reading(tilt_meas=still + 0.003 * (-1) ** k)) is not None
    shaken = [sensor.step(0.02, reading(tilt_meas=still + 0.1 * (-1) ** k)) for k in range(50)]
    assert shaken[-1] is None
    calm = [sensor.step(0.02, reading(tilt_meas=still)) for _ in range(100)]
    assert calm[-1] is not None
    np.testing.assert_allclose(calm[-1], ARM.forward(Q))


def test_the_innovation_is_smoothed_and_has_a_limit():
    monitor, off = ModelMonitor(2.0, 0.004), np.array([0.0, 0.003, -0.004])
    for _ in range(100):
        monitor.step(0.02, off, np.zeros(3))
    assert monitor.innovation == pytest.approx(0.005 * (1.0 - np.exp(-1.0)))
    assert not monitor.mismatch
    for _ in range(200):
        monitor.step(0.02, off, np.zeros(3))
    assert monitor.mismatch
