"""What is amiss reaches the units, and nothing else changes."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.wording import Wording

from handover.controllers.helix.vision.handover_vision import Detector
from handover.controllers.helix.vision.stereo import triangulate
from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.exceptions import WiringError
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.robots.helix.cameras import calibrated, camera_of, camera_parameters, marker_fault
from handover.scenarios.robots.helix.disturbances import Cover
from handover.scenarios.robots.helix.helix_handover import HelixHandover
from handover.scenarios.robots.helix.parameters import (
    BoundRule,
    Filters,
    Parameters,
    StepRule,
    Tuning,
    WeightRule,
    settings_of,
)


def built(seed: int = 3, **given: Any) -> System:
    return HelixHandover().build(Parameters(**given), seed, lambda name: cached(HelixHandover.units[name], 3))


PASSED_ON: dict[str, tuple[Any, tuple[str, ...]]] = {
    "tremor": (0.003, ("hand.tremor_rms",)),
    "drift": (0.01, ("hand.drift_rms",)),
    "guidance": (30.0, ("hand.guide_stiffness",)),
    "light": (0.4, ("camera.light",)),
    "sensor_noise": (8.0, ("camera.noise",)),
    "lost_pictures": (0.3, ("camera.lost_pictures",)),
    "detector": (Detector.PUBLISHED, ("vision.detector",)),
    "marker": (0.022, ("camera.marker", "vision.marker")),
    "rings": (2, ("camera.rings", "vision.rings")),
    "covered_markers": (3, ("camera.covered_markers",)),
    "jitter": (0.5, ("servo.jitter",)),
    "decimation": (15, ("camera.decimation", "vision.decimation")),
    "ball_mass": (0.04, ("hand.ball_mass",)),
    "finger_friction": (0.4, ("hand.finger_friction",)),
    "hand_force_max": (8.0, ("hand.force_max",)),
    "help_speed": (0.05, ("hand.help_speed",)),
}
CHANGED: list[tuple[dict[str, Any], set[str]]] = [
    (
        {"arm_stiffness": 0.7, "move_azimuth": 0.5, "camera_turn": 0.02, "step_rule": StepRule.BY_ERROR},
        {"arm.EA", "arm.EI", "hand.p_WO_1", "hand.move_for", "camera.q_WC_right", "servo.adaptive_step"},
    ),
    (
        {"gripper_load": 1.5, "move_height": 0.05, "hide_for": 2.0, "bound_rule": BoundRule.BY_COVARIANCE},
        {
            *("arm.gripper_mass", "hand.p_WO_1", "hand.move_for", "camera.hide_ball_from", "camera.hide_ball_until"),
            "servo.bound_by_covariance",
        },
    ),
    (
        {"cover": Cover.LEFT, "click_noise": 2.0, "weight_rule": WeightRule.BY_STATE},
        {
            *("camera.cover_left_from", "camera.cover_left_until", "servo.weight_fall"),
            *(f"vision.{what}_WC_{side}" for what in "pq" for side in ("left", "right")),
        },
    ),
]


@pytest.fixture(scope="module")
def undisturbed() -> System:
    return built()


def start(system: System) -> dict[str, Any]:
    return {f"{name}.{port}": value for name, unit in system.units.items() for port, value in unit.start.items()}


def changed(a: System, b: System) -> set[str]:
    before, after = start(a), start(b)
    same = {name for name in before if name in after and np.array_equal(before[name], after[name])}
    return (before.keys() | after.keys()) - same


def test_each_sets_what_it_says_and_nothing_else(undisturbed: System):
    disturbed = built(**{name: value for name, (value, _) in PASSED_ON.items()})
    wanted = {port: value for value, ports in PASSED_ON.values() for port in ports}
    assert changed(undisturbed, disturbed) == set(wanted)
    assert {port: start(disturbed)[port] for port in wanted} == wanted
    for given, set_on in CHANGED:
        assert changed(undisturbed, built(**given)) == set_on


def test_a_hand_that_moves_on_turns_about_the_arm_and_rises():
    hand = Parameters(move_azimuth=np.pi / 2, move_height=0.05).hand_values(np.array([0.16, 0.0, -0.6]))
    np.testing.assert_allclose(hand["p_WO_1"], [0.0, 0.16, -0.55], atol=1e-12)


def test_a_turned_camera_sees_what_lay_in_the_middle_farther_to_the_right():
    point = np.array([[0.0, 0.0, -0.6]])
    before, after = (camera_of("right", camera_parameters(turned)).project(point)[0] for turned in (0.0, 0.02))
    assert after[0] - before[0] == pytest.approx(0.02 * 908.5, rel=0.1)
    assert after[1] == pytest.approx(before[1], abs=0.5)


def test_filters_are_chosen_apart_from_the_tuning():
    thesis, own = settings_of(Tuning.THESIS), settings_of(Tuning.OWN)
    mixed = Parameters(filters=Filters.THESIS).settings
    assert (mixed["Q_wrist"], mixed["gate"], mixed["shaping_time"]) == (thesis["Q_wrist"], 0.0, own["shaping_time"])
    other = Parameters(tuning=Tuning.THESIS, filters=Filters.OWN).settings
    assert (other["Q_wrist"], other["settle_steps"]) == (own["Q_wrist"], 1)


def test_the_detector_gets_what_the_clicks_give_and_places_come_out_within_millimetres():
    truth, off = camera_parameters(), list[float]()
    places = np.array([[0.16, 0.0, -0.6], [0.0, 0.2, -0.5], [-0.1, -0.1, -0.7]])
    for seed in range(20):
        found = calibrated(0.5, seed, -0.8)
        cameras = camera_of("left", found), camera_of("right", found)
        for p in places:
            seen = [camera_of(side, truth).project(p) for side in ("left", "right")]
            off.append(float(np.linalg.norm(triangulate(cameras, seen)[0] - p)))
    assert 0.0003 < np.sqrt(np.mean(np.square(off))) < 0.003
    exact = calibrated(0.0, 1, -0.8)
    for side in ("left", "right"):
        np.testing.assert_allclose(exact[f"p_WC_{side}"], truth[f"p_WC_{side}"], atol=1e-6)
        R_found, R_true = (rotation_of(c[f"q_WC_{side}"]) for c in (exact, truth))
        np.testing.assert_allclose(R_found, R_true, atol=1e-6)


def test_runs_with_anything_amiss_are_not_compared_with_the_paper():
    thesis = Parameters(tuning=Tuning.THESIS, alpha=0.4, control_period=1.45)
    assert HelixHandover().published(thesis)
    assert not HelixHandover().published(replace(thesis, light=0.4))


def test_what_no_camera_sees_is_refused_before_anything_starts(wording: Wording):
    cases: list[dict[str, Any]] = [{"box_height": -2.0}, {"marker": 0.012}, {"marker": 0.03}]
    for given in cases:
        with pytest.raises(WiringError) as caught:
            built(**given).check()
        wording.check(caught.value)
    assert [marker_fault(marker) for marker in (0.0183, 0.02, 0.0241)] == [None] * 3
