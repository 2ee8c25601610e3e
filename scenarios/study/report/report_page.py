"""Writes the page of a study: who took part, what did not count, the results, and the methods in words."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from handover.cosim.exceptions import counted
from handover.scenarios.runs.reporting.html import rows_table
from handover.scenarios.runs.reporting.page import Section, template, write_page
from handover.scenarios.study.folder.codebook import PILOT
from handover.scenarios.study.folder.session_folder import pseudonym_of
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.order import balance_of_complete, order_row
from handover.scenarios.study.report.report_sections import (
    Words,
    failures_section,
    model_section,
    note,
    order_section,
    published_section,
    ratings_section,
    tests_section,
)
from handover.scenarios.study.report.result_tables import result_columns, write_results
from handover.scenarios.study.statistics.analysis import StudyAnalysis
from handover.scenarios.study.statistics.exact_tests import MIN_PARTICIPANTS

NO_PERSON = f"{PILOT.capitalize()}: no person took part."
"""On every section of a page whose sessions programs played."""


def write_study_report(study: StudyFolder, file: Path | None = None) -> Path:
    """Write the tables of all participants, the results, and the page; return the page.

    Args:
        study: it need not be complete.
        file: where the page goes; by default `report.html` in the folder.

    Raises:
        InvalidRunFolder: what is kept of a session is damaged. RecordNotWritten: something cannot be written.
    """
    analysis = StudyAnalysis(study)
    words = Words(analysis)
    sections = [
        _participants_section(analysis),
        _exclusions_section(analysis, words),
        failures_section(analysis, words),
        published_section(analysis, words),
        ratings_section(analysis, words),
        tests_section(analysis, words),
        order_section(analysis, words),
        model_section(analysis, words),
        _methods_section(analysis),
        _files_section(analysis),
    ]
    study.write_tables()
    write_results(analysis, study.path / "results")
    page = file or study.path / "report.html"
    title = f"{study.plan.title} ({PILOT})" if study.plan.pilot else study.plan.title
    write_page(page, title, _header(analysis), [_marked(s, study.plan.pilot) for s in sections if s is not None])
    return page


def _marked(section: Section, pilot: bool) -> Section:
    """Return a section that says, if it is so, that no person took part."""
    if not pilot:
        return section
    html = Markup("<p class='soft'><b>{}</b></p>").format(NO_PERSON) + section.html
    return Section(anchor=section.anchor, title=section.title, html=html, scripts=section.scripts)


def _header(analysis: StudyAnalysis) -> Markup:
    plan, n = analysis.plan, len(analysis.sessions)
    incomplete = [s.session.pseudonym for s in analysis.sessions if not s.is_complete]
    lines: list[Markup] = []
    if plan.pilot:
        lines.append(Markup("<p class='verdict bad'><b>Scripted pilot</b>: no person took part.</p>"))
    who = counted(n, PILOT if plan.pilot else "participant")
    valid, played = len(analysis.counted), len(analysis.rounds)
    text = f"{plan.participants} are planned; {valid} of {played} rounds that were played count."
    if incomplete:
        text += f" Not complete: {', '.join(incomplete)}."
    if withdrawn := len(analysis.study.withdrawals):
        text += f" {counted(withdrawn, 'participant')} withdrew, and {'is' if withdrawn == 1 else 'are'} in no result."
    lines.append(Markup("<p class='verdict'><b>{}</b>: {}</p>").format(who, text))
    if n:
        lines.append(note(balance_of_complete(plan, [s.session.number for s in analysis.complete_sessions])))
    if 0 < n < MIN_PARTICIPANTS:
        lines.append(note(f"Fewer than {MIN_PARTICIPANTS} are too few for a test: none is made."))
    return Markup("\n").join(lines)


def _participants_section(analysis: StudyAnalysis) -> Section:
    """Return the sessions, and what participants said of themselves."""
    rows: list[tuple[str, ...]] = []
    for s in analysis.sessions:
        row = s.sessions_row()
        numbers = [str(row[name]) for name in ("rounds", "void_rounds", "marked_rounds", "failures")]
        state = "complete" if s.is_complete else f"incomplete: {row['rounds']} of {analysis.plan.rounds} rounds"
        who = (s.session.pseudonym, str(order_row(analysis.plan, s.session.number)), row["device"], row["language"])
        rows.append((*who, *numbers, state))
    if not rows:
        return Section(anchor="participants", title="Who took part", html=note("No session has begun yet."))
    header = ("participant", "order", "device", "language", "rounds", "void", "marked", "not successful", "session")
    html = rows_table(header, rows, numbers=(1, 4, 5, 6, 7))
    html += note("Order: row of the Williams square. Marked: rounds whose latency was above the limit; they count.")
    return Section(anchor="participants", title="Who took part", html=html + _said(analysis))


def _said(analysis: StudyAnalysis) -> Markup:
    """Return how often each choice was made, and the texts that were written."""
    plan, asked = analysis.plan, [q for s in analysis.sessions if (q := s.questionnaire) is not None]
    text = next(iter(plan.texts.values()))
    html = Markup()
    for question in plan.questions:
        given = [a for answers in asked if (a := answers.get(question.name))]
        if question.choices:
            words = dict(zip(question.choices, text.choices[question.name], strict=True))
            found = Counter(given)
            counts = ", ".join(f"{words[c]}: {found[c]}" for c in question.choices if found[c])
            html += Markup("<p>{} <span class='soft'>{}</span></p>").format(
                text.questions[question.name], counts or "–"
            )
        elif given:
            quotes = Markup().join(Markup("<li>{}</li>").format(g) for g in given)
            html += Markup("<details><summary>{} ({})</summary><ul>{}</ul></details>").format(
                text.questions[question.name], len(given), quotes
            )
    return html


def _exclusions_section(analysis: StudyAnalysis, words: Words) -> Section:
    """Return the rounds that do not count, and those whose latency was above the limit."""
    void = [r for r in analysis.rounds if r["void"]]
    rows = [
        (r["participant"], str(r["round"]), words.task(r["task"]), r["behaviour"], r["void_reason"] or "–")
        for r in void
    ]
    html = Markup()
    if rows:
        header = ("participant", "round", "task", "behaviour", "why it does not count")
        html += rows_table(header, rows, numbers=(1,))
    else:
        html += Markup("<p>No round is void.</p>")
    html += _repeated_attempts(analysis, words)
    limit = analysis.plan.latency_limit
    measured = [r["latency_p95_ms"] for r in analysis.counted if r["latency_p95_ms"] is not None]
    marked = sum(bool(r["marked_over_limit"]) for r in analysis.counted)
    if measured:
        html += note(
            f"Latency from hand to picture, exceeded in 5 of 100 instants of a round: at most {max(measured):.0f} ms; "
            f"{marked} of {len(measured)} rounds that count are above {limit:.0f} ms, and are marked, not left out."
        )
    unmeasured = len(analysis.counted) - len(measured)
    if unmeasured:
        html += note(f"{unmeasured} rounds that count have no latency: it was not measured.")
    html += _withdrawals(analysis) + _entering(analysis, words)
    return Section(anchor="exclusions", title="What does not count", html=html)


def _repeated_attempts(analysis: StudyAnalysis, words: Words) -> Markup:
    """Return which rounds were begun and played again, and why: a crash of the simulation is shown, too."""
    rows = [
        (a["participant"], str(a["round"]), words.task(a["task"]), a["behaviour"], a["reason"])
        for s in analysis.sessions
        for a in s.void_attempts_rows()
    ]
    if not rows:
        return note("No round was broken off.")
    header = ("participant", "round", "task", "behaviour", "why it was broken off")
    caption = f"Attempts that were broken off, and whose rounds were played again: {len(rows)}"
    return rows_table(header, rows, numbers=(1,), caption=caption)


def _withdrawals(analysis: StudyAnalysis) -> Markup:
    """Return who withdrew and when; nothing else of them is shown."""
    withdrawals = analysis.study.withdrawals
    if not withdrawals:
        return note("Nobody has withdrawn.")
    rows = [
        (
            pseudonym_of(number),
            w.ended,
            "during the session" if w.during else "after it",
            f"deleted {w.deleted}" if w.deleted else "kept, and in no result",
        )
        for number, w in withdrawals.items()
    ]
    header = ("participant", "withdrew", "", "what was kept of them")
    return rows_table(header, rows, caption=f"Withdrawn: {counted(len(rows), 'participant')}, in no table and no test")


def _entering(analysis: StudyAnalysis, words: Words) -> Markup:
    """Return which sessions enter which results, and by which rule; and what incomplete ones give to which tests."""
    plan, begun = analysis.plan, len(analysis.sessions)
    failures, ratings = analysis.failure_tests, analysis.rating_tests
    pairs = "complete pairs: rounds of both behaviours in the same task and period that count"
    rows = [
        (
            "failures by task and behaviour",
            "every round that counts",
            str(len({r["participant"] for r in analysis.counted})),
        ),
        ("tests of failures", f"{pairs}, and can be judged", _between([t.participants for t in failures])),
        ("tests of ratings", f"{pairs}, and were rated", _between([t.participants for t in ratings])),
        (
            "order effects",
            "complete sessions, without void rounds and the first",
            _between([e.participants for e in analysis.order_effects]),
        ),
        (
            "mixed ordinal model",
            "every rating that counts",
            str(len({a["participant"] for a in analysis.answers if not a["void"]})),
        ),
    ]
    header = ("result", "what enters it", f"participants, of {begun}")
    html = rows_table(header, rows, numbers=(2,), caption="Which sessions enter which results")
    for s in analysis.sessions:
        if not s.is_complete:
            who = s.session.pseudonym
            tasks = [
                words.task(t) for t in plan.tasks if any(m.participant == who and m.task == t for m in analysis.means)
            ]
            where = f"by complete pairs the tests of {', '.join(tasks)}" if tasks else "no test, as no pair is complete"
            html += note(f"{who}: the session is not complete; it enters {where}.")
    return html


def _between(numbers: Sequence[int]) -> str:
    low, high = min(numbers), max(numbers)
    return str(low) if low == high else f"{low} to {high}"


def _methods_section(analysis: StudyAnalysis) -> Section:
    html = template("study/study_methods.html").render(plan=analysis.plan, tested=analysis.tested)
    return Section(anchor="methods", title="Methods", html=Markup(html))


def _files_section(analysis: StudyAnalysis) -> Section:
    tables = ", ".join(f"{name}.csv" for name in result_columns(analysis.plan))
    rows = [
        ("rounds, answers, void_attempts, questionnaire, sessions", "all participants' tables, as .csv and .parquet"),
        ("codebook.csv, codebook.md", "their columns, with types, units and meanings"),
        (f"results/{tables}", "what this page shows, with results/codebook.csv"),
        ("participants/P01/rounds/01", "the record of a round: `handover study replay` shows it"),
        ("plan.toml, versions.json", "the plan, and the versions that carried it out"),
    ]
    return Section(anchor="files", title="Files", html=rows_table(("file", "what it holds"), rows, cards=True))
