"""Sections of a study's page that have its results: failures, ratings, tests, order effects, the mixed model.

Numbers of scripted pilots are headed by that word wherever they stand.
"""

from collections.abc import Sequence

from markupsafe import Markup

from handover.cosim.exceptions import counted
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.published.free_flyer.handovers import STUDIED, published_failures
from handover.scenarios.published.verdicts import format_interval, format_p_value, format_share
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Task
from handover.scenarios.runs.reporting.html import plot_html, rows_table
from handover.scenarios.runs.reporting.page import Section
from handover.scenarios.study.folder.codebook import PILOT
from handover.scenarios.study.report.report_plots import ratings_figure, shifts_figure
from handover.scenarios.study.statistics.analysis import FailureCount, StatementModel, StudyAnalysis
from handover.scenarios.study.statistics.exact_tests import MIN_PARTICIPANTS, SignedRankTest
from handover.scenarios.study.statistics.mixed_ordinal import Effect

_TOO_FEW = "too few"
_SCENARIOS = {
    "flyer_robot_to_human": Task.ROBOT_TO_HUMAN,
    "flyer_human_to_robot": Task.HUMAN_TO_ROBOT,
    "flyer_collaborative": Task.COLLABORATIVE,
}
"""The thesis's tasks by the scenarios that a plan may have under other names."""


class Words:
    """What a page calls tasks, behaviours and results.

    Attributes:
        text: what people read, in the plan's first language.
        first, second: the behaviours.
        whose: heads columns of numbers: "ours", or of pilots that they are.
    """

    def __init__(self, analysis: StudyAnalysis) -> None:
        plan = analysis.plan
        self.text = next(iter(plan.texts.values()))
        self.first, self.second = plan.behaviours
        self.whose = PILOT if plan.pilot else "ours"

    def task(self, name: str) -> str:
        """Return a task as people read it."""
        return self.text.task_names[name]


def note(text: str) -> Markup:
    """Return a sentence below a table or a plot."""
    return Markup("<p class='soft'>{}</p>").format(text)


def failures_section(analysis: StudyAnalysis, words: Words) -> Section:
    """Return counts by task and behaviour with intervals, their comparison within participants, and what happened."""
    rows = [
        (words.task(c.task), c.behaviour, str(c.failures), str(c.rounds), _interval_of(c), str(c.unsuccessful))
        for c in analysis.failures
    ]
    header = ("task", "behaviour", "failed", "rounds", "failed, 95 %", "not successful")
    table = rows_table(header, rows, numbers=(2, 3, 4, 5), caption=f"Rounds that failed by the rule: {words.whose}")
    unjudged = sum(c.unjudged for c in analysis.failures)
    text = (
        "The rule of [Fernandes2020] sec. 5.6: the object was not transferred, or was out of both hands in between. "
        "Intervals of Clopper and Pearson, which take rounds for independent, though two are of one participant. Not "
        "successful: as a run of the scenario is judged, which asks more than the rule."
    )
    if unjudged:
        text += f" Rounds whose record does not say who held the object, and which are left out: {unjudged}."
    return Section(
        anchor="failures",
        title="Failures",
        html=table + note(text) + _failure_tests(analysis, words) + _failed_rounds(analysis, words),
    )


def _interval_of(c: FailureCount) -> str:
    if c.low is None or c.high is None:
        return "–"
    return f"{format_share(c.failures / c.rounds)} ({format_interval(c.low, c.high)})"


def _failure_tests(analysis: StudyAnalysis, words: Words) -> Markup:
    rows: list[tuple[str, ...]] = []
    for t in analysis.failure_tests:
        difference = "–" if t.difference is None else f"{_signed(100 * t.difference, 0)} %"
        p = [_TOO_FEW if p is None else format_p_value(p) for p in (t.p_pairs, t.p_holm, t.p_participants)]
        rows.append((words.task(t.task), str(t.participants), difference, *p))
    header = ("task", "participants", f"{words.first} − {words.second}", "p, pairs", "p, Holm", "p, participants")
    caption = f"Failures compared within participants: {words.whose}"
    return rows_table(header, rows, numbers=range(1, 6), caption=caption) + note(
        "p, pairs: exact flips within pairs, a participant's rounds of both behaviours in the same task and period; "
        "Holm: the same, corrected over tasks; p, participants: exact flips of whole participants, which lets rounds "
        "of one depend on each other." + _too_few_note([t.participants for t in analysis.failure_tests])
    )


