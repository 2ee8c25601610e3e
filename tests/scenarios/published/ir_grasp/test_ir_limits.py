"""The experiment `ir-limits`: what it runs, and what it makes of made-up results."""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import pytest
from support.scenarios.made_tables import empty, made_table, one
from support.wording import Wording

from handover.controllers.ir_grasp.ir_reflex import IrReflex
from handover.cosim.blocks.description import describe
from handover.plants.ir_grasp.objects import is_held_out
from handover.plants.ir_grasp.scene import GraspScene
from handover.scenarios.published.ir_grasp.ir_limits import IrLimits
from handover.scenarios.published.ir_grasp.limits_axes import (
    ARMS,
    AXES,
    BLIND,
    CONTACT,
    FORWARD_35,
    FORWARD_55,
    PAPER,
    PARAMETERS,
    REFLEX,
    Axis,
)
from handover.scenarios.published.ir_grasp.limits_results import Comparison, LimitRuns, sentence_of_worth
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.runs.campaign.plan import PlannedRun
from handover.scenarios.runs.campaign.table import CampaignTable

WITHOUT = tuple(arm for arm in ARMS if not arm.looks)
UNITS = {"scene": GraspScene, "reflex": IrReflex}


def axis(key: str) -> Axis:
    return next(axis for axis in AXES if axis.key == key)


@cache
def planned(quick: bool) -> Sequence[PlannedRun]:
    return IrLimits().plan(quick).runs()


def limits_table(
    succeeds: Callable[[PlannedRun], bool],
    quick: bool = False,
    pushed: Callable[[PlannedRun], float] = lambda _run: 0.0,
) -> CampaignTable:
    """Return a table of the plan, in which runs succeed, and have pushed the object (m), as given."""
    return made_table(
        {"run": run.name, "seed": run.seed, "status": "done", "success": succeeds(run)}
        | {name: run.parameters.get(name) for name in PARAMETERS}
        | {"displacement": pushed(run), "refinement_time": 2.0}
        for run in planned(quick)
    )


def succeeds(run: PlannedRun) -> bool:
    """The reflex holds all; hands that do not look hold what is nominal, or moved away by less than 60 mm.

    The paper's algorithm fails in the dark.
    """
    p = run.parameters
    if p.get("scene.reflectivity") == "0.2" and p.get("correction") == "paper":
        return False
    return p["strategy"] == "reflex" or p.get("shift") in (None, "0.02,0", "0.04,0")


@pytest.fixture(scope="module")
def runs() -> LimitRuns:
    return IrLimits().results(limits_table(succeeds))


@pytest.fixture(scope="module")
def claims() -> Sequence[Claim]:
    return IrLimits().claims(limits_table(succeeds))


def test_what_is_set_of_units_is_a_parameter_of_theirs():
    own = {f"{unit}.{v.name}" for unit, block in UNITS.items() for v in describe(block).parameters}
    assert {name for name in PARAMETERS if "." in name} <= own


def test_ways_share_their_scenes_and_objects_and_levels_do_not():
    plan = IrLimits().plan(quick=False)
    of_arms = {name for arm in ARMS for name in arm.parameters}
    of_sensors = {"scene.reflectivity", "scene.ambient", "scene.sensor_tolerance"}  # their levels share scenes
    scenes: dict[int, set[frozenset[tuple[str, str]]]] = {}
    arms: dict[int, set[str]] = {}
    for run in plan.runs():
        scene = frozenset((n, v) for n, v in run.parameters.items() if n not in of_arms | of_sensors)
        scenes.setdefault(run.seed, set()).add(scene)
        arms.setdefault(run.seed, set()).add(run.parameters["strategy"])
    assert all(len(found) == 1 for found in scenes.values())
    assert all(found >= {"reflex", "forward", "contact"} for found in arms.values())
    different = set[frozenset[tuple[str, str]]]().union(*scenes.values())
    assert len(scenes) == plan.repetitions * len(different)


def test_objects_that_are_held_out_are_drawn_alone():
    drawn = [point for axis in AXES for point in axis.scenes if point["thing"] == "drawn"]
    assert drawn
    assert all(is_held_out(int(point["thing_seed"])) for point in drawn)


def test_every_arm_has_runs_at_every_level_of_its_axes_and_in_the_quick_plan_at_the_hardest(runs: LimitRuns):
    quick = IrLimits().results(limits_table(succeeds, quick=True))
    for along in AXES:
        for arm in (arm for arm in ARMS if arm.meets(along)):
            assert {runs.count(arm, along, (level,))[1] for level in along.all_levels} == {3 * len(along.scenes)}
            assert quick.count(arm, along, along.levels[-1:])[1] == 1
    assert {len(along.scenes) for along in AXES if along.blind_alike or along.key == "speed"} == {12}
    assert {axis.key for axis in AXES if BLIND.meets(axis)} == set(BLIND.axes)
    assert {key for arm in ARMS for key in arm.axes} <= {axis.key for axis in AXES}


def test_light_makes_no_difference_to_hands_that_do_not_look(runs: LimitRuns):
    dark = axis("dark")
    assert runs.of(CONTACT, dark, dark.levels[:1]).rows == runs.of(CONTACT, dark, dark.all_levels[:1]).rows
    assert runs.of(PAPER, dark, dark.levels[:1]).rows != runs.of(PAPER, dark, dark.all_levels[:1]).rows


