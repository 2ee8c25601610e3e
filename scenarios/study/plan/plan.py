"""The plan of a user study, PLAN.toml: tasks, behaviours, rounds, statements, questions, and all that people read.

`handover study new` writes one that is the thesis's study, [Fernandes2020] ch. 5. A plan is checked whole before
anything starts: all faults of types and ranges are reported at once, then all of what does not fit together.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import msgspec
import tomli
from msgspec import Meta, Struct

from handover.cosim.exceptions import first_faults, nearest, one_line
from handover.cosim.files import read_regular, reading_fault
from handover.cosim.typed_data import Name, Text, all_faults, checked, unknown_names
from handover.scenarios.catalog import SCENARIOS, InvalidScenario, installed_scenarios, named_scenario
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import InvalidParameter, check_effects, parse_parameters

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


class InvalidPlan(ValueError):
    """A plan that no study can follow; `faults` lists all that is wrong."""

    def __init__(self, path: Path | str, faults: Sequence[str]) -> None:
        super().__init__(f"{path}: {'; '.join(first_faults(faults))}")
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


class Question(Struct, frozen=True, forbid_unknown_fields=True):
    """A question after the last round.

    Attributes:
        name: its column in `questionnaire.csv`.
        kind: whether one of `choices` is the answer, or any text.
        choices: what can be answered, as it is kept in all languages; empty: any text.
    """

    name: Text
    kind: Literal["choice", "text"]
    choices: list[Text] = []


class StudyText(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
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

    language: Text
    welcome: Text
    consent: Text
    eligibility: list[Text]
    practice: Text
    task_names: dict[str, Text]
    instructions: dict[str, Text]
    statements: dict[str, Text]
    lowest: Text
    highest: Text
    questions: dict[str, Text] = {}
    choices: dict[str, list[Text]] = {}
    thanks: Text


_COLUMNS = ("participant", "kind")
"""Of questionnaire.csv, besides the questions'."""
_Value = str | int | float | bool
_Parameters = dict[str, _Value | list[_Value]]
_Rating = Annotated[int, Meta(ge=0, le=100)]


class _Scale(Struct, forbid_unknown_fields=True):
    lowest: _Rating
    highest: _Rating


class _Plan(Struct, kw_only=True, forbid_unknown_fields=True):
    """The tables and keys of PLAN.toml; those of a task have the behaviours' names, too."""

    title: Text
    pilot: bool = False
    seed: Annotated[int, Meta(ge=0, le=2**31 - 1)]
    participants: Annotated[int, Meta(ge=1, le=999)]
    repetitions: Annotated[int, Meta(ge=1, le=20)]
    practice: Annotated[float, Meta(ge=0.0, le=7200.0)]
    latency_limit: Annotated[float, Meta(ge=1.0, le=10000.0)]
    devices: Annotated[list[Text], Meta(min_length=1)]
    scale: _Scale
    parameters: _Parameters = {}
    tasks: dict[Name, dict[str, Any]]
    behaviours: dict[Name, _Parameters]
    statements: Annotated[list[Text], Meta(min_length=1)]
    questions: list[Question] = []
    text: dict[Name, StudyText]


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
        text = read_regular(path).decode("utf-8-sig")
    except OSError as e:
        raise InvalidPlan(path, [reading_fault(e)]) from e
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
    content = _stripped(content)
    if faults := list(all_faults(content, _Plan)):
        raise InvalidPlan(path, faults)
    plan = checked(content, _Plan)
    conditions = _conditions(plan, faults)
    faults += _faults(plan)
    if faults:
        raise InvalidPlan(path, faults)
    rigid, compliant = plan.behaviours
    return StudyPlan(
        title=plan.title,
        pilot=plan.pilot,
        seed=plan.seed,
        participants=plan.participants,
        repetitions=plan.repetitions,
        practice=plan.practice,
        latency_limit=plan.latency_limit,
        devices=plan.devices,
        scale=(plan.scale.lowest, plan.scale.highest),
        tasks=list(plan.tasks),
        behaviours=(rigid, compliant),
        conditions=conditions,
        statements=plan.statements,
        questions=plan.questions,
        texts=plan.text,
        source=text,
    )


def _stripped(content: Any) -> Any:
    """Return TOML's data with texts without blanks around them."""
    if isinstance(content, dict):
        return {name: _stripped(value) for name, value in cast(dict[str, Any], content).items()}
    if isinstance(content, list):
        return [_stripped(value) for value in cast(list[Any], content)]
    return content.strip() if isinstance(content, str) else content


