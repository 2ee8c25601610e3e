"""The columns of a study's tables, what each means, and tables as CSV and Parquet, written whole or not at all."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handover.scenarios.runs.results.run_folder import disk_errors_reported, replacing, write_whole
from handover.scenarios.study.plan.plan import DEVICES, StudyPlan

PERSON, PILOT = "person", "scripted pilot"
"""Who played a session, in every table."""

TEXT, WHOLE, NUMBER, FLAG = "text", "whole number", "number", "true or false"
"""Types of columns; pandas calls them string, Int64, Float64 and boolean."""

_FORMULA = ("=", "+", "-", "@")
"""What spreadsheets take for the beginning of a formula."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        name: in the table's head.
        kind: its type.
        unit: "1" of numbers without one, "" of what is not a number.
        meaning: in a sentence without its full stop.
        optional: whether it may be empty.
        free: whether it is text that a person typed.
    """

    name: str
    kind: str
    unit: str
    meaning: str
    optional: bool = False
    free: bool = False


WHO = (
    Column("participant", TEXT, "", "pseudonym, by the order of coming"),
    Column("kind", TEXT, "", f"who played: {PERSON!r}, or {PILOT!r}: a program, no person"),
)
WHAT = (
    Column("round", WHOLE, "1", "number of the round, from 1 in the order played"),
    Column("task", TEXT, "", "task of the plan"),
    Column("behaviour", TEXT, "", "behaviour of the robot, of the plan"),
)

ROUNDS = (
    *WHO,
    *WHAT,
    Column("period", WHOLE, "1", "which time it is that every condition comes once, from 1"),
    Column("scenario", TEXT, "", "the scenario that was run"),
    Column("seed", WHOLE, "1", "seed of the round's random numbers"),
    Column("ended", TEXT, "", "when the round ended, date and time by ISO 8601"),
    Column("success", FLAG, "", "whether the handover succeeded, by ground truth, as `handover run` judges it"),
    Column("reason", TEXT, "", "why it succeeded or failed, by ground truth"),
    Column(
        "failed_by_rule",
        FLAG,
        "",
        "whether it failed by the rule of [Fernandes2020] sec. 5.6 alone: the object was not transferred, or was out "
        "of both hands in between; empty where the record does not say who held it",
        optional=True,
    ),
    Column("void", FLAG, "", "whether the round does not count, for a reason that is not the participant's"),
    Column("void_reason", TEXT, "", "why it does not count", optional=True),
    Column(
        "latency_median_ms", NUMBER, "ms", "time from the hand's movement to the picture that shows it, median", True
    ),
    Column("latency_p95_ms", NUMBER, "ms", "the same, exceeded in 5 of 100 instants", True),
    Column("latency_max_ms", NUMBER, "ms", "the same, greatest", True),
    Column("age_at_use_ms", NUMBER, "ms", "age of what the device said when the simulation used it, median", True),
    Column("missed_deadlines", WHOLE, "1", "steps of the simulation that ended later than their real time", True),
    Column(
        "marked_over_limit",
        FLAG,
        "",
        "whether latency_p95_ms is above the plan's latency_limit; empty where it was not measured",
        optional=True,
    ),
)

VOID_ATTEMPTS = (
    *WHO,
    *WHAT,
    Column("attempt", WHOLE, "1", "which attempt at the round it was, from 1"),
    Column("ended", TEXT, "", "when it ended, date and time by ISO 8601"),
    Column("reason", TEXT, "", "why it does not count; the round was played again"),
    Column("folder", TEXT, "", "where its run was put aside, in rounds/; empty if it had not begun", optional=True),
)


def answers_columns(plan: StudyPlan) -> tuple[Column, ...]:
    """Return the columns of `answers.csv`: a row for each round and statement."""
    low, high = plan.scale
    text = next(iter(plan.texts.values()))
    said = "; ".join(f"{name}: {text.statements[name]}" for name in plan.statements)
    return (
        *WHO,
        *WHAT,
        Column("void", FLAG, "", "whether the round does not count"),
        Column("statement", TEXT, "", f"what was rated: {said}"),
        Column("value", WHOLE, "1", f"rating from {low}, {text.lowest}, to {high}, {text.highest}"),
    )


def questionnaire_columns(plan: StudyPlan) -> tuple[Column, ...]:
    """Return the columns of `questionnaire.csv`: a row for each participant."""
    text = next(iter(plan.texts.values()))
    asked: list[Column] = []
    for question in plan.questions:
        words = text.choices.get(question.name, ())
        meanings = "; ".join(f"{c}: {w}" for c, w in zip(question.choices, words, strict=True))
        meaning = text.questions[question.name] + (f" ({meanings})" if meanings else "")
        free = not question.choices
        meaning += "; in CSV after an apostrophe where a spreadsheet would take it for a formula" if free else ""
        asked.append(Column(question.name, TEXT, "", meaning, optional=True, free=free))
    return (*WHO, *asked)


def sessions_columns(plan: StudyPlan) -> tuple[Column, ...]:
    """Return the columns of a table of sessions, as the report writes it from the files `session.json`."""
    devices = "; ".join(f"{name}: {DEVICES[name]}" for name in plan.devices)
    return (
        *WHO,
        Column("order_row", WHOLE, "1", "row of the Williams square that gave the order of rounds, from 1"),
        Column("started", TEXT, "", "when the session began, date and time by ISO 8601"),
        Column("device", TEXT, "", f"what moved the hand ({devices})"),
        Column("language", TEXT, "", "language of what was read"),
        Column("rounds", WHOLE, "1", "rounds that were played to their end, void ones included"),
        Column("void_rounds", WHOLE, "1", "rounds of these that do not count"),
        Column("marked_rounds", WHOLE, "1", "rounds of these whose latency is above the limit"),
        Column("failures", WHOLE, "1", "rounds that count and whose handover failed"),
    )


def all_tables(plan: StudyPlan) -> dict[str, tuple[Column, ...]]:
    """Return the columns of each table by its name without an ending."""
    return {
        "rounds": ROUNDS,
        "answers": answers_columns(plan),
        "void_attempts": VOID_ATTEMPTS,
        "questionnaire": questionnaire_columns(plan),
        "sessions": sessions_columns(plan),
    }


def write_codebook(folder: Path, plan: StudyPlan, tables: Mapping[str, Sequence[Column]] | None = None) -> None:
    """Write `codebook.csv` and `codebook.md`, which explain every column; of the study's tables, or of others.

    Raises:
        RecordNotWritten: they cannot be written.
    """
    explained = all_tables(plan) if tables is None else tables
    rows = [
        (table, c.name, c.kind, c.unit, "yes" if c.optional else "no", c.meaning)
        for table, columns in explained.items()
        for c in columns
    ]
    header = ("table", "column", "type", "unit", "may_be_empty", "meaning")
    write_whole(folder / "codebook.csv", csv_text(header, rows))
    lines = [f"# Codebook: {plan.title}", ""]
    if plan.pilot:
        lines += [f"**{PILOT.capitalize()}s: programs, no person took part.**", ""]
    for table, columns in explained.items():
        lines += [f"## {table}", "", "| column | type | unit | meaning |", "|---|---|---|---|"]
        lines += [f"| `{c.name}` | {_kind(c)} | {c.unit} | {_cell(c.meaning)} |" for c in columns]
        lines.append("")
    write_whole(folder / "codebook.md", "\n".join(lines))


def write_csv(path: Path, columns: Sequence[Column], rows: Sequence[Row]) -> None:
    """Write a table as CSV, whole or not at all: UTF-8, a comma between, empty where there is no value.

    What a person typed has an apostrophe before it if it begins like a formula, which a spreadsheet would carry out.

    Raises:
        RecordNotWritten: it cannot be written.
    """
    write_whole(
        path, csv_text([c.name for c in columns], [[_csv(row.get(c.name), c.free) for c in columns] for row in rows])
    )


def write_parquet(path: Path, columns: Sequence[Column], rows: Sequence[Row]) -> None:
    """Write the same as Parquet, likewise, with units and meanings as the columns' metadata.

    Raises:
        RecordNotWritten: it cannot be written.
    """
    import pyarrow as pa  # slow to import
    import pyarrow.parquet as pq

    types: dict[str, pa.DataType] = {TEXT: pa.string(), WHOLE: pa.int64(), NUMBER: pa.float64(), FLAG: pa.bool_()}
    fields = [pa.field(c.name, types[c.kind], metadata={"unit": c.unit, "description": c.meaning}) for c in columns]
    arrays = [pa.array([row.get(c.name) for row in rows], types[c.kind]) for c in columns]
    with disk_errors_reported(path), replacing(path) as unfinished:
        pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), unfinished)


def csv_text(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return rows as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([header, *rows])
    return text.getvalue()


def _csv(value: Any, free: bool) -> Any:
    if value is None:
        return ""
    if free and isinstance(value, str) and value.lstrip().startswith(_FORMULA):
        return f"'{value}"
    return str(value).lower() if isinstance(value, bool) else value


def _kind(column: Column) -> str:
    return f"{column.kind}, may be empty" if column.optional else column.kind


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
