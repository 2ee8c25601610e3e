"""The correction on the move, before the grasp scene and before readings made for a case."""

import math
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_passed_on
from support.wording import Wording

from handover.controllers.ir_grasp.ir_reflex import Inputs, IrReflex, Outputs, Params, Phase, Stop, Strategy
from handover.controllers.ir_grasp.parameters import Correction, InvalidReflexParameters
from handover.controllers.ir_grasp.visibility import Visibility
from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.objects import Thing
from handover.plants.ir_grasp.scene import GraspScene
from handover.plants.ir_grasp.scene import Inputs as Commands
from handover.plants.ir_grasp.scene import Outputs as Sensed
from handover.plants.ir_grasp.scene import Params as SceneParams

DT = 0.015
START, PREGRASP = (-0.279, 0.0), (-0.159, 0.0)
SMALL: dict[str, Any] = {"thing": Thing.DISC, "disc_radius": 0.015, "mass_O": 0.25}
QUICK: dict[str, Any] = {"search_speed": 0.28, "arrival_way": 0.0, "touch_most": 0}
"""A search so fast that a small heavy disc stands before the index's tip."""


def reflex(**more: Any) -> IrReflex:
    given: dict[str, Any] = {"correction": Correction.FAST, "p_WH_pregrasp": np.array(PREGRASP), **more}
    return IrReflex(Params(**given))


def scene(p_WO: tuple[float, float] = (0.0, 0.0), **more: Any) -> GraspScene:
    return GraspScene(SceneParams(p_WO_0=np.array(p_WO), p_WH_0=np.array(START), **more))


def read(y: Sensed) -> Inputs:
    return Inputs(
        ticks=y.ticks, p_WH=y.p_WH_meas, yaw=y.yaw_meas, sigma=y.sigma_meas, tension=y.tension_meas, q=y.q_meas
    )


def grasp(controller: IrReflex, plant: GraspScene, until: Phase = Phase.CLOSE) -> list[tuple[Outputs, Sensed]]:
    """Run until a phase begins; return what was commanded, and what was there then."""
    y = plant.outputs(0.0, Commands(p_WH_cmd=np.array(START)))
    seen: list[tuple[Outputs, Sensed]] = []
    while not (seen and seen[-1][0].phase is until):
        k = len(seen)
        assert k < 2000, f"phase {until.name} was not reached"
        o = controller.step(k * DT, DT, read(y))
        seen.append((o, y))
        y = plant.step(k * DT, DT, Commands(p_WH_cmd=o.p_WH_cmd, yaw_cmd=o.yaw_cmd, sigma_cmd=o.sigma_cmd))
    return seen


def led(controller: IrReflex, ticks: Floats, rounds: int) -> list[Outputs]:
    """Return what is commanded to a hand that follows at once from the pre-grasp pose, while its sensors read alike."""
    x, made = (*PREGRASP, 0.0, 0.0), list[Outputs]()
    while len(made) < rounds and not (made and made[-1].phase is Phase.CLOSE):
        u = Inputs(ticks=ticks, p_WH=np.array(x[:2]), yaw=x[2], sigma=x[3])
        made.append(controller.step(len(made) * DT, DT, u))
        x = (*made[-1].p_WH_cmd.tolist(), made[-1].yaw_cmd, made[-1].sigma_cmd)
    return made


def ticks_at(*distances: float) -> Floats:
    """Return readings at distances, in m; 0 is out of sight."""
    return np.array([float(round(Params().calibration.ticks(d))) if d else 0.0 for d in distances])


def phases(seen: list[tuple[Outputs, Sensed]]) -> set[Phase]:
    return {o.phase for o, _ in seen}


def in_hand(y: Sensed) -> Floats:
    """The object's place in the hand's axes, in m."""
    c, s = math.cos(y.yaw), math.sin(y.yaw)
    return np.array([[c, s], [-s, c]]) @ (y.p_WO - y.p_WH)


