"""What a participant goes through, as a state machine: what the page shows next, and what may be done there.

    (who ->) language -> consent -> eligibility -> device -> practice
      -> for each round of the plan (instruction -> round -> rating) -> questions -> thanks

after [Fernandes2020] sec. 5.7. A round that does not count shows "void" first; who does not agree is shown "declined",
and "withdraw" ends a session from any of its screens. All that is to be kept is written as it comes; a session that was
broken off goes on at what was not finished, when whoever carries out the study says that it is the same person. Nothing
is written of who does not agree, or may not take part.
"""

import contextlib
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

from handover.cosim.exceptions import RecordNotWritten, nearest
from handover.scenarios.study.folder.session_folder import RoundRecord, Session, SessionFolder
from handover.scenarios.study.folder.session_notes import VoidAttempt, Withdrawal, timestamp
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.order import Round
from handover.scenarios.study.plan.plan import DEVICES, StudyText
from handover.scenarios.study.session.screen_content import VoidCause, questions, rating, round_to_play, who

MOST_ATTEMPTS = 3
"""How often a round is played at most that fails for a reason which is not the participant's (assumed)."""
_LONGEST_TEXT = 5000
"""Characters of an answer in words."""


class InvalidAction(ValueError):
    """What a page asks for cannot be done there."""


