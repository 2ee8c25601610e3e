"""The command `handover check`: what is wrong with FMUs and SSPs, from any tool, as text or JSON."""

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import click
from rich.table import Table
from rich.text import Text

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.check.report import EXPERIMENTS, CheckReport, Section
from handover.cosim.exceptions import counted, shown_path
from handover.cosim.files import reading_fault
from handover.cosim.fmu.file.archive import NO_FILE_FAULT
from handover.cosim.probe.finding import Finding, Level
from handover.cosim.ssp.check_ssp import check_ssp
from handover.scenarios.cli.console import open_console
from handover.scenarios.cli.options import PATH
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.fmu_run import is_fmu
from handover.scenarios.runs.execution.progress import doing
from handover.scenarios.runs.execution.selection import folder_fault
from handover.scenarios.runs.execution.ssp_run import is_ssp

_FAULTS = 1
_MAX_FINDINGS = 20  # of one level in one section
_STYLES = {Level.OK: "green", Level.NOTE: "cyan", Level.WARNING: "yellow", Level.FAULT: "bold red"}

_HELP = """Find what is wrong with FILEs that should be co-simulation FMUs of FMI 2.0 or 3.0, or SSPs, from any tool.

The archive, its model description (by the standard's schema and rules) and its library for this machine are checked.
Then the unit is loaded and run for ten steps in a process of its own, which may crash. A unit of `handover build` reads
its environment variables then, as in other tools: see `handover build --help`. Experiments in CSV that the FMU contains
(FMI-LS-REF) are run, too, and the outputs compared with their results: a fault where one is beyond the tolerance. Of an
SSP its system is checked, then each FMU in it.

\b
Exit status
  0  no faults; there may be notes and warnings
  1  faults were found
  2  usage error: a FILE is not there or cannot be read
"""


@click.command("check", help=_HELP, short_help="Find what is wrong with FMUs and SSPs, whoever made them.")
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=PATH)
@click.option(
    "--timeout",
    type=click.FloatRange(min=0, min_open=True),
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="Time that loading, then running, and then an experiment may take of each FILE.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON.")
def check(files: Sequence[Path], timeout: float, as_json: bool) -> None:
    """Find what is wrong with files that should be co-simulation FMUs or SSPs."""
    _check_files_exist(files)
    reports: list[CheckReport] = []
    for file in files:
        for report in _reports(file, timeout):
            reports.append(report)
            if not as_json:
                _print_report(report)
    if as_json:
        click.echo(json.dumps([r.as_json() for r in reports], indent=2))
    elif len(reports) > 1:
        open_console().print(_overall(reports), soft_wrap=True)
    sys.exit(0 if all(r.passed for r in reports) else _FAULTS)


def _reports(file: Path, timeout: float) -> Iterable[CheckReport]:
    if is_ssp(str(file)):
        yield from check_ssp(file, timeout)
        return
    with doing(f"checking {file.name}"):
        report = check_fmu(file, timeout)
    yield report


def _check_files_exist(files: Sequence[Path]) -> None:
    faults: list[str] = []
    for file in files:
        try:
            if file.is_dir():
                if not is_ssp(str(file)) and not is_fmu(str(file)):
                    faults.append(f"{file}: {folder_fault(file)}")
            elif file.exists() and not file.is_file():  # opening a pipe would wait for its writer
                faults.append(f"{file}: {NO_FILE_FAULT}")
            else:
                file.open("rb").close()
        except OSError as e:
            faults.append(f"{file}: {reading_fault(e)}")
    if faults:
        raise UsageError("; ".join(faults))


def _print_report(report: CheckReport) -> None:
    console = open_console()
    console.print(Text(str(report.path), style="bold"), soft_wrap=True)
    for section in report.sections:
        _print_section(section)
    console.print(_verdict(report), soft_wrap=True)


def _print_section(section: Section) -> None:
    level = section.level.name.lower() if section.reached else "-"
    style = _STYLES[section.level] if section.reached else "dim"
    line = Text.assemble("  ", (level.ljust(9), style), section.name.ljust(13), section.summary)
    line.rstrip()
    open_console().print(line, soft_wrap=True)
    for wanted in sorted(Level, reverse=True):
        findings = [f for f in section.findings if f.level is wanted]
        for finding in findings[:_MAX_FINDINGS]:
            _print_finding(finding, named=wanted is not section.level)
        if len(findings) > _MAX_FINDINGS:
            more = f"and {len(findings) - _MAX_FINDINGS} more; --json shows all"
            _print_indented("", Text(more), 11)


def _print_finding(finding: Finding, *, named: bool) -> None:
    level = f"{finding.level.name.lower()}: " if named else ""
    _print_indented("- ", Text(level + finding.line), 11)
    for line in finding.log:
        _print_indented("| ", Text(line, style="dim"), 13)


def _print_indented(mark: str, text: Text, width: int) -> None:
    """Print a text after a mark: with a hanging indent in a terminal, in one line where other programs read it."""
    console = open_console()
    if console.is_terminal:
        row = Table.grid()
        row.add_row(" " * width + mark, text)
        console.print(row)
    else:
        console.print(Text(" " * width + mark) + text, soft_wrap=True)


def _overall(reports: Sequence[CheckReport]) -> Text:
    faulty = [shown_path(r.path) for r in reports if not r.passed]
    if not faulty:
        return Text.assemble(("no faults", "green"), f" in all {len(reports)}")
    return Text.assemble(("faults", "bold red"), f" in {len(faulty)} of {len(reports)}: {', '.join(faulty)}")


def _verdict(report: CheckReport) -> Text:
    counts = [
        counted(n, level.name.lower())
        for level in (Level.FAULT, Level.WARNING, Level.NOTE)
        if (n := report.count(level))
    ]
    sentence = f" ({', '.join(counts)})" if counts else ""
    if report.passed:
        return Text.assemble(("usable", "green"), f": no faults were found{sentence}")
    if {s.name for s in report.sections if s.level is Level.FAULT} == {EXPERIMENTS}:
        return Text.assemble(("runs here", "bold red"), f", but not as in its own experiments{sentence}")
    if report.ran:
        return Text.assemble(
            ("against the standard", "bold red"), f": it runs here, but another tool may refuse it{sentence}"
        )
    return Text.assemble(("not usable as it is", "bold red"), sentence)
