"""The command `handover` with all subcommands loaded, as the reference shows it: the program loads each when called."""

from copy import copy

import click

from handover.scenarios.cli.command import DeferredCommand
from handover.scenarios.cli.command import main as program


def loaded(command: click.Command) -> click.Command:
    """Return a command, and of a group a copy that has its subcommands, with their options."""
    if isinstance(command, DeferredCommand):
        return loaded(command.load())
    if isinstance(command, click.Group):
        command = copy(command)
        command.commands = {name: loaded(child) for name, child in command.commands.items()}
    return command


main = loaded(program)