def _faults(plan: _Plan) -> Iterator[str]:
    """Yield what is wrong with values of a plan together."""
    for name in plan.devices:
        if name not in DEVICES:
            yield f"devices: no device {name!r}; {nearest(name, DEVICES)}"
    if SCRIPT in plan.devices and not plan.pilot:
        yield "devices: 'script' is not a person's; pilot = true is of scripted pilots"
    if plan.scale.highest <= plan.scale.lowest:
        yield f"scale: its highest, {plan.scale.highest}, is not above its lowest, {plan.scale.lowest}"
    questions = [q.name for q in plan.questions]
    for kind, names in (("statements", plan.statements), ("questions", questions)):
        if len(set(names)) < len(names):
            yield f"{kind}: a name is given twice"
    for name in questions:
        if name in _COLUMNS:
            yield f"questions: {name} is another column of questionnaire.csv; choose another name"
    for k, question in enumerate(plan.questions, 1):
        if len(set(question.choices)) < len(question.choices):
            yield f"questions[{k}].choices: a choice is given twice"
        if (question.kind == "choice") is not bool(question.choices):
            yield f"questions[{k}].choices: {len(question.choices)} given; kind 'choice' has some, 'text' none"
    if not plan.text:
        yield "text: it needs a table for each language, such as [text.en]"
    choices = {q.name: q.choices for q in plan.questions if q.choices}
    for language, text in plan.text.items():
        where = f"text.{language}"
        yield from _names_faults(text.task_names, plan.tasks, f"{where}.task_names")
        yield from _names_faults(text.instructions, plan.tasks, f"{where}.instructions")
        yield from _names_faults(text.statements, plan.statements, f"{where}.statements")
        yield from _names_faults(text.questions, questions, f"{where}.questions")
        yield from _names_faults(text.choices, choices, f"{where}.choices")
        for name, words in text.choices.items():
            if name in choices and len(words) != len(choices[name]):
                yield f"{where}.choices.{name}: {len(words)} texts for {len(choices[name])} choices"


def _names_faults(given: Mapping[str, Any], names: Iterable[str], where: str) -> Iterator[str]:
    yield from (f"{where}.{name}: it is missing; each has a text" for name in names if name not in given)
    yield from unknown_names(given, dict.fromkeys(names), where)


def _conditions(plan: _Plan, faults: list[str]) -> list[Condition]:
    """Return the conditions, whose parameters their scenarios take."""
    if not plan.tasks:
        faults.append("tasks: it needs one at least, such as [tasks.robot_to_human]")
    if len(plan.behaviours) != 2:
        faults.append(
            "behaviours: two are compared, such as [behaviours.rigid] and [behaviours.compliant]; "
            f"it has {len(plan.behaviours)}"
        )
    if taken := sorted({"scenario", "parameters"} & plan.behaviours.keys()):
        faults.append(f"behaviours.{taken[0]}: that is what a task's own settings are called; choose another")
        return []
    own = [
        (name, _Parameters, msgspec.field(default_factory=dict[str, Any])) for name in ("parameters", *plan.behaviours)
    ]
    declared = msgspec.defstruct("Task", [("scenario", Text), *own], forbid_unknown_fields=True)
    conditions: list[Condition] = []
    for task, table in plan.tasks.items():
        if wrong := list(all_faults(table, declared, f"tasks.{task}")):
            faults += wrong
            continue
        scenario = _scenario(name := table["scenario"], f"tasks.{task}", faults)
        for behaviour, given in plan.behaviours.items():
            tables = (plan.parameters, table.get("parameters", {}), given, table.get(behaviour, {}))
            texts = {name: _parameter(value) for parameters in tables for name, value in parameters.items()}
            condition = Condition(task, behaviour, name, texts)
            if scenario is not None:
                _check_parameters(condition, scenario, faults)
            conditions.append(condition)
    return conditions


def _parameter(value: _Value | list[_Value]) -> str:
    """Return a parameter's value as `handover run -p` takes it."""
    if isinstance(value, list):
        return ",".join(map(_parameter, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _scenario(name: str, where: str, faults: list[str]) -> type[Experiment[Any]] | None:
    """Return the scenario of a name; no path of a class is taken, whose code would be run as a folder is read."""
    try:
        return named_scenario(name if name in SCENARIOS else installed_scenarios()[name])
    except KeyError:
        known = [*SCENARIOS, *installed_scenarios()]
        faults.append(f"{where}.scenario: no scenario {name!r}; {nearest(name, known)}")
    except InvalidScenario as e:
        faults.append(f"{where}.scenario: {one_line(e)}")
    return None


def _check_parameters(condition: Condition, scenario: type[Experiment[Any]], faults: list[str]) -> None:
    try:
        check_effects(scenario, parse_parameters(scenario, condition.given))
    except InvalidParameter as e:
        faults += [f"tasks.{condition.task}, {condition.behaviour}: {fault}" for fault in e.faults]