def test_it_comes_to_the_object_in_less_than_two_thirds_of_the_papers_time():
    fast, paper = (grasp(reflex(correction=c), scene((0.03, -0.03))) for c in (Correction.FAST, Correction.PAPER))
    assert len(fast) < 0.67 * len(paper)
    assert DT * len(fast) < 4.0
    x, y = in_hand(fast[-1][1])
    assert 0.09 < x < 0.14
    assert abs(y) < 0.012


def test_an_object_that_is_carried_is_followed_and_gone_along_with_while_the_hand_closes():
    v = 0.030
    seen = grasp(reflex(), scene((0.0, -0.01), carry_velocity=np.array([0.0, v])), Phase.PULL)
    assert Phase.TRACK in phases(seen)
    closing = [(o, y) for o, y in seen if o.phase is Phase.CLOSE]
    assert np.linalg.norm(closing[0][1].p_WO - closing[0][1].p_ground - [0.0, -0.01]) < 2e-3
    gone = closing[-1][0].p_WH_cmd - closing[0][0].p_WH_cmd
    assert 0.4 * v < gone[1] / (DT * (len(closing) - 1)) < 1.5 * v
    assert closing[-1][1].touching >= 2
    at_rest = grasp(reflex(), scene((0.01, 0.0)), Phase.PULL)
    still = [o.p_WH_cmd for o, _ in at_rest if o.phase is Phase.CLOSE]
    assert np.linalg.norm(still[-1] - still[0]) < 5e-3


def test_an_object_off_to_the_side_is_found_by_the_search_across():
    p_WO = (0.04, -0.06)
    seen = grasp(reflex(), scene(p_WO))
    assert Phase.SEARCH in phases(seen)
    x, y = in_hand(seen[-1][1])
    assert 0.08 < x < 0.14
    assert abs(y) < 0.02
    blind = grasp(reflex(strategy=Strategy.FORWARD, forward_distance=0.055), scene(p_WO))
    assert abs(in_hand(blind[-1][1])[1]) > 0.05


@pytest.mark.parametrize("reach", [0.05, 0.15])
def test_where_nothing_is_it_searches_within_its_reach_and_closes_at_its_guess(reach: float):
    seen = grasp(reflex(fast_reach=np.array([reach, reach, 0.9])), scene((0.5, 0.35)))
    p = Params()
    commands = np.array([o.p_WH_cmd for o, _ in seen if o.phase is Phase.SEARCH]) - PREGRASP
    left, right = np.minimum(p.search_width, reach)
    assert np.max(commands[:, 1]) == pytest.approx(left, abs=1e-3)
    assert np.min(commands[:, 1]) == pytest.approx(-right, abs=1e-3)
    assert np.all(np.abs(commands) <= reach + 1e-9)
    assert seen[-1][0].stop is Stop.OUT_OF_SIGHT
    assert seen[-1][0].p_WH_cmd - PREGRASP == pytest.approx([min(p.search_guess, reach), 0.0])


def test_a_hand_whose_ways_change_nothing_pushes_and_stops():
    """The thumb reads the same wherever the hand goes, as if the object went along."""
    end, p = led(reflex(), ticks_at(0.012, 0.0, 0.040), 400)[-1], Params()
    assert end.stop is Stop.PUSHED
    assert abs(end.p_WH_cmd[1]) < 0.05 + p.push_limit
    assert end.p_WH_cmd[0] - PREGRASP[0] < p.path_limit


@pytest.mark.parametrize(("ticks", "side"), [(ticks_at(0.034, 0.0, 0.0), -1.0), (ticks_at(0.0, 0.058, 0.0), 1.0)])
def test_what_one_side_sees_as_far_off_on_the_way_ahead_is_gone_around(ticks: Floats, side: float):
    """As if a fingertip pushed it along: at the edge of sight it changes no other way of the hand."""
    p = Params()
    ahead, left = np.transpose([o.p_WH_cmd - PREGRASP for o in led(reflex(), ticks, 120)])
    turned = int(np.argmax(np.diff(ahead) < 0.0))
    assert ahead[turned] < p.along_limit + 3e-3
    back = turned + 1 + int(np.argmax(np.diff(ahead)[turned + 1 :] >= 0.0))
    assert ahead[turned] - ahead[back] == pytest.approx(p.along_back, abs=2e-3)
    assert side * (left[-1] - left[turned]) > 0.9 * p.along_across


