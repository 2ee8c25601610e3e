"""The plan of a user study, PLAN.toml: tasks, behaviours, rounds, statements, questions, and all that people read.

`handover study new` writes one that is the thesis's study, [Fernandes2020] ch. 5. A plan is checked whole before
anything starts: every fault of it is told at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import tomli

from handover.cosim.exceptions import nearest, one_line
from handover.cosim.files import read_regular
from handover.scenarios.catalog import SCENARIOS, InvalidScenario, installed_scenarios, named_scenario
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.study.plan.plan_table import PlanTable

DEVICES: Mapping[str, str] = {
    "mouse": "mouse and keyboard",
    "touch": "touch screen",
    "gamepad": "gamepad",
    "webcam": "hand followed by a webcam",
    "tracker": "hand tracker, such as a Leap Motion",
    "script": "scripted pilot, no person",
}
"""What may move the hand, by the name in a plan."""

TRACKER = "tracker"
"""The device that sends its samples by a connection of its own."""
SCRIPT = "script"
"""The device of a scripted pilot."""
WEBCAM = "webcam"
"""The device that is offered only where the lab gives the files that find a hand in pictures."""

_CHOICE, _TEXT = "choice", "text"


class InvalidPlan(ValueError):
    """A plan that no study can follow; `faults` lists all that is wrong."""

    def __init__(self, path: Path | str, faults: Sequence[str]) -> None:
        super().__init__(f"{path}: {'; '.join(faults)}")
        self.path, self.faults = path, tuple(faults)


@dataclass(frozen=True)
class Condition:
    """A task with a behaviour of the robot: what a round is of.

    Attributes:
        task, behaviour: their names in the plan.
        scenario: the one that is run.
        parameters: of the scenario, as texts by name.
    """

    task: str
    behaviour: str
    scenario: str
    parameters: Mapping[str, str]

    @property
    def given(self) -> list[str]:
        """The parameters as `handover run -p` takes them."""
        return [f"{name}={text}" for name, text in self.parameters.items()]


@dataclass(frozen=True)
class Question:
    """A question after the last round.

    Attributes:
        name: its column in `questionnaire.csv`.
        choices: what can be answered, as it is kept in all languages; empty: any text.
    """

    name: str
    choices: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class StudyText:
    """All that people read, in one language.

    Attributes:
        language: its name in itself, such as "English".
        welcome, practice, thanks: at the beginning, before the practice, and at the end.
        consent: what a participant agrees to.
        eligibility: what a participant confirms one by one, as a condition of taking part.
        task_names, instructions: of each task, by its name.
        statements: by their names, rated from `lowest` to `highest`.
        questions: by their names.
        choices: of each question that has them, in the order of the plan.
    """

    language: str
    welcome: str
    consent: str
    eligibility: Sequence[str]
    practice: str
    task_names: Mapping[str, str]
    instructions: Mapping[str, str]
    statements: Mapping[str, str]
    lowest: str
    highest: str
    questions: Mapping[str, str]
    choices: Mapping[str, Sequence[str]]
    thanks: str


@dataclass(frozen=True, kw_only=True)
class StudyPlan:
    """A study as it is planned.

    Attributes:
        title: of the study.
        pilot: whether scripts take the place of people: all that is written says so.
        seed: from which the seeds of all rounds follow.
        participants: how many are planned.
        repetitions: how often each participant meets each condition.
        practice: seconds before the first round.
        latency_limit: from hand to picture, ms; rounds above it are marked.
        devices: allowed to move the hand, names of `DEVICES`.
        scale: lowest and highest rating.
        tasks: names of the tasks, in the order of tables.
        behaviours: names of the two that are compared.
        conditions: tasks x behaviours, in this order.
        statements: names of what is rated after each round.
        questions: asked after the last round.
        texts: by language, such as "en"; the first is the default.
        source: the text of the plan.
    """

    title: str
    pilot: bool
    seed: int
    participants: int
    repetitions: int
    practice: float
    latency_limit: float
    devices: Sequence[str]
    scale: tuple[int, int]
    tasks: Sequence[str]
    behaviours: tuple[str, str]
    conditions: Sequence[Condition]
    statements: Sequence[str]
    questions: Sequence[Question]
    texts: Mapping[str, StudyText]
    source: str

    @property
    def rounds(self) -> int:
        """How many rounds a participant plays."""
        return self.repetitions * len(self.conditions)

    @cached_property
    def ratings(self) -> range:
        """What a statement can be answered by."""
        return range(self.scale[0], self.scale[1] + 1)

    def condition(self, task: str, behaviour: str) -> Condition:
        """Return the condition of a task and a behaviour.

        Raises:
            KeyError: there is none.
        """
        for condition in self.conditions:
            if (condition.task, condition.behaviour) == (task, behaviour):
                return condition
        raise KeyError(f"{task}, {behaviour}")


def default_plan() -> str:
    """Return the plan of the thesis's study, as a text to start from. [Fernandes2020] ch. 5, app. B."""
    return resources.files("handover.scenarios.study.plan").joinpath("default_plan.toml").read_text(encoding="utf-8")


