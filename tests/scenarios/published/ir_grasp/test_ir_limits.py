"""The experiment `ir-limits`: what it runs, and what it makes of made-up results."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from support.scenarios.limits_table import limits_table

from handover.controllers.ir_grasp.ir_reflex import IrReflex
from handover.cosim.blocks.description import describe
from handover.plants.ir_grasp.objects import is_held_out
from handover.plants.ir_grasp.scene import GraspScene
from handover.scenarios.campaign.plan import PlannedRun
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp
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

WITHOUT = tuple(arm for arm in ARMS if not arm.looks)


def axis(key: str) -> Axis:
    return next(axis for axis in AXES if axis.key == key)


def succeeds(run: PlannedRun) -> bool:
    """The reflex holds all; hands that do not look hold what is nominal, or moved away by less than 60 mm.

    The paper's algorithm fails in the dark.
    """
    p = run.parameters
    if p.get("scene.reflectivity") == "0.2" and p.get("correction") == "paper":
        return False
    return p["strategy"] == "reflex" or p.get("shift") in (None, "0.02,0", "0.04,0")


@pytest.fixture(scope="module")
def table() -> CampaignTable:
    return limits_table(succeeds)


@pytest.fixture(scope="module")
def runs(table: CampaignTable) -> LimitRuns:
    return LimitRuns(table)


@pytest.fixture(scope="module")
def claims(table: CampaignTable) -> Sequence[Claim]:
    return IrLimits().claims(table)


def one(claims: Sequence[Claim], begin: str) -> Claim:
    (found,) = (claim for claim in claims if claim.claim.startswith(begin))
    return found


def test_no_point_is_run_twice():
    points = IrLimits().plan(quick=False).points
    assert len({frozenset(p.items()) for p in points}) == len(points)


def test_every_point_is_one_that_the_scenario_takes():
    points = [point for axis in AXES for level in axis.all_levels for point in axis.settings(level)]
    texts = {tuple(f"{name}={value}" for name, value in point.items() if "." not in name) for point in points}
    assert all(not parse_parameters(IrGrasp, given).faults() for given in texts)
    of_units = {name for name in PARAMETERS if "." in name}
    units = {"scene": describe(GraspScene), "reflex": describe(IrReflex)}
    own = {f"{unit}.{variable.name}" for unit, description in units.items() for variable in description.parameters}
    assert of_units <= own
    assert all(
        not parse_parameters(IrGrasp, [f"{n}={v}" for n, v in arm.parameters.items() if "." not in n]).faults()
        for arm in ARMS
    )


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


def test_every_arm_has_runs_at_every_level_of_its_axes(runs: LimitRuns):
    for along in AXES:
        for level in along.all_levels:
            counts = {runs.count(arm, along, (level,))[1] for arm in ARMS if arm.meets(along)}
            assert counts == {3 * len(along.scenes)}, (along.key, level)
    assert {len(along.scenes) for along in AXES if along.blind_alike or along.key == "speed"} == {12}
    assert {axis.key for axis in AXES if not BLIND.meets(axis)} == {axis.key for axis in AXES} - set(BLIND.axes)
    assert {key for arm in ARMS for key in arm.axes} <= {axis.key for axis in AXES}


def test_light_makes_no_difference_to_hands_that_do_not_look(runs: LimitRuns):
    dark = axis("dark")
    assert runs.rows(CONTACT, dark, dark.levels[:1]) == runs.rows(CONTACT, dark, dark.all_levels[:1])
    assert runs.rows(PAPER, dark, dark.levels[:1]) != runs.rows(PAPER, dark, dark.all_levels[:1])


def test_the_quick_plan_tries_every_arm_at_the_hardest_level_of_every_axis():
    found = LimitRuns(limits_table(succeeds, quick=True))
    tried = [(arm, along) for arm in ARMS for along in AXES if arm.meets(along)]
    assert all(found.count(arm, along, along.levels[-1:])[1] == 1 for arm, along in tried)


def test_where_an_arm_falls_below_one_half_lies_between_levels(runs: LimitRuns):
    assert runs.half(REFLEX, axis("away")) == "not within the range"
    assert runs.half(FORWARD_55, axis("away")) == "50 mm"  # all at 40, none at 60
    assert runs.half(FORWARD_55, axis("towards")) == "10 mm"
    never = LimitRuns(limits_table(lambda run: run.parameters["strategy"] == "reflex"))
    assert never.half(BLIND, axis("towards")) == "from the start"
    assert never.half(BLIND, axis("away")) == ""  # not tried
    assert never.half(CONTACT, axis("bar")) == "at 60 mm or before"


def test_the_best_way_without_looking_is_that_which_held_most():
    def held(run: PlannedRun) -> bool:
        contact = run.parameters["strategy"] == "contact" and "reflex.touch_torque" not in run.parameters
        return contact and run.repetition == 0

    best = {c.axis.key: c.best for c in LimitRuns(limits_table(held)).compared(REFLEX, WITHOUT)}
    assert best["away"] is CONTACT
    assert best["turn"] is CONTACT


def test_looking_is_worth_it_where_pairs_differ_by_enough_and_costs_where_they_do_in_reverse(runs: LimitRuns):
    worth = {c.axis.key: c for c in runs.compared(REFLEX, WITHOUT)}
    assert (worth["towards"].verdict, worth["towards"].gain) == ("worth it", 1.0)
    assert (worth["towards"].only_first, worth["towards"].only_second) == (60, 0)
    assert worth["towards"].p == pytest.approx(len(worth) * 2.0**-59, rel=1e-6)  # as McNemar's of 60 pairs, by Holm
    assert worth["turn"].verdict == "no difference shown"
    worse = LimitRuns(limits_table(lambda run: run.parameters["strategy"] == "forward"))
    found = worse.compared(REFLEX, (FORWARD_35, FORWARD_55))
    assert {c.verdict for c in found} == {"costs"}
    assert sentence_of_worth(found).startswith("Looking is nowhere shown to hold 15 points more")


def test_the_sentence_names_the_axes_from_the_greatest_gain_on(runs: LimitRuns):
    sentence = sentence_of_worth(runs.compared(REFLEX, WITHOUT))
    begin = "Looking holds more than the best way without, by 15 points or more, where the object is moved towards"
    assert sentence.startswith(begin)
    assert "moved away from the hand (+50)" in sentence
    assert "neither is shown: " in sentence
    assert sentence_of_worth([]) == "No axis was tried both with and without looking."


def test_levels_of_one_scene_are_not_taken_for_independent():
    """A hand that does not look fails in three scenes, at whose six levels the reflex holds all."""
    curve = axis("curve")

    def held(run: PlannedRun) -> bool:
        p = run.parameters
        fails = p["thing"] == "cylinder" and p["perturbed"] == "true" and "shift_least" not in p
        return p["strategy"] == "reflex" or not fails

    found = LimitRuns(limits_table(held))
    (compared,) = (c for c in found.compared(REFLEX, WITHOUT) if c.axis is curve)
    assert compared.first == (6 * 36, 6 * 36)
    assert compared.second == (33, 36)  # each run once
    assert (compared.only_first, compared.only_second) == (3, 0)
    assert compared.verdict == "no difference shown"


def test_fifteen_points_count_as_such():
    """57 of 60 less 48 of 60, in which binary fractions differ from 0.15."""
    c = Comparison(axis("away"), (57, 60), CONTACT, (48, 60), 9, 0, 0.001)
    assert c.verdict == "worth it"


def worth_claims(claims: Sequence[Claim]) -> list[Verdict]:
    """Return the verdicts on what looking is worth: by success, and by success without a push."""
    both = [c for c in claims if c.claim.startswith("On at least 4 axes")]
    assert [c.claim.endswith("does not look, counting what was pushed by at most 15 mm.") for c in both] == [
        False,
        True,
    ]
    return [c.verdict for c in both]


def test_that_looking_is_worth_it_takes_four_axes(claims: Sequence[Claim]):
    assert worth_claims(claims) == [Verdict.REPRODUCED, Verdict.REPRODUCED]
    alike = IrLimits().claims(limits_table(lambda _run: True))
    assert worth_claims(alike) == [Verdict.NOT_REPRODUCED, Verdict.NOT_REPRODUCED]


@pytest.mark.slow
@pytest.mark.parametrize(("push", "verdict"), [(0.014, Verdict.NOT_REPRODUCED), (0.016, Verdict.REPRODUCED)])
def test_a_hand_that_pushes_what_it_takes_is_outdone_where_that_counts(push: float, verdict: Verdict):
    pushing = limits_table(
        lambda _run: True, pushed=lambda run: 0.001 if run.parameters["strategy"] == "reflex" else push
    )
    assert worth_claims(IrLimits().claims(pushing)) == [Verdict.NOT_REPRODUCED, verdict]
    runs = LimitRuns(pushing, pushed_most=0.015)
    assert runs.count(REFLEX, axis("away"), axis("away").levels) == (60, 60)
    assert runs.count(CONTACT, axis("away"), axis("away").levels) == (60 if push < 0.015 else 0, 60)


def test_one_curve_for_all_materials_is_refuted_by_grasps_that_fail_in_the_dark(claims: Sequence[Claim]):
    dark = one(claims, "One calibration curve")
    assert (dark.verdict, dark.beyond, dark.where) == (Verdict.NOT_REPRODUCED, False, "sec. V-B")
    assert one(claims, "One curve is enough for all sensors").verdict is Verdict.REPRODUCED


def test_pushing_is_judged_by_median_and_most(claims: Sequence[Claim]):
    assert one(claims, "Before it closes").verdict is Verdict.REPRODUCED
    pushed = IrLimits().claims(limits_table(succeeds, displacement=0.016))
    assert one(pushed, "Before it closes").verdict is Verdict.NOT_REPRODUCED


@pytest.mark.slow
def test_figures_are_left_as_png_and_svg(table: CampaignTable, tmp_path: Path):
    names = {figure.name for figure in IrLimits().draw(table, tmp_path, tmp_path)}
    assert names == {"limits", "limits_displacement"}
    assert {p.name for p in tmp_path.iterdir()} == {f"{n}.{s}" for n in names for s in ("png", "svg")}


def test_without_runs_there_are_neither_verdicts_nor_figures(table: CampaignTable, tmp_path: Path):
    empty = CampaignTable(table.table.slice(0, 0))
    assert {c.verdict for c in IrLimits().claims(empty)} == {Verdict.NOT_COMPARABLE}
    assert [len(t.rows) for t in IrLimits().tables(empty)] == [0, 0, 0, 0, 0]
    assert IrLimits().draw(empty, tmp_path, tmp_path) == []
