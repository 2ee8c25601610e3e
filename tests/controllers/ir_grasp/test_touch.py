"""Contacts by the joints' encoders: the balance of torques against the scene's hand, in free space and at an object."""

import numpy as np
import pytest

from handover.controllers.ir_grasp.parameters import Params
from handover.controllers.ir_grasp.touch import Touch, inertia_levers
from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.hand import FINGERS, finger_points
from handover.plants.ir_grasp.objects import Thing
from handover.plants.ir_grasp.scene import GraspScene, Inputs, Outputs
from handover.plants.ir_grasp.scene import Params as SceneParams

DT = 0.015
START = np.array([-0.279, 0.0])


def moments(q: Floats) -> Floats:
    """Sum of mass times place of the phalanges of each finger, (3, 2) in H, by the scene's own geometry."""
    middles = [0.5 * (points[1:] + points[:-1]) for points in finger_points(np.zeros(2), 0.0, q)]
    return SceneParams().phalanx_mass * np.array([m.sum(axis=0) for m in middles])


def test_levers_are_the_derivatives_of_what_the_scenes_fingers_carry():
    q, h = np.array([0.3, 0.5, 0.2, 0.4, 0.1, 0.6, 0.3, 0.2]), 1e-6
    finger = np.repeat(np.arange(3), [len(f.lengths) for f in FINGERS])
    numeric = [
        (moments(q + h * e)[i] - moments(q - h * e)[i]) / (2.0 * h) for e, i in zip(np.eye(8), finger, strict=True)
    ]
    assert inertia_levers(q) == pytest.approx(np.array(numeric), abs=1e-9)


def drive(plant: GraspScene, velocity: tuple[float, float], rounds: int, sigma_rate: float = 0.0) -> list[Outputs]:
    y = plant.outputs(0.0, Inputs(p_WH_cmd=START))
    seen = [y]
    for k in range(rounds):
        goal = START + DT * (k + 1) * np.array(velocity)
        y = plant.step(k * DT, DT, Inputs(p_WH_cmd=goal, sigma_cmd=DT * (k + 1) * sigma_rate))
        seen.append(y)
    return seen


def feel(seen: list[Outputs], blind: bool = False) -> list[Touch]:
    """Return what is felt in each round."""
    found: list[Touch] = []
    touch = Touch(Params(), DT)
    for y in seen:
        touch.advance((*y.p_WH.tolist(), y.yaw, y.sigma), np.zeros(8) if blind else y.q, y.tension)
        copy = Touch(Params(), DT)
        copy.set_state(touch.get_state())
        found.append(copy)
    return found


@pytest.mark.parametrize(("velocity", "rate"), [((0.1, 0.0), 0.0), ((0.0, 0.14), 0.0), ((0.06, 0.0), 0.3)])
def test_a_hand_that_touches_nothing_feels_nothing(velocity: tuple[float, float], rate: float):
    plant = GraspScene(SceneParams(p_WO_0=np.array([0.5, 0.35]), p_WH_0=START))
    assert not any(touch.touches for touch in feel(drive(plant, velocity, 60, rate)))


def test_torques_of_a_free_hand_that_closes_balance_by_the_controllers_model_of_it():
    """With a stiffness or a pulley of any joint 10 % off, or without dampers, 1.6 to 5 mN m would be left."""
    plant = GraspScene(SceneParams(p_WO_0=np.array([0.5, 0.35]), p_WH_0=START))
    assert np.max(np.abs(feel(drive(plant, (0.0, 0.0), 60, 0.6))[-1].torque)) < 1.2e-3


@pytest.mark.parametrize(("left", "finger"), [(-0.080, 0), (0.092, 1)])
def test_a_fingertip_that_pushes_an_object_ahead_is_felt_within_fifteen_millimetres(left: float, finger: int):
    """A light disc whose middle is before the tip, met at the speed of arrival."""
    p_WO = np.array([-0.07, left])
    plant = GraspScene(SceneParams(thing=Thing.DISC, disc_radius=0.033, mass_O=0.1, p_WO_0=p_WO, p_WH_0=START))
    seen = drive(plant, (0.1, 0.0), 80)
    pushed = [float(np.linalg.norm(y.p_WO - p_WO)) for y in seen]
    felt = feel(seen)
    first = next(k for k, touch in enumerate(felt) if touch.touches)
    assert pushed[-1] > 0.03
    assert 0.0 < pushed[first] < 0.015
    assert felt[first].place.finger == finger
    assert not any(touch.touches for touch in feel(seen, blind=True))
