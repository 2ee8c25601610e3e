"""Options of commands that carry out campaigns: where it is, whether it has a page, and who carries it out."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

from handover.scenarios.headed_options import HeadedOption

_worker_option = partial(click.option, cls=HeadedOption, heading="Workers")

_OPTIONS = (
    click.option(
        "--out",
        type=click.Path(path_type=Path),
        help="Folder of the campaign; one that is there goes on.  [default: one of its own in campaigns/]",
    ),
    click.option("--no-report", is_flag=True, help="Write no report page at the end."),
    click.help_option("-h", "--help"),
    _worker_option(
        "--workers",
        type=click.IntRange(min=1),
        metavar="N",
        help="Runs at the same time, on this machine.  [default: one a core]",
    ),
    _worker_option(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask scheduler whose workers carry out the runs; they see this folder under the same path.",
    ),
)


def campaign_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--out`, `--no-report`, `--help`, `--workers` and `--scheduler`."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command