def test_an_object_that_a_fingertip_is_felt_to_meet_is_gone_around():
    """It stands before the tip of the index, which does not see it."""
    p_WO = (0.0, 0.09)

    def pushed(touch_torque: float) -> tuple[float, Floats]:
        seen = grasp(reflex(touch_torque=touch_torque), scene(p_WO, thing=Thing.CYLINDER))
        return float(np.linalg.norm(seen[-1][1].p_WO - p_WO)), in_hand(seen[-1][1])

    (unfelt, _), (felt, place) = pushed(1.0), pushed(Params().touch_torque)
    assert unfelt > 0.015
    assert felt < min(0.010, 0.4 * unfelt)
    assert abs(place[1]) < 0.012


@pytest.mark.parametrize("way", [0.0, 0.04])
def test_the_hand_is_slow_on_the_last_part_of_its_way_to_the_pre_grasp_pose(way: float):
    seen = grasp(reflex(arrival_way=way), scene((0.5, 0.35)), Phase.SEARCH)
    left = PREGRASP[0] - np.array([y.p_WH[0] for _, y in seen])
    last = (-np.diff(left) / DT)[(left[1:] < 0.03) & (left[1:] > 0.015)]
    assert (np.max(last) < 1.1 * Params().arrival_speed) == (way > 0.0)
    there = reflex(sigma_pregrasp=0.1, arrival_way=0.0).step(0.0, DT, Inputs(p_WH=np.array(PREGRASP)))
    assert (there.phase, there.p_WH_cmd.tolist(), there.sigma_cmd) == (Phase.REACH, list(PREGRASP), 0.1)


@pytest.mark.parametrize(
    ("case", "signs", "phase"),
    [
        (Visibility.NONE, (-1, 0), Phase.SEARCH),  # a search begins a step behind
        (Visibility.THUMB, (1, -1), Phase.RECOVER),
        (Visibility.INDEX, (1, 1), Phase.RECOVER),
        (Visibility.RING, (1, 1), Phase.RECOVER),
        (Visibility.INDEX_RING, (1, 1), Phase.RECOVER),
        (Visibility.THUMB_INDEX, (1, 1), Phase.RECOVER),
        (Visibility.THUMB_RING, (1, 0), Phase.TRACK),
    ],
)
def test_each_case_of_figure_9_moves_the_hand_at_once(case: Visibility, signs: tuple[int, int], phase: Phase):
    """To the side that sees the object near, and ahead; between both sides, ahead only, and closing."""
    near = (0.030, 0.050, 0.030)  # the index looks farther ahead
    o = led(reflex(), ticks_at(*(d if case & (1 << i) else 0.0 for i, d in enumerate(near))), 3)[-1]
    ahead, left = o.p_WH_cmd - PREGRASP
    assert (o.case, o.phase) == (case, phase)
    assert ahead * signs[0] > 1e-5
    assert (0.0 if abs(left) < 0.2 * abs(ahead) else math.copysign(1.0, left)) == signs[1]


def test_a_reading_beyond_the_range_is_not_seen_and_weighs_nothing():
    p, commands = Params(), list[list[float]]()
    for beyond in (0.0, math.floor(p.calibration.ticks(p.distance_max)) - 1.0):
        controller = reflex(ambient_rounds=0)  # else two such readings from the first are taken for ambient light
        ticks = np.array([beyond, beyond, round(p.calibration.ticks(0.02))])
        o = [controller.step(k * DT, DT, Inputs(ticks=ticks, p_WH=np.array(PREGRASP))) for k in range(5)][-1]
        assert (o.case, o.phase) == (Visibility.RING, Phase.RECOVER)
        commands.append([*o.p_WH_cmd.tolist(), o.yaw_cmd, o.sigma_cmd])
    assert commands[0] == commands[1]


