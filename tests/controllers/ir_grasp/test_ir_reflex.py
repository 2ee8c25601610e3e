"""The reflex before an analytic scene: a disc, three rays, and a wrist that follows its command at bounded rates."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_outputs_change_nothing, assert_passed_on
from support.wording import Wording

from handover.controllers.ir_grasp.ir_reflex import (
    Inputs,
    InvalidReading,
    InvalidReflexParameters,
    IrReflex,
    Outputs,
    Params,
    Phase,
    Stop,
    Strategy,
    Visibility,
)
from handover.controllers.ir_grasp.visibility import RECOVERY, Recovery, displaced

DT = 0.015
CURVE = Params().calibration
FAR = (0.065, 0.065, 0.065)


@dataclasses.dataclass
class Scene:
    """A hand whose sensors sit beside the grasp and look inwards and ahead; the disc does not move."""

    p_WO: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.033
    x: tuple[float, ...] = (-0.30, 0.0, 0.0, 0.0)

    def distances(self) -> list[float]:
        p_x, p_y, yaw, sigma = self.x
        c, s = math.cos(yaw), math.sin(yaw)
        found: list[float] = []
        for ahead, side in ((0.112, -1.0), (0.140, 1.0), (0.126, 1.0)):
            beside = side * (0.065 - 0.08 * sigma)
            angle = yaw - side * (1.1 + 1.2 * sigma)
            o_x, o_y = p_x + c * ahead - s * beside, p_y + s * ahead + c * beside
            d_x, d_y = math.cos(angle), math.sin(angle)
            m_x, m_y = o_x - self.p_WO[0], o_y - self.p_WO[1]
            b = m_x * d_x + m_y * d_y
            under = b * b - (m_x**2 + m_y**2 - self.radius**2)
            found.append(min(-b - math.sqrt(under), 0.065) if under > 0.0 and b < 0.0 else 0.065)
        return found

    def inputs(self) -> Inputs:
        return inputs(self.x, self.distances())

    def follow(self, y: Outputs) -> None:
        goal = (*y.p_WH_cmd.tolist(), y.yaw_cmd, y.sigma_cmd)
        rates = (0.3, 0.3, 1.5, 1.0)
        self.x = tuple(a + max(-r * DT, min(r * DT, b - a)) for a, b, r in zip(self.x, goal, rates, strict=True))


def inputs(x: tuple[float, ...], distances: Any) -> Inputs:
    ticks = np.array([round(CURVE.ticks(d)) if d < 0.065 else 0 for d in distances], dtype=np.float64)
    return Inputs(ticks=ticks, p_WH=np.array(x[:2]), yaw=x[2], sigma=x[3])


def run(scene: Scene, reflex: IrReflex, given: list[Inputs] | None = None) -> list[Outputs]:
    seen: list[Outputs] = []
    while not (seen and seen[-1].phase is Phase.DONE):
        assert len(seen) * DT < 60.0
        u = scene.inputs()
        seen.append(reflex.step(len(seen) * DT, DT, u))
        scene.follow(seen[-1])
        if given is not None:
            given.append(u)
    return seen


def phases(seen: list[Outputs]) -> list[Phase]:
    return [y.phase for k, y in enumerate(seen) if not k or seen[k - 1].phase is not y.phase]


def pregrasp(*p_WH: float, **more: Any) -> Params:
    return Params(p_WH_pregrasp=np.array(p_WH), **more)


def test_the_reflex_brings_thumb_and_ring_to_the_target_then_closes_pulls_and_shakes():
    scene = Scene(p_WO=(0.01, 0.015))
    seen = run(scene, IrReflex(pregrasp(-0.15, 0.0)))
    order = phases(seen)
    assert order[:2] == [Phase.REACH, Phase.CHECK]
    assert {Phase.PROBE, Phase.STEP} <= set(order)
    assert order[-4:] == [Phase.CLOSE, Phase.PULL, Phase.SHAKE, Phase.DONE]
    closing = next(y for y in seen if y.phase is Phase.CLOSE)
    assert closing.stop is Stop.THRESHOLD
    assert closing.cost <= 1.05 * Params().threshold
    assert closing.distance[[0, 2]] == pytest.approx(0.010, abs=0.006)
    assert closing.sigma_cmd == 1.0
    assert 1 <= closing.steps <= Params().max_steps


def test_the_pull_rolls_back_along_the_hand_and_the_shake_across():
    p = pregrasp(-0.15, 0.0, yaw_pregrasp=0.5, strategy=Strategy.BLIND)
    seen = run(Scene(), IrReflex(p))
    pull = next(y for y in seen if y.phase is Phase.PULL)
    back = pull.p_WH_cmd - p.p_WH_pregrasp
    assert back == pytest.approx([-0.15 * math.cos(0.5), -0.15 * math.sin(0.5)])
    shaken = np.array([y.p_WH_cmd - pull.p_WH_cmd for y in seen if y.phase is Phase.SHAKE])
    across = shaken @ [-math.sin(0.5), math.cos(0.5)]
    assert np.max(np.abs(shaken @ [math.cos(0.5), math.sin(0.5)])) < 1e-12
    assert across.max() == pytest.approx(p.shake_amplitude, rel=0.01)
    assert across.min() == pytest.approx(-p.shake_amplitude, rel=0.01)
    assert len(across) * DT == pytest.approx(p.shake_cycles / p.shake_frequency, abs=2 * DT)
    assert seen[-1].p_WH_cmd == pytest.approx(pull.p_WH_cmd)


def test_blind_closes_at_the_pre_grasp_pose_and_forward_35_mm_ahead():
    for strategy, ahead, stop in ((Strategy.BLIND, 0.0, Stop.BLIND), (Strategy.FORWARD, 0.035, Stop.FORWARD)):
        seen = run(Scene(p_WO=(0.0, 0.02)), IrReflex(pregrasp(-0.17, 0.01, yaw_pregrasp=0.3, strategy=strategy)))
        closing = next(y for y in seen if y.phase is Phase.CLOSE)
        assert closing.p_WH_cmd == pytest.approx([-0.17 + ahead * math.cos(0.3), 0.01 + ahead * math.sin(0.3)])
        assert (closing.stop, seen[-1].steps) == (stop, 0)
        assert not {Phase.CHECK, Phase.PROBE, Phase.STEP} & set(phases(seen))


def test_as_printed_the_cost_is_of_the_distances_themselves():
    u = inputs((0.0,) * 4, (0.02, 0.05, 0.03))
    own, literal = (IrReflex(Params(literal=v)).outputs(0.0, u) for v in (False, True))
    d = literal.distance
    assert literal.cost == pytest.approx(0.5 * (d[0] ** 2 + d[2] ** 2))
    assert own.cost == pytest.approx(0.5 * ((d[0] - 0.01) ** 2 + (d[2] - 0.01) ** 2))
    index_too = IrReflex(Params(weight=np.ones(3), literal=True)).outputs(0.0, u)
    assert index_too.cost == pytest.approx(0.5 * float(d @ d))
    cut = IrReflex(Params()).outputs(0.0, Inputs(ticks=np.array([0.0, 300.0, 4095.0])))
    assert cut.distance.tolist() == [0.065, CURVE.distance(300.0), CURVE.distance(4095.0)]
    assert cut.case is Visibility.INDEX_RING


@pytest.mark.parametrize("case", RECOVERY)
def test_each_case_makes_the_hand_move_as_its_action_says(case: Visibility):
    reflex, x, p = IrReflex(pregrasp(-0.15, 0.02, sigma_pregrasp=0.1)), (-0.15, 0.02, 0.0, 0.1), Params()
    u = inputs(x, [0.03 if case & (1 << i) else 0.065 for i in range(3)])
    y = reflex.outputs(0.0, u)
    assert y.case is case
    for k in range(40):
        y = reflex.step(k * DT, DT, u)
        if y.phase not in (Phase.REACH, Phase.CHECK):
            break
    motion = Recovery(p.recovery_step, p.recovery_closing, p.recovery_least).motion(case, may_close=True)
    assert (*y.p_WH_cmd, y.yaw_cmd, y.sigma_cmd) == pytest.approx(displaced(x, motion))
    assert y.phase is (Phase.APPROACH if case is Visibility.NONE else Phase.RECOVER)


def test_a_hand_that_sees_nothing_goes_forward_to_its_reach_and_closes():
    seen = run(Scene(p_WO=(5.0, 0.0)), IrReflex(pregrasp(-0.15, 0.0)))
    closing = next(y for y in seen if y.phase is Phase.CLOSE)
    assert closing.stop is Stop.REACH
    assert closing.p_WH_cmd == pytest.approx([-0.15 + Params().reach[0], 0.0])


def test_a_finger_outside_the_cost_is_not_waited_for():
    reflex, x, p, seen = IrReflex(pregrasp(-0.15, 0.0)), (-0.15, 0.0, 0.0, 0.0), Params(), list[Outputs]()
    while not (seen and seen[-1].phase is Phase.PROBE):
        seen.append(reflex.step(len(seen) * DT, DT, inputs(x, (0.03, 0.065, 0.03))))
        x = (*seen[-1].p_WH_cmd.tolist(), seen[-1].yaw_cmd, seen[-1].sigma_cmd)
        assert len(seen) < 200
    assert phases(seen).count(Phase.RECOVER) == p.waited_closings
    assert seen[-2].sigma_cmd == pytest.approx(p.waited_closings * p.recovery_closing)


def test_it_goes_on_from_any_state_bit_for_bit():
    """From a pre-grasp pose so near that the index sees past the object."""
    params, given = pregrasp(-0.11, 0.0), list[Inputs]()
    met = set(phases(run(Scene(p_WO=(0.01, 0.015)), IrReflex(params), given)))
    assert met == set(Phase) - {Phase.APPROACH, Phase.SEARCH, Phase.TRACK}
    assert_passed_on(lambda: IrReflex(params), given, 3, DT)
    assert_outputs_change_nothing(lambda: IrReflex(params), Scene().inputs(), DT, same=True)


def test_a_reading_that_is_no_number_is_refused_and_leaves_no_trace():
    reflex, other = IrReflex(Params()), IrReflex(Params())
    with pytest.raises(InvalidReading) as refused:
        reflex.step(0.0, DT, Inputs(ticks=np.array([0.0, math.nan, 0.0]), p_WH=np.zeros(2), yaw=math.inf))
    assert [fault.split()[0] for fault in refused.value.faults] == ["ticks", "yaw"]
    assert reflex.get_state() == other.get_state()


def test_all_faults_of_the_parameters_are_reported_together(wording: Wording):
    no_probe, coarse = np.array([0.004, 0.004, 0.04, 0.0]), np.full(4, 0.01)
    cases: list[dict[str, Any]] = [
        {"probe": no_probe, "weight": np.zeros(3), "damping": 0.0, "alpha": 0.0, "epsilon": 0.07, "b": 0.0},
        {"sigma_pregrasp": 0.9, "recovery_least": 0.02, "target": 0.003, "distance_max": 0.09, "tolerance": coarse},
        {"scans": 0},
    ]
    for bad in cases:
        with pytest.raises(InvalidReflexParameters) as refused:
            IrReflex(Params(**bad))
        wording.check("\n".join(refused.value.faults))
