"""The folder of a study: its plan, the versions of what carries it out, the codebook, and the folders of sessions.

OUT/plan.toml, versions.json, codebook.csv, codebook.md, and participants/P01/, P02/, ..., see `SessionFolder`. The
tables of all participants, rounds, answers, void_attempts, questionnaire and sessions, are made of these when they are
asked for.
"""

import contextlib
import json
from collections.abc import Generator
from dataclasses import asdict, replace
from pathlib import Path

from handover.cosim.files import read_regular
from handover.scenarios.runs.results.run_folder import (
    InvalidRunFolder,
    RunFolder,
    check_no_links,
    disk_errors_reported,
    folder_held,
    versions,
    write_whole,
)
from handover.scenarios.study.folder.codebook import PERSON, PILOT, all_tables, write_codebook, write_csv, write_parquet
from handover.scenarios.study.folder.session_folder import Session, SessionFolder, pseudonym_of
from handover.scenarios.study.folder.session_notes import SessionNotes, Withdrawal
from handover.scenarios.study.plan.order import order_row
from handover.scenarios.study.plan.plan import InvalidPlan, StudyPlan, parse_plan


class StudyFolder:
    """The folder of a study.

    Attributes:
        path: where it is.
        plan: the study's.
    """

    def __init__(self, path: Path, plan: StudyPlan) -> None:
        self.path, self.plan = path, plan

    @classmethod
    def opened(cls, path: Path, plan: StudyPlan) -> "StudyFolder":
        """Return the folder of a plan's study: a new one is made, one that is there goes on.

        Raises:
            InvalidRunFolder: it is another plan's, or something else. RecordNotWritten: it cannot be written.
        """
        folder = cls(path, plan)
        if not _missing_of(path):
            if cls.read(path).plan.source != plan.source:
                fault = "its study has another plan, plan.toml; name a new folder, or that plan"
                raise InvalidRunFolder(path, fault)
            return folder
        RunFolder(path)  # a new or an empty one
        with disk_errors_reported(path):
            folder.participants.mkdir(parents=True)
        write_codebook(path, plan)
        write_whole(path / "versions.json", json.dumps(versions(), indent=2) + "\n")
        write_whole(folder._plan_file, plan.source)
        return folder

    @classmethod
    def read(cls, path: Path) -> "StudyFolder":
        """Return the folder of a study that has begun.

        Raises:
            InvalidRunFolder: it is none, its plan is damaged, or folders of its sessions lie elsewhere, by a link.
        """
        file = path / "plan.toml"
        if missing := _missing_of(path):
            raise InvalidRunFolder(path, f"it is not the folder of a study: it has no {', '.join(missing)}")
        check_no_links(path, "participants", "participants/P*", "participants/P*/*", "participants/P*/*/*")
        try:
            return cls(path, parse_plan(read_regular(file).decode(), file))
        except (OSError, UnicodeDecodeError, InvalidPlan) as e:
            raise InvalidRunFolder(path, f"its plan.toml is damaged: {e}") from e

    @property
    def participants(self) -> Path:
        """The folder of the sessions' folders."""
        return self.path / "participants"

    @property
    def _plan_file(self) -> Path:
        return self.path / "plan.toml"

    @property
    def numbers(self) -> list[int]:
        """Numbers of the participants whose sessions have begun, of those who have withdrawn, too."""
        files = [*self.participants.glob("P*/session.json"), *self.participants.glob("P*/withdrawn.json")]
        return sorted({int(f.parent.name[1:]) for f in files if f.parent.name[1:].isdecimal()})

    @property
    def next_number(self) -> int:
        """The number of the participant who comes next."""
        return max(self.numbers, default=0) + 1

    @property
    def sessions(self) -> list["SessionFolder"]:
        """All sessions that have begun, but those of participants who have withdrawn: they are in no result."""
        withdrawn = self.withdrawals
        return [self.session(n) for n in self.numbers if n not in withdrawn]

    @property
    def withdrawals(self) -> dict[int, Withdrawal]:
        """Who has withdrawn, by number."""
        notes = {n: SessionNotes(self.participants / pseudonym_of(n)) for n in self.numbers}
        return {n: withdrawal for n, of in notes.items() if (withdrawal := of.withdrawn) is not None}

    def withdraw(self, number: int, when: str, *, delete: bool) -> Withdrawal:
        """Leave a participant out of all results from now on, as they want it, and delete what was kept if they do.

        Their number stays taken. Tables of all participants that are there already are written again.

        Raises:
            InvalidRunFolder: no session of this number has begun. RecordNotWritten: something cannot be written.
        """
        notes = SessionNotes(self.participants / pseudonym_of(number))
        withdrawal = notes.withdrawn
        if withdrawal is None:
            folder = SessionFolder.read(self.participants / pseudonym_of(number), self.plan)
            withdrawal = Withdrawal(when, during=not folder.is_complete)
            notes.keep_withdrawal(withdrawal)
        if delete and not withdrawal.deleted:
            notes.delete_all_else()
            withdrawal = replace(withdrawal, deleted=when)
            notes.keep_withdrawal(withdrawal)
        if any((self.path / f"{name}.csv").exists() for name in all_tables(self.plan)):
            self.write_tables()
        return withdrawal

    def session(self, number: int) -> "SessionFolder":
        """Return a session that has begun.

        Raises:
            InvalidRunFolder: there is none of that number, its session.json is damaged, or the plan does not allow it.
        """
        withdrawal = self.withdrawals.get(number)
        if withdrawal is not None and withdrawal.deleted:
            fault = f"its participant has withdrawn, and what was kept was deleted on {withdrawal.deleted}"
            raise InvalidRunFolder(self.participants / pseudonym_of(number), fault)
        folder = SessionFolder.read(self.participants / pseudonym_of(number), self.plan)
        if faults := _faults_of(folder.session, self.plan):
            raise InvalidRunFolder(folder.path, f"its session.json does not fit the plan: {'; '.join(faults)}")
        folder.check()
        return folder

    def begin(self, session: Session) -> "SessionFolder":
        """Write the first file of a session, whose participant has agreed and may take part.

        Raises:
            InvalidRunFolder: there is one of that number, or the plan does not allow it, with all reasons.
            RecordNotWritten: it cannot be written.
        """
        path = self.participants / session.pseudonym
        begun = any((path / name).exists() for name in ("session.json", "withdrawn.json"))
        if faults := [*(["a session has begun in it"] if begun else []), *_faults_of(session, self.plan)]:
            raise InvalidRunFolder(path, "; ".join(faults))
        return self._write(session)

    def replace_session(self, folder: "SessionFolder", session: Session) -> "SessionFolder":
        """Write a session's first file anew, as of another device, while nothing has been played in it.

        Raises:
            InvalidRunFolder: it has practised or played, or the plan does not allow it, with all reasons.
            RecordNotWritten: it cannot be written.
        """
        played = folder.notes.practice is not None or folder.next_round != folder.rounds[0]
        if faults := [*(["the session is under way"] if played else []), *_faults_of(session, self.plan)]:
            raise InvalidRunFolder(folder.path, "; ".join(faults))
        return self._write(session)

    def _write(self, session: Session) -> "SessionFolder":
        if missing := _missing_of(self.path):
            raise InvalidRunFolder(self.path, f"it was removed, or moved: it has no {', '.join(missing)}")
        path = self.participants / session.pseudonym
        data = {
            "participant": session.pseudonym,
            "kind": session.kind,
            **asdict(session),
            "order_row": order_row(self.plan, session.number),
            "latency_limit_ms": self.plan.latency_limit,
        }
        with disk_errors_reported(path):
            (path / "rounds").mkdir(parents=True, exist_ok=True)
        begun = SessionFolder(path, self.plan, session)
        begun.write_tables()
        write_whole(path / "session.json", json.dumps(data, indent=2, allow_nan=False) + "\n")  # with it, it has begun
        return begun

    def write_tables(self) -> None:
        """Write the tables of all participants, as CSV and Parquet, beside the codebook that explains them.

        Raises:
            InvalidRunFolder: what is kept of a session is damaged. RecordNotWritten: they cannot be written.
        """
        sessions = self.sessions
        rows = {
            "rounds": [row for s in sessions for row in s.rounds_rows()],
            "answers": [row for s in sessions for row in s.answers_rows()],
            "void_attempts": [row for s in sessions for row in s.void_attempts_rows()],
            "questionnaire": [row for s in sessions for row in s.questionnaire_rows()],
            "sessions": [s.sessions_row() for s in sessions],
        }
        for name, columns in all_tables(self.plan).items():
            write_csv(self.path / f"{name}.csv", columns, rows[name])
            write_parquet(self.path / f"{name}.parquet", columns, rows[name])

    @contextlib.contextmanager
    def held(self) -> Generator[None, None, None]:
        """Lock the folder against other processes that call this.

        Raises:
            InvalidRunFolder: another process holds it.
        """
        with folder_held(self.path, "another process carries out its study"):
            yield


