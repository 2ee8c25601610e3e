"""The hand as such: how it moves with what it holds, and what of it pushes what it meets."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from support.plants.hand_scene import CALM, DT, called

from handover.cosim.blocks.plain_rotation import IDENTITY, ZERO
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.hand.floating_object import FloatingObject
from handover.plants.free_flyer.hand.flyer_hand import FlyerHand
from handover.plants.free_flyer.hand.hand_and_object import Activity

END = (0.0, 0.07, 0.0)


def free_object() -> FloatingObject:
    return FloatingObject(0.1, (0.021, 0.195, 0.017))


def test_a_hand_moves_as_the_turning_object_that_it_holds():
    hand, thing = FlyerHand(CALM, END, IDENTITY), free_object()
    hand.take_or_leave(True, thing.body)
    thing.body.v, thing.body.spin = (0.1, -0.2, 0.3), (2e-4, 1e-5, -3e-4)
    places, velocities, h = list[Floats](), list[Frame](), 1e-4
    for _ in range(3):
        hand.arrive(hand.course, thing.body)
        places.append(np.array([*hand.p, *hand.q]))
        velocities.append(hand.carried_by(thing.body))
        thing.body.advance(h, ZERO, ZERO, ZERO, ZERO)
    v, w = velocities[1].v, velocities[1].w
    np.testing.assert_allclose(v, (places[2] - places[0])[:3] / (2.0 * h), atol=1e-6)
    assert np.linalg.norm(np.subtract(v, thing.body.v)) > 0.05
    before, after = (Rotation.from_quat(place[3:], scalar_first=True).as_matrix() for place in (places[0], places[2]))
    turned = Rotation.from_matrix(after @ np.transpose(before)).as_rotvec()
    np.testing.assert_allclose(w, turned / (2.0 * h), atol=1e-3)


def test_a_closed_hand_that_was_stretched_takes_again_after_it_has_opened():
    hand, thing = FlyerHand(replace(CALM, arm_reach=0.05), END, IDENTITY), free_object()
    hand.take_or_leave(hand.grasps(True, True), thing.body)
    assert hand.hold is not None
    thing.body.p = (0.2, 0.0, 0.0)
    hand.arrive(hand.course, thing.body)
    hand.take_or_leave(hand.grasps(True, False), thing.body)
    assert hand.hold is None
    assert not hand.grasps(True, True)
    assert not hand.grasps(False, True)
    assert hand.grasps(True, True)


def test_a_fist_presses_the_palm_from_before_it_and_not_on_its_way_back_from_behind():
    def pressed(start: float, end: float) -> list[float]:
        hand, thing = FlyerHand(CALM, (start, 0.0, 0.0), IDENTITY), free_object().body
        forces: list[float] = []
        for x in np.linspace(start, end, 30)[1:].tolist():
            course, f, _ = hand.press(DT, Frame((x, 0.0, 0.0), IDENTITY), Frame(ZERO, IDENTITY))
            hand.arrive(course, thing)
            forces.append(f[0])
        return forces

    assert max(pressed(-0.02, 0.10)) == CALM.arm_force_max
    assert max(pressed(0.10, -0.02)) == 0.0


def test_an_open_hand_bumps_what_is_before_its_palm_and_not_what_it_has_passed():
    thing, too_far = free_object(), Frame((0.05, 0.07, 0.0), IDENTITY)
    for start, bumps in ((-0.02, True), (0.08, False)):
        hand = FlyerHand(CALM, (start, 0.07, 0.0), IDENTITY)
        assert (hand.palm(too_far, thing.body) is not None) is bumps
        assert (hand.kept_off(DT, too_far, thing.body).p[0] < 0.03) is bumps


def test_a_bump_is_one_push_and_no_stronger_than_the_arm():
    """The thumb stands before the palm: each pushed with the arm's limit."""
    felt: list[float] = []
    for seed in range(6):
        clumsy = replace(CALM, depth_error=0.03, seed=seed, attempts=1, arm_force_max=0.5, reach_speed=3.0)
        scene = called(clumsy, Activity.GRASP)
        felt += [-float(y.f_H[0]) for y in scene.seen if y.activity is Activity.REACH]
    assert 0.45 < max(felt) <= 0.5 + 1e-9
