"""What is learned from points, and from which pairs of inputs and values."""

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.scenarios.vsl_training_points import ARM, TRAINING, call, made_up, nobody, points

from handover.controllers.vsl.hybrid_kinematics import HybridKinematics, Inputs, Params
from handover.controllers.vsl.learned_model import ForwardInput, Learned
from handover.controllers.vsl.model_text import model_text, parse_model, read_model
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.file.archive import write_archive
from handover.fmus.build import cached
from handover.scenarios.vsl.model_file import content_key
from handover.scenarios.vsl.training import VslTraining
from handover.scenarios.vsl.training_data import describe_arm


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


def test_key_follows_the_sources_of_the_plant_alone(tmp_path: Path):
    plant, engine = (f"resources/sources/handover/{m}.py" for m in ("plants/vsl/arm", "cosim/blocks/block"))

    def key(name: str, **files: bytes) -> str:
        sources = {
            "resources/sources/handover/plants/arm.py": b"1",
            "resources/sources/handover/cosim/blocks/block.py": b"2",
            **files,
        }
        return content_key(write_archive(tmp_path / name, sources))

    first = key("a.fmu")
    assert key("b.fmu") == first
    assert key("c.fmu", **{engine: b"3"}) == first
    assert key("d.fmu", **{plant: b"3"}) != first
    with zipfile.ZipFile(tmp_path / "e.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "1")
    assert content_key(tmp_path / "e.fmu") != first


def test_an_arm_without_the_ports_is_refused():
    with pytest.raises(InvalidFmu, match=r"no input 'q_cmd' \(3 real\).*no output 'p_WG_meas' \(3 real\)"):
        describe_arm(cached("TrajectoryPlanner", 3))


def test_another_seed_gives_another_model():
    a, b = (
        VslTraining(fmu=cached("VslArm", 3), kinematics=ARM, points=40, seed=seed).train(lambda _t, _end: None)[0]
        for seed in (1, 2)
    )
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


@pytest.mark.parametrize(
    ("learned", "forward_input"),
    [
        *((Learned.CUBIC, forward_input) for forward_input in ForwardInput),
        pytest.param(Learned.SMALL, ForwardInput.Q, marks=pytest.mark.slow),
    ],
)
def test_either_input_of_the_forward_model_is_learned(learned: Learned, forward_input: ForwardInput):
    training = replace(TRAINING, learned=learned, forward_input=forward_input)
    model, errors = training.learn(made_up(500), nobody)
    again = parse_model(model_text(model), "x")
    assert again.forward_input is forward_input
    assert errors.forward_other_input is not None
    assert errors.forward_hybrid < 0.2 * errors.forward_model_based
    assert errors.forward_other_input < 0.2 * errors.forward_model_based
    assert model.provenance["mean_test_errors_m"]["forward_other_input"] == pytest.approx(
        errors.forward_other_input, rel=1e-3
    )


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
