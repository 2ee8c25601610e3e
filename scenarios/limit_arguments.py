"""Options of commands that run units: how long a call may take, and how fast simulated time passes."""

from collections.abc import Callable
from functools import partial
from typing import Any

import click

from handover.scenarios.finite_range import FiniteRange
from handover.scenarios.headed_options import HeadedOption

CALL_LIMIT = 60.0
"""Seconds of wall time that a unit may take for one call where nothing else is said."""

_option = partial(click.option, cls=HeadedOption, heading="Wall time")
_LIMIT = _option(
    "--call-limit",
    type=FiniteRange(min=0),
    default=CALL_LIMIT,
    show_default=True,
    metavar="SECONDS",
    help="Wall time that a unit may take for one call, such as loading it or one step; 0: any. The run fails then.",
)
_PACE = _option(
    "--pace",
    type=FiniteRange(min=0, min_open=True),
    metavar="FACTOR",
    help="Let so many simulated seconds pass in one of the wall clock, 1 being real time; missed deadlines are told."
    "  [default: as fast as it goes]",
)


def limit_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--call-limit` and `--pace`; they fit `MasterOptions` by `limits`."""
    return _LIMIT(_PACE(command))


def limits(call_limit: float, pace: float | None) -> dict[str, Any]:
    """Return the options as those of `MasterOptions`."""
    return {"call_limit": call_limit or None, "pace": pace}
