"""The models that ship: of the present arm, made again, and along a path."""

import types

import numpy as np
import pytest
from support.scenarios.vsl_training_points import ARM, shipped

from handover.controllers.vsl import default_friction_model, default_model, default_physics_model, default_small_model
from handover.controllers.vsl.model_text import parse_model
from handover.fmus.build import cached
from handover.scenarios.vsl.model_file import content_key
from handover.scenarios.vsl.training import VslTraining


@pytest.mark.parametrize("module", [default_model, default_friction_model, default_small_model, default_physics_model])
def test_the_models_that_ship_were_trained_on_the_present_arm(module: types.ModuleType):
    key = parse_model(module.DEFAULT_MODEL, "that ships").provenance["arm"]["key"]
    assert key == content_key(cached("VslArm", 3)), (module.__doc__ or "").splitlines()[-1]


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
