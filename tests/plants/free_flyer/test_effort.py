"""The effort of a pull: its rise, its force at a speed, and that it moves what yields."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from support.plants.hand_scene import CALM, DT, called

from handover.plants.free_flyer.hand.effort import Effort, force_at_rest
from handover.plants.free_flyer.hand.hand_and_object import Activity

FAR = 1e9


def moved(mass: float, force: float, free_speed: float, load: float, seconds: float, dt: float) -> Effort:
    effort = Effort(mass)
    effort.begin()
    for _ in range(round(seconds / dt)):
        effort.advance(dt, force, free_speed, FAR, load)
    return effort


def test_an_effort_rises_holds_and_is_eased():
    forces = [force_at_rest(4.0, t, 0.3, 7.0, 3.0) for t in (0.0, 0.15, 0.3, 5.0, 7.0, 8.5, 10.0)]
    np.testing.assert_allclose(forces, [0.0, 2.0, 4.0, 4.0, 4.0, 2.0, 0.0], atol=1e-12)


def test_a_free_hand_gets_to_its_speed_as_the_law_says():
    m, F, v_0, t = 1.0, 4.0, 0.35, 0.1
    tau = m * v_0 / F
    exact = v_0 * (1.0 - np.exp(-t / tau))
    assert moved(m, F, v_0, 0.0, t, 1e-4).speed == pytest.approx(exact, rel=2e-3)
    assert moved(m, F, v_0, 0.0, 5.0, 0.032).speed == pytest.approx(v_0, rel=1e-9)


def test_against_a_load_the_hand_is_as_fast_as_force_and_speed_allow():
    assert moved(1.0, 4.0, 0.35, 3.0, 5.0, 0.016).speed == pytest.approx(0.25 * 0.35, rel=1e-9)
    early, late = (moved(1.0, 4.0, 0.35, 6.0, seconds, 0.016).speed for seconds in (0.8, 1.6))
    assert late - early == pytest.approx(-(6.0 - 1.3 * 4.0) * 0.8, rel=1e-9)  # no more than 1.3 times the force


@pytest.mark.parametrize("force", [1.0, 100.0])
def test_no_step_or_effort_makes_it_swing(force: float):
    effort = Effort(0.05)
    speeds: list[float] = []
    for _ in range(200):
        effort.advance(0.1, force, 0.35, FAR, 0.0)
        speeds.append(effort.speed)
    assert all(a <= b + 1e-12 for a, b in zip([0.0, *speeds], speeds, strict=False))


def test_it_ends_at_its_length_and_can_be_drawn_back_from_there():
    effort = Effort(1.0)
    for _ in range(100):
        effort.advance(DT, 4.0, 0.35, 0.1, 0.0)
    assert (effort.travelled, effort.speed) == (0.1, 0.0)
    for _ in range(20):
        effort.advance(DT, 0.0, 0.35, 0.1, 1.0)
    assert effort.travelled < 0.1


def test_a_gripper_that_stands_still_feels_the_effort_and_one_that_lets_go_leaves_the_hand_no_faster_than_a_free_one():
    scene = called(replace(CALM, effort=4.0, arm_force_max=6.0))
    y = scene.go(4.0)
    assert float(np.linalg.norm(y.f_G)) == pytest.approx(4.0, rel=0.03)
    assert y.f_G[2] > 0.9 * 4.0
    begin = len(scene.seen)
    scene.go(1.5, closure=0.0)
    free = [y for y in scene.seen[begin:] if y.activity is Activity.PULL]
    speeds = [float(np.linalg.norm(b.p_WH - a.p_WH)) / DT for a, b in itertools.pairwise(free)]
    assert 0.15 < max(speeds) < 1.15 * 0.35
