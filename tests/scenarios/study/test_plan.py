"""The plan of a study: the shipped one is the thesis's, and all that is wrong with another is told at once."""

from pathlib import Path

import pytest

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


def test_an_unknown_task_is_told_with_the_nearest():
    [fault] = faults_of(('"flyer_collaborative"', '"flyer_colaborative"'))
    assert fault.startswith("tasks.collaborative.scenario: no scenario 'flyer_colaborative'; did you mean flyer_coll")


def test_all_faults_are_told_at_once():
    faults = faults_of(
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
    assert (len(faults), len(together)) == (5, 7)
    shown = "\n".join(faults + together)
    for part in (
        "sed: no such key; did you mean seed",
        "seed: it is missing; expected a whole number from 0",
        "practice: it is 'long'; expected a number from 0 to 7200",
        "scale: its highest, 1, is not above its lowest, 1",
        "tasks.robot_to_human, rigid: behaviour: 'rigd' is none of rigid, compliant",
        "text.en.statements.S2: it is missing",
        "text.en.statements.S22: no such key; did you mean S2",
        "devices: no device 'mose'; did you mean mouse?",
        "text.en.language: it is datetime.date(1979, 5, 27); expected a non-empty string",
        "questions[3].kind: it is 'txt'; expected 'choice' or 'text'",
    ):
        assert part in shown


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (("title = ", "title = 3 #"), "title: it is 3; expected a non-empty string"),
        (("pilot = false", "pilot = 0"), "pilot: it is 0; expected true or false"),
        (('["S1", "S2", "S3"]', "[]"), "statements: it is []; expected a list of non-empty strings"),
        (('["S1", "S2", "S3"]', '["S1", "S1"]'), "statements: a name is given twice"),
        (('"gamepad", ', '"script", '), "devices: 'script' is no person's; pilot = true is of scripted pilots"),
        (("[behaviours.compliant]", "[behaviours.rigid.compliant]"), "behaviours.rigid.compliant: it is {"),
        (
            ("[behaviours.compliant]", "[behaviours.soft]\nskill = 1\n[behaviours.compliant]"),
            "behaviours: two are compared",
        ),
        (
            ("[behaviours.compliant]", "[behaviours.scenario]"),
            "behaviours.scenario: that is what a task's own",
        ),
        (("[tasks.human_to_robot]", '[tasks."a b"]'), "tasks.a b: it is 'a b'; expected a name of letters, digits"),
        (('"not_said"]\n\n[[', '"not_said", "mars"]\n\n[['), "text.en.choices.age_group: 7 texts for 8 choices"),
        (("participants = 18", "participants = nan"), "participants: it is nan; expected a whole number from 1 to 999"),
        (("practice = 600", "practice = nan"), "practice: it is nan; expected a number from 0 to 7200"),
        (
            ("[tasks.human_to_robot]", "[tasks.human_to_robot]\nrigd = {}"),
            "tasks.human_to_robot.rigd: no such key; did",
        ),
        (("practice = 600", "practice = inf"), "practice: it is inf; expected a number from 0 to 7200"),
        (('behaviour = "compliant"', 'bahaviour = "compliant"'), "has no parameter 'bahaviour'; did you mean behav"),
        (('S3"]', 'S3"'), "it is not TOML"),
    ],
)
def test_a_bad_plan_is_refused_with_the_reason(change: tuple[str, str], fault: str):
    assert any(fault in told for told in faults_of(change))


def test_a_pilot_study_may_be_driven_by_scripts():
    plan = parse_plan(default_plan().replace("pilot = false", "pilot = true").replace('"mouse", ', '"script", '))
    assert plan.pilot
    assert "script" in plan.devices


def test_a_file_that_is_no_plan_is_told(tmp_path: Path):
    with pytest.raises(InvalidPlan, match="there is no such file"):
        read_plan(tmp_path / "plan.toml")
    (tmp_path / "plan.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(InvalidPlan, match="it is not text in UTF-8"):
        read_plan(tmp_path / "plan.toml")


def test_a_plan_in_whose_rounds_nobody_can_lead_a_hand_is_told():
    plan = parse_plan(default_plan().replace('"flyer_robot_to_human"', '"flyer_two_robots"'))
    (rigid, compliant) = hand_faults(plan)
    assert rigid.startswith("tasks.robot_to_human, rigid: in flyer_two_robots nobody outside can lead a hand")
    assert compliant.startswith("tasks.robot_to_human, compliant: ")
