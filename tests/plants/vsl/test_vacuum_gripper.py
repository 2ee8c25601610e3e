"""The suction cup: when it picks up and drops, and how the object falls."""

import math

import numpy as np
import pytest
from support.restored_states import assert_continues
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.vacuum_gripper import Inputs, InvalidVacuumGripper, Outputs, Params, VacuumGripper

AT = np.array([0.35, 0.0, 0.05])
UP: Floats = np.array([0.0, 0.0, 1.0])


def step(gripper: VacuumGripper, p_WG: Floats, vacuum: bool, dt: float = 0.02) -> Outputs:
    return gripper.step(0.0, dt, Inputs(p_WG=p_WG, vacuum=vacuum))


@pytest.mark.parametrize(("off", "held"), [(0.0, True), (0.0099, True), (0.0101, False)])
def test_picks_up_what_is_near_while_it_sucks(off: float, held: bool):
    gripper = VacuumGripper(Params())
    assert not step(gripper, AT + off * UP, False).held
    y = step(gripper, AT + off * UP, True)
    assert (y.held, y.load) == (held, 0.05 if held else 0.0)


def test_what_is_held_keeps_its_place_beside_the_gripper():
    gripper = VacuumGripper(Params())
    beside = np.array([0.004, -0.003, 0.002])
    step(gripper, AT - beside, True)
    for k in range(10):
        p_WG = np.array([0.3 - 0.01 * k, 0.02 * k, 0.2])
        np.testing.assert_allclose(step(gripper, p_WG, True).p_WO, p_WG + beside, atol=1e-15)


@pytest.mark.parametrize("dt", [0.02, 0.07])
def test_what_is_dropped_falls_freely_and_comes_to_rest(dt: float):
    gripper = VacuumGripper(Params())
    step(gripper, AT, True)
    step(gripper, AT + 0.3 * UP, True)
    for k in range(1, int(math.sqrt(2.0 * 0.3 / 9.81) / dt) + 1):
        y = step(gripper, AT + 0.3 * UP, False, dt)
        assert (y.held, y.load) == (False, 0.0)
        np.testing.assert_allclose(y.p_WO, AT + (0.3 - 9.81 * (k * dt) ** 2 / 2.0) * UP, atol=1e-12)
    for _ in range(3):
        np.testing.assert_array_equal(step(gripper, AT + 0.3 * UP, False, dt).p_WO, AT)


def test_what_is_put_down_stays_and_can_be_picked_up_again():
    gripper = VacuumGripper(Params())
    step(gripper, AT, True)
    place = np.array([0.25, 0.1, 0.05])
    step(gripper, place, True)
    np.testing.assert_array_equal(step(gripper, place + 0.05 * UP, False).p_WO, place)
    assert step(gripper, place, True).held


def test_too_weak_a_cup_picks_nothing_up():
    for suction, held in ((1.9, False), (1.97, True)):
        y = step(VacuumGripper(Params(mass=0.2, suction=suction)), AT, True)
        assert y.held is held
        np.testing.assert_array_equal(y.p_WO, AT)


def test_continues_bit_for_bit_from_a_state():
    def course(n: int) -> Inputs:
        return Inputs(p_WG=AT + 0.2 * min(n, 1) * UP, vacuum=n < 2)

    assert_continues(lambda: VacuumGripper(Params()), course, [1, 3], 5, 0.02)


def test_unusable_values_are_refused_and_change_nothing(wording: Wording):
    with pytest.raises(InvalidVacuumGripper) as refused:
        VacuumGripper(Params(mass=-1.0, reach=1.0))
    wording.check(refused.value)
    gripper = VacuumGripper(Params())
    before = gripper.get_state()
    with pytest.raises(InvalidVacuumGripper) as refused:
        gripper.step(0.0, 0.02, Inputs(p_WG=np.array([math.nan, 0.0, 0.0]), vacuum=True))
    wording.check(refused.value)
    assert gripper.get_state() == before
