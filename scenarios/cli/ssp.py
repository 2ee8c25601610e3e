"""Options of `handover run` for an SSP: its stop time and its communication step."""

from collections.abc import Callable
from functools import partial
from typing import Any

import click

from handover.scenarios.cli.options import HeadedOption, Seconds
from handover.scenarios.execution.errors import UsageError

_option = partial(click.option, cls=HeadedOption, heading="Of FILE.ssp", type=Seconds(), metavar="SECONDS")
_STOP = _option(
    "--stop",
    help="When the run ends: at the first communication point at or after it.  [default: the file's own stop time]",
)
_STEP = _option("--step", help="Communication step of all units.  [default: what each FMU proposes]")


def ssp_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--stop` and `--step`, which are for SSPs."""
    return _STOP(_STEP(command))


def reject_for_ssp(**given: Any) -> None:
    """Reject options that are for scenarios.

    Raises:
        UsageError: one of them is given.
    """
    used = [name for name, value in given.items() if value]
    if used:
        raise UsageError(f"{', '.join(used)}: for scenarios; an SSP has its parameters and units inside")
