"""The commands `handover study report`, `replay`, `export` and `withdraw`: what is made of a study's folder."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from handover.cosim.exceptions import visible
from handover.scenarios.cli.options import PATH, page_to_write
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors, require_extra
from handover.scenarios.runs.execution.progress import doing, say
from handover.scenarios.runs.results.run_folder import RunFolder, check_place

if TYPE_CHECKING:
    from handover.scenarios.study.folder.session_folder import SessionFolder
    from handover.scenarios.study.folder.study_folder import StudyFolder
    from handover.scenarios.study.plan.order import Round

_FOLDER = click.argument("folder", metavar="DIR", type=PATH)


@click.command("report", short_help="Write the page of a study, and all its tables.")
@_FOLDER
@click.option(
    "--out",
    "file",
    metavar="FILE",
    type=PATH,
    help="The page, a name that ends with .html; a file of that name is replaced.  [default: DIR/report.html]",
)
def report(folder: Path, file: Path | None) -> None:
    """Write the page of the study in DIR: one HTML file that opens offline, and its results as CSV into DIR/results.

    A study that goes on has its page, too: what is not complete is said, and what too few took part in is not tested.
    """
    with one_line_errors(), _opened(folder) as study:
        page = page_to_write(folder, file)
        require_extra("reports", "the page")
        check_place(folder)
        from handover.scenarios.study.report.report_page import write_study_report

        with doing("writing the report"):
            write_study_report(study, page)
    click.echo(f"report: {page}")


@click.command("export", short_help="Write the tables of all participants.")
@_FOLDER
def export(folder: Path) -> None:
    """Write all participants' tables of the study in DIR: rounds, answers, void attempts, questionnaire, sessions.

    Each as CSV and as Parquet; DIR/codebook.csv has the columns' types, units and meanings.
    """
    with one_line_errors(), _opened(folder) as study:
        check_place(folder)
        study.write_tables()
        from handover.scenarios.study.folder.codebook import all_tables

        for name in all_tables(study.plan):
            click.echo(study.path / f"{name}.csv")


@click.command("replay", short_help="Show a round: what happened, and its page.")
@_FOLDER
@click.argument("participant")
@click.argument("number", metavar="ROUND", type=click.IntRange(1))
@click.option("--check", is_flag=True, help="Carry it out again from its recorded inputs instead, and compare.")
def replay(folder: Path, participant: str, number: int, *, check: bool) -> None:
    """Show what happened in a ROUND of a PARTICIPANT, such as P01, and write the page of its run, with the replay.

    With --check the round is run again with the hand's recorded inputs. Exit status 1 says that a signal has not the
    same bytes as in the record; the first difference is named.
    """
    if check:
        _check(folder, participant, number)
        return
    with one_line_errors(), _opened(folder) as study:
        session = _session(study, participant)
        planned = _planned(session, number)
        record = session.records.get(number)
        run = RunFolder.of_run(session.run_folder(number))
        who = f"{session.session.pseudonym} ({session.session.kind}), round {number}"
        click.echo(f"{who}: {planned.condition.task}, {planned.condition.behaviour}, period {planned.period}")
        if record is None:
            click.echo("it has not been played to its end")
        else:
            outcome = "succeeded" if record.success else "failed"
            click.echo(visible(f"{outcome}: {record.reason}"))
            rule = {True: "failed", False: "did not fail", None: "cannot be judged"}[record.failed_by_rule]
            click.echo(f"by the rule of failures it {rule}")
            if record.void:
                click.echo(visible(f"void, it does not count: {record.void_reason}"))
            ratings = session.answers.get(number, {})
            click.echo(visible(f"ratings: {', '.join(f'{k} = {v}' for k, v in ratings.items()) or 'none'}"))
            if record.latency_p95_ms is not None:
                click.echo(f"latency: median {record.latency_median_ms:.0f} ms, 95 % {record.latency_p95_ms:.0f} ms")
        if not run.is_there:
            raise UsageError(f"{run.path} has no record of a run to be shown")
        require_extra("reports", "the page")
        from handover.scenarios.runs.execution.resume import complete_signals
        from handover.scenarios.runs.reporting.run_page import write_run_page

        with run.held():
            complete_signals(run)
            for line in write_run_page(run):
                say(line)
    click.echo(f"page: {run.report}")


@click.command("withdraw", short_help="Leave a participant who has withdrawn out of all results.")
@_FOLDER
@click.argument("participant")
@click.option("--delete", is_flag=True, help="Delete all that was kept of the participant, too; for good.")
def withdraw(folder: Path, participant: str, *, delete: bool) -> None:
    """Leave a PARTICIPANT, such as P01, who has withdrawn from the study in DIR, out of all tables, tests and exports.

    The number stays taken; the report says how many have withdrawn, and when. Tables and a page that are in DIR already
    are written again.
    """
    with one_line_errors(), _opened(folder) as study:
        from handover.scenarios.study.folder.session_folder import pseudonym_of
        from handover.scenarios.study.folder.session_notes import timestamp

        number = _number(study, participant)
        check_place(folder)
        page = folder / "report.html"
        if shown := page.exists() or (folder / "results").exists():
            require_extra("reports", "the page, which is written again without the participant")
        with study.held():
            withdrawal = study.withdraw(number, timestamp(), delete=delete)
            if shown:
                from handover.scenarios.study.report.report_page import write_study_report

                with doing("writing the report"):
                    write_study_report(study, page)
    kept = f"deleted on {withdrawal.deleted}" if withdrawal.deleted else "not deleted; --delete does it"
    click.echo(
        f"{pseudonym_of(number)} withdrew on {withdrawal.ended}: in no table and no test; what was kept is {kept}"
    )
    say("tables and pages that were copied elsewhere still have it")


def _check(folder: Path, participant: str, number: int) -> None:
    """Say whether a round gives the same signals when it is carried out again; exit with 1 if it does not."""
    with one_line_errors(), _opened(folder) as study:
        session = _session(study, participant)
        planned = _planned(session, number)
        require_extra("live", "the check of a round")
        from handover.scenarios.study.session.round_check import check_round

        found = check_round(session, planned)
    who = f"{session.session.pseudonym}, round {number}"
    if found.other_versions:
        click.echo(visible(f"{who} was recorded by other versions: {found.other_versions}"))
    if found.difference is not None:
        click.echo(visible(f"{who} differs when it is carried out again, first in {found.difference}"))
        raise click.exceptions.Exit(1)
    click.echo(f"{who}: the same byte for byte when carried out again, {found.signals} signals in {found.rows} rows")


def _planned(session: "SessionFolder", number: int) -> "Round":
    """Return a round of a session.

    Raises:
        UsageError: the plan has none of this number.
    """
    planned = next((r for r in session.rounds if r.number == number), None)
    if planned is None:
        raise UsageError(f"the plan has {len(session.rounds)} rounds, none of number {number}")
    return planned


@contextmanager
def _opened(folder: Path) -> "Generator[StudyFolder, None, None]":
    """Give the study in a folder.

    Raises:
        UsageError: there is no such folder. InvalidRunFolder: it is none of a study.
    """
    from handover.scenarios.study.folder.study_folder import StudyFolder

    if not folder.is_dir():
        raise UsageError(f"{folder} is not a folder; name that of a study")
    yield StudyFolder.read(folder)


def _session(study: "StudyFolder", participant: str) -> "SessionFolder":
    """Return the session of a participant by number or pseudonym.

    Raises:
        UsageError: there is none, or the participant has withdrawn.
    """
    number = _number(study, participant)
    if number in study.withdrawals:
        raise UsageError(f"{participant} withdrew on {study.withdrawals[number].ended}: nothing of theirs is shown")
    return study.session(number)


def _number(study: "StudyFolder", participant: str) -> int:
    """Return the number of a participant by number or pseudonym.

    Raises:
        UsageError: no session of theirs has begun.
    """
    digits = participant.upper().removeprefix("P").lstrip("0")
    number = next((n for n in study.numbers if str(n) == digits), None)
    if number is None:
        known = ", ".join(s.session.pseudonym for s in study.sessions) or "none"
        raise UsageError(f"no participant {participant!r:.60}; sessions that have begun: {known}")
    return number