def test_an_arm_falls_below_one_half_between_levels_and_the_best_way_is_that_which_held_most(runs: LimitRuns):
    assert runs.half(REFLEX, axis("away")) == "not within the range"
    assert runs.half(FORWARD_55, axis("away")) == "50 mm"  # all at 40, none at 60
    assert runs.half(FORWARD_55, axis("towards")) == "10 mm"

    def held(run: PlannedRun) -> bool:
        contact = run.parameters["strategy"] == "contact" and "reflex.touch_torque" not in run.parameters
        return contact and run.repetition == 0

    few = IrLimits().results(limits_table(held))
    assert few.half(BLIND, axis("towards")) == "from the start"
    assert few.half(BLIND, axis("away")) == ""  # not tried
    assert few.half(CONTACT, axis("bar")) == "at 60 mm or before"
    best = {c.axis.key: c.best for c in few.compared(REFLEX, WITHOUT)}
    assert best["away"] is best["turn"] is CONTACT


def test_looking_is_worth_it_where_pairs_differ_by_enough_and_costs_where_they_do_in_reverse(
    runs: LimitRuns, wording: Wording
):
    compared = runs.compared(REFLEX, WITHOUT)
    worth = {c.axis.key: c for c in compared}
    assert (worth["towards"].verdict, worth["towards"].gain) == ("worth it", 1.0)
    assert (worth["towards"].only_first, worth["towards"].only_second) == (60, 0)
    assert worth["towards"].p == pytest.approx(len(worth) * 2.0**-59, rel=1e-6)  # as McNemar's of 60 pairs, by Holm
    assert worth["turn"].verdict == "no difference shown"
    worse = IrLimits().results(limits_table(lambda run: run.parameters["strategy"] == "forward"))
    found = worse.compared(REFLEX, (FORWARD_35, FORWARD_55))
    assert {c.verdict for c in found} == {"costs"}
    for axes in (compared, found, []):
        wording.check(sentence_of_worth(axes))


def test_levels_of_one_scene_are_not_taken_for_independent():
    """A hand that does not look fails in three scenes, at whose six levels the reflex holds all."""
    curve = axis("curve")

    def held(run: PlannedRun) -> bool:
        p = run.parameters
        fails = p["thing"] == "cylinder" and p["perturbed"] == "true" and "shift_least" not in p
        return p["strategy"] == "reflex" or not fails

    found = IrLimits().results(limits_table(held))
    (compared,) = (c for c in found.compared(REFLEX, WITHOUT) if c.axis is curve)
    assert compared.first == (6 * 36, 6 * 36)
    assert compared.second == (33, 36)  # each run once
    assert (compared.only_first, compared.only_second) == (3, 0)
    assert compared.verdict == "no difference shown"


def test_fifteen_points_count_as_such():
    """57 of 60 less 48 of 60, in which binary fractions differ from 0.15."""
    c = Comparison(axis("away"), (57, 60), CONTACT, (48, 60), 9, 0, 0.001)
    assert c.verdict == "worth it"


def verdicts(claims: Sequence[Claim]) -> list[Verdict]:
    """Return those on what looking is worth, by success and by success without a push, and on pushing itself."""
    worth = [c for c in claims if c.claim.startswith("On at least 4 axes")]
    without = "does not look, counting what was pushed by at most 15 mm."
    assert [c.claim.endswith(without) for c in worth] == [False, True]
    return [c.verdict for c in (*worth, one(claims, "Before it closes"))]


def test_looking_is_worth_it_on_four_axes_and_one_curve_is_refuted_by_grasps_that_fail_in_the_dark(
    claims: Sequence[Claim],
):
    assert verdicts(claims) == [Verdict.REPRODUCED] * 3
    dark = one(claims, "One calibration curve")
    assert (dark.verdict, dark.beyond, dark.where) == (Verdict.NOT_REPRODUCED, False, "sec. V-B")
    assert one(claims, "One curve is enough for all sensors").verdict is Verdict.REPRODUCED


@pytest.mark.parametrize(
    ("by_reflex", "by_others", "expected"),
    [
        (0.001, 0.016, [False, True, True]),
        pytest.param(0.001, 0.014, [False, False, True], marks=pytest.mark.slow),
        pytest.param(0.016, 0.001, [False, False, False], marks=pytest.mark.slow),
    ],
)
def test_a_hand_that_pushes_what_it_takes_is_outdone_where_that_counts(
    by_reflex: float, by_others: float, expected: list[bool]
):
    pushing = limits_table(
        lambda _run: True, pushed=lambda run: by_reflex if run.parameters["strategy"] == "reflex" else by_others
    )
    assert [v is Verdict.REPRODUCED for v in verdicts(IrLimits().claims(pushing))] == expected
    runs = IrLimits().results(pushing, pushed_most=0.015)
    for arm, push in ((REFLEX, by_reflex), (CONTACT, by_others)):
        assert runs.count(arm, axis("away"), axis("away").levels) == (60 if push < 0.015 else 0, 60)


def test_without_runs_there_are_neither_verdicts_nor_figures(tmp_path: Path):
    nothing = empty(limits_table(succeeds, quick=True))
    assert {c.verdict for c in IrLimits().claims(nothing)} == {Verdict.NOT_COMPARABLE}
    assert [len(t.rows) for t in IrLimits().tables(nothing)] == [0, 0, 0, 0, 0]
    assert IrLimits().draw(nothing, tmp_path, tmp_path) == []