def read_plan(path: Path) -> StudyPlan:
    """Read and check a plan.

    Raises:
        InvalidPlan: it cannot be read, or with all its faults.
    """
    try:
        text = read_regular(path).decode()
    except OSError as e:
        raise InvalidPlan(path, [f"it cannot be read: {e.strerror or e}"]) from e
    except ValueError as e:
        raise InvalidPlan(path, [f"it is not text in UTF-8: {one_line(e)}"]) from e
    return parse_plan(text, path)


def parse_plan(text: str, path: Path | str = "plan") -> StudyPlan:
    """Check the text of a plan and return what it says; `path` names it in faults.

    Raises:
        InvalidPlan: it is not TOML, or with all its faults.
    """
    try:
        content = tomli.loads(text)
    except (ValueError, RecursionError) as e:
        raise InvalidPlan(path, [f"it is not TOML: {one_line(e)}"]) from e
    plan = PlanTable("", content, [])
    found = _plan_of(plan, text)
    plan.check_names()
    if plan.faults:
        raise InvalidPlan(path, plan.faults)
    return found


def _plan_of(plan: PlanTable, source: str) -> StudyPlan:
    pilot = plan.flag("pilot", default=False)
    statements = plan.texts("statements")
    questions = [_question(table) for table in plan.list_of_tables("questions")]
    tasks, behaviours, conditions = _conditions(plan)
    texts_of = plan.table("text")
    languages = texts_of.tables()
    if not languages:
        plan.faults.append("text: it needs a table for each language, such as [text.en]")
    texts = {name: _text(table, tasks, statements, questions) for name, table in languages.items()}
    for kind, names in (("statements", statements), ("questions", [q.name for q in questions])):
        if len(set(names)) < len(names):
            plan.faults.append(f"{kind}: a name is given twice")
    return StudyPlan(
        title=plan.text("title"),
        pilot=pilot,
        seed=plan.whole("seed", 0, 2**31 - 1),
        participants=plan.whole("participants", 1, 999),
        repetitions=plan.whole("repetitions", 1, 20),
        practice=plan.number("practice", 0.0, 7200.0),
        latency_limit=plan.number("latency_limit", 1.0, 10000.0),
        devices=_devices(plan, pilot),
        scale=_scale(plan),
        tasks=tasks,
        behaviours=(behaviours[0], behaviours[1]) if len(behaviours) == 2 else ("", ""),
        conditions=conditions,
        statements=statements,
        questions=questions,
        texts=texts,
        source=source,
    )


def _devices(plan: PlanTable, pilot: bool) -> Sequence[str]:
    devices = plan.texts("devices")
    for name in devices:
        if name not in DEVICES:
            plan.faults.append(f"devices: no device {name!r}; {nearest(name, DEVICES)}")
    if "script" in devices and not pilot:
        plan.faults.append("devices: 'script' is no person's; pilot = true is of scripted pilots")
    return devices


