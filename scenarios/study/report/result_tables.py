"""A study's results as tables, with a codebook of their own: results/failures.csv, rating_tests.csv and others."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from handover.scenarios.runs.results.run_folder import disk_errors_reported, folder_within
from handover.scenarios.study.folder.codebook import (
    NUMBER,
    PERSON,
    PILOT,
    TEXT,
    WHO,
    WHOLE,
    Column,
    write_codebook,
    write_csv,
)
from handover.scenarios.study.plan.plan import StudyPlan
from handover.scenarios.study.statistics.analysis import StudyAnalysis
from handover.scenarios.study.statistics.exact_tests import SignedRankTest

_Rows = list[dict[str, Any]]

_KIND = WHO[1]
_TASK = Column("task", TEXT, "", "task of the plan")
_BEHAVIOUR = Column("behaviour", TEXT, "", "behaviour of the robot, of the plan")
_STATEMENT = Column("statement", TEXT, "", "statement of the plan")
_MOST = (
    Column("participants", WHOLE, "1", "participants whose rounds enter the test"),
    Column("zeros", WHOLE, "1", "participants whose difference is 0", optional=True),
    Column("estimate", NUMBER, "1", "shift by Hodges and Lehmann; empty with fewer than six participants", True),
    Column("low", NUMBER, "1", "lower end of its interval, at 95 % at least", optional=True),
    Column("high", NUMBER, "1", "upper end of it", optional=True),
    Column("p", NUMBER, "1", "exact Wilcoxon signed-rank test, two-sided, ties and zeros included", optional=True),
)


def _p(name: str, meaning: str) -> Column:
    return Column(name, NUMBER, "1", f"{meaning}; empty with fewer than six participants", optional=True)


def result_columns(plan: StudyPlan) -> Mapping[str, Sequence[Column]]:
    """Return the columns of each table by its name without an ending."""
    first, second = plan.behaviours
    difference = f"{first} minus {second}"
    return {
        "failures": (
            _KIND,
            _TASK,
            _BEHAVIOUR,
            Column("rounds", WHOLE, "1", "rounds that count and whose record says who held the object"),
            Column("failures", WHOLE, "1", "rounds of these that failed by the rule"),
            Column("unjudged", WHOLE, "1", "rounds that count and whose record does not say who held the object"),
            Column("unsuccessful", WHOLE, "1", "rounds that count and did not succeed as `handover run` judges"),
            Column("low", NUMBER, "1", "lower end of the share's interval, Clopper and Pearson, 95 %", optional=True),
            Column("high", NUMBER, "1", "upper end of it", optional=True),
        ),
        "failure_tests": (
            _KIND,
            _TASK,
            Column("participants", WHOLE, "1", "participants with a complete pair of judged rounds"),
            Column("difference", NUMBER, "1", f"mean difference of their shares of failures, {difference}", True),
            _p("p_pairs", "exact flips within pairs of both behaviours in the same task and period, two-sided"),
            _p("p_holm", "the same, corrected over tasks by Holm"),
            _p("p_participants", "exact flips of whole participants' differences, two-sided"),
        ),
        "rating_means": (
            *WHO,
            _TASK,
            _STATEMENT,
            Column("first", NUMBER, "1", f"mean of the participant's ratings in complete pairs, {first}"),
            Column("second", NUMBER, "1", f"the same, {second}"),
        ),
        "rating_tests": (
            _KIND,
            _TASK,
            _STATEMENT,
            Column("first", NUMBER, "1", f"mean of the participants' means, {first}", optional=True),
            Column("second", NUMBER, "1", f"the same, {second}", optional=True),
            *_MOST,
            _p("p_holm", "the same, corrected over all statements and tasks by Holm"),
        ),
        "order_effects": (
            _KIND,
            Column("effect", TEXT, "", f"round: each round later; period; carry-over: after {first}, not {second}"),
            Column("measure", TEXT, "", "statement, or failure: 1 of a round that failed by the rule"),
            *_MOST,
        ),
        "mixed_model": (
            _KIND,
            _STATEMENT,
            Column("effect", TEXT, "", f"behaviour: {difference}, in a task; task: against the first; period"),
            Column("estimate", NUMBER, "1", "log-odds of a higher rating; empty where it is not determined", True),
            Column("low", NUMBER, "1", "lower end of its Wald interval, 95 %; of behaviour alone", optional=True),
            Column("high", NUMBER, "1", "upper end of it", optional=True),
            Column(
                "p", NUMBER, "1", "of Wald's test, two-sided; of behaviour alone, which has slopes in the model", True
            ),
            Column("deviation", NUMBER, "1", "standard deviation of the participants' intercepts, log-odds", True),
            Column("slope_deviation", NUMBER, "1", "the same of their slopes of behaviour, each task its own", True),
            Column("reason", TEXT, "", "why there is no model", optional=True),
        ),
    }


def write_results(analysis: StudyAnalysis, folder: Path) -> None:
    """Write all results as CSV with their codebook into a folder.

    Raises:
        RecordNotWritten: they cannot be written.
    """
    with disk_errors_reported(folder):
        folder_within(folder)
    columns = result_columns(analysis.plan)
    kind = PILOT if analysis.plan.pilot else PERSON
    for name, rows_of in _ROWS.items():
        write_csv(folder / f"{name}.csv", columns[name], [{"kind": kind, **row} for row in rows_of(analysis)])
    write_codebook(folder, analysis.plan, columns)


def _failures(analysis: StudyAnalysis) -> _Rows:
    return [asdict(count) for count in analysis.failures]


def _failure_tests(analysis: StudyAnalysis) -> _Rows:
    return [asdict(test) for test in analysis.failure_tests]


def _rating_means(analysis: StudyAnalysis) -> _Rows:
    return [asdict(means) for means in analysis.means]


def _rating_tests(analysis: StudyAnalysis) -> _Rows:
    return [{**asdict(t), **_of_test(t.test)} for t in analysis.rating_tests]


def _order_effects(analysis: StudyAnalysis) -> _Rows:
    return [{**asdict(e), **_of_test(e.test)} for e in analysis.order_effects]


def _of_test(test: SignedRankTest | None) -> dict[str, Any]:
    return {} if test is None else {name: getattr(test, name) for name in ("zeros", "estimate", "low", "high", "p")}


def _mixed_model(analysis: StudyAnalysis) -> _Rows:
    rows: _Rows = []
    for m in analysis.models:
        effects = [None] * len(m.names) if m.model is None else m.model.effects
        deviations = {} if m.model is None else {n: getattr(m.model, n) for n in ("deviation", "slope_deviation")}
        for k, (name, effect) in enumerate(zip(m.names, effects, strict=True)):
            shown = ("estimate", "low", "high", "p") if k < m.tested else ("estimate",)
            numbers = {} if effect is None else {n: getattr(effect, n) for n in shown}
            rows.append({"statement": m.statement, "effect": name, **numbers, **deviations, "reason": m.reason})
    return rows


_ROWS: Mapping[str, Callable[[StudyAnalysis], _Rows]] = {
    "failures": _failures,
    "failure_tests": _failure_tests,
    "rating_means": _rating_means,
    "rating_tests": _rating_tests,
    "order_effects": _order_effects,
    "mixed_model": _mixed_model,
}
