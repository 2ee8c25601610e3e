"""What the screens of a study show that is made of its plan and its folder, as JSON can hold it."""

from collections.abc import Sequence
from enum import Enum
from typing import Any

from handover.scenarios.study.folder.session_folder import SessionFolder, pseudonym_of
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.order import Round
from handover.scenarios.study.plan.plan import StudyPlan, StudyText


class VoidCause(Enum):
    """Why a round does not count, or a practice begins again: a reason begins with the cause's value.

    Reasons are kept, in English, for those who carry a study out; the page tells causes in its own words.
    """

    NO_SAMPLE = "no sample of the hand came"
    NOT_DRAWN = "the page did not draw the scene"
    PAGE_CLOSED = "the page was closed, or its connection was lost"
    SERVER_ENDED = "the study's server ended before the round did"
    SERVER_FAILED = "the server failed"
    NOT_KEPT = "it could not be kept"

    @classmethod
    def of(cls, reason: str) -> str:
        """Return the name of a reason's cause as the page has it; "" of one that it has no words for."""
        return next((cause.name.lower() for cause in cls if reason.startswith(cause.value)), "")


def who(study: StudyFolder, unfinished: Sequence[SessionFolder]) -> dict[str, Any]:
    """Return who may go on, and who comes next, if somebody does."""
    following = study.next_number
    return {
        "unfinished": [
            {"number": s.number, "participant": s.pseudonym, "started": s.started.replace("T", " ")[:16]}
            for s in (folder.session for folder in unfinished)
        ],
        "new": pseudonym_of(following) if following <= study.plan.participants else None,
    }


def round_to_play(plan: StudyPlan, planned: Round, text: StudyText) -> dict[str, Any]:
    """Return what is shown of a round: its task, and not the robot's behaviour."""
    task = planned.condition.task
    task_texts = {"name": text.task_names[task], "instruction": text.instructions[task]}
    return {**task_texts, "task": task, "round": planned.number, "rounds": plan.rounds}


def rating(plan: StudyPlan, unrated: Round | None, text: StudyText) -> dict[str, Any]:
    """Return the statements that are rated after a round, and their scale."""
    low, high = plan.scale
    return {
        "round": None if unrated is None else unrated.number,
        "rounds": plan.rounds,
        "statements": {name: text.statements[name] for name in plan.statements},
        "scale": {"lowest": low, "highest": high, "low": text.lowest, "high": text.highest},
    }


def questions(plan: StudyPlan, text: StudyText) -> list[dict[str, Any]]:
    """Return the questions after the last round, with the choices of those that have some."""
    return [
        {
            "name": q.name,
            "text": text.questions[q.name],
            "choices": [{"value": c, "text": w} for c, w in zip(q.choices, text.choices.get(q.name, ()), strict=True)],
        }
        for q in plan.questions
    ]
