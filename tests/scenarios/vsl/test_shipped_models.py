"""The models that ship: of the present arm, made again, and along a path."""

import types
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from vsl_training_points import ARM, shipped

from handover.controllers.vsl import default_friction_model, default_model, default_physics_model, default_small_model
from handover.controllers.vsl.model_text import parse_model
from handover.cosim.master.master import Master
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
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


def path_error(method: str, **arm: Any) -> float:
    """Return the mean distance of the tip from its goal on the curve, at 0.5 bar and with 75 g, m."""
    s = System()
    planner = s.add("planner", cached("TrajectoryPlanner", 3), path="CURVE", pressure=np.array([5e4, 5e4]))
    kinematics = s.add("kinematics", cached("HybridKinematics", 3), method=method)
    vsl = s.add("arm", cached("VslArm", 3), load=0.075, **arm)
    for source, target, names in (
        (planner, kinematics, ("q_ref", "qd_ref")),
        (planner, vsl, ("p_cmd",)),
        (kinematics, vsl, ("q_cmd", "qd_cmd")),
        (vsl, kinematics, ("q_meas", "p_meas", "i_meas")),
    ):
        for name in names:
            s.connect(getattr(source.y, name), getattr(target.u, name))
    errors: list[float] = []

    def look(_t: float, signals: Signals) -> None:
        if signals["planner.moving"]:
            errors.append(float(np.linalg.norm(signals["arm.p_WG"] - signals["planner.p_WG_goal"])))

    with Master(s) as master:
        master.run(Fraction(10), [look])
    assert len(errors) > 300
    return float(np.mean(errors))


def test_hybrid_errs_by_less_than_a_fifth_of_the_model_based():
    assert path_error("HYBRID") < path_error("MODEL_BASED") / 5.0


@pytest.mark.slow
def test_an_arm_that_swings_is_not_swung_up():
    assert path_error("HYBRID", motion="DYNAMIC") < path_error("MODEL_BASED", motion="DYNAMIC") / 5.0
