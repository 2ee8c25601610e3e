"""What follows from a study's rounds and ratings: failures, tests of ratings, order effects, a mixed model.

Differences are of the plan's first behaviour minus the second. Void rounds do not count, and who has withdrawn is not
there. Means are a participant's own, so that a participant counts once in a test, however many rounds there were.

What is not complete enters a comparison by complete pairs alone: rounds of both behaviours in the same task and period,
so that neither a broken-off session nor a void round gives one behaviour the later rounds.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from handover.scenarios.runs.campaign.statistics import holm, sign_flip_test, success_interval
from handover.scenarios.study.folder.session_folder import SessionFolder
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.statistics.exact_tests import (
    MIN_PARTICIPANTS,
    SignedRankTest,
    signed_rank_test,
    within_condition_slopes,
)
from handover.scenarios.study.statistics.mixed_ordinal import MixedModel, NotFitted, Slopes, fit_mixed_ordinal

FAILURE = "failure"
"""As a measure beside the statements: 1 of a round that failed by the rule, 0 of one that did not."""

_Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class FailureCount:
    """Rounds of a task and behaviour that failed by the rule, with the interval of Clopper and Pearson at 95 %.

    Attributes:
        rounds: that count and whose record says who held the object.
        failures: of these, by the rule.
        unjudged: rounds that count and whose record does not say it.
        unsuccessful: rounds that count and did not succeed as `handover run` judges.
        low, high: of the share of failures, None without rounds. It takes rounds for independent.
    """

    task: str
    behaviour: str
    rounds: int
    failures: int
    unjudged: int
    unsuccessful: int
    low: float | None
    high: float | None


@dataclass(frozen=True, kw_only=True)
class FailureTest:
    """Failures of a task compared within participants; p-values are None with fewer than six participants.

    Attributes:
        participants: with a complete pair of judged rounds.
        difference: of their shares of failures, mean.
        p_pairs: by flips within complete pairs: rounds of one participant are taken for independent.
        p_holm: the same, corrected over tasks.
        p_participants: by flips of whole participants' differences: rounds of one may depend on each other. A
            participant has the weight of the number of pairs.
    """

    task: str
    participants: int
    difference: float | None
    p_pairs: float | None
    p_holm: float | None
    p_participants: float | None


@dataclass(frozen=True, kw_only=True)
class PairedMeans:
    """A participant's mean ratings of a statement in a task."""

    participant: str
    task: str
    statement: str
    first: float
    second: float


@dataclass(frozen=True, kw_only=True)
class RatingTest:
    """Ratings of a statement in a task compared; `test` is None with fewer than six participants.

    Attributes:
        participants: with a complete pair of ratings.
        first, second: means of the participants' means.
        p_holm: corrected over all tests.
    """

    task: str
    statement: str
    participants: int
    first: float | None
    second: float | None
    test: SignedRankTest | None
    p_holm: float | None = None


@dataclass(frozen=True, kw_only=True)
class OrderEffect:
    """How a measure goes with the order, in the participants' slopes within conditions; `test` None if too few.

    Attributes:
        effect: "round", "period" or "carry-over".
        measure: a statement, or "failure".
        participants: whose rounds give a slope.
    """

    effect: str
    measure: str
    participants: int
    test: SignedRankTest | None


@dataclass(frozen=True, kw_only=True)
class StatementModel:
    """The mixed ordinal model of a statement; None with the reason why there is none.

    Attributes:
        names: of the effects, in order: of the behaviour in each task, of tasks, and of the period.
        tested: how many of these, from the first, have random slopes, and so an interval and a p-value that hold.
    """

    statement: str
    names: Sequence[str]
    tested: int
    model: MixedModel | None
    reason: str


