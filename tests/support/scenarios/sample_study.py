"""Studies that are written through the session folder, with numbers that are known."""

from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pandas as pd

from handover.scenarios.study.folder.session_folder import RoundRecord, Session, SessionFolder
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.order import Round
from handover.scenarios.study.plan.plan import StudyPlan, default_plan, parse_plan

PLAN = parse_plan(default_plan())
PILOT_PLAN = parse_plan(default_plan().replace("pilot = false", "pilot = true").replace('"mouse"', '"script"'))

_TYPES = {"text": "string", "whole number": "Int64", "number": "Float64", "true or false": "boolean"}


def session(number: int, plan: StudyPlan = PLAN) -> Session:
    """Return a session of a participant who may take part."""
    return Session(
        number=number,
        device=plan.devices[0],
        device_settings={"gain": 1.5},
        language="en",
        consent=True,
        eligibility=[True] * len(plan.texts["en"].eligibility),
        pilot=plan.pilot,
        started="2026-11-24T09:00:00",
    )


def record(success: bool = True, latency: float = 60.0, void: bool = False) -> RoundRecord:
    """Return what is known of a round."""
    return RoundRecord(
        ended="2026-11-24T09:20:00",
        success=success,
        reason="the person had the object" if success else "the hand closed beside the object, 31 mm in depth",
        failed_by_rule=not success,
        void=void,
        void_reason="tracking lost, hand out of view" if void else "",
        latency_median_ms=latency - 20.0,
        latency_p95_ms=latency,
        latency_max_ms=latency + 40.0,
        age_at_use_ms=12.5,
        missed_deadlines=2,
    )


Rate = Callable[[int, Round, str], int]
Fails = Callable[[int, Round], bool]


def never(_number: int, _planned: Round) -> bool:
    """Say that nobody failed."""
    return False


def same(_number: int, _planned: Round, _statement: str) -> int:
    """Rate everything alike."""
    return 5


def rigid_is_better(number: int, planned: Round, statement: str) -> int:
    """Rate rigid rounds two points higher, in S1 only; some people rate higher than others."""
    above = 2 if planned.condition.behaviour == "rigid" and statement == "S1" else 0
    return 3 + number % 4 + above


def compliant_fails(number: int, planned: Round) -> bool:
    """Fail both compliant rounds of the second task, if the number is even."""
    return number % 2 == 0 and (planned.condition.task, planned.condition.behaviour) == ("human_to_robot", "compliant")


def play(folder: SessionFolder, rate: Rate, fails: Fails = never) -> None:
    """Play a session to its end: `rate` gives a participant's rating of a round's statement, `fails` who failed."""
    number = folder.session.number
    with patch.object(SessionFolder, "write_tables"):  # which the questionnaire's answers write, too
        for planned in folder.rounds:
            folder.record_round(planned.number, record(success=not fails(number, planned)))
            ratings = {name: rate(number, planned, name) for name in folder.plan.statements}
            folder.record_answers(planned.number, ratings)
    folder.record_questionnaire({"age_group": "21-30", "background": "engineering", "comments": 'a "quoted", text\n2'})


def write_study(path: Path, people: int, rate: Rate, fails: Fails = never, plan: StudyPlan = PLAN) -> StudyFolder:
    """Write a study of so many people."""
    study = StudyFolder.opened(path, plan)
    for number in range(1, people + 1):
        play(study.begin(session(number, plan)), rate, fails)
    return study


def read_by_codebook(study: Path, table: str, file: Path) -> Any:
    """Read a table as somebody does who knows the codebook alone."""
    read: Any = pd.read_csv  # type: ignore
    codebook = read(study / "codebook.csv", keep_default_na=False)
    columns = codebook[codebook["table"] == table]
    types = {name: _TYPES[kind] for name, kind in zip(columns["column"], columns["type"], strict=True)}
    found = read(file, dtype=types)
    assert list(found.columns) == list(columns["column"])
    filled = columns[columns["may_be_empty"] == "no"]["column"]
    assert not found[filled].isna().any(axis=None)
    return found
