"""The folder of one participant's session, written so that a kill loses no round that was finished.

Kept are session.json, practice.json, void_attempts.json, questionnaire.json, withdrawn.json, and of each round
rounds/01/, a run's folder as `handover run` writes it, rounds/01.json, which is replaced as a whole, and
rounds/01.begun, which says that the participant began it. The tables rounds, answers, void_attempts and questionnaire
are made of these.
No name, no picture and no video of a person is kept.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from handover.cosim.typed_data import Count, NotNegative
from handover.scenarios.runs.results.run_folder import (
    InvalidRunFolder,
    check_place,
    disk_errors_reported,
    read_file,
    write_whole,
)
from handover.scenarios.study.folder.codebook import (
    PERSON,
    PILOT,
    ROUNDS,
    VOID_ATTEMPTS,
    answers_columns,
    questionnaire_columns,
    write_csv,
    write_parquet,
)
from handover.scenarios.study.folder.session_notes import SessionNotes, VoidAttempt
from handover.scenarios.study.plan.order import Round, order_row, rounds_of
from handover.scenarios.study.plan.plan import StudyPlan


@dataclass(frozen=True, kw_only=True)
class Session:
    """What is known of a session when it begins.

    Attributes:
        number: the participant's, from 1.
        device, device_settings: what moves the hand, and how it is set.
        language: of what is read.
        consent: whether the participant has agreed.
        eligibility: what the participant has confirmed, in the order of the plan.
        pilot: whether a script takes the place of a person.
        started: date and time by ISO 8601.
    """

    number: Count
    device: str
    device_settings: Mapping[str, Any]
    language: str
    consent: bool
    eligibility: Sequence[bool]
    pilot: bool
    started: str

    @property
    def pseudonym(self) -> str:
        """The participant's name in all files."""
        return pseudonym_of(self.number)

    @property
    def kind(self) -> str:
        """Who plays, in every table."""
        return PILOT if self.pilot else PERSON


@dataclass(frozen=True, kw_only=True)
class RoundRecord:
    """What is known of a round that has been played; see `codebook.ROUNDS`.

    Attributes:
        ended: date and time by ISO 8601.
        success, reason: as the run's summary has them.
        failed_by_rule: see `session.trial.failed_by_rule`.
        void, void_reason: whether the round does not count, and why.
        latency_median_ms, latency_p95_ms, latency_max_ms, age_at_use_ms, missed_deadlines: None if not measured.
    """

    ended: str
    success: bool
    reason: str
    failed_by_rule: bool | None = None
    void: bool = False
    void_reason: str = ""
    latency_median_ms: NotNegative | None = None
    latency_p95_ms: NotNegative | None = None
    latency_max_ms: NotNegative | None = None
    age_at_use_ms: NotNegative | None = None
    missed_deadlines: Count | None = None


@dataclass(frozen=True)
class _KeptRound:
    """What a round's file holds; `answers` are the ratings by statement, None before they are given."""

    record: RoundRecord
    answers: Mapping[str, Count] | None = None


