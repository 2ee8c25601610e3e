import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from handover.controllers.vsl.default_model import DEFAULT_MODEL
from handover.controllers.vsl.hybrid_kinematics import (
    Elbow,
    HybridKinematics,
    Inputs,
    InvalidModel,
    Method,
    Outputs,
    Params,
)
from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.model_text import parse_model

ARM = VslKinematics(0.15, 0.225, 0.225, Elbow.UP)
MODEL = parse_model(DEFAULT_MODEL, "that ships")
Q = ARM.inverse(np.array([0.35, 0.0, 0.15]))
USUAL = Inputs(
    q_ref=Q,
    qd_ref=np.array([0.0, -0.1, 0.3]),
    q_meas=Q + np.array([0.0, 0.05, 0.02]),
    p_meas=np.array([1e5, 1e5]),
    i_meas=np.array([0.0, *MODEL.inverse.mean[5:].tolist()]),
)
RIGID = Params(method=Method.MODEL_BASED)
ESTIMATE = Params(method=Method.ESTIMATE)


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


def test_speeds_leave_room_for_corrections():
    y = HybridKinematics(Params(qd_correction=0.2)).step(0.0, 0.02, USUAL)
    np.testing.assert_allclose(y.qd_cmd, [0.0, -0.3, 0.5])


def test_what_was_not_trained_on_is_reported():
    unit = HybridKinematics(Params(i_lag=0.0))
    strange = [
        dataclasses.replace(USUAL, p_meas=np.array([4e5, 1e5])),
        dataclasses.replace(USUAL, i_meas=np.array([0.0, 3.0, 0.0])),
        dataclasses.replace(USUAL, q_ref=np.array([1.5, 0.5, -1.0])),
        dataclasses.replace(USUAL, q_meas=np.array([0.0, 2.5, -1.0])),
    ]
    for u in strange:
        y = unit.step(0.0, 0.02, u)
        assert y.outside
        assert np.all(np.isfinite(y.q_cmd))
        assert np.all(np.abs(y.q_cmd - u.q_ref) < 0.6)
    assert not unit.step(0.0, 0.02, USUAL).outside


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


@pytest.mark.parametrize("params", [RIGID, Params(), ESTIMATE])
def test_outputs_take_no_time(params: Params):
    unit = HybridKinematics(params)
    state = unit.get_state()
    first = flat(unit.outputs(0.0, USUAL))
    assert unit.get_state() == state
    assert first == flat(unit.step(0.0, 0.02, USUAL))


@pytest.mark.parametrize("params", [RIGID, Params(), ESTIMATE])
@pytest.mark.parametrize("steps", [0, 7])
def test_a_restored_state_goes_on_bit_for_bit(params: Params, steps: int):
    rng = np.random.default_rng(3)
    us = [dataclasses.replace(USUAL, i_meas=USUAL.i_meas + rng.normal(0.0, 0.05, 3)) for _ in range(steps + 20)]
    one, other = HybridKinematics(params), HybridKinematics(params)
    for u in us[:steps]:
        one.step(0.0, 0.02, u)
    state = one.get_state()
    after = [flat(one.step(0.0, 0.02, u)) for u in us[steps:]]
    other.set_state(state)
    assert [flat(other.step(0.0, 0.02, u)) for u in us[steps:]] == after
    one.set_state(state)
    assert [flat(one.step(0.0, 0.02, u)) for u in us[steps:]] == after


def test_a_model_is_read_from_a_file(tmp_path: Path):
    changed = json.loads(DEFAULT_MODEL)
    changed["inverse"]["coefficients"] = [[0.25] + [0.0] * 119] * 3
    file = tmp_path / "m.json"
    file.write_text(json.dumps(changed))
    y = HybridKinematics(Params(model=str(file))).step(0.0, 0.02, USUAL)
    np.testing.assert_allclose(y.q_cmd, USUAL.q_ref + 0.25)


def test_a_file_that_is_no_model_is_refused(tmp_path: Path):
    file = tmp_path / "m.json"
    file.write_text("{}")
    with pytest.raises(InvalidModel, match=r"m\.json: its format is None"):
        HybridKinematics(Params(model=str(file)))
    with pytest.raises(InvalidModel, match="cannot be read"):
        HybridKinematics(Params(model=str(tmp_path / "none.json")))
    HybridKinematics(Params(method=Method.MODEL_BASED, model="none.json"))


@pytest.mark.parametrize("params", [Params(L_2=0.2), Params(elbow=Elbow.DOWN)])
def test_a_model_of_other_links_is_refused(params: Params):
    with pytest.raises(InvalidModel, match=r"trained for L_1, L_2, L_3 = 0\.15, 0\.225, 0\.225 m with the elbow up"):
        HybridKinematics(params)


def test_an_estimate_alone_leaves_the_command_to_rigid_kinematics():
    hybrid, rigid, estimate = (HybridKinematics(p).step(0.0, 0.02, USUAL) for p in (Params(), RIGID, ESTIMATE))
    np.testing.assert_array_equal([estimate.q_cmd, estimate.qd_cmd], [rigid.q_cmd, rigid.qd_cmd])
    np.testing.assert_array_equal([estimate.p_WG_est, estimate.p_WG_model], [hybrid.p_WG_est, hybrid.p_WG_model])
    assert estimate.outside == hybrid.outside
