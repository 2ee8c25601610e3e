"""The plan of a study: the shipped one is the thesis's, and all that is wrong with another is reported at once."""

from pathlib import Path

import pytest
from support.wording import Wording

from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.study.plan.led_hands import hand_faults
from handover.scenarios.study.plan.plan import InvalidPlan, default_plan, parse_plan, read_plan


def faults_of(*changes: tuple[str, str]) -> tuple[str, ...]:
    """Return the faults of the shipped plan with texts replaced by others."""
    text = default_plan()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    with pytest.raises(InvalidPlan) as e:
        parse_plan(text)
    return e.value.faults


def test_the_shipped_plan_is_the_thesis_study():
    plan, thesis = parse_plan(default_plan()), paper_values("free_flyer", "published")
    english = plan.texts["en"]
    assert [english.statements[name] for name in ("S1", "S2", "S3")] == thesis["statements"]
    assert list(plan.scale) == thesis["rating_scale"]
    assert plan.practice == thesis["practice"]
    assert plan.latency_limit == 1000 * thesis["interface_delay"]
    assert plan.rounds == 12
    assert plan.repetitions * 10 == thesis["trials"]
    assert list(plan.tasks) == ["robot_to_human", "human_to_robot", "collaborative"]
    assert len(plan.conditions) == 6
    assert not plan.pilot


def test_each_condition_runs_its_scenario_with_its_behaviour():
    plan = parse_plan(default_plan())
    for condition in plan.conditions:
        parameters = parse_parameters(SCENARIOS[condition.scenario], condition.given)
        assert parameters.behaviour.item == condition.behaviour
        assert condition.scenario == f"flyer_{condition.task}"


def test_parameters_of_all_of_a_task_and_of_a_condition_add_up_and_the_narrower_comes_first():
    text = default_plan().replace(
        '[tasks.human_to_robot]\nscenario = "flyer_human_to_robot"',
        "[parameters]\nskill = 0.5\ngradual = true\n"
        '[tasks.human_to_robot]\nscenario = "flyer_human_to_robot"\nparameters = { skill = 0.7 }\n'
        "rigid = { p_WG_handover = [0.0, -0.1, 0.0] }",
    )
    plan = parse_plan(text)
    narrow = plan.condition("human_to_robot", "rigid").parameters
    assert narrow == {"skill": "0.7", "gradual": "true", "behaviour": "rigid", "p_WG_handover": "0.0,-0.1,0.0"}
    assert plan.condition("human_to_robot", "compliant").parameters["skill"] == "0.7"
    assert plan.condition("collaborative", "rigid").parameters["skill"] == "0.5"
    with pytest.raises(KeyError):
        plan.condition("human_to_robot", "soft")


def test_all_faults_are_reported_at_once(wording: Wording):
    of_types = faults_of(
        ("seed = 2020", "sed = 2020"),
        ("practice = 600", 'practice = "long"'),
        ('kind = "text"', 'kind = "txt"'),
        ('language = "English"', "language = 1979-05-27"),
    )
    together = faults_of(
        ("highest = 9", "highest = 1"),
        ('behaviour = "rigid"', 'behaviour = "rigd"'),
        ('S2 = "I was', 'S22 = "I was'),
        ('"mouse", ', '"mose", '),
    )
    assert (len(of_types), len(together)) == (5, 7)
    wording.check("\n".join(of_types))
    wording.check("\n".join(together))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("title = ", "title = 3 #"),
        ("pilot = false", "pilot = 0"),
        ('["S1", "S2", "S3"]', "[]"),
        ('["S1", "S2", "S3"]', '["S1", "S1"]'),
        ('"gamepad", ', '"script", '),
        ('"flyer_collaborative"', '"flyer_colaborative"'),
        ("[behaviours.compliant]", "[behaviours.rigid.compliant]"),
        ("[behaviours.compliant]", "[behaviours.soft]\nskill = 1\n[behaviours.compliant]"),
        ("[behaviours.compliant]", "[behaviours.scenario]"),
        ("[tasks.human_to_robot]", '[tasks."a b"]'),
        ("[tasks.human_to_robot]", "[tasks.human_to_robot]\nrigd = {}"),
        ('"not_said"]\n\n[[', '"not_said", "mars"]\n\n[['),
        ('"18-20", "21-30"', '"18-20", "18-20"'),
        ("age_group", "participant"),
        ("participants = 18", "participants = nan"),
        ("practice = 600", "practice = inf"),
        ('behaviour = "compliant"', 'bahaviour = "compliant"'),
        ('S3"]', 'S3"'),
    ],
)
def test_a_bad_plan_is_refused_with_the_reason(old: str, new: str, wording: Wording):
    wording.check("\n".join(faults_of((old, new))))


def test_a_pilot_study_may_be_driven_by_scripts():
    plan = parse_plan(default_plan().replace("pilot = false", "pilot = true").replace('"mouse", ', '"script", '))
    assert plan.pilot
    assert "script" in plan.devices


def test_a_file_that_is_no_plan_is_refused(tmp_path: Path, wording: Wording):
    (tmp_path / "no_text.toml").write_bytes(b"\xff\xfe")
    for name in ("none.toml", "no_text.toml"):
        with pytest.raises(InvalidPlan) as refused:
            read_plan(tmp_path / name)
        wording.check(refused.value)


def test_a_plan_in_whose_rounds_nobody_can_lead_a_hand_is_reported(wording: Wording):
    faults = hand_faults(parse_plan(default_plan().replace('"flyer_robot_to_human"', '"flyer_two_robots"')))
    assert len(faults) == 2
    wording.check("\n".join(faults))


def test_a_plan_may_begin_with_a_byte_order_mark(tmp_path: Path):
    (tmp_path / "plan.toml").write_text("\ufeff" + default_plan(), encoding="utf-8")
    assert read_plan(tmp_path / "plan.toml") == parse_plan(default_plan())