class Protocol:
    """What one seat shows: a participant's session, or, where sessions were begun and not ended, who it is to be.

    Args:
        study: where all is kept.
        devices: those of the plan that this computer has, by their names in the plan.
        number: the first participant's; None: it is asked whether an unfinished session goes on, or the next begins.

    Attributes:
        screen: what is shown, one of `SCREENS`.
        session: of the participant; None before it has begun.
        void_reason: why the last round does not count, for the screen "void".
    """

    def __init__(self, study: StudyFolder, devices: Sequence[str], number: int | None = None) -> None:
        self.study, self._devices = study, list(devices)
        self.session: SessionFolder | None = None
        self.void_reason = ""
        self._practice_over = False
        self._asked_for = number
        self._begin()

    def _begin(self) -> None:
        """Show the session that goes on, or the beginning of the next."""
        self.session, self._eligibility, self._language = None, list[bool](), next(iter(self.study.plan.texts))
        number, self._asked_for = self._asked_for, None
        self.number = self.study.next_number if number is None else number
        if number is None and self._unfinished:
            self.screen = "who"
        else:
            self._sit_down(self.number)

    @property
    def _unfinished(self) -> list[SessionFolder]:
        """Sessions that have begun and not ended."""
        return [s for s in self.study.sessions if not s.has_ended]

    def _sit_down(self, number: int) -> None:
        self.number = number
        if number in self.study.numbers:
            self.session = self.study.session(number)
            self._language = self.session.session.language
            planned = self.session.next_round
            if planned is not None and self.session.is_broken_off(planned.number):
                self.void_round(VoidCause.SERVER_ENDED.value)
            else:
                self.screen = self._next_of_session()
        else:
            self.screen = "language" if number <= self.study.plan.participants else "complete"

    @property
    def text(self) -> StudyText:
        """All that is read, in the language that was chosen."""
        return self.study.plan.texts[self._language]

    @property
    def round(self) -> Round | None:
        """The round that is to be played next, or is under way; None where none is."""
        return None if self.session is None else self.session.next_round

    def act(self, action: str, value: Any = None) -> None:
        """Do what the page asks for on its screen.

        Raises:
            InvalidAction: it is not to be done there, or not so; nothing has changed.
            RecordNotWritten: it cannot be kept.
        """
        if action == "withdraw":
            self._withdraw()
            return
        acts = self._acts.get(self.screen, {})
        if action not in acts:
            right = ", ".join(acts) or "nothing"
            raise InvalidAction(f"{action!r} is not for the screen {self.screen!r}: {right} is")
        acts[action](value)

    @property
    def _acts(self) -> Mapping[str, Mapping[str, Callable[[Any], None]]]:
        return {
            "who": {"continue": self._continue, "new": lambda _value: self._sit_down(self.study.next_number)},
            "language": {"language": self._choose_language},
            "consent": {"consent": self._consent},
            "eligibility": {"eligibility": self._confirm},
            "declined": {"next": self._start_anew},
            "device": {"device": self._choose_device},
            "practice": {"begin": self._begin_practice, "other_device": self._choose_another},
            "practising": {},
            "instruction": {"begin": self._begin_round},
            "round": {},
            "void": {"next": self._go_on},
            "rating": {"rate": self._rate},
            "questions": {"answer": self._answer},
            "thanks": {"next": self._start_anew},
            "withdrawn": {"next": self._start_anew},
        }

    def end_practice(self, test: Mapping[str, Any]) -> None:
        """Keep what the practice showed of the device, and go on."""
        self._begun.notes.keep_practice(test)
        self.screen, self._practice_over = self._next_of_session(), True

    def break_off_practice(self, reason: str) -> None:
        """Let the practice begin again, as it could not go on."""
        self.screen, self.void_reason = "practice", reason

    def break_off(self, reason: str) -> None:
        """Show that what was played could not be kept, and why; it can be played again, or goes on if it was kept."""
        if self.screen == "practising":
            self.break_off_practice(reason)
        elif self.screen == "round":
            self.screen, self.void_reason = "void", reason

    def end_round(self, record: RoundRecord) -> None:
        """Keep the round that was played; its statements are rated next.

        Raises:
            RecordNotWritten: it cannot be kept.
        """
        planned = self._planned
        try:
            self._begun.record_round(planned.number, record)
        except RecordNotWritten:
            if self.round == planned:
                raise
            # the round is kept, and tables alone are not: they are written again with its ratings
        self.screen = self._next_of_session()

    def void_round(self, reason: str) -> None:
        """Note that the round under way does not count; it is played again, unless that was tried often enough.

        Raises:
            RecordNotWritten: it cannot be kept.
        """
        session, planned = self._begun, self._planned
        attempt = session.notes.attempts_at(planned.number) + 1
        if attempt < MOST_ATTEMPTS:
            aside = session.clear_unfinished(planned.number)
            folder = "" if aside is None else aside.name
            session.record_void_attempt(VoidAttempt(planned.number, attempt, timestamp(), reason, folder))
        else:
            session.record_round(
                planned.number,
                RoundRecord(ended=timestamp(), success=False, reason="not judged", void=True, void_reason=reason),
            )
        self.screen, self.void_reason = "void", reason

    def _next_of_session(self) -> str:
        session, plan = self._begun, self.study.plan
        if session.notes.withdrawn is not None:
            return "withdrawn"
        if session.notes.practice is None and plan.practice > 0.0:
            return "practice"
        if session.unrated_round is not None:
            return "rating"
        if session.next_round is not None:
            return "instruction"
        return "thanks" if session.is_complete else "questions"

    @property
    def _begun(self) -> SessionFolder:
        if self.session is None:
            raise InvalidAction("no session has begun")
        return self.session

    @property
    def _planned(self) -> Round:
        planned = self.round
        if planned is None:
            raise InvalidAction("all rounds have been played")
        return planned

    def _continue(self, value: Any) -> None:
        unfinished = {s.session.number: s.session.pseudonym for s in self._unfinished}
        if isinstance(value, bool) or not isinstance(value, int) or value not in unfinished:
            valid = ", ".join(f"{number} ({name})" for number, name in unfinished.items()) or "there is none"
            raise InvalidAction(f"no unfinished session has the number {value!r}: {valid}")
        self._sit_down(value)

    def _choose_language(self, value: Any) -> None:
        if not isinstance(value, str) or value not in self.study.plan.texts:
            raise InvalidAction(f"no language {value!r}: {nearest(str(value), self.study.plan.texts)}")
        self._language, self.screen = value, "consent"

    def _consent(self, value: Any) -> None:
        if not isinstance(value, bool):
            raise InvalidAction("consent is true or false")
        self.screen = "declined" if not value else "eligibility" if self.text.eligibility else "device"

    def _confirm(self, value: Any) -> None:
        answers: list[Any] = cast(list[Any], value) if isinstance(value, list) else []
        asked = len(self.text.eligibility)
        if len(answers) != asked or not all(isinstance(v, bool) for v in answers):
            raise InvalidAction(f"eligibility takes {asked} times true or false")
        self._eligibility = [bool(v) for v in answers]
        self.screen = "device" if all(self._eligibility) else "declined"

    def _choose_device(self, value: Any) -> None:
        settings: Any = {}
        if isinstance(value, dict):
            given = cast(dict[str, Any], value)
            value, settings = given.get("device"), given.get("settings", {})
        if value not in self._devices:
            raise InvalidAction(f"no device {value!r}: {nearest(str(value), self._devices)}")
        device: dict[str, Any] = {"device": value, "device_settings": _settings_of(settings)}
        if self.session is not None:
            self.session = self.study.replace_session(self.session, replace(self.session.session, **device))
        else:
            session = Session(
                number=self.number,
                language=self._language,
                consent=True,
                eligibility=self._eligibility,
                pilot=self.study.plan.pilot,
                started=timestamp(),
                **device,
            )
            self.session = self.study.begin(session)
        self.screen = self._next_of_session()

    def _choose_another(self, _value: Any) -> None:
        self.screen, self.void_reason = "device", ""

    def _begin_practice(self, _value: Any) -> None:
        self.screen = "practising"

    def _begin_round(self, _value: Any) -> None:
        with contextlib.suppress(RecordNotWritten):  # reported where the round itself is to be kept
            self._begun.note_begun(self._planned.number)
        self.screen, self._practice_over = "round", False

    def _go_on(self, _value: Any) -> None:
        self.screen, self.void_reason = self._next_of_session(), ""

    def _rate(self, value: Any) -> None:
        unrated = self._begun.unrated_round
        if unrated is None:  # its ratings are kept, but tables could not be written
            self._begun.write_tables()
            self.screen = self._next_of_session()
            return
        if not isinstance(value, dict):
            raise InvalidAction("rate takes a number for each statement, by its name")
        try:
            self._begun.record_answers(unrated.number, cast(dict[str, int], value))
        except (ValueError, TypeError) as e:
            raise InvalidAction(str(e)) from e
        self.screen = self._next_of_session()

    def _answer(self, value: Any) -> None:
        answers = cast(dict[Any, Any], value) if isinstance(value, dict) else {"": 0}
        if not all(isinstance(k, str) and isinstance(v, str) and len(v) <= _LONGEST_TEXT for k, v in answers.items()):
            raise InvalidAction(
                f"answer takes a text of up to {_LONGEST_TEXT} characters for each question, by its name"
            )
        try:
            self._begun.record_questionnaire(cast(dict[str, str], answers))
        except ValueError as e:
            raise InvalidAction(str(e)) from e
        self.screen = "thanks"

    def _withdraw(self) -> None:
        """End the session, as the participant wants; what was kept until then is in no result."""
        if self.session is None or self.screen in ("thanks", "withdrawn", "declined"):
            raise InvalidAction("no session is under way")
        self.session.notes.keep_withdrawal(Withdrawal(timestamp()))
        self.screen = "withdrawn"

    def _start_anew(self, _value: Any) -> None:
        self._begin()

    def content(self) -> dict[str, Any]:
        """Return what the screen shows, as JSON can hold it; the page has the words of its buttons."""
        plan, text = self.study.plan, self.text
        shown: dict[str, Any] = {
            "screen": self.screen,
            "title": plan.title,
            "language": self._language,
            "pilot": plan.pilot,
            "participants": plan.participants,
            "participant": None if self.session is None else self.session.session.pseudonym,
            "device": None if self.session is None else self.session.session.device,
        }
        return {**shown, **self._details(text)}

    @property
    def _void(self) -> dict[str, str]:
        """Why the round does not count, or the practice begins again."""
        return {"reason": self.void_reason, "cause": VoidCause.of(self.void_reason)}

    def _details(self, text: StudyText) -> dict[str, Any]:
        plan, planned = self.study.plan, self.round
        match self.screen:
            case "who":
                return who(self.study, self._unfinished)
            case "language":
                return {"languages": {name: t.language for name, t in plan.texts.items()}}
            case "consent":
                return {"welcome": text.welcome, "consent": text.consent}
            case "eligibility":
                return {"eligibility": list(text.eligibility)}
            case "device":
                return {"devices": {name: DEVICES[name] for name in self._devices}}
            case "practice" | "practising":
                return {"practice": text.practice, "seconds": plan.practice, **self._void}
            case "instruction" | "round":
                begins = {} if planned is None else round_to_play(plan, planned, text)
                return {**begins, "practice_over": self._practice_over}
            case "void":
                return {**self._void, "again": planned is not None}
            case "rating":
                return rating(plan, self._begun.unrated_round, text)
            case "questions":
                return {"questions": questions(plan, text)}
            case "thanks":
                return {"thanks": text.thanks}
            case _:
                return {}


SCREENS = (
    "who",
    "language",
    "consent",
    "eligibility",
    "declined",
    "device",
    "practice",
    "practising",
    "instruction",
    "round",
    "void",
    "rating",
    "questions",
    "thanks",
    "withdrawn",
    "complete",
)
"""What a page can show."""


def _settings_of(given: Any) -> dict[str, Any]:
    """Return settings of a device that are numbers or short texts; anything else is left out."""
    if not isinstance(given, dict):
        return {}
    items = list(cast(dict[Any, Any], given).items())[:20]
    return {str(k)[:40]: v for k, v in items if _is_plain(v)}


def _is_plain(value: Any) -> bool:
    if isinstance(value, (bool, int, float)):
        return abs(value) <= sys.float_info.max
    return isinstance(value, str) and len(value) <= 200