def _failed_rounds(analysis: StudyAnalysis, words: Words) -> Markup:
    failed = [r for r in analysis.counted if r["failed_by_rule"] or not r["success"]]
    if not failed:
        return note("No round that counts failed.")
    rows = [
        (
            r["participant"],
            str(r["round"]),
            words.task(r["task"]),
            r["behaviour"],
            {True: "failed", False: "did not fail", None: "not judged"}[r["failed_by_rule"]],
            r["reason"],
        )
        for r in failed
    ]
    header = ("participant", "round", "task", "behaviour", "by the rule", "by ground truth")
    table = rows_table(header, rows, numbers=(1,))
    return Markup("<details><summary>What happened in {}</summary>{}</details>").format(
        counted(len(failed), "round"), table
    )


def published_section(analysis: StudyAnalysis, words: Words) -> Section | None:
    """Return table 5.1 of the thesis and its p-values beside these; None if the plan has none of its conditions."""
    rows = [row for c in analysis.failures if (row := _published_row(analysis, words, c)) is not None]
    if not rows:
        return None
    header = ("task", "behaviour", "published", words.whose)
    caption = "Table 5.1, of ten people: handovers that failed"
    html = rows_table(header, rows, numbers=(2, 3), caption=caption) + _published_tests(analysis, words)
    html += note(
        "Table 5.1 has ten people, two rounds each; their orders were drawn, and a Leap Motion followed their hands. "
        "Which test gave the published p-values is not stated."
    )
    return Section(anchor="published", title="Beside the thesis", html=html)


def _published_row(analysis: StudyAnalysis, words: Words, c: FailureCount) -> tuple[str, ...] | None:
    condition = analysis.plan.condition(c.task, c.behaviour)
    task = _SCENARIOS.get(condition.scenario)
    behaviour = {b.item: b for b in Behaviour}.get(condition.parameters.get("behaviour", ""))
    if task is None or behaviour is None:
        return None
    failed, of = published_failures(task, behaviour)
    ours = f"{c.failures} of {c.rounds}, {format_share(c.failures / c.rounds)}" if c.rounds else "no round"
    return words.task(c.task), c.behaviour, f"{failed} of {of}, {format_share(failed / of)}", ours


def _published_tests(analysis: StudyAnalysis, words: Words) -> Markup:
    published = paper_values("free_flyer", "published")
    statements = {text: k for k, text in enumerate(published["statements"])}
    rows: list[tuple[str, ...]] = []
    for t in analysis.rating_tests:
        task = _SCENARIOS.get(analysis.plan.condition(t.task, words.first).scenario)
        k = statements.get(words.text.statements[t.statement])
        if task is None or k is None:
            continue
        theirs = f"{published['p_values'][STUDIED.index(task)][k]:.4f}"
        rows.append((t.statement, words.task(t.task), theirs, _TOO_FEW if t.test is None else format_p_value(t.test.p)))
    if not rows:
        return Markup()
    header = ("statement", "task", "published", words.whose)
    caption = "Sec. 5.8: p-values of ratings, not corrected"
    return rows_table(header, rows, numbers=(2, 3), caption=caption)


def ratings_section(analysis: StudyAnalysis, words: Words) -> Section:
    """Return a plot of each statement, with every participant's means and the means of all."""
    if not analysis.means:
        return Section(anchor="ratings", title="Ratings", html=note("No participant has rated both behaviours yet."))
    html = Markup()
    for name in analysis.plan.statements:
        label = f"{name}: {words.text.statements[name]}"
        html += Markup("<h3>{}</h3>").format(label) + plot_html(
            ratings_figure(analysis, words.text.task_names, name), 340, label
        )
    return Section(
        anchor="ratings",
        title="Ratings",
        html=html
        + note(
            f"Participants' means, {words.whose}, a line each between the two behaviours; a bar is the mean of all. "
            f"From {analysis.plan.scale[0]}, {words.text.lowest}, to {analysis.plan.scale[1]}, {words.text.highest}."
        ),
    )


def tests_section(analysis: StudyAnalysis, words: Words) -> Section:
    """Return the tests of all ratings, as a plot of shifts with intervals and a table."""
    rows = [
        (
            t.statement,
            words.task(t.task),
            str(t.participants),
            *(("–", "–") if t.first is None or t.second is None else (f"{t.first:.2f}", f"{t.second:.2f}")),
            *_of_test(t.test),
            _TOO_FEW if t.p_holm is None else format_p_value(t.p_holm),
        )
        for t in analysis.rating_tests
    ]
    header = ("statement", "task", "participants", words.first, words.second, "shift, 95 %", "p", "p, Holm")
    caption = f"{words.first} − {words.second}: {words.whose}"
    table = rows_table(header, rows, numbers=range(2, 8), caption=caption)
    text = (
        "Means of the participants' means; shift of Hodges and Lehmann with its exact interval; p: exact Wilcoxon "
        f"signed-rank test, two-sided; Holm: corrected over the {analysis.tested} tests that "
        f"were made, of {len(rows)}."
    )
    tested = [t for t in analysis.rating_tests if t.test is not None]
    plot = Markup()
    if tested:
        figure = shifts_figure(tested, words.text.task_names, f"{words.first} − {words.second}, points")
        plot = plot_html(figure, 90 + 42 * len(tested), "shifts with intervals")
    few = _too_few_note([t.participants for t in analysis.rating_tests])
    return Section(anchor="tests", title="Tests of ratings", html=plot + table + note(text + few))