def _missing_of(path: Path) -> list[str]:
    """Return what a folder lacks of what every study's has: a plan alone lies in folders of other things, too."""
    files = [name for name in ("plan.toml", "versions.json") if not (path / name).is_file()]
    return files + ([] if (path / "participants").is_dir() else ["participants"])


def _faults_of(session: Session, plan: StudyPlan) -> list[str]:
    """Return what the plan does not allow of a session; a person who may not take part leaves nothing."""
    faults = [] if session.pilot else _not_confirmed(session, plan)
    if session.device not in plan.devices:
        faults.append(f"the plan has no device {session.device!r}; it has {', '.join(plan.devices)}")
    if session.language not in plan.texts:
        faults.append(f"the plan has no text in {session.language!r}; it has {', '.join(plan.texts)}")
    if session.pilot != plan.pilot:
        kinds = (PILOT if plan.pilot else PERSON, session.kind)
        faults.append(f"the plan is of a {kinds[0]}, the session of a {kinds[1]}; they do not mix in one study")
    return faults


def _not_confirmed(session: Session, plan: StudyPlan) -> list[str]:
    faults = [] if session.consent else ["the participant has not agreed to take part"]
    needed = [len(text.eligibility) for name, text in plan.texts.items() if name == session.language]
    if not all(session.eligibility) or [len(session.eligibility)] != needed:
        faults.append("the participant has not confirmed all that taking part needs")
    return faults
