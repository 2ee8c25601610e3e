"""Options that several commands share, headings for them in the help, and types of their values.

`scenario_options` are for commands that take a scenario, `limit_options` for those that run units, `campaign_options`
for those that run campaigns. Options of the master are in `handover.scenarios.cli.master_options`.
"""

import math
import re
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import click

from handover.cosim.files import FileTaken
from handover.cosim.stepping.options import CALL_LIMIT
from handover.cosim.typed_data import GREATEST_SEED, is_exact_time
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.progress import LOG_LEVELS
from handover.scenarios.runs.results.run_folder import check_place

_TAKEN = "it is there already; --force replaces it"


def check_new_file(option: str, file: Path, *, force: bool) -> None:
    """Refuse the file of an option, which is to be written, before anything starts.

    Raises:
        UsageError: there is a folder of that name, or a file and no `force`. InvalidRunFolder: its folder takes none.
    """
    if file.is_dir():
        raise UsageError(f"{option}: there is a folder of that name")
    if file.exists() and not force:
        raise UsageError(f"{option}: {_TAKEN}")
    check_place(file.parent)


def page_to_write(folder: Path, file: Path | None) -> Path:
    """Return where a report's page goes, which may replace one: the file of `--out`, or that in its folder.

    Raises:
        UsageError: there is a folder of that name, or it is not a page's, so that other files stay.
        InvalidRunFolder: its folder takes none.
    """
    page = file or folder / "report.html"
    if page.is_dir():
        raise UsageError(f"{page} is a folder; name a file for the page")
    if page.suffix.lower() != ".html":
        raise UsageError(f"--out {page}: name a file for the page that ends with .html")
    check_place(page.parent)
    return page


@contextmanager
def refused_if_taken(option: str) -> Generator[None, None, None]:
    """Refuse the file of an option that came to be while it was written, as `check_new_file` does one from before.

    Raises:
        UsageError: there is one.
    """
    try:
        yield
    except FileTaken as e:
        raise UsageError(f"{option}: {_TAKEN}") from e


class HeadedOption(click.Option):
    """An option that stands under a heading; for a `HeadedCommand`."""

    def __init__(self, *names: Any, heading: str, **given: Any) -> None:
        super().__init__(*names, **given)
        self.heading = heading


class HeadedCommand(click.Command):
    """A command whose help has headings in the order of the options that name them, "Options" for the others."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options."""
        sections: dict[str, list[tuple[str, str]]] = {}
        for option in self.get_params(ctx):
            row = option.get_help_record(ctx)
            if row is not None and isinstance(option, click.Option):
                heading = option.heading if isinstance(option, HeadedOption) else "Options"
                sections.setdefault(heading, []).append(row)
        for heading, rows in sections.items():
            with formatter.section(heading):
                formatter.write_dl(rows)


class FiniteRange(click.FloatRange):
    """A finite number in a range; `click.FloatRange` lets infinity and not-a-number through."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number in the range {self._describe_range()}.", param, ctx)
        return number


class _PathName(click.Path):
    """A path; "" is none, which `pathlib` takes for the working directory."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path."""
        if value == "":
            self.fail("it is empty; give a path", param, ctx)
        return super().convert(value, param, ctx)


PATH = _PathName(path_type=Path)
"""The path of a file or folder, for options and arguments."""

FILE = _PathName(dir_okay=False, path_type=Path)
"""The path of a file."""


class WholeNumber(click.IntRange):
    """A whole number in a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return the number."""
        try:
            number = int(value)
        except (TypeError, ValueError, OverflowError):
            number = None
        if number is None or (isinstance(value, float) and not value.is_integer()):
            self.fail(f"{value!r:.60} is not a whole number.", param, ctx)
        if self.max is not None and number > self.max:
            self.fail(f"{value!s:.60} is not in the range {self._describe_range()}.", param, ctx)
        return int(super().convert(number, param, ctx))


class Instant(click.ParamType):  # type: ignore (generic in newer versions only)
    """A time in seconds, such as 0.01, 1/30 or -2, taken exactly."""

    name = "seconds"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Fraction:
        """Return the time."""
        digits = str(value).removeprefix("-")
        try:
            seconds = Fraction(digits) if _FORM.fullmatch(digits) else None
        except (ValueError, ZeroDivisionError):
            seconds = None
        if seconds is None or not is_exact_time(seconds):
            self.fail(f"{value!r:.60} is not a time in seconds, such as 0.01, 1/30 or -2", param, ctx)
        return -seconds if str(value).startswith("-") else seconds


SEED = WholeNumber(0, GREATEST_SEED)
"""Of all random numbers of a run, or of a campaign."""

_FORM = re.compile(r"[\d.]+(e[-+]?\d{1,3})?|\d+/\d+", re.IGNORECASE)
"""Exact fractions of larger exponents would take long to compute."""


