"""A large object, coupled to two robots as the master does, and taken and given by one hand or two."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.plants.hand_scene import DT, EXACT, Steps, body_sums
from support.restored_states import flat
from support.wording import Wording

from handover.cosim.blocks.plain_rotation import (
    dot,
    from_rotation_vector,
    quaternion,
    rotate,
    rotation_matrix,
    vector,
)
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.large_object.hand_pair import middle_of_grippers
from handover.plants.free_flyer.large_object.large_object_and_hands import (
    Activity,
    Holding,
    Inputs,
    InvalidLargeObjectParameters,
    LargeObjectAndHands,
    Motion,
    Params,
    StartHolder,
)
from handover.plants.free_flyer.robot.free_flyer import FreeFlyer
from handover.plants.free_flyer.robot.free_flyer import Inputs as FlyerInputs
from handover.plants.free_flyer.robot.free_flyer import Params as FlyerParams

FLYER = FlyerParams()
CALM = Params(tremor_rms=0.0, drift_rms=0.0, p_WO_0=np.zeros(3), **EXACT)
IDLE = replace(CALM, motion=Motion.NONE, motion_again=Motion.NONE)
GIVING = replace(CALM, motion=Motion.GIVE, object_with=StartHolder.HAND)


def scene(params: Params) -> Steps:
    """Return the unit with grippers that a test moves and closes."""
    return Steps(LargeObjectAndHands(params), Inputs())


CLOSE = {"closure_1": 1.0, "closure_2": 1.0}
OPEN = {"closure_1": 0.0, "closure_2": 0.0}
SIGNAL, DARK = {"light_1": True, "light_2": True}, {"light_1": False, "light_2": False}


class Loop:
    """Two robots without thrust and the object, coupled step by step: robots first, forces held over a step."""

    def __init__(self, params: Params, dt: float, *flyers: FlyerParams) -> None:
        u = Inputs()
        at = (u.p_WG_1 - FLYER.p_BG, u.p_WG_2 - FLYER.p_BG)
        self.robots = [FreeFlyer(replace(f, p_WB_0=p)) for f, p in zip(flyers, at, strict=True)]
        self.ys = [robot.outputs(0.0, FlyerInputs()) for robot in self.robots]
        self.unit, self.dt, self.t = LargeObjectAndHands(params), dt, 0.0
        self.h = self.unit.outputs(0.0, u)

    def step(self, **changes: Any) -> None:
        h = self.h
        wrenches = ((h.f_G_1, h.tau_G_1), (h.f_G_2, h.tau_G_2))
        self.ys = [
            robot.step(self.t, self.dt, FlyerInputs(f_G=f, tau_G=tau))
            for robot, (f, tau) in zip(self.robots, wrenches, strict=True)
        ]
        names = ("p_WG", "q_WG", "v_WG", "w_WG")
        of = {f"{name}_{i}": getattr(y, name) for i, y in enumerate(self.ys, 1) for name in names}
        self.h = self.unit.step(self.t, self.dt, Inputs(**of, **changes))
        self.t += self.dt

    def sums(self) -> Floats:
        """Momenta about the origin and kinetic energy of all bodies, the impulses on their way included."""
        h, p = self.h, Params()
        a, b, c = p.object_size**2
        inertia = p.object_mass / 12.0 * np.diag([b + c, a + c, a + b])
        total = body_sums(p.object_mass, inertia, h.p_WO, h.q_WO, h.v_WO, h.w_WO)
        for y, f, tau in zip(self.ys, (h.f_G_1, h.f_G_2), (h.tau_G_1, h.tau_G_2), strict=True):
            total += body_sums(FLYER.mass, FLYER.I_B, y.p_WB, y.q_WB, y.v_WB, y.w_WB)
            total += self.dt * np.concatenate([f, tau + np.cross(y.p_WG, f), [0.0]])
        return total

    def elastic_energy(self) -> float:
        """Energy in the springs of both grips, J."""
        energy, b = 0.0, self.unit._object.body  # type: ignore
        for y, gripper in zip(self.ys, self.unit._grippers, strict=True):  # type: ignore
            assert gripper.grip is not None
            G = Frame(vector(y.p_WG), quaternion(y.q_WG))
            f, tau = gripper.grip.load(G, b.p, b.q, rotation_matrix(b.q))
            energy += 0.5 * dot(f, f) / gripper.stiffness.k + 0.5 * dot(tau, tau) / gripper.stiffness.k_turn
        return energy


def test_momentum_of_two_robots_and_the_gripped_object_stays_and_energy_does_not_grow():
    moving = replace(FLYER, v_WB_0=np.array([0.05, -0.03, 0.04]), w_WB_0=np.array([0.1, -0.1, 0.1]))
    dt = 0.032
    loop = Loop(replace(IDLE, gripper_rate=100.0), dt, moving, FLYER)
    while loop.h.grippers_holding is not Holding.BOTH:
        loop.step(**CLOSE)
        assert loop.t < 0.1
    before, energies = loop.sums(), list[float]()
    for _ in range(round(6.0 / dt)):
        loop.step(**CLOSE)
        energies.append(loop.sums()[-1] + loop.elastic_energy())
    after = loop.sums()
    np.testing.assert_allclose(after[:3], before[:3], atol=1e-12)
    np.testing.assert_allclose(after[3:6], before[3:6], atol=0.02 * float(np.linalg.norm(before[3:6])))
    assert np.linalg.norm(loop.ys[1].v_WB) > 0.01  # the other robot is drawn along
    settled = np.array(energies[round(2.0 / dt) :])
    assert np.max(np.diff(settled)) < 1e-4 * settled[0]
    assert settled[-1] > 0.8 * settled[0]  # what turns as one has nothing to lose
    assert settled[0] < 0.85 * energies[0]  # what shook between the grips has


def test_hands_take_what_grippers_and_object_give():
    """Force on the object is what grippers and hands lose: with both held, means over a step add up to its change."""
    s = scene(replace(CALM, motion=Motion.TAKE))
    s.go(1.0, **CLOSE)
    s.until(Activity.PULL, **SIGNAL)
    for _ in range(100):
        before = s.y.v_WO
        y = s.go(DT)
        force = -(y.f_G_1 + y.f_G_2 + y.f_H_1 + y.f_H_2)
        np.testing.assert_allclose(force * DT, 3.0 * (y.v_WO - before), atol=1e-10)


def test_a_pair_of_hands_takes_the_object_from_both_grippers():
    s = scene(CALM)
    s.go(1.0, **CLOSE)
    assert (s.y.grippers_holding, s.y.hands_holding) == (Holding.BOTH, Holding.NONE)
    s.until(Activity.PULL, **SIGNAL)
    s.go(1.5, **DARK)
    assert s.y.hands_holding is Holding.BOTH
    np.testing.assert_allclose(s.y.f_G_1, s.y.f_G_2, atol=0.05)
    np.testing.assert_allclose(s.y.f_G_1[0], -2.0, atol=0.3)  # the effort of a hand each
    s.until(Activity.REST, **OPEN)
    assert (s.y.grippers_holding, s.y.hands_holding) == (Holding.NONE, Holding.BOTH)
    np.testing.assert_allclose(s.y.p_WH_1 - s.y.p_WH_2, [0.0, 0.5, 0.0], atol=0.02)


def test_a_pair_of_hands_gives_the_object_to_both_grippers():
    s = scene(GIVING)
    assert s.y.hands_holding is Holding.BOTH
    s.until(Activity.PUSH, **SIGNAL)
    s.go(1.0, **DARK)
    np.testing.assert_allclose([s.y.f_G_1[0], s.y.f_G_2[0]], [1.0, 1.0], atol=0.3)  # half the effort, at either palm
    s.until(Activity.REST, **CLOSE)
    assert (s.y.grippers_holding, s.y.hands_holding) == (Holding.BOTH, Holding.NONE)


def test_the_person_keeps_on_while_one_gripper_still_holds():
    s = scene(CALM)
    s.go(1.0, **CLOSE)
    s.until(Activity.PULL, **SIGNAL)
    s.go(1.0, **DARK)
    s.go(2.0, closure_1=0.0)
    assert (s.y.activity, s.y.grippers_holding) == (Activity.PULL, Holding.SECOND)
    s.until(Activity.WITHDRAW, closure_2=0.0)


def test_the_light_of_one_robot_is_no_signal_and_robots_may_signal_one_after_the_other():
    s = scene(CALM)
    s.go(1.0, **CLOSE)
    s.go(2.0, light_1=True)
    assert s.go(1.0, light_1=False).activity is Activity.WAIT
    s.until(Activity.REACH, light_2=True)


def test_the_person_keeps_what_one_gripper_alone_received():
    s = scene(GIVING)
    s.until(Activity.PUSH, **SIGNAL)
    s.go(1.0, **DARK)
    s.go(0.72, p_WG_2=s.u.p_WG_2 + np.array([0.1, 0.0, 0.0]), **CLOSE)  # too far behind its handle
    assert s.y.grippers_holding is Holding.FIRST
    s.until(Activity.WITHDRAW)
    assert s.y.hands_holding is Holding.BOTH


def test_one_hand_at_an_end_draws_at_the_gripper_opposite_more():
    turned: list[float] = []
    for p_OH in (np.array([-0.28, 0.0, 0.0]), np.array([-0.28, 0.25, 0.0])):
        s = scene(replace(CALM, hands=1, p_OH=p_OH))
        s.go(1.0, **CLOSE)
        s.until(Activity.PULL, **SIGNAL)
        s.go(1.0, **DARK)
        assert s.y.hands_holding is Holding.FIRST
        turned.append(abs(float(s.y.f_G_1[0] - s.y.f_G_2[0])))
        np.testing.assert_array_equal(s.y.f_H_2, np.zeros(3))
    assert turned[0] < 0.02
    assert turned[1] > 1.0


def test_a_second_hand_that_is_late_takes_hold_later_and_one_that_is_much_too_late_makes_the_person_try_again():
    for delay in (0.2, 0.7):
        attempts = 1 if delay == 0.2 else 2
        s = scene(replace(CALM, hand_delay=delay, patience=1.0, attempts=attempts))
        s.go(1.0, **CLOSE)
        s.until(Activity.REST, **SIGNAL)
        held = [y.hands_holding for y in s.seen]
        if delay == 0.2:
            assert abs((held.index(Holding.BOTH) - held.index(Holding.FIRST)) * DT - 0.2) <= DT
        else:
            assert s.activities().count(Activity.PULL) == attempts
            assert Holding.BOTH not in held


@pytest.mark.parametrize(("near", "far"), [(1, 2), (2, 1)])
def test_a_fist_pushes_its_gripper_though_it_is_beside_and_beyond_the_palm_of_the_other(near: int, far: int):
    s = scene(replace(CALM, motion=Motion.PUSH, p_WO_0=np.array([0.1, -1.5, 0.0])))
    s.go(DT, **{f"p_WG_{near}": getattr(s.u, f"p_WG_{near}") - np.array([0.1, 0.0, 0.0])})
    s.until(Activity.PUSH, **SIGNAL)
    s.go(1.0)
    np.testing.assert_allclose([s.y.f_G_1[0], s.y.f_G_2[0]], [1.0, 1.0], atol=0.3)
    for _ in range(10):  # towards the fist
        y = s.go(DT, **{f"p_WG_{far}": getattr(s.u, f"p_WG_{far}") - np.array([0.001, 0.0, 0.0])})
        assert getattr(y, f"f_G_{far}")[0] > 0.5


@pytest.mark.parametrize("params", [Params(p_WO_0=np.zeros(3), hand_delay=0.1), replace(GIVING, tremor_rms=5e-4)])
def test_a_restored_state_continues_bit_for_bit(params: Params):
    s, other = scene(params), scene(params)
    s.go(1.0, **({} if params.object_with is StartHolder.HAND else CLOSE))
    s.until(Activity.PULL if params.motion is Motion.TAKE else Activity.PUSH, **SIGNAL)
    for closure in (1.0, 0.0):
        s.go(0.1, closure_1=closure)
        other.unit.set_state(s.unit.get_state())
        other.u, other.i = s.u, s.i
        np.testing.assert_array_equal(flat(s.go(0.5)), flat(other.go(0.5)))


def test_the_middle_of_grippers_lies_along_the_line_between_them():
    q = from_rotation_vector((0.0, 0.0, 0.3))
    y = rotate(rotation_matrix(q), (0.0, 1.0, 0.0))
    A, B = Frame((0.3 * y[0], 0.3 * y[1], 0.1), q), Frame((-0.3 * y[0], -0.3 * y[1], 0.1), q)
    M = middle_of_grippers(A, B)
    np.testing.assert_allclose(M.p, [0.0, 0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(M.q, q, atol=1e-12)
    askew = middle_of_grippers(Frame(A.p, quaternion(np.array([1.0, 0.0, 0.0, 0.0]))), Frame(B.p, (1.0, 0.0, 0.0, 0.0)))
    np.testing.assert_allclose(rotate(askew.R, (0.0, 1.0, 0.0)), y, atol=1e-9)


def test_faults_are_reported_all_at_once(wording: Wording):
    false = Params(p_OH=np.array([-0.2, 0.0, 0.0]), motion=Motion.GIVE, hand_spacing=0.05, pull_direction=np.zeros(3))
    with pytest.raises(InvalidLargeObjectParameters) as e:
        LargeObjectAndHands(false)
    wording.check(e.value)
    around_a_handle = LargeObjectAndHands(replace(IDLE, angle_0=0.6))
    with pytest.raises(InvalidLargeObjectParameters) as e:
        around_a_handle.step(0.0, DT, Inputs())
    wording.check(e.value)
