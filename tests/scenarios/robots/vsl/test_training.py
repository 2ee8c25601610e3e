"""What is learned from points, from which pairs of inputs and values, and the models that ship."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.scenarios.vsl_training_points import ARM, TRAINING, call, made_up, nobody, points, shipped
from support.wording import Wording

from handover.controllers.vsl.fit import directions_of
from handover.controllers.vsl.hybrid_kinematics import HybridKinematics, Inputs, Params, shipped_file
from handover.controllers.vsl.learned_model import ForwardInput, Learned
from handover.controllers.vsl.model_text import model_text, parse_model, read_model
from handover.cosim.exceptions import InvalidFmu
from handover.fmus.build import cached
from handover.scenarios.robots.vsl.training import VslTraining
from handover.scenarios.robots.vsl.training_data import Measured, describe_arm


def test_the_parts_are_70_15_15_of_the_usable_points_and_lose_nothing():
    measured = made_up(1000)
    parts = measured.parts()
    assert [len(p) for p in parts] == [630, 135, 135]
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.flatnonzero(measured.order >= 0))
    few = measured.parts(0.1)
    assert [len(p) for p in few] == [63, 14, 135]
    np.testing.assert_array_equal(few[0], parts[0][:63])
    np.testing.assert_array_equal(few[2], parts[2])


def test_forward_residuals_are_those_of_the_plane_that_joint_1_turns():
    sag = np.array([-0.01, 0.002, -0.03])
    inputs, residuals = TRAINING.residuals.forward_pairs(points(50, np.zeros(3), sag))
    np.testing.assert_allclose(residuals, np.tile(sag, (50, 1)), atol=1e-12)
    assert inputs.shape == (50, 7)


def test_inverse_residuals_lead_from_the_measured_tip_to_the_command():
    droop = np.array([0.0, -0.02, -0.01])
    data = points(50, droop, np.zeros(3))
    inputs, residuals = TRAINING.residuals.inverse_pairs(data)
    np.testing.assert_allclose(inputs[:, :3], data.q, atol=1e-9)
    np.testing.assert_allclose(residuals, np.tile(-droop, (50, 1)), atol=1e-9)


def test_an_arm_without_the_ports_is_refused(wording: Wording):
    with pytest.raises(InvalidFmu) as refused:
        describe_arm(cached("TrajectoryPlanner", 3))
    wording.check(str(refused.value).partition(": ")[2])


def test_the_same_seed_gives_the_same_model_and_another_seed_another():
    a, again, b = (
        VslTraining(fmu=cached("VslArm", 3), kinematics=ARM, points=40, seed=seed).train(nobody)[0]
        for seed in (1, 1, 2)
    )
    assert model_text(again) == model_text(a)
    assert np.all(a.inverse.domain.mean != b.inverse.domain.mean)
    assert a.provenance["arm"]["parameters"]["seed"] != b.provenance["arm"]["parameters"]["seed"]


def test_a_walk_changes_one_thing_a_point():
    training = VslTraining(fmu=cached("VslArm", 3), kinematics=ARM, points=60, seed=3, walk=True)
    data = training.measure(nobody).points
    turned = np.any(np.diff(data.q_cmd, axis=0) != 0.0, axis=1)
    blown = np.any(np.abs(np.diff(data.p, axis=0)) > 3000.0, axis=1)
    assert not np.any(turned & blown)
    assert 8 < np.sum(turned) < 35
    assert 8 < np.sum(blown) < 35
    assert np.sum(~turned & ~blown) > 5  # another load


@pytest.mark.parametrize("forward_input", ForwardInput)
def test_either_input_of_the_forward_model_is_learned(forward_input: ForwardInput):
    model, errors = replace(TRAINING, forward_input=forward_input).learn(made_up(500), nobody)
    assert parse_model(model_text(model), "x").forward_input is forward_input
    assert errors.forward_other_input is not None
    assert max(errors.forward_hybrid, errors.forward_other_input) < 0.2 * errors.forward_model_based
    reported = model.provenance["mean_test_errors_m"]["forward_other_input"]
    assert reported == pytest.approx(errors.forward_other_input, rel=1e-3)


@pytest.mark.slow
def test_a_small_network_learns():
    _, errors = replace(TRAINING, learned=Learned.SMALL, forward_input=ForwardInput.Q).learn(made_up(200), nobody)
    assert errors.forward_hybrid < 0.2 * errors.forward_model_based


@pytest.mark.slow
def test_a_published_network_is_trained_and_used(tmp_path: Path):
    pytest.importorskip("torch")
    out = tmp_path / "m.json"
    result = call("--learned", "published", "--points", "400", "--epochs", "2", "--out", out)
    assert result.exit_code == 0, result.output
    unit = HybridKinematics(Params(learned=Learned.PUBLISHED, model=str(out)))
    assert unit.step(0.0, 0.02, Inputs(q_ref=np.array([0.0, 0.6, -1.2]))).q_cmd.shape == (3,)
    facts = read_model(out).provenance["forward"]
    assert facts["epochs"] == 2
    assert facts["torch"]


@pytest.fixture(scope="module")
def present() -> Measured:
    """Return points of the present arm that no model has seen."""
    return VslTraining(fmu=cached("VslArm", 3), kinematics=ARM, points=40, seed=77).measure(nobody)


@pytest.mark.parametrize("kind", ["cubic", "friction", "small", "physics"])
def test_the_models_that_ship_know_the_present_arm(kind: str, present: Measured):
    model = read_model(shipped_file(kind))
    usable = present.points.rows(present.order >= 0)
    points = usable.without_friction(directions_of(usable.q_cmd[:, 1:], Params().reversal), model.friction)
    errors, stated = TRAINING.like(model).residuals.errors(model, points), model.provenance["mean_test_errors_m"]
    for name in ("forward_hybrid", "inverse_hybrid"):
        assert getattr(errors, name) < 1.5 * stated[name]


@pytest.mark.slow
def test_the_model_that_ships_can_be_made_again():
    text = shipped().provenance
    training = VslTraining(
        fmu=cached("VslArm", 3), kinematics=ARM, points=text["points"]["measured"], seed=text["seed"]
    )
    again, _ = training.train(lambda _t, _end: None)
    assert again.provenance["arm"] == text["arm"]
    domain = shipped().inverse.domain
    x = domain.mean + np.random.default_rng(0).uniform(-1.5, 1.5, (100, 7)) * domain.scale
    np.testing.assert_allclose(again.inverse.predict(x), shipped().inverse.predict(x), atol=2e-6)  # 1 um at the tip
    np.testing.assert_allclose(again.forward.predict(x), shipped().forward.predict(x), atol=1e-6)
