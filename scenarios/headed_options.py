"""Options under headings in a command's help, of which one list would be too long to read."""

from typing import Any

import click


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