def test_contact_closes_when_joints_or_tendon_feel_the_object_between_the_fingers():
    numb = {"touch_torque": 100.0}
    for given, p_WO, stop in (
        ({}, (0.01, 0.02), Stop.CONTACT),
        (numb, (0.01, 0.02), Stop.REACH),
        (numb, (0.01, 0.06), Stop.CONTACT),  # by the tendon
        ({}, (0.5, 0.35), Stop.REACH),
    ):
        seen = grasp(reflex(strategy=Strategy.CONTACT, **given), scene(p_WO))
        o, y = seen[-1]
        assert o.stop is stop
        assert not {Phase.TRACK, Phase.SEARCH, Phase.PROBE} & phases(seen)
        assert given or (y.touching > 0) == (p_WO[0] < 0.1)
    assert o.p_WH_cmd[0] - PREGRASP[0] >= Params().reach[0] - 1e-3


@pytest.mark.parametrize(
    ("given", "p_WO", "thing", "met"),
    [
        ({}, (0.045, 0.075), {}, {Phase.SEARCH, Phase.RECOVER, Phase.TRACK, Phase.CLOSE, Phase.SHAKE, Phase.DONE}),
        (QUICK, (0.0, 0.006), SMALL, {Phase.SEARCH, Phase.RECOVER, Phase.CLOSE}),  # pushed along, and gone around
        ({"strategy": Strategy.CONTACT}, (0.045, 0.075), {}, {Phase.APPROACH, Phase.CLOSE}),
    ],
)
def test_it_goes_on_from_any_state_bit_for_bit(
    given: dict[str, Any], p_WO: tuple[float, float], thing: dict[str, Any], met: set[Phase]
):
    seen = grasp(reflex(**given), scene(p_WO, **thing), Phase.DONE if Phase.DONE in met else Phase.CLOSE)
    assert met <= phases(seen)
    assert_passed_on(lambda: reflex(**given), [read(y) for _, y in seen], 12, DT)


def test_what_the_correction_on_the_move_cannot_work_with_is_refused(wording: Wording):
    refused: tuple[dict[str, Any], ...] = (
        {"literal": True},
        {"feed": 0.0},
        {"weight": np.array([1.0, 1.0, 0.0])},
        {"sigma_limit": 0.8},
    )
    for given in refused:
        with pytest.raises(InvalidReflexParameters) as caught:
            reflex(**given)
        wording.check(caught.value)
        reflex(correction=Correction.PAPER, **given)


def test_a_grasp_begins_with_the_jacobian_of_the_last_one():
    first = reflex()
    assert not np.any(first.outputs(0.0, Inputs()).jacobian_offset)
    learnt = grasp(first, scene((0.03, 0.02)))[-1][0].jacobian_offset
    assert np.max(np.abs(learnt[[0, 2]])) > 0.02  # what thumb and ring saw was not met squarely
    second = reflex(jacobian_offset_0=learnt)
    assert np.array_equal(second.outputs(0.0, Inputs()).jacobian_offset, learnt)
    o, y = grasp(second, scene((0.03, 0.02)))[-1]
    assert not np.array_equal(o.jacobian_offset, learnt)
    assert np.linalg.norm(in_hand(y)) < 0.2


@pytest.mark.slow
def test_ambient_light_is_not_taken_for_an_object():
    in_the_dark, *in_light = (grasp(reflex(), scene((0.02, 0.03), ambient=light)) for light in (0.0, 100.0, 1500.0))
    for seen in in_light:
        assert seen[-1][0].stop is in_the_dark[-1][0].stop
        assert in_hand(seen[-1][1]) == pytest.approx(in_hand(in_the_dark[-1][1]), abs=2e-3)


def test_what_several_fingers_see_at_the_start_is_ambient_light_and_what_one_sees_is_not():
    bright, one = [1500.0] * 3, [0.0, 900.0, 3.0]
    for given, ticks, case in (
        ({}, bright, Visibility.NONE),
        ({"ambient_rounds": 0}, bright, Visibility.ALL_SEEN),
        ({}, one, Visibility.INDEX),
    ):
        controller, u = reflex(**given), Inputs(ticks=np.array(ticks), p_WH=np.array(PREGRASP))
        assert [controller.step(k * DT, DT, u) for k in range(10)][-1].case is case