class StudyAnalysis:
    """The results of a study, as far as it has come.

    Attributes:
        study: its folder.
        sessions: all that have begun.
        rounds: rows of rounds that were played, see `codebook.ROUNDS`.
        answers: rows of ratings.
    """

    def __init__(self, study: StudyFolder) -> None:
        self.study, self.plan = study, study.plan
        self.sessions: Sequence[SessionFolder] = study.sessions
        self.rounds: list[_Row] = [row for s in self.sessions for row in s.rounds_rows()]
        self.answers: list[_Row] = [row for s in self.sessions for row in s.answers_rows()]

    @cached_property
    def complete_sessions(self) -> Sequence[SessionFolder]:
        """Those of which all rounds were played and rated, and the questions answered."""
        return [s for s in self.sessions if s.is_complete]

    @property
    def counted(self) -> list[_Row]:
        """Rounds that count."""
        return [row for row in self.rounds if not row["void"]]

    @cached_property
    def failures(self) -> Sequence[FailureCount]:
        """Failures by task and behaviour, in the plan's order."""
        return [self._failures(c.task, c.behaviour) for c in self.plan.conditions]

    def _failures(self, task: str, behaviour: str) -> FailureCount:
        rows = [r for r in self.counted if (r["task"], r["behaviour"]) == (task, behaviour)]
        judged = [r for r in rows if r["failed_by_rule"] is not None]
        failed = sum(r["failed_by_rule"] for r in judged)
        interval = success_interval(failed, len(judged)) if judged else None
        return FailureCount(
            task=task,
            behaviour=behaviour,
            rounds=len(judged),
            failures=failed,
            unjudged=len(rows) - len(judged),
            unsuccessful=sum(not r["success"] for r in rows),
            low=None if interval is None else interval.low,
            high=None if interval is None else interval.high,
        )

    @cached_property
    def failure_tests(self) -> Sequence[FailureTest]:
        """Failures of each task compared within participants, corrected over tasks."""
        tests = [self._failure_test(task) for task in self.plan.tasks]
        corrected = _holm(t.p_pairs for t in tests)
        return [replace(t, p_holm=p) for t, p in zip(tests, corrected, strict=True)]

    def _failure_test(self, task: str) -> FailureTest:
        of_participants = [d for s in self.sessions if (d := self._pair_differences(s.session.pseudonym, task))]
        enough = len(of_participants) >= MIN_PARTICIPANTS
        return FailureTest(
            task=task,
            participants=len(of_participants),
            difference=float(np.mean([np.mean(d) for d in of_participants])) if of_participants else None,
            p_pairs=sign_flip_test([x for d in of_participants for x in d]) if enough else None,
            p_holm=None,
            p_participants=sign_flip_test([sum(d) for d in of_participants]) if enough else None,
        )

    def _pair_differences(self, participant: str, task: str) -> list[int]:
        """Return a participant's differences of failures in the complete pairs of a task, one a period."""
        rows = [r for r in self.counted if (r["participant"], r["task"]) == (participant, task)]
        pairs: dict[int, int] = {}
        for r in self._paired([r for r in rows if r["failed_by_rule"] is not None]):
            side = 1 if r["behaviour"] == self.plan.behaviours[0] else -1
            pairs[r["period"]] = pairs.get(r["period"], 0) + side * int(r["failed_by_rule"])
        return list(pairs.values())

    @cached_property
    def means(self) -> Sequence[PairedMeans]:
        """Participants' means of each task and statement over complete pairs of ratings."""
        values: dict[tuple[str, str, str, str], list[int]] = {}
        for a in self._paired(self._rated):
            values.setdefault((a["participant"], a["task"], a["statement"], a["behaviour"]), []).append(a["value"])
        found: list[PairedMeans] = []
        for task in self.plan.tasks:
            for statement in self.plan.statements:
                for s in self.sessions:
                    who = s.session.pseudonym
                    first, second = (values.get((who, task, statement, b)) for b in self.plan.behaviours)
                    if first and second:
                        means = (float(np.mean(first)), float(np.mean(second)))
                        of = {"participant": who, "task": task, "statement": statement}
                        found.append(PairedMeans(**of, first=means[0], second=means[1]))
        return found

    def _paired(self, rows: Sequence[_Row]) -> list[_Row]:
        """Return the rows of complete pairs: the participant has both behaviours in the same task and period."""
        behaviours: dict[tuple[Any, ...], set[str]] = {}
        of = [(r["participant"], r["task"], r["period"], r.get("statement")) for r in rows]
        for key, row in zip(of, rows, strict=True):
            behaviours.setdefault(key, set()).add(row["behaviour"])
        return [row for key, row in zip(of, rows, strict=True) if len(behaviours[key]) == len(self.plan.behaviours)]

    @property
    def _rated(self) -> list[_Row]:
        return [a for a in self.answers if not a["void"]]

    @cached_property
    def rating_tests(self) -> Sequence[RatingTest]:
        """Ratings of each statement in each task compared, corrected over all of them."""
        tests = [self._rating_test(task, name) for name in self.plan.statements for task in self.plan.tasks]
        corrected = _holm(None if t.test is None else t.test.p for t in tests)
        return [replace(t, p_holm=p) for t, p in zip(tests, corrected, strict=True)]

    @property
    def tested(self) -> int:
        """How many tests of ratings were made: over so many they are corrected."""
        return sum(t.test is not None for t in self.rating_tests)

    def _rating_test(self, task: str, statement: str) -> RatingTest:
        pairs = [m for m in self.means if (m.task, m.statement) == (task, statement)]
        return RatingTest(
            task=task,
            statement=statement,
            participants=len(pairs),
            first=float(np.mean([m.first for m in pairs])) if pairs else None,
            second=float(np.mean([m.second for m in pairs])) if pairs else None,
            test=signed_rank_test([m.first - m.second for m in pairs]),
        )

    @cached_property
    def order_effects(self) -> Sequence[OrderEffect]:
        """How ratings and failures go with the round's number, the period, and the behaviour of the round before.

        Of complete sessions, without their void rounds and the first, which comes after nothing. The number, or the
        period, and carry-over are fitted together: void rounds, and a number of sessions that is not a multiple of the
        conditions, would leave the one in the other's slope.
        """
        measured = {name: [a for a in self._rated if a["statement"] == name] for name in self.plan.statements}
        judged = [r for r in self.counted if r["failed_by_rule"] is not None]
        measured[FAILURE] = [{**r, "value": float(r["failed_by_rule"])} for r in judged]
        effects = ["round", *(["period"] if self.plan.repetitions > 1 else []), "carry-over"]
        return [self._order_effect(effect, name, rows) for effect in effects for name, rows in measured.items()]

    def _order_effect(self, effect: str, measure: str, rows: Sequence[_Row]) -> OrderEffect:
        slopes: list[float] = []
        for s in self.complete_sessions:
            own = [r for r in rows if r["participant"] == s.session.pseudonym and r["round"] > 1]
            if not own:  # all that were played are void
                continue
            x = [self._places(effect, s, r["round"]) for r in own]
            found = within_condition_slopes(x, [r["value"] for r in own], [(r["task"], r["behaviour"]) for r in own])
            if found is not None:
                slopes.append(found[1 if effect == "carry-over" else 0])
        return OrderEffect(effect=effect, measure=measure, participants=len(slopes), test=signed_rank_test(slopes))

    def _places(self, effect: str, session: SessionFolder, number: int) -> tuple[float, float]:
        """Return what a round has of practice, and of carry-over: 1 after the first behaviour, 0 after the second.

        Practice is the period where that is the effect, and the round's number beside the others.
        """
        before = session.rounds[number - 2].condition.behaviour
        practice = session.rounds[number - 1].period if effect == "period" else number
        return float(practice), float(before == self.plan.behaviours[0])

    @cached_property
    def models(self) -> Sequence[StatementModel]:
        """The mixed ordinal model of each statement."""
        return [self._model(name) for name in self.plan.statements]

    def _model(self, statement: str) -> StatementModel:
        rows = [a for a in self._rated if a["statement"] == statement]
        period = {(r["participant"], r["round"]): r["period"] for r in self.rounds}
        tasks, first = self.plan.tasks, self.plan.behaviours[0]
        names = [*(f"behaviour, {t}" for t in tasks), *(f"task {t}" for t in tasks[1:])]
        names += ["period"] if self.plan.repetitions > 1 else []
        if len({a["participant"] for a in rows}) < MIN_PARTICIPANTS:
            reason = f"fewer than {MIN_PARTICIPANTS} participants"
            return StatementModel(statement=statement, names=names, tested=len(tasks), model=None, reason=reason)
        x: list[list[float]] = []
        sides = [0.5 if a["behaviour"] == first else -0.5 for a in rows]
        slopes = Slopes(sides, [a["task"] for a in rows])
        for a, side in zip(rows, sides, strict=True):
            line = [side * (a["task"] == t) for t in tasks] + [float(a["task"] == t) for t in tasks[1:]]
            x.append([*line, *([float(period[a["participant"], a["round"]])] if "period" in names else [])])
        try:
            model = fit_mixed_ordinal([a["value"] for a in rows], x, [a["participant"] for a in rows], slopes)
        except NotFitted as e:
            return StatementModel(statement=statement, names=names, tested=len(tasks), model=None, reason=str(e))
        return StatementModel(statement=statement, names=names, tested=len(tasks), model=model, reason="")


def _holm(p: Iterable[float | None]) -> list[float | None]:
    """Return p-values corrected for the number of those that there are."""
    values = list(p)
    corrected = iter(holm([v for v in values if v is not None]))
    return [None if v is None else next(corrected) for v in values]