class SessionFolder:
    """The folder of a session.

    Attributes:
        path: where it is.
        plan: the study's.
        session: what was known when it began.
        rounds: the participant's, as planned, in order.
        notes: of its practice, of attempts that do not count, and of a withdrawal.
    """

    def __init__(self, path: Path, plan: StudyPlan, session: Session) -> None:
        check_place(path)
        self.path, self.plan, self.session = path, plan, session
        self.rounds: Sequence[Round] = rounds_of(plan, session.number)
        self.notes = SessionNotes(path)

    @classmethod
    def read(cls, path: Path, plan: StudyPlan) -> "SessionFolder":
        """Return the session in a folder, which has begun.

        Raises:
            InvalidRunFolder: there is none, or its session.json is damaged.
        """
        session = read_file(path / "session.json", "no session has begun in it: it has no session.json", Session)
        if session.pseudonym != path.name or session.pilot != plan.pilot:
            raise InvalidRunFolder(path, "its session.json is of another participant, or of another study")
        return cls(path, plan, session)

    def run_folder(self, number: int) -> Path:
        """Return the folder of a round's run."""
        return self.path / "rounds" / f"{number:02d}"

    def _file(self, number: int) -> Path:
        return self.path / "rounds" / f"{number:02d}.json"

    def _kept(self, number: int) -> "_KeptRound | None":
        """Return what is known of a round, None if it has not been played to its end.

        Raises:
            InvalidRunFolder: its file is damaged.
        """
        file = self._file(number)
        return read_file(file, f"it has no {file.name}", _KeptRound) if file.is_file() else None

    @property
    def records(self) -> dict[int, RoundRecord]:
        """What is known of the rounds that have been played, by their numbers.

        Raises:
            InvalidRunFolder: a file is damaged.
        """
        kept = {planned.number: self._kept(planned.number) for planned in self.rounds}
        return {number: of.record for number, of in kept.items() if of is not None}

    @property
    def answers(self) -> dict[int, dict[str, int]]:
        """Ratings by statement of the rounds that were rated, by their numbers."""
        kept = {r.number: self._kept(r.number) for r in self.rounds}
        return {number: dict(of.answers) for number, of in kept.items() if of is not None and of.answers}

    @property
    def questionnaire(self) -> dict[str, str] | None:
        """Answers to the questions after the last round; None if they were not asked yet."""
        file = self.path / "questionnaire.json"
        if not file.exists():
            return None
        return read_file(file, "it has no questionnaire.json", dict[str, str])

    def check(self) -> None:
        """Compare what is kept with the plan.

        Raises:
            InvalidRunFolder: a file is damaged, or has ratings or answers that the plan does not allow; all are named.
        """
        found = {f"rounds/{n:02d}.json": self._rating_faults(given) for n, given in self.answers.items()}
        found["questionnaire.json"] = self._answer_faults(self.questionnaire or {})
        if faults := [f"{file}: {fault}" for file, of in found.items() for fault in of]:
            raise InvalidRunFolder(self.path, f"it does not fit the plan: {'; '.join(faults)}")

    @property
    def next_round(self) -> Round | None:
        """The round to be played next; None if all have been."""
        return next((r for r in self.rounds if not self._file(r.number).is_file()), None)

    @property
    def unrated_round(self) -> Round | None:
        """A round that has been played and counts, and has no ratings yet; None if there is none."""
        answers, records = self.answers, self.records
        return next((r for r in self.rounds if r.number in records and not self._is_rated(r, records, answers)), None)

    def _is_rated(self, r: Round, records: Mapping[int, RoundRecord], answers: Mapping[int, Any]) -> bool:
        return records[r.number].void or r.number in answers

    @property
    def is_complete(self) -> bool:
        """Whether all rounds were played and rated, and the questions answered."""
        asked = self.questionnaire is not None or not self.plan.questions
        return self.next_round is None and self.unrated_round is None and asked

    @property
    def has_ended(self) -> bool:
        """Whether it is complete, or the participant has withdrawn."""
        return self.is_complete or self.notes.withdrawn is not None

    def note_begun(self, number: int) -> None:
        """Note that a participant has begun a round: its run is made ready before.

        Raises:
            RecordNotWritten: it cannot be written.
        """
        with disk_errors_reported(self.path):
            self._begun(number).parent.mkdir(exist_ok=True)
        write_whole(self._begun(number), "")

    def is_broken_off(self, number: int) -> bool:
        """Return whether a round has been begun and not finished."""
        return self._begun(number).is_file() and not self._file(number).is_file()

    def _begun(self, number: int) -> Path:
        return self._file(number).with_suffix(".begun")

    def clear_unfinished(self, number: int) -> Path | None:
        """Put the folder of a run that did not come to its end aside, for the round to be played again; return where.

        Raises:
            RecordNotWritten: it cannot be renamed.
        """
        folder = self.run_folder(number)
        if self._file(number).is_file() or not folder.exists():
            return None
        k = 1
        while (aside := folder.with_name(f"{folder.name}_unfinished_{k}")).exists():
            k += 1
        with disk_errors_reported(folder):
            folder.rename(aside)
        return aside

    def record_round(self, number: int, record: RoundRecord) -> None:
        """Keep a round that has been played: with this it is finished, whatever happens after.

        Raises:
            ValueError: it is not the next round. RecordNotWritten: it cannot be written.
        """
        planned = self.next_round
        if planned is None or planned.number != number:
            raise ValueError(f"round {number} cannot be kept: {planned and planned.number} is the next one")
        data = {name: None if isinstance(v, float) and math.isnan(v) else v for name, v in asdict(record).items()}
        self._keep(number, data, None)

    def record_void_attempt(self, attempt: VoidAttempt) -> None:
        """Keep an attempt at a round that does not count; the round is still to be played.

        Raises:
            RecordNotWritten: it cannot be written.
        """
        self.notes.keep_void_attempt(attempt)
        self._begun(attempt.number).unlink(missing_ok=True)
        self.write_tables()

    def record_answers(self, number: int, answers: Mapping[str, int]) -> None:
        """Keep the ratings of a round that has been played.

        Raises:
            ValueError: with all that is wrong with them. RecordNotWritten: they cannot be written.
        """
        kept = self._kept(number)
        faults = [] if kept is not None else [f"round {number} has not been played"]
        faults += self._rating_faults(answers)
        if faults or kept is None:
            raise ValueError("; ".join(faults))
        self._keep(number, asdict(kept.record), {name: int(answers[name]) for name in self.plan.statements})

    def record_questionnaire(self, answers: Mapping[str, str]) -> None:
        """Keep the answers to the questions after the last round; a question may stay without one.

        Raises:
            ValueError: with all that is wrong with them. RecordNotWritten: they cannot be written.
        """
        if faults := self._answer_faults(answers):
            raise ValueError("; ".join(faults))
        kept = {q.name: str(answers[q.name]) for q in self.plan.questions if answers.get(q.name)}
        write_whole(self.path / "questionnaire.json", json.dumps(kept, indent=2) + "\n")
        self.write_tables()

    def _rating_faults(self, answers: Mapping[str, int]) -> list[str]:
        faults = [f"{name} is not rated" for name in self.plan.statements if name not in answers]
        faults += [f"there is no statement {name}" for name in answers if name not in self.plan.statements]
        low, high = self.plan.scale
        for name, value in answers.items():
            if isinstance(value, bool) or value not in self.plan.ratings:
                faults.append(f"{name} = {value!r}: expected a whole number from {low} to {high}")
        return faults

    def _answer_faults(self, answers: Mapping[str, str]) -> list[str]:
        questions = {q.name: q for q in self.plan.questions}
        faults = [f"there is no question {name}" for name in answers if name not in questions]
        for name, question in questions.items():
            answer = answers.get(name, "")
            if answer and question.choices and answer not in question.choices:
                faults.append(f"{name} = {answer!r}: expected one of {', '.join(question.choices)}")
        return faults

    def _keep(self, number: int, record: Mapping[str, Any], answers: Mapping[str, int] | None) -> None:
        content = {"record": record, "answers": answers}
        write_whole(self._file(number), json.dumps(content, indent=2, allow_nan=False) + "\n")
        self.write_tables()

    def write_tables(self) -> None:
        """Write the session's tables again from what is kept, each whole or not at all.

        Raises:
            InvalidRunFolder: what is kept is damaged. RecordNotWritten: they cannot be written.
        """
        rounds = self.rounds_rows()
        write_csv(self.path / "rounds.csv", ROUNDS, rounds)
        write_parquet(self.path / "rounds.parquet", ROUNDS, rounds)
        write_csv(self.path / "answers.csv", answers_columns(self.plan), self.answers_rows())
        write_csv(self.path / "void_attempts.csv", VOID_ATTEMPTS, self.void_attempts_rows())
        write_csv(self.path / "questionnaire.csv", questionnaire_columns(self.plan), self.questionnaire_rows())

    def rounds_rows(self) -> list[dict[str, Any]]:
        """Return the rows of `rounds.csv`."""
        records = self.records
        return [
            {**self._of_round(planned), **asdict(record), "marked_over_limit": self._is_late(record)}
            for planned in self.rounds
            if (record := records.get(planned.number)) is not None
        ]

    def answers_rows(self) -> list[dict[str, Any]]:
        """Return the rows of `answers.csv`."""
        records, answers = self.records, self.answers
        return [
            {**self._of_round(planned), "void": records[planned.number].void, "statement": name, "value": value}
            for planned in self.rounds
            for name, value in answers.get(planned.number, {}).items()
        ]

    def void_attempts_rows(self) -> list[dict[str, Any]]:
        """Return the rows of `void_attempts.csv`."""
        rounds = {r.number: r for r in self.rounds}
        return [
            {
                **self._of_round(rounds[a.number]),
                "attempt": a.attempt,
                "ended": a.ended,
                "reason": a.reason,
                "folder": a.folder,
            }
            for a in self.notes.void_attempts
            if a.number in rounds
        ]

    def questionnaire_rows(self) -> list[dict[str, Any]]:
        """Return the row of `questionnaire.csv`; none before the questions were asked."""
        answers = self.questionnaire
        return [] if answers is None else [{**self._who, **answers}]

    def sessions_row(self) -> dict[str, Any]:
        """Return the session's row in a table of sessions."""
        rows = self.rounds_rows()
        s = self.session
        return {
            **self._who,
            "order_row": order_row(self.plan, s.number),
            **{name: getattr(s, name) for name in ("started", "device", "language")},
            "rounds": len(rows),
            "void_rounds": sum(row["void"] for row in rows),
            "marked_rounds": sum(bool(row["marked_over_limit"]) for row in rows),
            "failures": sum(not row["void"] and not row["success"] for row in rows),
        }

    @property
    def _who(self) -> dict[str, Any]:
        return {"participant": self.session.pseudonym, "kind": self.session.kind}

    def _of_round(self, r: Round) -> dict[str, Any]:
        condition = r.condition
        what = {"round": r.number, "task": condition.task, "behaviour": condition.behaviour}
        return {**self._who, **what, "period": r.period, "scenario": condition.scenario, "seed": r.seed}

    def _is_late(self, record: RoundRecord) -> bool | None:
        p95 = record.latency_p95_ms
        return None if p95 is None else p95 > self.plan.latency_limit


def pseudonym_of(number: int) -> str:
    """Return the name of a participant in all files, such as P01."""
    return f"P{number:02d}"