class Seconds(click.ParamType):  # type: ignore (generic in newer versions only)
    """A positive number of seconds, such as 0.01 or 1/30, taken exactly."""

    name = "seconds"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Fraction:
        """Return the number."""
        try:
            seconds = Fraction(value) if _FORM.fullmatch(value) else Fraction(0)
        except (ValueError, ZeroDivisionError):
            seconds = Fraction(0)
        if seconds > sys.float_info.max:
            self.fail(
                f"{value!r} is not finite as a floating-point number; seconds are such as 0.01 or 1/30", param, ctx
            )
        if seconds < sys.float_info.min or not is_exact_time(seconds):
            self.fail(f"{value!r:.60} is not a positive number of seconds, such as 0.01 or 1/30", param, ctx)
        return seconds


_SCENARIO_OPTIONS = (
    click.option(
        "-p",
        "parameters",
        multiple=True,
        metavar="NAME=VALUE",
        help="Set a parameter of the scenario, see `handover list SCENARIO`; or of a unit: UNIT.NAME=VALUE.",
    ),
    click.option("--seed", type=SEED, default=0, help="Seed of all random numbers."),
    click.option(
        "--unit",
        "replaced",
        multiple=True,
        metavar="NAME=FILE|NAME=UNIT|NAME=MODULE:CLASS",
        help="Replace a unit by another FMU, by another unit of the catalog, or by a block of your own.",
    ),
)


def scenario_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `-p`, `--seed` and `--unit`."""
    for option in reversed(_SCENARIO_OPTIONS):
        command = option(command)
    return command


def _trust(ctx: click.Context, _option: click.Parameter, files: Sequence[Path]) -> None:
    from handover.scenarios.catalog import InvalidScenario, trust_file  # of own scenarios alone

    for file in () if ctx.resilient_parsing else files:
        try:
            trust_file(file)
        except InvalidScenario as e:
            raise UsageError(f"--trust {e}") from e


trust_option = click.option(
    "--trust",
    multiple=True,
    type=PATH,
    metavar="FILE.py",
    expose_value=False,
    callback=_trust,
    help="Run the code of this file, which holds a scenario of your own, to draw its plots and its replay. No code is"
    " run because a folder names it.",
)

stop_option = click.option(
    "--stop",
    "--stop-time",
    "stop",
    type=Instant(),
    metavar="SECONDS",
    help="When a run ends: at the first communication point at or after it, if its evaluation does not end it before."
    "  [default: the scenario's or the file's own stop time]",
)
"""For commands that run what has a stop time."""

log_option = click.option(
    "--log-level",
    type=click.Choice(LOG_LEVELS),
    help="From which level on the units' logs and the master's progress are printed on standard error; debug: all that"
    " units log.  [default: the master's warnings, and the log of a unit that fails]",
)
"""For commands that run units; `logging_to_standard_error` takes its value."""

_wall_time_option = partial(click.option, cls=HeadedOption, heading="Wall time")
_LIMIT = _wall_time_option(
    "--call-limit",
    type=FiniteRange(min=0),
    default=CALL_LIMIT,
    show_default=True,
    metavar="SECONDS",
    help="Wall time after which a unit's call, such as loading it or one step, fails the run; 0: no limit.",
)
_PACE = _wall_time_option(
    "--pace",
    type=FiniteRange(min=0, min_open=True),
    metavar="FACTOR",
    help="Simulated seconds in one second of the wall clock, 1 being real time; missed deadlines are reported."
    "  [default: as fast as it goes]",
)


def limit_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--call-limit` and `--pace`; `limits` converts them to those of `MasterOptions`."""
    return _LIMIT(_PACE(command))


def limits(call_limit: float, pace: float | None) -> dict[str, Any]:
    """Return the options as those of `MasterOptions`."""
    return {"call_limit": call_limit or None, "pace": pace}


_worker_option = partial(click.option, cls=HeadedOption, heading="Workers")

_CAMPAIGN_OPTIONS = (
    click.option(
        "--out",
        type=PATH,
        help="Folder of the campaign; one that is there is resumed.  [default: one of its own in campaigns/]",
    ),
    click.option("--no-report", is_flag=True, help="Write no report page at the end."),
    click.help_option("-h", "--help"),
    _worker_option(
        "--workers",
        type=WholeNumber(min=1),
        metavar="N",
        help="Runs at the same time, on this machine.  [default: one a core]",
    ),
    _worker_option(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask scheduler whose workers do the runs; they see this folder under the same path.",
    ),
)


def campaign_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--out`, `--no-report`, `--help`, `--workers` and `--scheduler`."""
    for option in reversed(_CAMPAIGN_OPTIONS):
        command = option(command)
    return command