def _of_test(test: SignedRankTest | None) -> tuple[str, str]:
    if test is None:
        return _TOO_FEW, _TOO_FEW
    return _shift(test), format_p_value(test.p)


def _shift(x: SignedRankTest | Effect) -> str:
    return f"{_signed(x.estimate)} ({_signed(x.low)} to {_signed(x.high)})"


def _signed(x: float, digits: int = 2) -> str:
    """Return a number with its sign, of which 0 has none."""
    return f"{x:+.{digits}f}" if round(x, digits) else f"{0.0:.{digits}f}"


def order_section(analysis: StudyAnalysis, words: Words) -> Section:
    """Return how ratings and failures go with the order of rounds."""
    meant = {
        "round": "a round later",
        "period": "a period later",
        "carry-over": f"after {words.first}, not {words.second}",
    }
    rows = [(meant[e.effect], e.measure, str(e.participants), *_of_test(e.test)) for e in analysis.order_effects]
    header = ("order", "measure", "participants", "shift, 95 %", "p")
    table = rows_table(header, rows, numbers=(2, 3, 4), caption=f"Order effects: {words.whose}")
    text = (
        "Slopes within a participant's conditions by least squares, so that no effect of behaviour or task is in them. "
        "The round's number, or the period, is fitted together with the behaviour before, so that void "
        "rounds or unbalanced orders leave neither in the other; the first round, after nothing, is left out. Over "
        "participants by the exact signed-rank test, not corrected. Ratings in points, failures as 0 or 1."
    )
    few = _too_few_note([e.participants for e in analysis.order_effects])
    return Section(anchor="order", title="Order effects", html=table + note(text + few))


def model_section(analysis: StudyAnalysis, words: Words) -> Section:
    """Return the mixed ordinal model of each statement."""
    rows = [row for m in analysis.models for row in _model_rows(m, analysis, words)]
    header = ("statement", "effect", "log-odds, 95 %", "p")
    html = rows_table(header, rows, numbers=(2, 3), caption=f"Mixed ordinal model: {words.whose}")
    html += Markup().join(note(f"{m.statement}: no model, as {m.reason}.") for m in analysis.models if m.model is None)
    text = (
        "A supplement: a cumulative logit model by maximum likelihood, in which each participant has an intercept and, "
        "in each task, a slope of the behaviour, as participants differ in how much it matters to them; their standard "
        "deviations are in the first lines of each statement. Wald intervals are approximate, the tests above are "
        "exact. Tasks and period have no slopes in the model, so that their intervals would be too narrow: estimates "
        f"alone are given. A positive effect of the behaviour: {words.first} is rated higher."
    )
    return Section(anchor="model", title="Mixed ordinal model", html=html + note(text))


def _model_rows(m: StatementModel, analysis: StudyAnalysis, words: Words) -> list[tuple[str, ...]]:
    if m.model is None:
        return []
    tasks = analysis.plan.tasks
    names = [f"{words.first} − {words.second}: {words.task(t)}" for t in tasks]
    names += [f"{words.task(t)}, not {words.task(tasks[0]).lower()}" for t in tasks[1:]]
    names += ["a period later"] if "period" in m.names else []
    rows: list[tuple[str, ...]] = [
        (m.statement, "participants' intercepts, standard deviation", f"{m.model.deviation:.2f}", "")
    ]
    if m.model.slope_deviation is not None:
        label = f"participants' {words.first} − {words.second}, standard deviation"
        rows.append((m.statement, label, f"{m.model.slope_deviation:.2f}", ""))
    for k, (name, e) in enumerate(zip(names, m.model.effects, strict=True)):
        shift, p = (_shift(e), format_p_value(e.p)) if k < m.tested else (_signed(e.estimate), "not tested")
        rows.append((m.statement, name, shift, p))
    return rows


def _too_few_note(participants: Sequence[int]) -> str:
    if not participants or min(participants) >= MIN_PARTICIPANTS:
        return ""
    return (
        f" Too few: with fewer than {MIN_PARTICIPANTS} participants no exact test of signs can reject at 5 %, so that "
        "none is made."
    )