def _scale(plan: PlanTable) -> tuple[int, int]:
    table = plan.table("scale")
    lowest, highest = table.whole("lowest", 0, 100), table.whole("highest", 0, 100)
    if highest <= lowest:
        plan.faults.append(f"scale: its highest, {highest}, is not above its lowest, {lowest}")
    return lowest, highest


def _question(table: PlanTable) -> Question:
    name, kind = table.text("name"), table.choice("kind", (_CHOICE, _TEXT))
    choices = table.texts("choices") if kind == _CHOICE else []
    return Question(name, choices)


def _conditions(plan: PlanTable) -> tuple[list[str], list[str], list[Condition]]:
    """Return tasks, behaviours, and the conditions, whose parameters their scenarios take."""
    common = plan.table("parameters", needed=False).parameters()
    tasks, behaviours = plan.table("tasks").tables(), plan.table("behaviours").tables()
    if not tasks:
        plan.faults.append("tasks: it needs one at least, such as [tasks.robot_to_human]")
    if len(behaviours) != 2:
        plan.faults.append(
            "behaviours: two are compared, such as [behaviours.rigid] and [behaviours.compliant]; "
            f"it has {len(behaviours)}"
        )
    if taken := sorted({"scenario", "parameters"} & behaviours.keys()):
        plan.faults.append(f"behaviours.{taken[0]}: that is what a task's own settings are called; choose another")
    of_behaviour = {name: table.parameters() for name, table in behaviours.items()}
    conditions: list[Condition] = []
    for task, table in tasks.items():
        name = table.text("scenario")
        scenario = _scenario(name, table) if name else None
        of_task = table.table("parameters", needed=False).parameters()
        for behaviour, given in of_behaviour.items():
            own = table.table(behaviour, needed=False).parameters()
            condition = Condition(task, behaviour, name, {**common, **of_task, **given, **own})
            if scenario is not None:
                _check_parameters(condition, scenario, plan.faults)
            conditions.append(condition)
    return list(tasks), list(behaviours), conditions


def _scenario(name: str, table: PlanTable) -> type[Experiment[Any]] | None:
    """Return the scenario of a name; no path of a class is taken, whose code would be run as a folder is read."""
    try:
        return named_scenario(name if name in SCENARIOS else installed_scenarios()[name])
    except KeyError:
        known = [*SCENARIOS, *installed_scenarios()]
        table.faults.append(f"{table.where}.scenario: no scenario {name!r}; {nearest(name, known)}")
    except InvalidScenario as e:
        table.faults.append(f"{table.where}.scenario: {one_line(e)}")
    return None


def _check_parameters(condition: Condition, scenario: type[Experiment[Any]], faults: list[str]) -> None:
    try:
        parse_parameters(scenario, condition.given)
    except InvalidParameter as e:
        faults += [f"tasks.{condition.task}, {condition.behaviour}: {fault}" for fault in e.faults]


def _text(
    table: PlanTable, tasks: Sequence[str], statements: Sequence[str], questions: Sequence[Question]
) -> StudyText:
    names = [q.name for q in questions]
    choices_of = table.table("choices", needed=any(q.choices for q in questions))
    choices: dict[str, list[str]] = {}
    for question in questions:
        if question.choices:
            words = choices[question.name] = choices_of.texts(question.name)
            if words and len(words) != len(question.choices):
                table.faults.append(
                    f"{choices_of.where}.{question.name}: {len(words)} texts for {len(question.choices)} choices"
                )
    return StudyText(
        language=table.text("language"),
        welcome=table.text("welcome"),
        consent=table.text("consent"),
        eligibility=table.texts("eligibility", empty=True),
        practice=table.text("practice"),
        task_names=table.table("task_names").texts_by_name(tasks),
        instructions=table.table("instructions").texts_by_name(tasks),
        statements=table.table("statements").texts_by_name(statements),
        lowest=table.text("lowest"),
        highest=table.text("highest"),
        questions=table.table("questions", needed=bool(names)).texts_by_name(names),
        choices=choices,
        thanks=table.text("thanks"),
    )
