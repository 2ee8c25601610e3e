"""Arms that differ from the trained one: what is drawn, what the plant gets, and what it does to the error."""

from dataclasses import replace

import numpy as np
import pytest

from handover.cosim.master.master import Master
from handover.fmus.build import cached
from handover.plants.vsl.parameters import Params as ArmParams
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.robots.vsl.arms import arm_of
from handover.scenarios.robots.vsl.parameters import HybridParameters, Parameters
from handover.scenarios.robots.vsl.path_experiments import VslHybrid

SCATTERED = Parameters(arm_scatter=0.1, length_scatter=0.001, arm_seed=3)


def outcome_of(*given: str) -> Outcome:
    p, e = parse_parameters(VslHybrid, ["settle=2", "speed=0.1", "points=20", *given]), VslHybrid()
    evaluator = e.evaluator(p)
    with Master(e.build(p, 0, lambda name: cached(VslHybrid.units[name], 3))) as master:
        master.run(e.stop_time(p), [evaluator], until=lambda: evaluator.over)
    return evaluator.outcome()


def test_the_usual_arm_is_left_as_it_is_and_factors_are_those_of_all_links_gears_and_joints():
    assert arm_of(Parameters()).settings == arm_of(Parameters(arm_seed=5)).settings == {}
    assert arm_of(Parameters()).metrics == {}
    settings = arm_of(Parameters(EI_factor=1.1, friction_factor=2.0)).settings
    assert {name: list(value) for name, value in settings.items()} == {
        "EI_factor": pytest.approx([1.1] * 3),
        "friction_factor": [2.0] * 3,
    }


def test_a_scattered_arm_is_the_same_for_the_same_seed_and_differs_everywhere():
    arm, again = arm_of(SCATTERED), arm_of(replace(SCATTERED, load=0.0))
    for name, value in arm.settings.items():
        np.testing.assert_array_equal(value, again.settings[name])
    drawn = np.concatenate([np.ravel(value) for value in arm.settings.values()])
    assert len(np.unique(drawn)) == len(drawn) == 13
    other = arm_of(replace(SCATTERED, arm_seed=4))
    assert np.all(np.abs(other.EI_factor - arm.EI_factor) > 1e-3)
    np.testing.assert_allclose(arm_of(replace(SCATTERED, EI_factor=2.0)).EI_factor, 2.0 * arm.EI_factor)


def test_scatter_is_as_large_as_it_says():
    arms = [arm_of(replace(SCATTERED, arm_seed=seed)) for seed in range(250)]
    for name in ("EI_factor", "mass_factor", "friction_factor", "joint_factor"):
        np.testing.assert_allclose(np.std(np.log([getattr(a, name) for a in arms]), axis=0), 0.1, rtol=0.15)
    lengths = [(a.L_2 - ArmParams().L_2, a.L_3 - ArmParams().L_3) for a in arms]
    np.testing.assert_allclose(np.std(lengths, axis=0), 0.001, rtol=0.15)


def test_a_stiffer_arm_than_the_trained_one_errs_more_and_is_in_the_metrics():
    usual, stiffer = outcome_of(), outcome_of("EI_factor=1.1")
    assert stiffer.metrics["mean_error"].value > 1.5 * usual.metrics["mean_error"].value
    factors = {n: m.value for n, m in stiffer.metrics.items() if "factor" in n}
    assert factors == {"EI_factor_2": 1.1, "EI_factor_3": 1.1}
    assert not any("factor" in n for n in usual.metrics)


@pytest.mark.slow
def test_a_scattered_arm_runs_and_says_what_it_is_made_of():
    metrics = outcome_of("arm_scatter=0.1", "length_scatter=0.001", "arm_seed=3").metrics
    arm = arm_of(HybridParameters(arm_scatter=0.1, length_scatter=0.001, arm_seed=3))
    assert metrics["friction_factor_J3"].value == arm.friction_factor[2]
    assert metrics["joint_factor_J2"].value == arm.joint_factor[0]
    assert (metrics["L_3"].value, metrics["L_3"].unit) == (arm.L_3, "m")
