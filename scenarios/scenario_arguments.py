"""Options of commands that take a scenario: its parameters, its seed, and other FMUs for its units."""

from collections.abc import Callable
from typing import Any

import click

_OPTIONS = (
    click.option(
        "-p", "parameters", multiple=True, metavar="NAME=VALUE", help="Set a parameter; see `handover list SCENARIO`."
    ),
    click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of all random numbers."),
    click.option("--unit", "replaced", multiple=True, metavar="NAME=FILE", help="Let another FMU take a unit's place."),
)


def scenario_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `-p`, `--seed` and `--unit`."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command
